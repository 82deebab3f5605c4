//! What messages consist of, as text ("Standard data representation format").

use std::fmt::Write;

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
}

/// Whether a text needs no quotation marks: a word of capitals can be taken for nothing else.
fn is_plain(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_uppercase() || byte == b'_')
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A contact of a public recording of 2014, and what else the document has.
    #[test]
    fn text_is_written_as_the_document_has_it() {
        let ids = Value::List([1848, 4, 2, 6].map(Value::Int).to_vec());
        let contact = [ids, Value::floats([0.06, -0.029, 0.009]), Value::List(vec![Value::Int(47)]), Value::Float(9.3)];
        assert_eq!(Value::line(&[Value::List(contact.to_vec())]), "((1848 4 2 6) (0.06 -0.029 0.009) (47) 9.3)");
        let texts = ["OK", "/a:o", "say \"1\"", "12", ""].map(|text| Value::Text(text.to_owned()));
        let written = Value::line(&[&[Value::Float(240.0), Value::Float(f64::NAN)], &texts[..]].concat());
        assert_eq!(written, r#"240.0 nan OK "/a:o" "say \"1\"" "12" """#);
        assert_eq!(Value::line(&[Value::List(Vec::new()), Value::Float(f64::INFINITY)]), "() inf");
    }
}
