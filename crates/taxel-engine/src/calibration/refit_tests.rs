//! What several sessions have in common when they are fitted together.

use super::*;
use crate::calibration::samples::Sample;

fn session(number: u64, branches: Branch) -> Arc<SessionView> {
    Arc::new(SessionView { number, branches, ..SessionView::default() })
}

#[test]
fn both_branches_are_fitted_where_every_session_gathered_both() {
    use Branch::{Both, Rising};
    for (gathered, fitted) in [([Both, Both], Both), ([Both, Rising], Rising), ([Rising, Rising], Rising)] {
        let sessions: Vec<Arc<SessionView>> = (1..).zip(gathered).map(|(n, of)| session(n, of)).collect();
        assert_eq!(branch(&sessions), fitted, "{gathered:?}");
    }
}

#[test]
fn of_sessions_over_both_branches_the_rising_fit_has_the_samples_up_to_the_top_of_each_ramp() {
    let sample = |(n, &(ramp, pressure_kpa)): (usize, &(u16, f64))| Sample {
        ramp,
        time_ns: n as i64,
        pressure_kpa,
        counts: [n as u16].as_slice().into(),
    };
    let course = [(0, 1.0), (0, 30.0), (0, 70.0), (0, 40.0), (0, 2.0), (1, 1.0), (1, 60.0), (1, 5.0)];
    let samples = SessionSamples { ramps: Vec::new(), samples: course.iter().enumerate().map(sample).collect() };
    let rose: Vec<i64> = samples.of_branch(Branch::Rising).samples.iter().map(|sample| sample.time_ns).collect();
    assert_eq!(rose, [0, 1, 2, 5, 6]);
}
