//! The force on YARP's ports, for programs that read what skinManager writes.

pub mod messages;
pub mod parts;
pub mod publish;
