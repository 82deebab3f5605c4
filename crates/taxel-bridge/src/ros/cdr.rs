//! Messages as ROS 2 writes them: little-endian CDR after a head of four bytes, by the crate `cdr-encoding`.

use byteorder::LittleEndian;
use serde::Serialize;

/// Plain CDR, little-endian, no options. Alignment is counted from behind it.
pub const HEAD: [u8; 4] = [0, 1, 0, 0];

/// A message's bytes.
///
/// # Errors
/// If the message has a type that CDR does not know; no message of this crate has one.
pub fn encode<T: Serialize>(message: &T) -> Result<Vec<u8>, cdr_encoding::Error> {
    let mut bytes = HEAD.to_vec();
    cdr_encoding::to_writer::<T, LittleEndian, _>(&mut bytes, message)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::types::{Header, Time, TriggerResponse, Vector3, Wrench, WrenchStamped};

    fn hexadecimal(bytes: &[u8]) -> String {
        bytes.iter().map(|byte| format!("{byte:02x}")).collect()
    }

    #[test]
    fn a_wrench_has_the_bytes_that_ros_gives_it() {
        let header = Header { stamp: Time { sec: 1_700_000_000, nanosec: 123_456_789 }, frame_id: "l_forearm".into() };
        let force = Vector3 { x: 1.5, y: -2.0, z: 10.25 };
        let torque = Vector3 { x: 0.0, y: 0.0, z: 0.125 };
        let bytes = encode(&WrenchStamped { header, wrench: Wrench { force, torque } }).unwrap();
        let of_ros = "0001000000f1536515cd5b070a0000006c5f666f726561726d000000000000000000f83f00000000000000c00000000000802\
                      44000000000000000000000000000000000000000000000c03f";
        assert_eq!(hexadecimal(&bytes), of_ros);
    }

    #[test]
    fn an_answer_of_trigger_has_the_bytes_that_ros_gives_it() {
        let bytes = encode(&TriggerResponse { success: true, message: "tared".into() }).unwrap();
        assert_eq!(hexadecimal(&bytes), "000100000100000006000000746172656400");
    }
}
