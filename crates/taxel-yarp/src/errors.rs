//! What can go wrong with a port, in words for people.

use std::io;
use std::time::Duration;

use thiserror::Error;

/// Why a port cannot be read, or not be found.
#[derive(Debug, Error)]
pub enum PortError {
    /// No file of YARP says where the name server is.
    #[error(
        "no name server is known: {file} cannot be read ({error}); run `yarp conf ADDRESS PORT`, or write \
         server = \"ADDRESS:PORT\" into the bus's section"
    )]
    NoConfiguration {
        /// The file that YARP's programs would read.
        file: String,
        /// What the system says.
        error: io::Error,
    },
    /// The address of the name server makes no sense.
    #[error("{what}: \"{found}\" is no address of a name server, expected ADDRESS:PORT as in 10.0.0.2:10000")]
    Address {
        /// Where it was found.
        what: String,
        /// What was found.
        found: String,
    },
    /// The name server does not answer.
    #[error("no name server at {address}: {error}")]
    NoNameServer {
        /// Its address.
        address: String,
        /// What the system says.
        error: io::Error,
    },
    /// It answers what makes no sense.
    #[error("the name server at {address} answers \"{answer}\"")]
    Answer {
        /// Its address.
        address: String,
        /// The beginning of the answer.
        answer: String,
    },
    /// It does not know the port.
    #[error("the name server at {address} knows no port {port}: is the robot's software running?")]
    Unknown {
        /// The name server.
        address: String,
        /// The port.
        port: String,
    },
    /// The port is registered and cannot be reached.
    #[error("port {port} is registered at {address} and does not answer there: {error}")]
    Unreachable {
        /// The port.
        port: String,
        /// Where the name server says it is.
        address: String,
        /// What the system says.
        error: io::Error,
    },
    /// The connection ended.
    #[error("port {port} ended the connection")]
    Ended {
        /// The port.
        port: String,
    },
    /// Nothing comes.
    #[error("port {port} has sent nothing for {} s", waited.as_secs())]
    Silent {
        /// The port.
        port: String,
        /// For so long.
        waited: Duration,
    },
    /// What comes is no message.
    #[error("port {port} sends no text of YARP: {found}")]
    NoMessage {
        /// The port.
        port: String,
        /// What comes.
        found: String,
    },
    /// Another process has the name.
    #[error("the name {port} is another program's, at {address}: end that, or choose another name")]
    Taken {
        /// The name.
        port: String,
        /// Where it answers.
        address: String,
    },
}
