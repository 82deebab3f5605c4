//! Where in a line of text the pressure is: `P={kPa} T={*}`.
//!
//! `{kPa}`, or another unit, is the number. `{*}` is any text, as short as it can be. A space stands for spaces and tabs, as many
//! as there are. All else must be in the line as it is in the template, up to the end of the line: so a line of another kind, or
//! one that was cut off or garbled, is refused and not read as a wrong pressure.

use taxel_wire::signal::PressureUnit;

use crate::lines::LINE_BYTES_MAX;

/// So much of a line is repeated in a message.
const SHOWN_CHARS: usize = 40;

/// A template that makes sense.
#[derive(Clone, Debug, PartialEq)]
pub struct Template {
    /// As it is written.
    text: String,
    /// What stands between the places of any text, in order; the number is in one of them.
    segments: Vec<Vec<Part>>,
    unit: Option<PressureUnit>,
}

#[derive(Clone, Debug, PartialEq)]
enum Part {
    Text(String),
    Spaces,
    Number,
}

impl Part {
    /// How it could be in a line.
    fn sample(&self) -> &str {
        match self {
            Self::Text(text) => text,
            Self::Spaces => " ",
            Self::Number => "12.5",
        }
    }
}

impl Template {
    /// Reads a template of a number.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn new(text: &str) -> Result<Self, String> {
        let none = "it has no number: write the unit in braces where it is, as in \"P={kPa}\"";
        Self::pattern(text).and_then(|read| if read.unit.is_some() { Ok(read) } else { Err(none.to_owned()) })
    }

    /// Reads a template that may do without a number.
    ///
    /// # Errors
    /// What is wrong with it, also that no line can ever be so.
    pub fn pattern(text: &str) -> Result<Self, String> {
        // In single quotes of TOML an escape is two characters.
        let has_end = text.contains(char::is_control) || text.contains("\\r") || text.contains("\\n");
        if text.len() > LINE_BYTES_MAX || has_end {
            return Err(format!("it has an end of a line in it, or is longer than {LINE_BYTES_MAX} bytes"));
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
            let brace = "a brace has no other half: expected {kPa} or another unit, and {*} for any text";
            let (inside, after) = rest.strip_prefix('{').and_then(|rest| rest.split_once('}')).ok_or(brace)?;
            if inside == "*" {
                segments.push(std::mem::take(&mut parts));
            } else {
                units.push(PressureUnit::named(inside).ok_or_else(|| {
                    format!("{{{inside}}} is no unit: expected {{*}}, or in braces one of {}", PressureUnit::NAMES)
                })?);
                parts.push(Part::Number);
            }
            rest = after;
        }
        if !rest.is_empty() {
            parts.push(Part::Text(rest.to_owned()));
        }
        segments.push(parts);
        if units.len() > 1 {
            return Err(format!("it has {} numbers: leave one, and write {{*}} for the others", units.len()));
        }
        Self { text: text.trim().to_owned(), segments, unit: units.first().copied() }.makes_sense()
    }

    /// It, if a line can be so, and does not name another unit behind the number.
    fn makes_sense(self) -> Result<Self, String> {
        let sample = |parts: &Vec<Part>| parts.iter().map(Part::sample).collect::<String>();
        let line = self.segments.iter().map(sample).collect::<Vec<_>>().join("x");
        let Some(unit) = self.unit else { return Ok(self) };
        if self.matched(&line) != Some(Some(12.5)) {
            return Err("no line is ever so: the number takes what stands behind it as its own digits".to_owned());
        }
        let behind = self.segments.iter().find_map(|parts| {
            let mut behind = parts.iter().skip_while(|part| **part != Part::Number).skip(1);
            behind.find_map(|part| if let Part::Text(text) = part { Some(word(text)) } else { None })
        });
        match behind.and_then(|word| Some((word, PressureUnit::named(word)?))) {
            Some((word, said)) if said.to_kilopascal(1.0) != unit.to_kilopascal(1.0) => {
                Err(format!("the line says {word} behind the number: expected {{{word}}}"))
            }
            _ => Ok(self),
        }
    }

    /// The unit of its number, if it has one.
    #[must_use]
    pub const fn unit(&self) -> Option<PressureUnit> {
        self.unit
    }

    /// As it is written.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The number in a line, if the template has one, in its unit.
    ///
    /// # Errors
    /// The line beside the template, if it is not so.
    pub fn read(&self, line: &str) -> Result<Option<f64>, String> {
        let line = line.trim();
        self.matched(line).ok_or_else(|| format!("received {}, expected {}", quoted(line), quoted(&self.text)))
    }

    fn matched(&self, line: &str) -> Option<Option<f64>> {
        let (first, others) = self.segments.split_first()?;
        let (mut rest, mut found) = segment(first, line)?;
        for (position, parts) in others.iter().enumerate() {
            // The leftmost place leaves most to what follows; the last one has to end with the line.
            let is_last = position + 1 == others.len();
            if is_last && parts.is_empty() {
                return Some(found);
            }
            let starts = rest.char_indices().map(|(at, _)| at);
            let fits = |at: usize| segment(parts, &rest[at..]).filter(|(after, _)| !is_last || after.is_empty());
            let (after, number) = starts.filter_map(fits).next()?;
            (rest, found) = (after, found.or(number));
        }
        rest.is_empty().then_some(found)
    }
}

