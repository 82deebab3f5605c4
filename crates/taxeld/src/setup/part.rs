//! The parts of an iCub: on which bus each is, and which boards it has in the order of its port.

use crate::config::KindWord;

/// One part of the robot, for example its left forearm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    side: Side,
    place: &'static Place,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Left,
    Right,
    /// The torso has none.
    Middle,
}

/// What left and right have in common.
#[derive(Debug, PartialEq, Eq)]
struct Place {
    /// As in the names of iCub's ports.
    name: &'static str,
    /// How file names and headers begin, beside that.
    others: &'static [&'static str],
    /// The bus, without the side.
    bus: &'static str,
    /// The words by which a robot's configuration files name its limb.
    limbs: &'static [&'static str],
    /// Board addresses in the order of the part's port, as all iCubs have them but for a few.
    addresses: &'static [u8],
    /// Position of the part's first board in the list of its limb's boards.
    first_board: usize,
}

/// Longer names before the ones that they end with.
const PLACES: [Place; 7] = [
    Place { name: "forearm", others: &[], bus: "arm", limbs: ARM, addresses: &[13, 12], first_board: 1 },
    Place { name: "hand", others: &[], bus: "arm", limbs: ARM, addresses: &[14], first_board: 0 },
    Place {
        name: "arm",
        others: &["upper_arm", "upperarm"],
        bus: "arm",
        limbs: ARM,
        addresses: &[11, 10, 9, 8],
        first_board: 3,
    },
    Place {
        name: "leg_upper",
        others: &["upper_leg"],
        bus: "leg_1",
        limbs: LEG,
        addresses: &[1, 2, 3, 4, 5, 6, 7],
        first_board: 6,
    },
    Place {
        name: "leg_lower",
        others: &["lower_leg"],
        bus: "leg_2",
        limbs: LEG,
        addresses: &[8, 9, 10, 11],
        first_board: 2,
    },
    Place { name: "foot", others: &[], bus: "leg_2", limbs: LEG, addresses: &[13, 12], first_board: 0 },
    Place {
        name: "torso",
        others: &["chest"],
        bus: "torso",
        limbs: &["torso"],
        addresses: &[7, 8, 9, 10],
        first_board: 0,
    },
];
const ARM: &[&str] = &["arm", "upperarm", "forearm", "hand"];
const LEG: &[&str] = &["leg", "foot"];

impl Part {
    /// The part that a file name or a header names: `left_forearm_V2`, `l_upper_leg`, `torso`.
    #[must_use]
    pub fn named(text: &str) -> Option<Self> {
        let text = text.to_ascii_lowercase();
        let (side, rest) = side_of(&text);
        let place = PLACES
            .iter()
            .find(|place| std::iter::once(&place.name).chain(place.others).any(|name| begins_with_word(rest, name)))?;
        let fits = (side == Side::Middle) == (place.name == "torso");
        fits.then_some(Self { side, place })
    }

    /// Its name, as that of the robot's port: `left_forearm`.
    #[must_use]
    pub fn name(self) -> String {
        self.with_side(self.place.name)
    }

    /// Its bus: `left_arm`; legs have two, `left_leg_1` and `left_leg_2`.
    #[must_use]
    pub fn bus(self) -> String {
        self.with_side(self.place.bus)
    }

    fn with_side(self, name: &str) -> String {
        match self.side {
            Side::Left => format!("left_{name}"),
            Side::Right => format!("right_{name}"),
            Side::Middle => name.to_owned(),
        }
    }

    /// Board addresses in the order of its port, as nearly all iCubs have them.
    #[must_use]
    pub const fn addresses(self) -> &'static [u8] {
        self.place.addresses
    }

    /// Position of its first board in the list of all boards of its limb.
    #[must_use]
    pub const fn first_board(self) -> usize {
        self.place.first_board
    }

    /// Whether a device or file of the robot's configuration is of its limb: `left_leg-eb10-skin`.
    #[must_use]
    pub fn is_of_limb(self, device: &str) -> bool {
        let device = device.to_ascii_lowercase();
        let (side, rest) = side_of(&device);
        side == self.side && self.place.limbs.iter().any(|limb| begins_with_word(rest, limb))
    }

    /// What a module of it is where no file says so.
    #[must_use]
    pub fn kind(self, module: u8) -> KindWord {
        match (self.place.name, module) {
            ("hand", 8..=11) => KindWord::Palm,
            ("hand", _) => KindWord::Fingertip,
            _ => KindWord::Triangle,
        }
    }

    /// Whether it is a hand: fingertips and palm on one board.
    #[must_use]
    pub fn is_hand(self) -> bool {
        self.place.name == "hand"
    }
}

/// The side that a name begins with, and the rest of it.
fn side_of(text: &str) -> (Side, &str) {
    let sides = [("left_", Side::Left), ("l_", Side::Left), ("right_", Side::Right), ("r_", Side::Right)];
    let found = sides.iter().find_map(|(prefix, side)| Some((*side, text.strip_prefix(prefix)?)));
    found.unwrap_or((Side::Middle, text))
}

/// Whether a name begins with this word and not with a longer one.
fn begins_with_word(text: &str, word: &str) -> bool {
    text.strip_prefix(word).is_some_and(|rest| !rest.starts_with(|c: char| c.is_ascii_alphabetic()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_found_by_the_names_of_files_headers_and_ports() {
        for (text, name) in [
            ("left_forearm_V2", "left_forearm"),
            ("l_forearm", "left_forearm"),
            ("right_hand_V2_1", "right_hand"),
            ("r_upper_arm", "right_arm"),
            ("left_arm_mesh", "left_arm"),
            ("l_upper_leg", "left_leg_upper"),
            ("right_leg_lower", "right_leg_lower"),
            ("l_foot", "left_foot"),
            ("Torso", "torso"),
        ] {
            assert_eq!(Part::named(text).map(Part::name).as_deref(), Some(name), "{text}");
        }
        for text in ["forearm", "left_torso", "left_leg", "skin", "", "left_armour"] {
            assert_eq!(Part::named(text), None, "{text}");
        }
    }

    #[test]
    fn devices_of_a_limb_are_told_from_those_of_another() {
        let foot = Part::named("left_foot").unwrap();
        assert!(foot.is_of_limb("left_leg-eb10-skin") && !foot.is_of_limb("right_leg-eb11-skin"));
        let arm = Part::named("left_arm").unwrap();
        assert!(arm.is_of_limb("left_upperarm-eb2-skin") && !arm.is_of_limb("left_leg-eb10-skin"));
        assert_eq!((arm.bus(), foot.bus()), ("left_arm".to_owned(), "left_leg_2".to_owned()));
    }
}
