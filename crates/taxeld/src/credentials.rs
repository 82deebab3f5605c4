//! Certificates and tokens, read again when somebody asks for it.

use std::path::{Path, PathBuf};

use taxel_rpc::{Access, Rules, Tls, Tokens};

use crate::config::Doors;

/// What the service takes from files to know who calls.
#[derive(Debug)]
pub struct Credentials {
    access: Access,
    tokens: Option<PathBuf>,
    tls: Vec<Tls>,
}

impl Credentials {
    /// Reads the tokens; certificates are added as their listeners are opened.
    ///
    /// # Errors
    /// The file of tokens and what is wrong with it.
    pub fn read(doors: &Doors) -> anyhow::Result<Self> {
        let rules = Rules { tokens: tokens(doors.tokens.as_deref())?, ..doors.rules.clone() };
        Ok(Self { access: Access::new(rules), tokens: doors.tokens.clone(), tls: Vec::new() })
    }

    /// Looks after the certificates of one more listener.
    pub fn add(&mut self, tls: Tls) {
        self.tls.push(tls);
    }

    /// Who may do what, by these and the configuration.
    pub fn access(&self) -> Access {
        self.access.clone()
    }

    /// Other grants from the configuration; what comes of a file stays.
    pub fn regrant(&self, rules: Rules) {
        self.access.update(|now| Rules { tokens: now.tokens.clone(), ..rules });
    }

    /// Reads all files again. What is wrong stays as it was, and is told.
    pub fn read_again(&self) {
        match tokens(self.tokens.as_deref()) {
            Ok(tokens) => self.access.update(|now| Rules { tokens, ..now.clone() }),
            Err(error) => tracing::error!("{error}; the tokens stay as they were"),
        }
        for error in self.tls.iter().filter_map(|tls| tls.reload().err()) {
            tracing::error!("{error}; the certificates stay as they were");
        }
    }
}

/// The tokens of a file; none without one.
fn tokens(path: Option<&Path>) -> anyhow::Result<Tokens> {
    let Some(path) = path else { return Ok(Tokens::default()) };
    Tokens::load(path).map_err(|problem| anyhow::anyhow!("access.tokens: {problem}"))
}
