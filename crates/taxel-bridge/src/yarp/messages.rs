//! What goes out: a force with its interval, pressures by row, contacts as skinManager writes them.

use std::time::Duration;

use taxel_client::{Force, NoForce};
use taxel_proto::judge;
use taxel_proto::v1::{Contact, ForceState, Skin, TaxelLayout, TaxelSample, Vector3};
use taxel_skin::{VALUES_PER_BOARD, VALUES_PER_MODULE};
use taxel_yarp::Value;

use super::parts::Part;
use crate::daemon::pressure_kpa;

/// All taxels of a patch, by number.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layout {
    /// What the daemon says of each, and its row: in the vector of a skin port, and in a position file.
    pub taxels: Vec<(usize, TaxelLayout)>,
    /// How many rows there are: 192 a board.
    pub rows: usize,
}

impl Layout {
    /// Of what the daemon says of the patch, whose boards are in the order of the port's vector.
    pub fn new(skin: &Skin) -> Self {
        let mut boards: Vec<_> = skin.taxels.iter().map(|taxel| (taxel.bus, taxel.board)).collect();
        boards.dedup();
        let row = |taxel: &TaxelLayout| {
            let board = boards.iter().position(|of| *of == (taxel.bus, taxel.board)).unwrap_or(0);
            VALUES_PER_BOARD * board + VALUES_PER_MODULE * taxel.module as usize + taxel.slot as usize
        };
        let taxels = skin.taxels.iter().map(|taxel| (row(taxel), taxel.clone())).collect();
        Self { taxels, rows: VALUES_PER_BOARD * boards.len() }
    }
}

/// As three numbers.
fn array(vector: &Option<Vector3>) -> [f64; 3] {
    vector.as_ref().map(|vector| [vector.x, vector.y, vector.z]).unwrap_or_default()
}

/// `(total low high) (x y z) STATE (reasons) age`, in N, m and s; the first two lists are empty where there is no force or no
/// centre. `high` is `inf` where any amount more may press.
pub fn force(force: &Result<Force, NoForce>) -> Vec<Value> {
    let (state, reasons, age) = match force {
        Ok(force) => (force.sample.state(), force.sample.reasons.clone(), Some(force.age)),
        Err(NoForce::Sample(judge::NoForce::State(state, reasons, _))) => (*state, reasons.clone(), None),
        Err(NoForce::Sample(judge::NoForce::TooOld(age, _))) => (ForceState::Stale, Vec::new(), Some(*age)),
        Err(why) => (ForceState::Stale, vec![why.to_string()], None),
    };
    let interval = |force: &Force| {
        let Force { total_n, sample, .. } = force;
        [*total_n, sample.low_n.unwrap_or_default(), sample.high_n.unwrap_or(f64::INFINITY)]
    };
    let centres = force.iter().filter(|force| force.sample.centre_of_pressure_m.is_some());
    vec![
        Value::floats(force.iter().flat_map(interval)),
        Value::floats(centres.flat_map(|force| array(&force.sample.centre_of_pressure_m))),
        Value::Text(judge::word(state).to_owned()),
        Value::List(reasons.into_iter().map(Value::Text).collect()),
        Value::Float(age.map_or(f64::NAN, |age| age.as_secs_f64())),
    ]
}

/// kPa, one value a row; `NaN` where there is no taxel or no valid one, `waited` after the sample was sent.
pub fn pressures(sample: &TaxelSample, layout: &Layout, waited: Duration) -> Vec<f64> {
    let mut rows = vec![f64::NAN; layout.rows];
    for (reading, (row, _)) in sample.taxels.iter().zip(&layout.taxels) {
        if let (Some(kpa), Some(row)) = (pressure_kpa(reading, sample, waited), rows.get_mut(*row)) {
            *row = f64::from(kpa);
        }
    }
    rows
}

