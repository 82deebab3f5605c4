//! What YARP messages consist of, as text and as bytes ("Standard data representation format").

use std::fmt::Write;

/// Lists in lists, at most; deeper ones are refused.
const DEPTH_MAX: usize = 16;

/// A number, a word or a list.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A whole number.
    Int(i64),
    /// Any number.
    Float(f64),
    /// A word, a vocabulary word or a sentence.
    Text(String),
    /// A list.
    List(Vec<Value>),
}

impl Value {
    /// A list of numbers.
    pub fn floats(numbers: impl IntoIterator<Item = f64>) -> Self {
        Self::List(numbers.into_iter().map(Self::Float).collect())
    }

    /// The word, if it is one.
    #[must_use]
    pub fn as_text(&self) -> Option<&str> {
        match self {
            Self::Text(text) => Some(text),
            _ => None,
        }
    }

    /// The elements of a message as a line of text, without its end.
    #[must_use]
    pub fn line(elements: &[Self]) -> String {
        let mut line = String::new();
        elements.iter().for_each(|element| element.append_to(&mut line));
        line
    }

    fn append_to(&self, line: &mut String) {
        if !line.is_empty() && !line.ends_with('(') {
            line.push(' ');
        }
        // Writing to a string does not fail.
        let _ = match self {
            Self::Int(number) => write!(line, "{number}"),
            Self::Float(number) if number.is_nan() => write!(line, "nan"),
            // A number without a point would be read as a whole one.
            Self::Float(number) => write!(line, "{number:?}"),
            Self::Text(text) if is_plain(text) => write!(line, "{text}"),
            Self::Text(text) => {
                let escaped = text.replace('\\', "\\\\").replace('"', "\\\"").replace('\r', "\\r").replace('\n', "\\n");
                write!(line, "\"{escaped}\"")
            }
            Self::List(elements) => {
                line.push('(');
                elements.iter().for_each(|element| element.append_to(line));
                write!(line, ")")
            }
        };
    }

    /// The elements of a line of text; nothing if a list or a quotation does not end.
    #[must_use]
    pub fn parse(line: &str) -> Option<Vec<Self>> {
        let mut open = vec![Vec::new()];
        let mut rest = line.trim_start();
        while let Some(first) = rest.chars().next() {
            match first {
                '(' if open.len() < DEPTH_MAX => {
                    open.push(Vec::new());
                    rest = &rest[1..];
                }
                ')' if open.len() > 1 => {
                    let list = open.pop()?;
                    open.last_mut()?.push(Self::List(list));
                    rest = &rest[1..];
                }
                '"' => {
                    let (text, after) = quoted(&rest[1..])?;
                    open.last_mut()?.push(Self::Text(text));
                    rest = after;
                }
                _ => {
                    let end = rest.find(|c: char| c.is_ascii_whitespace() || matches!(c, '(' | ')' | '"'));
                    let (token, after) = rest.split_at(end.unwrap_or(rest.len()));
                    if token.is_empty() {
                        return None; // too deep, or a list that ends before it begins
                    }
                    open.last_mut()?.push(Self::of_token(token));
                    rest = after;
                }
            }
            rest = rest.trim_start();
        }
        open.pop().filter(|_| open.is_empty())
    }

    fn of_token(token: &str) -> Self {
        let is_number = token.starts_with(|c: char| c.is_ascii_digit() || matches!(c, '-' | '+' | '.'));
        match (token.parse(), token.parse()) {
            (Ok(whole), _) if is_number => Self::Int(whole),
            (_, Ok(number)) if is_number || token == "nan" => Self::Float(number),
            _ => {
                let word = token.strip_prefix('[').and_then(|word| word.strip_suffix(']'));
                Self::Text(word.unwrap_or(token).to_owned())
            }
        }
    }
}

/// Whether a text needs no quotation marks and cannot be taken for a number or a list.
fn is_plain(text: &str) -> bool {
    let known = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '/' | ':' | '-' | '.');
    text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '/')
        && text.chars().all(known)
        && text != "nan"
        && text != "inf"
}

/// What stands between quotation marks, and what comes behind.
fn quoted(rest: &str) -> Option<(String, &str)> {
    let mut text = String::new();
    let mut chars = rest.char_indices();
    while let Some((at, c)) = chars.next() {
        match c {
            '"' => return Some((text, &rest[at + 1..])),
            '\\' => text.push(match chars.next()?.1 {
                'n' => '\n',
                'r' => '\r',
                other => other,
            }),
            other => text.push(other),
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A contact of a public recording of 2014, and what else the document has.
    #[test]
    fn text_is_read_and_written_as_the_document_has_it() {
        let line = "((1848 4 2 6) (0.06 -0.029 0.009) (47) 9.3)";
        let read = Value::parse(line).unwrap();
        let ids = Value::List([1848, 4, 2, 6].map(Value::Int).to_vec());
        let place = Value::floats([0.06, -0.029, 0.009]);
        assert_eq!(read, [Value::List(vec![ids, place, Value::List(vec![Value::Int(47)]), Value::Float(9.3)])]);
        assert_eq!(Value::line(&read), line);
        let read = Value::parse(r#"[add] "tcp:/reader" 10.0 nan a"b" "#).unwrap();
        assert_eq!(read[..3], [Value::Text("add".into()), Value::Text("tcp:/reader".into()), Value::Float(10.0)]);
        assert!(matches!(read[3], Value::Float(nan) if nan.is_nan()));
        let written = Value::line(&[Value::Float(240.0), Value::Text("good list".into()), Value::List(Vec::new())]);
        assert_eq!(written, r#"240.0 "good list" ()"#);
    }

    #[test]
    fn what_does_not_end_or_begin_is_refused() {
        for line in ["(1 2", "1)", "\"half", "\"\\", ")"] {
            assert_eq!(Value::parse(line), None, "{line}");
        }
        assert_eq!(Value::parse(&"(".repeat(100_000)), None);
    }

    fn any_value() -> impl Strategy<Value = Value> {
        let leaf = prop_oneof![
            any::<i64>().prop_map(Value::Int),
            any::<f64>().prop_filter("finite", |n| n.is_finite()).prop_map(Value::Float),
            any::<String>().prop_map(Value::Text),
        ];
        leaf.prop_recursive(4, 32, 8, |inner| proptest::collection::vec(inner, 0..8).prop_map(Value::List))
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_again(elements in proptest::collection::vec(any_value(), 0..8)) {
            prop_assert_eq!(Value::parse(&Value::line(&elements)), Some(elements));
        }

        #[test]
        fn any_line_is_read_or_refused(line in any::<String>()) {
            let _ = Value::parse(&line);
        }
    }
}
