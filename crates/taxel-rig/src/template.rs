//! Where in a line of text the pressure is: `P={kPa} T={*}`.
//!
//! `{kPa}`, or another unit, is the number. `{*}` is any text, as short as it can be. A space stands for spaces and tabs, as many
//! as there are. All else must be in the line as it is in the template, up to the end of the line: so a line of another kind, or
//! one that was cut off or garbled, is refused and not read as a wrong pressure.

use std::fmt;

use taxel_wire::signal::PressureUnit;

use crate::lines::LINE_BYTES_MAX;

/// So much of a line is repeated in a message.
const SHOWN_CHARS: usize = 40;

/// A template that makes sense.
#[derive(Clone, Debug, PartialEq)]
pub struct Template {
    /// What stands between the places of any text, in order; the number is in one of them.
    segments: Vec<Vec<Part>>,
    unit: PressureUnit,
}

#[derive(Clone, Debug, PartialEq)]
enum Part {
    Text(String),
    Spaces,
    Number,
}

/// What is wrong with a template.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TemplateFault {
    /// It has no place of a number, or several.
    Numbers(usize),
    /// A brace without its other half.
    Brace,
    /// What stands in braces is no unit.
    Unit(String),
    /// It has an end of a line in it, or is longer than a line.
    Line,
}

impl fmt::Display for TemplateFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Numbers(0) => {
                f.write_str("it has no number: write the unit in braces where it is, as in \"P={kPa}\"")
            }
            Self::Numbers(count) => write!(f, "it has {count} numbers: leave one, and write {{*}} for the others"),
            Self::Brace => {
                f.write_str("a brace has no other half: expected {kPa} or another unit, and {*} for any text")
            }
            Self::Unit(found) => {
                write!(f, "{{{found}}} is no unit: expected {{*}}, or in braces one of {}", PressureUnit::NAMES)
            }
            Self::Line => write!(f, "it has an end of a line in it, or is longer than {LINE_BYTES_MAX} bytes"),
        }
    }
}

/// Why a line has no pressure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unread {
    line: String,
}

impl fmt::Display for Unread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shown: String = self.line.chars().take(SHOWN_CHARS).flat_map(char::escape_debug).collect();
        let more = if self.line.chars().count() > SHOWN_CHARS { "..." } else { "" };
        write!(f, "line \"{shown}{more}\" is not as the template says")
    }
}

impl Template {
    /// Reads a template.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn new(text: &str) -> Result<Self, TemplateFault> {
        if text.len() > LINE_BYTES_MAX || text.contains(char::is_control) {
            return Err(TemplateFault::Line);
        }
        let (mut segments, mut parts, mut units) = (Vec::new(), Vec::new(), Vec::new());
        let mut rest = text.trim();
        while let Some(at) = rest.find(['{', '}', ' ']) {
            if at > 0 {
                parts.push(Part::Text(rest[..at].to_owned()));
            }
            rest = &rest[at..];
            if rest.starts_with(' ') {
                parts.push(Part::Spaces);
                rest = rest.trim_start();
                continue;
            }
            let (inside, after) = rest.strip_prefix('{').and_then(|r| r.split_once('}')).ok_or(TemplateFault::Brace)?;
            if inside == "*" {
                segments.push(std::mem::take(&mut parts));
            } else {
                units.push(PressureUnit::named(inside).ok_or_else(|| TemplateFault::Unit(inside.to_owned()))?);
                parts.push(Part::Number);
            }
            rest = after;
        }
        if !rest.is_empty() {
            parts.push(Part::Text(rest.to_owned()));
        }
        segments.push(parts);
        match units[..] {
            [unit] => Ok(Self { segments, unit }),
            _ => Err(TemplateFault::Numbers(units.len())),
        }
    }

    /// The unit of its number.
    #[must_use]
    pub const fn unit(&self) -> PressureUnit {
        self.unit
    }

    /// The number in a line, in the template's unit.
    ///
    /// # Errors
    /// The line, if it is not as the template says.
    pub fn read(&self, line: &str) -> Result<f64, Unread> {
        let line = line.trim();
        self.number_in(line).ok_or_else(|| Unread { line: line.chars().take(LINE_BYTES_MAX).collect() })
    }

    fn number_in(&self, line: &str) -> Option<f64> {
        let (first, others) = self.segments.split_first()?;
        let (mut rest, mut found) = segment(first, line)?;
        for (position, parts) in others.iter().enumerate() {
            // The leftmost place leaves most to what follows; the last one has to end with the line.
            let is_last = position + 1 == others.len();
            if is_last && parts.is_empty() {
                return found;
            }
            let starts = rest.char_indices().map(|(at, _)| at);
            let fits = |at: usize| segment(parts, &rest[at..]).filter(|(after, _)| !is_last || after.is_empty());
            let (after, number) = starts.filter_map(fits).next()?;
            (rest, found) = (after, found.or(number));
        }
        found.filter(|_| rest.is_empty())
    }
}

/// What follows the parts in a text that begins with them, and the number among them.
fn segment<'a>(parts: &[Part], text: &'a str) -> Option<(&'a str, Option<f64>)> {
    let (mut rest, mut found) = (text, None);
    for part in parts {
        rest = match part {
            Part::Text(text) => rest.strip_prefix(text.as_str())?,
            Part::Spaces => rest.strip_prefix([' ', '\t'])?.trim_start(),
            Part::Number => {
                let (number, after) = number(rest.trim_start())?;
                found = Some(number);
                after
            }
        };
    }
    Some((rest, found))
}

