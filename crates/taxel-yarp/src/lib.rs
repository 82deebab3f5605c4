//! YARP without YARP: the part of its protocol that skin ports and force ports need.
//!
//! Most robots with iCub's skin have its CAN buses behind an Ethernet board; the counts are to be had on YARP ports alone.
//! What is here is of YARP's own documents ("YARP without YARP", "The YARP protocol", "The name server protocol"): plain text,
//! which every port reads and writes. What comes over a connection is data of a stranger: every length has a limit.
//!
//! - [`NameServer`]: where a port is; what a port of ours is called.
//! - [`PortReader`]: the messages of a port.
//! - [`Rows`]: from the vector of a skin port to the frames that its boards sent.
//! - [`port_bus`]: a port as a bus of the daemon; [`candump_of`]: its recording as one.
//! - [`OutPort`]: a port that others read.
//! - [`Value`]: what messages consist of.

mod commands;
mod connection;
mod dump;
mod gauge;
mod names;
mod out_port;
mod reader;
mod rows;
mod sender_clock;
mod source;
mod value;

pub use dump::{DumpFault, candump_of, is_dump};
pub use names::{NameServer, PortError};
pub use out_port::OutPort;
pub use reader::{Message, PortReader};
pub use rows::{Rows, Unfit, read_counts};
pub use source::{Content, Port, port_bus};
pub use value::Value;
