//! The standard ROS 2 messages that the bridge sends, field for field.

use serde::{Deserialize, Serialize};

/// A type that goes over a topic.
pub trait RosType: Serialize + Send + Sync + 'static {
    /// Its package, its name and its hash.
    const NAME: [&'static str; 3];
}

macro_rules! of_ros {
    ($($name:ident $package:literal $hash:literal)*) => {
        $(impl RosType for $name { const NAME: [&'static str; 3] = [$package, stringify!($name), $hash]; })*
    };
}

// RIHS01 (REP 2016) of each type; the same from jazzy to rolling. `tests/bridge/run.py` works them out again with `rosbags`.
of_ros! {
    WrenchStamped "geometry_msgs" "8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77"
    PointStamped "geometry_msgs" "4c0296af86e01e562e9e0405d138a01537247580076c58ea38d7923ac1045897"
    JointState "sensor_msgs" "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"
    PointCloud2 "sensor_msgs" "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5"
    DiagnosticArray "diagnostic_msgs" "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"
}
/// The hash of `std_srvs/srv/Trigger`.
pub const TRIGGER_HASH: &str = "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f";

/// `builtin_interfaces/msg/Time`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Time {
    /// Seconds since 1970.
    pub sec: i32,
    /// Nanoseconds, below 1e9.
    pub nanosec: u32,
}

/// `std_msgs/msg/Header`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Header {
    /// When the newest frame of the value was received.
    pub stamp: Time,
    /// The frame in which coordinates are.
    pub frame_id: String,
}

/// `geometry_msgs/msg/Vector3`, or `Point`: along x, y and z.
pub type Vector3 = [f64; 3];

/// What ROS calls stamped: a header, then what it is of. On the wire a message is no more than its fields.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Stamped<T> {
    /// When and in which frame.
    pub header: Header,
    /// What was then.
    pub value: T,
}

/// `geometry_msgs/msg/WrenchStamped`: what acts on the skin in N, and its moment about the frame's origin in N m.
pub type WrenchStamped = Stamped<[Vector3; 2]>;
/// `geometry_msgs/msg/PointStamped`, in m.
pub type PointStamped = Stamped<Vector3>;
/// `diagnostic_msgs/msg/DiagnosticArray`: one status for each thing that is watched.
pub type DiagnosticArray = Stamped<Vec<DiagnosticStatus>>;

/// `sensor_msgs/msg/JointState`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct JointState {
    /// When.
    pub header: Header,
    /// What each value is.
    pub name: Vec<String>,
    /// Not used here.
    pub position: Vec<f64>,
    /// Not used here.
    pub velocity: Vec<f64>,
    /// One value for each name.
    pub effort: Vec<f64>,
}

/// `sensor_msgs/msg/PointField`: its name, where it begins in a point in bytes, its type (6 is `uint32`, 7 is `float32`), how many.
pub type PointField = (String, u32, u8, u32);

/// `sensor_msgs/msg/PointCloud2`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct PointCloud2 {
    /// When and in which frame.
    pub header: Header,
    /// 1: the points are in no order.
    pub height: u32,
    /// How many points.
    pub width: u32,
    /// What a point consists of.
    pub fields: Vec<PointField>,
    /// Never.
    pub is_bigendian: bool,
    /// Bytes of a point.
    pub point_step: u32,
    /// Bytes of all points.
    pub row_step: u32,
    /// The points.
    pub data: Vec<u8>,
    /// Whether no point has a number that is none.
    pub is_dense: bool,
}

/// `diagnostic_msgs/msg/KeyValue`: what, and its value as text.
pub type KeyValue = (String, String);

/// `diagnostic_msgs/msg/DiagnosticStatus`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DiagnosticStatus {
    /// 0 OK, 1 WARN, 2 ERROR, 3 STALE.
    pub level: u8,
    /// What it is about.
    pub name: String,
    /// How it is, in words.
    pub message: String,
    /// Which robot.
    pub hardware_id: String,
    /// Figures.
    pub values: Vec<KeyValue>,
}

/// The answer of `std_srvs/srv/Trigger`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TriggerResponse {
    /// Whether it was done.
    pub success: bool,
    /// What came of it, or why not.
    pub message: String,
}

impl ros2_client::Message for TriggerResponse {}
