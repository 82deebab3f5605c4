//! What can go wrong with a port, in words for people.

use std::io;
use std::time::Duration;

use thiserror::Error;

/// Why a port cannot be read, not be found, or not be opened.
#[derive(Debug, Error)]
pub enum PortError {
    /// This file of YARP, which would say where the name server is, cannot be read.
    #[error(
        "no name server is known: {0} cannot be read ({1}); run `yarp conf ADDRESS PORT`, or write server = \"ADDRESS:PORT\""
    )]
    NoConfiguration(String, io::Error),
    /// What stands here, the second, is no address of a name server.
    #[error("{0}: \"{1}\" is no address of a name server, expected ADDRESS:PORT as in 10.0.0.2:10000")]
    Address(String, String),
    /// The name server of this address does not answer.
    #[error("no name server at {0}: {1}")]
    NoNameServer(String, io::Error),
    /// The name server of this address answers what makes no sense.
    #[error("the name server at {0} answers \"{1}\"")]
    Answer(String, String),
    /// The name server of this address does not know the port.
    #[error("the name server at {0} knows no port {1}: is the robot's software running?")]
    Unknown(String, String),
    /// The port is registered at this address and cannot be reached.
    #[error("port {0} is registered at {1} and does not answer there: {2}")]
    Unreachable(String, String, io::Error),
    /// The port ended the connection.
    #[error("port {0} ended the connection")]
    Ended(String),
    /// Nothing has come from the port for so long.
    #[error("port {} has sent nothing for {} s", .0, .1.as_secs())]
    Silent(String, Duration),
    /// What comes from the port, the second, is no message.
    #[error("port {0} sends no text of YARP: {1}")]
    NoMessage(String, String),
    /// Another process answers under this name, at this address.
    #[error("the name {0} is another program's, at {1}: end that, or choose another name")]
    Taken(String, String),
}
