//! What is said to a port of ours ("Port commands" and "The administrative interface").

/// What an administrative command wants.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Command {
    /// Send to this port.
    Add(String),
    /// Send to it no more.
    Remove(String),
    /// The names of the readers.
    Readers,
    /// How this reader is connected.
    Reader(String),
    /// The names of those who send to this port: there are none.
    Senders,
    /// The version of this interface.
    Version,
    /// Something else.
    Other,
}

impl Command {
    /// Of `[add] "tcp:/reader"`, `[del] /reader`, `[list] [out]`.
    pub fn of(line: &str) -> Self {
        let mut words = line.split_whitespace().map(|word| word.trim_matches(['[', ']', '"']));
        let mut word = || words.next().unwrap_or_default();
        match (word(), word(), word()) {
            ("add", to, _) if !to.is_empty() => Self::Add(target(to)),
            ("del", to, _) if !to.is_empty() => Self::Remove(target(to)),
            ("list", "out", "") => Self::Readers,
            ("list", "out", reader) => Self::Reader(reader.to_owned()),
            ("list", ..) => Self::Senders,
            ("ver", ..) => Self::Version,
            _ => Self::Other,
        }
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
        for (line, command) in [
            ("[add] \"tcp:/reader\"", Command::Add("/reader".into())),
            ("add /reader:i", Command::Add("/reader:i".into())),
            ("[add] \"mcast://reader:i\"", Command::Add("/reader:i".into())),
            ("[del] \"/reader:i\"", Command::Remove("/reader:i".into())),
            ("[list] [out]", Command::Readers),
            ("[list] [out] \"/reader\"", Command::Reader("/reader".into())),
            ("[list] [in]", Command::Senders),
            ("[ver]", Command::Version),
            ("[add]", Command::Other),
            ("", Command::Other),
        ] {
            assert_eq!(Command::of(line), command, "{line}");
        }
    }
}
