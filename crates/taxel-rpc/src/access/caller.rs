//! Who makes a call, and what that one may do.

use std::sync::Arc;

use crate::access::origin::Origin;
use crate::access::role::Role;

/// Longest name that goes into a log line, in characters.
const NAME_CHARS_MAX: usize = 128;

/// Who makes a call. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Caller {
    pub(crate) origin: Arc<Origin>,
    /// The name that is proven: of an account, a certificate or a token's holder.
    pub(crate) name: Option<Arc<str>>,
    /// By a token, and not by what the connection proves.
    pub(crate) by_token: bool,
    pub(crate) role: Option<Role>,
    /// What is asked for, as it came and shortened, once the request has been read.
    pub(crate) said: String,
}

impl Caller {
    /// The proven name for logs and the audit log, without anything that a terminal would act on.
    pub(crate) fn who(&self) -> String {
        let name = self.name.as_deref().unwrap_or("nobody in particular");
        let shown: String = name.chars().take(NAME_CHARS_MAX).flat_map(char::escape_debug).collect();
        if self.by_token { format!("token {shown}") } else { shown }
    }

    /// Whether reserved places are for this one, too.
    pub(crate) fn is_operator(&self) -> bool {
        self.role >= Some(Role::Operator)
    }

    /// Whose share the call takes: the holder of a token has one beside that of others from the same place.
    pub(crate) fn key(&self) -> String {
        if self.by_token { self.who() } else { self.origin.key() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_caller_is_told_by_the_proven_name_short_and_without_control_characters() {
        let address = ([127, 0, 0, 1], 4000).into();
        let caller = |name: Option<&str>, by_token| Caller {
            origin: Arc::new(Origin::of_tcp(address)),
            name: name.map(Arc::from),
            by_token,
            role: None,
            said: String::new(),
        };
        assert_eq!(caller(None, false).who(), "nobody in particular");
        assert_eq!(caller(Some("ada"), false).who(), "ada");
        assert_eq!(caller(Some("bench"), true).who(), "token bench");
        assert_eq!(caller(Some("a\u{1b}[2Jb\n"), false).who(), "a\\u{1b}[2Jb\\n");
        assert_eq!(caller(Some(&"x".repeat(500)), false).who().len(), NAME_CHARS_MAX);
        assert_eq!(caller(Some("ada"), false).key(), "loopback TCP");
        assert_eq!(caller(Some("bench"), true).key(), "token bench");
    }
}
