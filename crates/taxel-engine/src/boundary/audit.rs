//! Who asked for what, and what came of it: rows of the audit log. The engine knows nothing of callers; the rows go
//! through its records because their order on disk is that of what happened.

use serde::{Deserialize, Serialize};

/// Somebody asked for something that changes the daemon's state. Written before the engine hears of it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Asked {
    /// Number of the request in this run of the daemon; ties the answer to it.
    pub request: u64,
    /// When, nanoseconds since 1970.
    pub wall_ns: i64,
    /// The name that was proven.
    pub who: String,
    /// The role that it had.
    pub role: String,
    /// How it came: `unix`, `loopback`, `tls`, `insecure`.
    pub transport: String,
    /// From where: an account and process, or an address.
    pub place: String,
    /// The call.
    pub method: String,
    /// Its arguments, in words.
    pub what: String,
    /// The name that the request itself gives (`confirmed_by`, `by`); empty without one.
    pub claimed: String,
    /// The patch that it is about; empty if it is about none.
    pub patch: String,
    /// The model set that was active on that patch; empty for none.
    pub before: String,
}

/// What came of a request.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Answered {
    /// Number of the request in this run of the daemon.
    pub request: u64,
    /// When, nanoseconds since 1970.
    pub wall_ns: i64,
    /// `done`, or why not.
    pub result: String,
    /// The model set that is active on the patch now; empty for none.
    pub after: String,
}

/// One request as the audit log has it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AuditEntry {
    /// Its number in the log, from 1.
    pub number: u64,
    /// What was asked; `None` if the row is damaged.
    pub asked: Option<Asked>,
    /// What came of it; `None` if the daemon stopped before it was written down, or if the row is damaged.
    pub answered: Option<Answered>,
    /// What is wrong with its rows; empty if nothing is.
    pub damage: String,
}
