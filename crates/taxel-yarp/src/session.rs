//! What is said to a port of ours, and what it answers ("Port commands" and "The administrative interface").
//!
//! No sockets: a command in, an answer out. What it wants done is for [`crate::OutPort`] to do.

use crate::value::Value;

/// What a command wants.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Wish {
    /// An answer, and nothing else.
    Nothing,
    /// Send to this port.
    Add(String),
    /// Send to it no more.
    Remove(String),
    /// The names of the readers, or whether this one is among them.
    ListOut(Option<String>),
    /// This connection becomes a reader.
    Reverse,
    /// End the connection.
    Quit,
}

/// Of a command that is a word: `*`, `r`, `/reader`, `!/reader`, `q`.
pub(crate) fn of_word(word: &str) -> Wish {
    match word.chars().next() {
        Some('/') => Wish::Add(target(word)),
        Some('!' | '~') => Wish::Remove(target(&word[1..])),
        Some('r') => Wish::Reverse,
        Some('q') => Wish::Quit,
        _ => Wish::Nothing,
    }
}

/// Of an administrative message: `[add] "tcp:/reader"`, `[del] /reader`, `[list] [out]`.
pub(crate) fn of_admin(message: &[Value]) -> Wish {
    let word = |at: usize| message.get(at).and_then(Value::as_text).unwrap_or_default();
    match (word(0), word(1)) {
        ("add", to) if !to.is_empty() => Wish::Add(target(to)),
        ("del", to) if !to.is_empty() => Wish::Remove(target(to)),
        ("list", "out") => Wish::ListOut(Some(word(2)).filter(|name| !name.is_empty()).map(str::to_owned)),
        _ => Wish::Nothing,
    }
}

/// What is answered to a message whose wish is [`Wish::Nothing`].
pub(crate) fn answer_to(message: &[Value]) -> Vec<Value> {
    let text = |text: &str| Value::Text(text.to_owned());
    match message.first().and_then(Value::as_text) {
        Some("ver") => vec![text("ver"), Value::Int(1), Value::Int(2), Value::Int(3)],
        Some("list") => Vec::new(), // nobody sends to this port
        Some("help") => {
            vec![text("[help]"), text("[ver]"), text("[add] $port"), text("[del] $port"), text("[list] [out]")]
        }
        _ => vec![Value::Int(-1), text("not understood: type help")],
    }
}

/// `/reader:i` of `tcp:/reader:i`, `tcp://reader:i`, `/reader:i`.
fn target(written: &str) -> String {
    match written.split_once(":/") {
        Some((_, name)) => format!("/{}", name.trim_start_matches('/')),
        None => written.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_understood_as_the_documents_have_them() {
        let admin = |line: &str| of_admin(&Value::parse(line).unwrap());
        assert_eq!(admin("[add] \"tcp:/reader\""), Wish::Add("/reader".into()));
        assert_eq!(admin("add /reader"), Wish::Add("/reader".into()));
        assert_eq!(admin("[add] \"tcp:/reader:i\""), Wish::Add("/reader:i".into()));
        assert_eq!(admin("[add] /reader:i"), Wish::Add("/reader:i".into()));
        assert_eq!(admin("[del] \"/reader:i\""), Wish::Remove("/reader:i".into()));
        assert_eq!(admin("[list] [out]"), Wish::ListOut(None));
        assert_eq!(admin("[list] [out] \"/reader\""), Wish::ListOut(Some("/reader".into())));
        assert_eq!(admin("[list] [in]"), Wish::Nothing);
        assert_eq!(answer_to(&Value::parse("[list] [in]").unwrap()), []);
        assert_eq!(of_word("/mcast://read"), Wish::Add("/read".into()));
        assert_eq!(of_word("!/read"), Wish::Remove("/read".into()));
        assert_eq!((of_word("r"), of_word("*"), of_word("q")), (Wish::Reverse, Wish::Nothing, Wish::Quit));
    }
}
