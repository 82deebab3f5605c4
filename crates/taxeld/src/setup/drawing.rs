//! iCub's skin drawing files (`conf/skinGui/*.ini`): what each module of a part is.
//!
//! A row is `kind module x y degrees gain mirror [layout]`, the module numbered over all boards: 16 x board position +
//! module. Only kind and module are used. `cardid` is not: it has boards in another order than the port, or lacks some.

use std::collections::BTreeMap;

use crate::config::KindWord;

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
        let mut drawing = Self::default();
        let (mut in_sensors, mut repeated) = (false, 0_usize);
        for (line, text) in text.trim_start_matches('\u{feff}').lines().enumerate() {
            let mut words = text.split('#').next().unwrap_or("").split_whitespace();
            let Some(first) = words.next() else { continue };
            if first.starts_with('[') {
                in_sensors = first.eq_ignore_ascii_case("[SENSORS]");
            } else if in_sensors {
                let module = words.next().and_then(|word| word.parse().ok()).filter(|m| *m < MODULES_MAX);
                match module {
                    Some(module) => repeated += drawing.row(first, module, line + 1),
                    None => drawing.remarks.push(format!("line {}: `{first}` without a module number", line + 1)),
                }
            } else if first.eq_ignore_ascii_case("cardid") {
                let ids: Vec<&str> = words.collect();
                drawing
                    .remarks
                    .push(format!("cardid {} is not used: it is not in the order of the port", ids.join(" ")));
            } else if first.eq_ignore_ascii_case("robotPart") {
                drawing.part = words.next().map(str::to_owned);
            }
        }
        if repeated > 0 {
            drawing.remarks.push(format!("{repeated} modules come again: each counts once"));
        }
        drawing
    }

    /// Takes a row; returns how many of its modules were there already.
    fn row(&mut self, kind: &str, module: usize, line: usize) -> usize {
        let Some((modules, word)) = self.meaning(kind, line) else { return 0 };
        let mut repeated = 0;
        for offset in 0..modules {
            // A palm that does not begin at module 8 has its odd module, the last one, elsewhere.
            let word = match (word, module % 16, offset) {
                (KindWord::Palm, first, 3) if first != 8 => KindWord::PalmPad7,
                (KindWord::Palm, first, _) if first != 8 => KindWord::PalmPad11,
                _ => word,
            };
            match self.modules.entry(module + offset) {
                std::collections::btree_map::Entry::Vacant(entry) => {
                    entry.insert(word);
                }
                std::collections::btree_map::Entry::Occupied(entry) if *entry.get() == word => repeated += 1,
                std::collections::btree_map::Entry::Occupied(_) => {
                    let number = module + offset;
                    self.remarks.push(format!("line {line}: module {number} is another kind than before: left out"));
                }
            }
        }
        repeated
    }

    /// How many modules a word stands for, and what they are.
    fn meaning(&mut self, kind: &str, line: usize) -> Option<(usize, KindWord)> {
        match kind {
            // Older drawings have the two thermal pads of a triangle as circles, too, and another word for it.
            "triangle_10pad" | "triangle" => Some((1, KindWord::Triangle)),
            "palmL" | "palmR" => Some((4, KindWord::Palm)),
            "fakePalm" => None, // an outline, no module
            _ if kind.starts_with("fingertip") => Some((1, KindWord::Fingertip)),
            _ if kind.starts_with("cer_sh_") => {
                let why = "four modules of R1's hand, of whose 48 values not all are taxels";
                self.remarks.push(format!("line {line}: {kind}: {why}: `taxeld scan` shows which are alive"));
                Some((4, KindWord::Twelve))
            }
            _ => {
                self.remarks.push(format!("line {line}: kind `{kind}` is not known: left out"));
                None
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hand_has_fingertips_and_a_palm_of_four_modules() {
        let text = "cardid 14\r\nrobotPart left_hand\r\n# a hand\r\n[SENSORS]\r\npalmL 8 -25.0 0 0 4 0 0\r\n\
                    fingertip2L\t3\t32 35 -30 4 0 0\r\nfakePalm 9 0 0 0 4 0\r\n\t\t\t\r\nfingertip2L 0 1 2 3 4 0 0\r\n";
        let drawing = Drawing::parse(text);
        assert_eq!(drawing.part.as_deref(), Some("left_hand"));
        let palm = (8..12).map(|module| (module, KindWord::Palm));
        let tips = [(0, KindWord::Fingertip), (3, KindWord::Fingertip)];
        assert_eq!(drawing.modules, tips.into_iter().chain(palm).collect());
        assert_eq!(drawing.remarks, ["cardid 14 is not used: it is not in the order of the port"]);
    }

    #[test]
    fn repeated_rows_count_once_and_what_is_not_known_is_said() {
        let text = "[SENSORS]\ntriangle_10pad 61 1 2\ntriangle_10pad 61 1 2\nquad16 3 0 0\ntriangle_10pad\n\
                    cer_sh_td 8 0 0\nfingertip 61 0 0\ntriangle_10pad 999 0 0\n";
        let drawing = Drawing::parse(text);
        assert_eq!(drawing.modules.len(), 5);
        let remarks = drawing.remarks.join("\n");
        for says in [
            "1 modules come again",
            "line 4: kind `quad16`",
            "line 5: `triangle_10pad` without a module number",
            "line 6: cer_sh_td",
            "line 7: module 61 is another kind",
            "line 8: `triangle_10pad` without",
        ] {
            assert!(remarks.contains(says), "{says}: {remarks}");
        }
    }
}