/// The number that a text begins with, and what follows it.
fn number(text: &str) -> Option<(f64, &str)> {
    let digits = |from: usize| text[from..].bytes().take_while(u8::is_ascii_digit).count();
    let sign = usize::from(text.starts_with(['+', '-']));
    let whole = digits(sign);
    let mut end = sign + whole;
    let mut part = 0;
    if text[end..].starts_with('.') {
        part = digits(end + 1);
        end += 1 + part;
    }
    if whole + part == 0 {
        return None;
    }
    if text[end..].starts_with(['e', 'E']) {
        let sign = usize::from(text[end + 1..].starts_with(['+', '-']));
        let power = digits(end + 1 + sign);
        end += if power > 0 { 1 + sign + power } else { 0 };
    }
    let number = text[..end].parse::<f64>().ok().filter(|number| number.is_finite())?;
    Some((number, &text[end..]))
}

/// Every number in a line, with a template that reads it where its unit is kPa: for whoever looks for the right one.
#[must_use]
pub fn numbers_of(line: &str) -> Vec<(f64, String)> {
    let (mut found, mut template, mut rest) = (Vec::new(), String::new(), line.trim());
    while let Some(next) = rest.chars().next() {
        // A digit within a name, as in `P1=`, begins none.
        let begins = template.chars().next_back().is_none_or(|before| !before.is_alphanumeric() && before != '.');
        match number(rest).filter(|_| begins) {
            Some((value, after)) => {
                found.push((value, format!("{template}{{kPa}}{}", if after.is_empty() { "" } else { "{*}" })));
                template.push_str("{*}");
                rest = after;
            }
            None => {
                template.push(if next.is_whitespace() { ' ' } else { next });
                rest = &rest[next.len_utf8()..];
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(template: &str, line: &str) -> Option<f64> {
        Template::new(template).unwrap().read(line).ok()
    }

    #[test]
    fn the_number_is_read_where_the_template_says() {
        for (template, line, number) in [
            ("P={kPa}", "P=12.5", Some(12.5)),
            ("P={kPa}", " P= -0.25 ", Some(-0.25)),
            ("{kPa}", "+1.2e1", Some(12.0)),
            ("{mbar} mbar", "101.3   mbar", Some(101.3)),
            ("A {kPa} {*}", "A +014.69 +025.00 +00.00 Air", Some(14.69)),
            ("A {*} {kPa} {*}", "A +014.69 +025.00 +00.00 Air", Some(25.0)),
            ("{*},{Pa},{*}", "17,99870,23.1", Some(99_870.0)),
            ("{*}p:{kPa}{*}", "t:3 p:4 h:5", Some(4.0)),
            ("{*}{kPa}", "x 1 y 22", Some(22.0)),
            ("P={kPa}", "P=12.5 T=20", None),
            ("P={kPa}", "P=12,5", None),
            ("P={kPa}", "P=nan", None),
            ("P={kPa}", "P=", None),
            ("P={kPa}", "Q=3", None),
            ("P={kPa}", "P=1e999", None),
            ("P {kPa}", "P3", None),
            ("{kPa};{*}", "12.5", None),
        ] {
            assert_eq!(read(template, line), number, "{template} of {line:?}");
        }
    }

    #[test]
    fn what_is_wrong_with_a_template_is_said() {
        let says = |text: &str| Template::new(text).unwrap_err().to_string();
        assert!(says("P=").contains("write the unit in braces"), "{}", says("P="));
        assert!(says("{kPa} {Pa}").starts_with("it has 2 numbers"), "{}", says("{kPa} {Pa}"));
        assert!(says("{kPa").starts_with("a brace") && says("}").starts_with("a brace"));
        assert!(
            says("{ksi}").starts_with("{ksi} is no unit: expected {*}, or in braces one of Pa,"),
            "{}",
            says("{ksi}")
        );
        assert!(says("{kPa}\r\n").starts_with("it has an end of a line"));
        assert_eq!(Template::new("{psi}").unwrap().unit(), PressureUnit::Psi);
    }

    #[test]
    fn a_line_that_is_not_read_is_shown_cut_and_without_control_characters() {
        let unread = Template::new("P={kPa}").unwrap().read(&format!("\u{1b}[2J{}", "x".repeat(90))).unwrap_err();
        assert_eq!(
            unread.to_string(),
            format!("line \"\\u{{1b}}[2J{}...\" is not as the template says", "x".repeat(36))
        );
    }

    #[test]
    fn every_number_of_a_line_has_a_template_that_reads_it() {
        let line = "P1=12.5 T=20.1;3 ok";
        let found = numbers_of(line);
        assert_eq!(found.iter().map(|(value, _)| *value).collect::<Vec<_>>(), [12.5, 20.1, 3.0]);
        assert_eq!(found[0].1, "P1={kPa}{*}");
        for (value, template) in found.iter().chain(&numbers_of("42")) {
            assert_eq!(read(template, if *value == 42.0 { "42" } else { line }), Some(*value), "{template}");
        }
    }

    proptest! {
        #[test]
        fn no_template_and_no_line_panics(template in "[P={}*kPa 0-9.]{0,12}", line in "\\PC{0,40}") {
            if let Ok(template) = Template::new(&template) {
                let _ = template.read(&line);
            }
            let _ = numbers_of(&line);
        }

        #[test]
        fn what_is_printed_is_read(value in -1e6..1e6_f64, places in 0..6_usize) {
            let printed = format!("{value:.places$}");
            prop_assert_eq!(read("{*} p={kPa} kPa", &format!("#1 p={printed} kPa")), printed.parse().ok());
        }
    }
}
