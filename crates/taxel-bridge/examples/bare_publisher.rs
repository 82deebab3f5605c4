//! A publisher of `ros2-client` and nothing else, beside which `tests/bridge/rate.py` measures the bridge.
//!
//! `bare_publisher DOMAIN RATE_HZ` publishes `/bare/wrench`, stamped just before it is sent.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use ros2_client::dds::{Context, ContextOptions};
use ros2_client::qos::WhenFull;
use ros2_client::{MessageTypeName, Name, NodeName, NodeOptions, QosProfile};
use taxel_bridge::ros::types::{Header, Time, WrenchStamped};

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().collect();
    let (domain, rate_hz): (u16, f64) = (arguments[1].parse()?, arguments[2].parse()?);
    let context = Context::with_options(ContextOptions::new().domain_id(domain))?;
    let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
    let mut node = context.new_node(NodeName::new("/bare", "bare")?, options)?;
    let quality = QosProfile::publisher_default().reliability_reliable(WhenFull::Fail);
    let kind = MessageTypeName::new("geometry_msgs", "WrenchStamped");
    let topic = node.create_topic(&Name::new("/bare", "wrench")?, kind, &quality)?;
    let publisher = node.create_publisher::<WrenchStamped>(&topic, None)?;
    let mut next = Instant::now();
    loop {
        next += Duration::from_secs_f64(1.0 / rate_hz);
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
        let now = SystemTime::now().duration_since(UNIX_EPOCH)?;
        let stamp = Time { sec: i32::try_from(now.as_secs())?, nanosec: now.subsec_nanos() };
        let header = Header { stamp, frame_id: "l_forearm_skin".to_owned() };
        publisher.publish(WrenchStamped { header, ..WrenchStamped::default() })?;
    }
}
