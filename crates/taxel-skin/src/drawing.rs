//! iCub's skin drawing files (`conf/skinGui/*.ini`): what each module of a part is.
//!
//! A row is `kind module x y degrees gain mirror [layout]`, the module numbered over all boards: 16 x board position +
//! module. Only kind and module are used. `cardid` is not: it has boards in another order than the port, or lacks some.

use std::collections::BTreeMap;

use crate::module_list::KindWord;

/// Most modules that a part can have: more boards than one bus has addresses.
const MODULES_MAX: usize = 16 * 16;

/// A drawing file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Drawing {
    /// The part that it says it is of.
    pub part: Option<String>,
    /// What each module is, by its number over all boards.
    pub modules: BTreeMap<usize, KindWord>,
    /// What a user should know, a line each.
    pub remarks: Vec<String>,
}

impl Drawing {
    /// Reads a drawing file; no text is refused, rows that say nothing of a module are remarked on.
    #[must_use]
    pub fn parse(text: &str) -> Self {
        let (mut drawing, mut in_sensors) = (Self::default(), false);
        for (line, text) in (1..).zip(text.trim_start_matches('\u{feff}').lines()) {
            let mut words = text.split('#').next().unwrap_or("").split_whitespace();
            let Some(first) = words.next() else { continue };
            if first.starts_with('[') {
                in_sensors = first.eq_ignore_ascii_case("[SENSORS]");
            } else if in_sensors {
                let module = words.next().and_then(|word| word.parse().ok()).filter(|m| *m < MODULES_MAX);
                match module.zip(meaning(first)) {
                    Some((module, (count, word))) => drawing.row(module, count, word),
                    None => drawing.remarks.push(format!("line {line}: `{text}` is no module that is known: left out")),
                }
            } else if first.eq_ignore_ascii_case("robotPart") {
                drawing.part = words.next().map(str::to_owned);
            }
        }
        drawing
    }

    fn row(&mut self, module: usize, count: usize, word: KindWord) {
        for offset in 0..count {
            // A palm that does not begin at module 8 has its odd module, the last one, elsewhere.
            let word = match (word, module % 16, offset) {
                (KindWord::Palm, first, 3) if first != 8 => KindWord::PalmPad7,
                (KindWord::Palm, first, _) if first != 8 => KindWord::PalmPad11,
                _ => word,
            };
            self.modules.entry(module + offset).or_insert(word);
        }
    }
}

/// How many modules a word stands for, and what they are.
fn meaning(kind: &str) -> Option<(usize, KindWord)> {
    match kind {
        // Older drawings have the two thermal pads of a triangle as circles, too, and another word for it.
        "triangle_10pad" | "triangle" => Some((1, KindWord::Triangle)),
        "palmL" | "palmR" => Some((4, KindWord::Palm)),
        "fakePalm" => Some((0, KindWord::Palm)), // an outline, no module
        // R1's hand: of its 48 values not all are taxels, which `taxeld scan` shows.
        _ if kind.starts_with("cer_sh_") => Some((4, KindWord::Twelve)),
        _ if kind.starts_with("fingertip") => Some((1, KindWord::Fingertip)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hand_has_fingertips_and_a_palm_of_four_modules_and_what_is_not_known_is_said() {
        let text = "cardid 14\r\nrobotPart left_hand\r\n# a hand\r\n[SENSORS]\r\npalmL 8 -25.0 0 0 4 0 0\r\n\
                    fingertip2L\t3\t32 35 -30 4 0 0\r\nfakePalm 9 0 0 0 4 0\r\n\t\t\t\r\nfingertip2L 0 1 2 3 4 0 0\r\n\
                    fingertip 0 0 0\nquad16 3 0 0\ntriangle_10pad\ntriangle_10pad 999 0 0\n";
        let drawing = Drawing::parse(text);
        assert_eq!(drawing.part.as_deref(), Some("left_hand"));
        let palm = (8..12).map(|module| (module, KindWord::Palm));
        let tips = [(0, KindWord::Fingertip), (3, KindWord::Fingertip)];
        assert_eq!(drawing.modules, tips.into_iter().chain(palm).collect());
        let lines: Vec<&str> = drawing.remarks.iter().filter_map(|remark| remark.split(':').next()).collect();
        assert_eq!(lines, ["line 11", "line 12", "line 13"]);
    }
}
