//! From samples of the service to messages of ROS 2.
//!
//! The caller has decided that the sample is a force. What the scene does not compute gives no
//! message, and no message holds a number that is none.

use std::time::Duration;

use taxel_proto::Timestamp;
use taxel_proto::v1::{ForceSample, ForceState, Skin, TaxelSample, Vector3 as ProtoVector};

use crate::daemon::pressure_kpa;
use crate::ros::types::{Header, JointState, PointCloud2, PointStamped, Time, Vector3, WrenchStamped};

/// `sensor_msgs/msg/PointField.UINT32` and `FLOAT32`.
const UINT32: u8 = 6;
const FLOAT32: u8 = 7;
/// Fields of a point: name and type, four bytes each.
const FIELDS: [(&str, u8); 7] = [
    ("x", FLOAT32),
    ("y", FLOAT32),
    ("z", FLOAT32),
    ("pressure", FLOAT32),
    ("taxel", UINT32),
    ("sigma", FLOAT32),
    ("range", UINT32),
];
/// ROS has pressures in pascal.
const PASCAL_PER_KPA: f32 = 1000.0;

/// A header, if ROS has that time; its seconds end in 2038.
pub fn header(time: Option<&Timestamp>, frame: &str) -> Option<Header> {
    let time = time?;
    let stamp = Time { sec: i32::try_from(time.seconds).ok()?, nanosec: u32::try_from(time.nanos).ok()? };
    Some(Header { stamp, frame_id: frame.to_owned() })
}

fn vector(of: Option<&ProtoVector>) -> Option<Vector3> {
    of.map(|of| [of.x, of.y, of.z]).filter(|of| of.iter().all(|number| number.is_finite()))
}

/// The force that acts on the skin and its moment about the origin of the patch's frame; `None` if the scene has no
/// force vector.
pub fn wrench(sample: &ForceSample, frame: &str) -> Option<WrenchStamped> {
    let value = [vector(sample.resultant_n.as_ref())?, vector(sample.moment_nm.as_ref())?];
    Some(WrenchStamped { header: header(sample.time.as_ref(), frame)?, value })
}

/// The total normal force with what is known of it, by names with their units. A figure that is not known has no entry.
pub fn force(sample: &ForceSample, frame: &str) -> Option<JointState> {
    let total_n = sample.total_n?;
    let mut state = JointState { header: header(sample.time.as_ref(), frame)?, ..JointState::default() };
    let flag = |set: bool| if set { 1.0 } else { 0.0 };
    for (name, value) in [
        ("force_N", Some(total_n)),
        ("variance_N2", sample.total_sigma_n.map(|sigma_n| sigma_n * sigma_n)),
        ("low_N", sample.low_n),
        ("high_N", sample.high_n),
        ("degraded", Some(flag(sample.state() == ForceState::Degraded))),
        ("simulated", sample.simulated.then_some(1.0)),
    ] {
        if let Some(value) = value.filter(|value| value.is_finite()) {
            state.name.push(name.to_owned());
            state.effort.push(value);
        }
    }
    Some(state)
}

/// The centre of pressure; `None` without a load or positions.
pub fn centre_of_pressure(sample: &ForceSample, frame: &str) -> Option<PointStamped> {
    let value = vector(sample.centre_of_pressure_m.as_ref())?;
    Some(PointStamped { header: header(sample.time.as_ref(), frame)?, value })
}