/// A contact as skinManager writes it: (number, body part, link, skin part), centre of pressure, force, moment about that centre,
/// mean place, normal, rows of the taxels, mean pressure (here in kPa). Lengths in m, forces in N.
pub fn contact([body, link, skin]: Part, contact: &Contact, layout: &Layout) -> Value {
    let taxels: Vec<_> = contact.taxels.iter().filter_map(|taxel| layout.taxels.get(*taxel as usize)).collect();
    let (centre, resultant, moment) =
        (array(&contact.centre_m), array(&contact.resultant_n), array(&contact.moment_nm));
    let arm = cross(centre, resultant);
    let count = taxels.len().max(1) as f64;
    let mean = |of: fn(&TaxelLayout) -> [f64; 3]| {
        let sum = |axis: usize| taxels.iter().map(|(_, taxel)| of(taxel)[axis]).sum::<f64>() / count;
        [sum(0), sum(1), sum(2)]
    };
    let normal = mean(|taxel| array(&taxel.normal));
    let length = normal.iter().map(|part| part * part).sum::<f64>().sqrt();
    let area_mm2: f64 = taxels.iter().map(|(_, taxel)| taxel.area_mm2).sum();
    Value::List(vec![
        Value::List([i64::from(contact.id), body, link, skin].map(Value::Int).to_vec()),
        Value::floats(centre),
        Value::floats(resultant),
        Value::floats([0, 1, 2].map(|axis| moment[axis] - arm[axis])),
        Value::floats(mean(|taxel| array(&taxel.position_m))),
        Value::floats(normal.map(|part| if length > 0.0 { part / length } else { 0.0 })),
        Value::List(taxels.iter().map(|(row, _)| Value::Int(*row as i64)).collect()),
        Value::Float(if area_mm2 > 0.0 { 1e3 * contact.force_n / area_mm2 } else { 0.0 }), // 1 N on 1 mm2 is 1e3 kPa
    ])
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::super::parts::named;
    use super::*;
    use taxel_proto::v1::{ForceSample, TaxelReading};

    fn layout() -> Layout {
        let taxel = |board, slot, x| {
            let (position_m, normal) = (vector(x, 0.0, 0.0), vector(0.0, 0.0, 1.0));
            TaxelLayout { board, slot, position_m, normal, area_mm2: 40.0, ..TaxelLayout::default() }
        };
        let taxels = vec![taxel(13, 0, 0.0), taxel(13, 3, 0.01), taxel(12, 11, 0.02)];
        Layout::new(&Skin { taxels, ..Skin::default() })
    }

    fn vector(x: f64, y: f64, z: f64) -> Option<Vector3> {
        Some(Vector3 { x, y, z })
    }

    #[test]
    fn a_contact_is_written_as_skin_manager_writes_it() {
        let pressed = Contact {
            id: 7,
            area_mm2: 80.0,
            peak_kpa: 30.0,
            force_n: 2.0,
            centre_m: vector(0.015, 0.0, 0.0),
            taxels: vec![1, 2],
            resultant_n: vector(0.0, 0.0, -2.0),
            moment_nm: vector(0.0, 0.03, 0.0),
        };
        let line = Value::line(&[contact(named("left_forearm").unwrap(), &pressed, &layout())]);
        assert_eq!(
            line,
            "((7 3 4 2) (0.015 0.0 0.0) (0.0 0.0 -2.0) (0.0 0.0 0.0) (0.015 0.0 0.0) (0.0 0.0 1.0) (3 203) 25.0)"
        );
    }

    #[test]
    fn a_force_has_its_interval_and_what_is_none_has_a_state() {
        let sample = ForceSample {
            state: ForceState::Ok.into(),
            total_n: Some(5.0),
            low_n: Some(4.25),
            high_n: Some(6.25),
            centre_of_pressure_m: vector(0.1, 0.2, 0.3),
            ..ForceSample::default()
        };
        let good =
            |sample: &ForceSample| Ok(Force { total_n: 5.0, age: Duration::from_millis(20), sample: sample.clone() });
        assert_eq!(Value::line(&force(&good(&sample))), "(5.0 4.25 6.25) (0.1 0.2 0.3) OK () 0.02");
        let bound = ForceSample { high_n: None, ..sample };
        assert!(Value::line(&force(&good(&bound))).starts_with("(5.0 4.25 inf) "));
        let none = |why| Value::line(&force(&Err(why)));
        let lost = NoForce::Lost("no daemon".to_owned());
        assert_eq!(none(lost), "() () STALE (\"the stream was lost: no daemon\") nan");
        let invalid = judge::NoForce::State(ForceState::TareInvalid, vec!["no zero".to_owned()], Vec::new());
        assert_eq!(none(NoForce::Sample(invalid)), "() () TARE_INVALID (\"no zero\") nan");
        let old = judge::NoForce::TooOld(Duration::from_millis(200), Duration::from_millis(150));
        assert_eq!(none(NoForce::Sample(old)), "() () STALE () 0.2");
    }

    #[test]
    fn a_pressure_stands_in_its_row_and_what_is_old_or_faulty_is_none() {
        let reading =
            |kpa, age_s| TaxelReading { pressure_kpa: Some(kpa), age_s: Some(age_s), ..TaxelReading::default() };
        let stale = TaxelReading { stale: true, ..reading(3.0, 0.0) };
        let sample = TaxelSample {
            taxels: vec![reading(1.5, 0.01), reading(2.0, 0.1), stale],
            max_age_s: 0.15,
            ..TaxelSample::default()
        };
        let rows = pressures(&sample, &layout(), Duration::from_millis(60));
        assert_eq!((rows.len(), rows[0]), (384, 1.5));
        assert!(rows[3].is_nan() && rows[203].is_nan() && rows[1].is_nan());
    }
}
