//! The parts of an iCub: on which bus each is, and which boards it has in the order of its port.

use taxel_skin::KindWord;

/// One part of the robot, for example its left forearm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// `left_` or `right_`; nothing for the torso.
    side: &'static str,
    place: &'static Place,
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
    /// Board addresses in the order of the part's port, as all iCubs have them but for a few.
    addresses: &'static [u8],
}

/// Longer names before the ones that they end with.
const PLACES: [Place; 7] = [
    Place { name: "forearm", others: &[], bus: "arm", addresses: &[13, 12] },
    Place { name: "hand", others: &[], bus: "arm", addresses: &[14] },
    Place { name: "arm", others: &["upper_arm", "upperarm"], bus: "arm", addresses: &[11, 10, 9, 8] },
    Place { name: "leg_upper", others: &["upper_leg"], bus: "leg_1", addresses: &[1, 2, 3, 4, 5, 6, 7] },
    Place { name: "leg_lower", others: &["lower_leg"], bus: "leg_2", addresses: &[8, 9, 10, 11] },
    Place { name: "foot", others: &[], bus: "leg_2", addresses: &[13, 12] },
    Place { name: "torso", others: &["chest"], bus: "torso", addresses: &[7, 8, 9, 10] },
];

impl Part {
    /// The part that a file name or a header names: `left_forearm_V2`, `l_upper_leg`, `torso`.
    pub fn named(text: &str) -> Option<Self> {
        let text = text.to_ascii_lowercase();
        let (side, rest) = side_of(&text);
        let place = PLACES
            .iter()
            .find(|place| std::iter::once(&place.name).chain(place.others).any(|name| begins_with_word(rest, name)))?;
        let fits = side.is_empty() == (place.name == "torso");
        fits.then_some(Self { side, place })
    }

    /// Its name, as that of the robot's port: `left_forearm`.
    pub fn name(self) -> String {
        format!("{}{}", self.side, self.place.name)
    }

    /// Its bus: `left_arm`; legs have two, `left_leg_1` and `left_leg_2`.
    pub fn bus(self) -> String {
        format!("{}{}", self.side, self.place.bus)
    }

    /// Board addresses in the order of its port, as nearly all iCubs have them.
    pub const fn addresses(self) -> &'static [u8] {
        self.place.addresses
    }

    /// What a module of it is where no file says so.
    pub fn kind(self, module: u8) -> KindWord {
        match (self.place.name, module) {
            ("hand", 8..=11) => KindWord::Palm,
            ("hand", _) => KindWord::Fingertip,
            _ => KindWord::Triangle,
        }
    }

    /// Whether it is a hand: fingertips and palm on one board.
    pub fn is_hand(self) -> bool {
        self.place.name == "hand"
    }
}

/// The side that a name begins with, and the rest of it.
fn side_of(text: &str) -> (&'static str, &str) {
    let sides = [("left_", "left_"), ("l_", "left_"), ("right_", "right_"), ("r_", "right_")];
    let found = sides.iter().find_map(|(prefix, side)| Some((*side, text.strip_prefix(prefix)?)));
    found.unwrap_or(("", text))
}

/// Whether a name begins with this word and not with a longer one.
fn begins_with_word(text: &str, word: &str) -> bool {
    text.strip_prefix(word).is_some_and(|rest| !rest.starts_with(|c: char| c.is_ascii_alphabetic()))
}
