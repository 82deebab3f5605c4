//! Which daemon a command of ours asks, as options of its command line.

use std::path::PathBuf;

use crate::connect::{Address, ConnectError, Line, Options, TlsOptions};

/// The heading of these options in the help of each command.
const HEADING: &str = "Connection";

/// Which daemon, and which patch of it.
#[derive(Clone, Debug, clap::Args)]
pub struct Server {
    /// The daemon: http://HOST:PORT, HOST:PORT, unix:PATH or, with --tls, https://HOST:PORT. Default: /run/taxeld/taxeld.sock if there is one, else
    /// 127.0.0.1:50051.
    #[arg(long, value_name = "ADDRESS", env = "TAXELD_SERVER", value_parser = Address::parse, help_heading = HEADING)]
    server: Option<Address>,
    /// File whose first line is the token to show.
    #[arg(long, value_name = "FILE", env = "TAXELD_TOKEN_FILE", help_heading = HEADING)]
    token: Option<PathBuf>,
    /// For https://: a folder with ca.pem, the authority of the daemon's certificate, and with client.pem and client.key, which
    /// tell the daemon who you are.
    #[arg(long, value_name = "DIR", env = "TAXELD_TLS", help_heading = HEADING)]
    tls: Option<PathBuf>,
    /// The name in the daemon's certificate, where it is not the host in the address.
    #[arg(long, value_name = "NAME", requires = "tls", help_heading = HEADING)]
    tls_name: Option<String>,
    /// The patch, needed only if the daemon has several.
    #[arg(long, value_name = "NAME", default_value = "", help_heading = HEADING)]
    pub patch: String,
}

impl Server {
    /// Opens the connection.
    ///
    /// # Errors
    /// The address and why nobody answers there, or the file of a credential and what is wrong with it.
    pub async fn connect(&self) -> Result<Line, ConnectError> {
        let address = self.server.clone().unwrap_or_else(Address::local);
        let in_folder = |folder: &PathBuf| TlsOptions::in_folder(folder, self.tls_name.clone());
        let tls = self.tls.as_ref().map(in_folder).transpose()?;
        Options { token: self.token.clone(), tls, ..Options::new(address) }.connect().await
    }
}

/// Fewer characters name no set: a script's variable that is empty would name the only one there is.
const BEGINNING_MIN: usize = 4;

/// The one of these model sets, newest first, whose id these characters begin; `newest` is the first.
///
/// # Errors
/// No set or several begin so.
pub fn model_set_named(mut ids: Vec<String>, beginning: &str) -> Result<String, String> {
    if beginning == "newest" {
        ids.truncate(1);
    } else if beginning.chars().count() < BEGINNING_MIN {
        return Err(format!(
            "`{beginning}` names no model set: give at least its first {BEGINNING_MIN} characters, as in m-1e"
        ));
    } else {
        ids.retain(|id| id.starts_with(beginning));
    }
    match ids.as_slice() {
        [one] => Ok(one.clone()),
        [] => Err(format!("there is no model set `{beginning}`; `taxeld models list` has them")),
        several => Err(format!("`{beginning}` begins {}", several.join(", "))),
    }
}