/// The taxels that have a position, no fault and, at this moment, a pressure that is not too old; the sample was sent
/// `waited` ago.
pub fn taxels(sample: &TaxelSample, skin: &Skin, frame: &str, waited: Duration) -> Option<PointCloud2> {
    let header = header(sample.time.as_ref(), frame)?;
    let (mut data, mut width, mut is_dense) = (Vec::new(), 0, true);
    for (reading, layout) in sample.taxels.iter().zip(&skin.taxels) {
        let (Some(kpa), Some(at)) = (pressure_kpa(reading, sample, waited), &layout.position_m) else { continue };
        let numbers = [at.x as f32, at.y as f32, at.z as f32, kpa * PASCAL_PER_KPA];
        if numbers.into_iter().all(f32::is_finite) {
            data.extend(numbers.into_iter().flat_map(f32::to_le_bytes));
            data.extend(layout.taxel.to_le_bytes());
            let sigma_kpa = reading.sigma_kpa.filter(|sigma_kpa| sigma_kpa.is_finite());
            is_dense &= sigma_kpa.is_some();
            data.extend(sigma_kpa.map_or(f32::NAN, |sigma_kpa| sigma_kpa * PASCAL_PER_KPA).to_le_bytes());
            data.extend((reading.range() as u32).to_le_bytes());
            width += 1;
        }
    }
    let point_step = FIELDS.len() as u32 * 4;
    Some(PointCloud2 {
        header,
        height: 1,
        width,
        fields: FIELDS.into_iter().zip(0..).map(|((name, kind), at)| (name.to_owned(), at * 4, kind, 1)).collect(),
        is_bigendian: false,
        point_step,
        row_step: point_step * width,
        data,
        is_dense,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::good;
    use taxel_proto::v1::{Range, TaxelLayout, TaxelReading};

    #[test]
    fn a_wrench_is_the_samples_vector_at_the_samples_time_in_the_patchs_frame() {
        let message = wrench(&good(), "l_forearm_skin").unwrap();
        assert_eq!(message.header.stamp, Time { sec: 1_700_000_000, nanosec: 5 });
        assert_eq!(message.header.frame_id, "l_forearm_skin");
        assert_eq!(message.value, [[1.0, -2.0, 3.0], [0.1, 0.2, 0.3]]);
        for sample in [
            ForceSample { resultant_n: None, ..good() },
            ForceSample { moment_nm: None, ..good() },
            ForceSample { moment_nm: Some(ProtoVector { x: 0.0, y: f64::NAN, z: 0.0 }), ..good() },
            ForceSample { time: None, ..good() },
        ] {
            assert_eq!(wrench(&sample, "f"), None);
        }
    }

    #[test]
    fn the_scalar_has_a_variance_where_the_uncertainty_is_known() {
        let message = force(&good(), "f").unwrap();
        assert_eq!(message.name, ["force_N", "variance_N2", "low_N", "high_N", "degraded"]);
        assert_eq!(message.effort, [4.9, 0.25, 3.9, 6.1, 0.0]);
        let degraded = ForceSample { state: ForceState::Degraded.into(), high_n: None, ..good() };
        let message = force(&degraded, "f").unwrap();
        assert_eq!(message.name, ["force_N", "variance_N2", "low_N", "degraded"]);
        assert_eq!(message.effort, [4.9, 0.25, 3.9, 1.0]);
        let message = force(&ForceSample { simulated: true, ..good() }, "f").unwrap();
        assert_eq!(message.name, ["force_N", "variance_N2", "low_N", "high_N", "degraded", "simulated"]);
        assert_eq!(message.effort[5], 1.0);
        assert_eq!(force(&ForceSample { total_n: None, ..good() }, "f"), None);
    }

    #[test]
    fn a_cloud_has_the_taxels_whose_pressure_is_known_and_fresh_and_no_others() {
        let position_m = Some(ProtoVector { x: 0.5, y: 0.0, z: -1.0 });
        let placed = |taxel| TaxelLayout { taxel, position_m, ..TaxelLayout::default() };
        let mut skin = Skin { taxels: (0..6).map(placed).collect(), ..Skin::default() };
        skin.taxels[1].position_m = None;
        let (pressure_kpa, sigma_kpa, age_s) = (Some(2.0), Some(0.25), Some(0.01));
        let range = Range::Above.into();
        let good_one = TaxelReading { pressure_kpa, sigma_kpa, range, age_s, ..TaxelReading::default() };
        let sample = TaxelSample {
            time: good().time,
            taxels: vec![
                good_one.clone(),
                good_one.clone(), // has no position
                TaxelReading { pressure_kpa: None, ..good_one.clone() },
                TaxelReading { stale: true, ..good_one.clone() },
                TaxelReading { pressure_kpa: Some(f32::NAN), ..good_one.clone() },
                TaxelReading { faults: vec!["frozen".to_owned()], ..good_one.clone() },
            ],
            max_age_s: 0.15,
            ..TaxelSample::default()
        };
        let cloud = taxels(&sample, &skin, "f", Duration::ZERO).unwrap();
        assert_eq!((cloud.width, cloud.point_step, cloud.row_step, cloud.data.len()), (1, 28, 28, 28));
        assert_eq!(cloud.data[12..16], 2000_f32.to_le_bytes());
        assert_eq!((&cloud.data[20..24], &cloud.data[24..28]), (&250_f32.to_le_bytes()[..], &3_u32.to_le_bytes()[..]));
        assert!(cloud.is_dense);
        let old = taxels(&sample, &skin, "f", Duration::from_millis(141)).unwrap();
        assert_eq!((old.width, old.data.len()), (0, 0));
        let unknown = TaxelReading { sigma_kpa: None, ..good_one };
        let cloud = taxels(&TaxelSample { taxels: vec![unknown], ..sample }, &skin, "f", Duration::ZERO).unwrap();
        assert!(cloud.data[20..24] == f32::NAN.to_le_bytes() && !cloud.is_dense, "no uncertainty is no small one");
    }
}