/// A text for a message: cut, and without control characters.
pub(crate) fn quoted(text: &str) -> String {
    let shown: String = text.chars().take(SHOWN_CHARS).flat_map(char::escape_debug).collect();
    let more = if text.chars().count() > SHOWN_CHARS { "..." } else { "" };
    format!("\"{shown}{more}\"")
}

/// The word that a text begins with; a unit is one.
fn word(text: &str) -> &str {
    text.split(|c: char| !c.is_alphanumeric() && c != '/').next().unwrap_or_default()
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

/// A number in a line.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The number.
    pub value: f64,
    /// The unit that the line names behind it.
    pub unit: Option<PressureUnit>,
    /// A template that reads it, in that unit or in kPa.
    pub template: String,
}

/// Every number in a line: for a user who looks for the right one.
#[must_use]
pub fn numbers_of(line: &str) -> Vec<Found> {
    let (mut found, mut before, mut rest) = (Vec::new(), String::new(), line.trim());
    while let Some(next) = rest.chars().next() {
        // A digit within a name, as in `P1=`, begins none.
        let begins = before.chars().next_back().is_none_or(|before| !before.is_alphanumeric() && before != '.');
        if let Some((value, after)) = number(rest).filter(|_| begins) {
            let name = word(after.trim_start());
            let unit = PressureUnit::named(name);
            let (inside, end) = match unit {
                Some(_) => (name, after.len() - after.trim_start().len() + name.len()),
                None => ("kPa", 0),
            };
            let (behind, more) = after.split_at(end);
            let more = if more.is_empty() { "" } else { "{*}" };
            found.push(Found { value, unit, template: format!("{before}{{{inside}}}{behind}{more}") });
            before.push_str("{*}");
            rest = after;
        } else {
            match next {
                '{' | '}' => before.push_str("{*}"), // JSON
                next if next.is_whitespace() => before.push(' '),
                next => before.push(next),
            }
            rest = &rest[next.len_utf8()..];
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(template: &str, line: &str) -> Option<f64> {
        Template::new(template).unwrap().read(line).ok().flatten()
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
        assert!([r"P={kPa}\r\n", "{kPa}\r\n"].iter().all(|text| says(text).starts_with("it has an end of a line")));
        assert!(says("P={kPa}5").starts_with("no line is ever so"), "{}", says("P={kPa}5"));
        assert_eq!(says("p {kPa} mbar;"), "the line says mbar behind the number: expected {mbar}");
        assert!(["{hPa} mbar", "{kPa} abs", "{kPa}.0", "{*}{kPa}{*}5"].iter().all(|text| Template::new(text).is_ok()));
        assert_eq!(Template::new("{psi}").unwrap().unit(), Some(PressureUnit::Psi));
    }

    #[test]
    fn a_line_that_is_not_read_is_shown_cut_and_without_control_characters() {
        let unread = Template::new("P={kPa}").unwrap().read(&format!("\u{1b}[2J{}", "x".repeat(90))).unwrap_err();
        assert_eq!(
            unread.to_string(),
            format!("received \"\\u{{1b}}[2J{}...\", expected \"P={{kPa}}\"", "x".repeat(36))
        );
    }

    #[test]
    fn every_number_of_a_line_has_a_template_that_reads_it() {
        for (line, values) in [
            ("P1=12.5 T=20.1;3 ok", [12.5, 20.1, 3.0].as_slice()),
            ("42", &[42.0]),
            ("{\"p\": -3.21, \"unit\": \"kPa\"}", &[-3.21]),
            ("T 20 p  812.5  hPa 1", &[20.0, 812.5, 1.0]),
        ] {
            let found = numbers_of(line);
            assert_eq!(found.iter().map(|one| one.value).collect::<Vec<_>>(), values);
            for one in found {
                assert_eq!(read(&one.template, line), Some(one.value), "{}", one.template);
            }
        }
        let found = numbers_of("T 20 p 812.5 hPa 1");
        assert_eq!((found[0].unit, found[1].unit), (None, Some(PressureUnit::Hectopascal)));
        assert_eq!((&*found[0].template, &*found[1].template), ("T {kPa}{*}", "T {*} p {hPa} hPa{*}"));
        assert_eq!(numbers_of("P1=12.5 T=20.1")[0].template, "P1={kPa}{*}");
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
