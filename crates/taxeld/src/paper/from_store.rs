//! The samples of a stored session, and the known loads that were read on its patch.

use std::path::Path;

use anyhow::bail;
use taxel_engine::Restored;
use taxel_report::paper::{Data, Weighing, Weighings};

use crate::paper::session::{name, of_session};
use crate::store_at::read_store;

/// Reads session `number` of the store at `path`, or its newest one.
///
/// # Errors
/// A store that cannot be opened, as while the daemon runs on it; no such session, or one whose samples are damaged.
pub(super) fn read(path: &Path, number: Option<u64>) -> anyhow::Result<Data> {
    let store = read_store(path)?;
    let restored = store.restored();
    let found = match number {
        Some(number) => restored.sessions.iter().find(|view| view.number == number),
        None => restored.sessions.last(),
    };
    let Some(view) = found else {
        let there: Vec<String> = restored.sessions.iter().map(|view| view.number.to_string()).collect();
        bail!(
            "there is no such session; sessions: {}",
            if there.is_empty() { "none".to_owned() } else { there.join(" ") }
        );
    };
    let samples = store.samples(view.number)?;
    let source = format!("session {} of patch {} in {}", view.number, view.patch, name(path));
    let data = of_session(source, &samples)?;
    let loads = loads(restored, &view.patch);
    Ok(if loads.is_empty() {
        data.without_loads("no known load of this patch is in the store")
    } else {
        data.with_loads(loads)
    })
}

/// The loads of a patch that still count, by the model set that they were read with.
fn loads(restored: &Restored, patch: &str) -> Vec<Weighings> {
    let replaced = |number: u64| restored.loads.iter().any(|load| load.replaces == Some(number));
    let mut all: Vec<Weighings> = Vec::new();
    for load in restored.loads.iter().filter(|load| load.patch == patch && !replaced(load.number)) {
        let by = format!("as the daemon read them, model set {}", load.model_set);
        let weighing = Weighing { kilogram: load.mass_kg, true_n: load.force_n, measured_n: load.read.mean_n };
        match all.iter_mut().find(|weighings| weighings.by == by) {
            Some(weighings) => weighings.all.push(weighing),
            None => all.push(Weighings { by, all: vec![weighing] }),
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use taxel_engine::baseline::TaxelBaseline;
    use taxel_engine::calibration::{RampBaseline, Sample, SessionState, SessionView};
    use taxel_engine::loads::{Load, Reading};
    use taxel_engine::record::Record;
    use taxel_store::{Batch, Store};

    fn session(number: u64) -> Vec<Record> {
        let (patch, state) = ("palm".to_owned(), SessionState::Review);
        let view = SessionView { number, patch, state, target_kpa: 70.0, ..SessionView::default() };
        let taxels = vec![TaxelBaseline { mean: 240.0, noise: 0.5 }; 2];
        let begun = |ramp| RampBaseline { ramp, taxels: taxels.clone(), gauge_kpa: Some(0.0) };
        let mut records = vec![
            Record::Session(Arc::new(view)),
            Record::Ramp { session: number, ramp: begun(0) },
            Record::Ramp { session: number, ramp: begun(1) },
        ];
        records.extend((0..200).map(|index| {
            let pressure_kpa = 0.7 * (index % 100) as f64;
            let counts = [240 - pressure_kpa as u8, 200].as_slice().into();
            let ramp = (index / 100) as u16;
            let sample = Sample { ramp, time_ns: index as i64 * 50_000_000, pressure_kpa, counts };
            Record::Sample { session: number, index, sample }
        }));
        records
    }

    fn load(number: u64, patch: &str, replaces: Option<u64>) -> Record {
        let read = Reading { mean_n: 5.5, scans: 20, ..Reading::default() };
        let (patch, model_set) = (patch.to_owned(), "m-0".to_owned());
        let load =
            Load { number, patch, model_set, force_n: 5.0, mass_kg: Some(0.5), replaces, read, ..Load::default() };
        Record::Load(Arc::new(load))
    }

    #[test]
    fn a_session_has_its_runs_and_the_loads_of_its_patch_that_count() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.db");
        let (store, ..) = Store::open(&path, Box::new(|_| {})).unwrap();
        let mut records = session(1);
        records.extend([load(1, "palm", None), load(2, "palm", Some(1)), load(3, "sole", None)]);
        store.submit(Batch { records, on_durable: None }).unwrap();
        store.close().unwrap();
        let data = read(&path, None).unwrap();
        assert_eq!((data.taxels(), data.scans()), (2, 200));
        assert!(data.source().contains("session 1 of patch palm"), "{}", data.source());
        let loads: Vec<_> = data.loads().flat_map(|loads| loads.all.clone()).collect();
        assert_eq!(loads, [Weighing { kilogram: Some(0.5), true_n: 5.0, measured_n: 5.5 }]);
        let out = folder.path().join("out");
        let tables = taxel_report::paper::write(&out, &data, 10.0).unwrap();
        assert_eq!((tables.calibration.runs, tables.calibration.usable), (2, 1), "{tables:?}");
        assert!(out.join("repeatability.svg").exists() && out.join("force.svg").exists());
        let error = read(&path, Some(7)).unwrap_err().to_string();
        assert!(error.contains("no such session; sessions: 1"), "{error}");
    }
}
