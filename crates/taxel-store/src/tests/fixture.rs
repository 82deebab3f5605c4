//! Small sessions and model sets, each a function of a few numbers.

use crate::{Batch, Durability, Quarantined, Store, StoreError, StoreEvent, models_json};
pub use rusqlite::Connection;
pub use std::fs;
pub use std::fs::File;
pub use std::path::{Path, PathBuf};
pub use std::sync::mpsc::{Receiver, channel};
pub use std::sync::{Arc, LazyLock};
pub use taxel_engine::Restored;
pub use taxel_engine::audit::{Answered, Asked, AuditEntry};
pub use taxel_engine::baseline::TaxelBaseline;
pub use taxel_engine::calibration::{SessionSamples, SessionState, SessionView};
pub use taxel_engine::loads::{Load, Reading};
pub use taxel_engine::model_set::ModelSet;
pub use taxel_engine::record::{KeptZero, RampBaseline, Record, Sample};
pub use taxel_model::{FitOptions, Samples, TaxelModel};
pub use tempfile::TempDir;

pub const PATCH: &str = "left_forearm";

/// One taxel of each sort: good and falling, good and rising, dead, without data.
static TAXELS: LazyLock<Vec<TaxelModel>> = LazyLock::new(|| {
    let fit = |count: fn(f64) -> f64, samples: u32| {
        let kpa: Vec<f64> = (0..samples).map(|k| f64::from(k) / 10.0).collect();
        let counts: Vec<f64> = kpa.iter().map(|kpa| count(*kpa).round()).collect();
        taxel_model::fit(&Samples::new(&counts, &kpa), &FitOptions::default())
    };
    vec![
        fit(|kpa| 240.0 - 80.0 * kpa / (kpa + 40.0), 700),
        fit(|kpa| 20.0 + 90.0 * kpa / (kpa + 60.0), 700),
        fit(|_| 128.0, 700),
        fit(|_| 0.0, 0),
    ]
});

/// A set that differs from others by its time, and by a line that has it too: the time alone makes no other id.
pub fn model_set(created_wall_ns: i64) -> ModelSet {
    with_id(ModelSet {
        patch: PATCH.to_owned(),
        created_wall_ns,
        session: Some(1),
        method: "order 5, paper".to_owned(),
        board_settings: vec![format!("board 13: period 50 ms, set {created_wall_ns}")],
        baseline: TAXELS
            .iter()
            .enumerate()
            .map(|(taxel, _)| TaxelBaseline { mean: 240.0 + taxel as f64 / 3.0, noise: 0.7 })
            .collect(),
        pressure_max_kpa: 69.9,
        gauge_gain_rel: 0.005,
        gauge_offset_kpa: 0.1,
        taxels: TAXELS.clone(),
        ..ModelSet::default()
    })
}

pub fn with_id(mut set: ModelSet) -> ModelSet {
    set.id = models_json::content_id(&set);
    set
}

pub fn session(number: u64, state: SessionState) -> Record {
    Record::Session(Arc::new(SessionView {
        number,
        patch: PATCH.to_owned(),
        state,
        target_kpa: 70.0,
        ..SessionView::default()
    }))
}

pub fn began(session: u64, ramp: u16, taxels: Vec<TaxelBaseline>) -> Record {
    Record::Ramp { session, ramp: RampBaseline { ramp, taxels, gauge_kpa: Some(0.1) } }
}

pub fn ramp(session: u64, ramp: u16) -> Record {
    began(session, ramp, model_set(0).baseline)
}

pub fn sample(index: u64) -> Sample {
    Sample {
        ramp: 0,
        time_ns: index as i64 * 50_000_000,
        pressure_kpa: index as f64 / 7.0,
        counts: [0, 1, 2, 3].map(|taxel| (index * 31 + taxel * 7) as u16 % 256).into(),
    }
}

pub fn sample_record(session: u64, index: u64) -> Record {
    Record::Sample { session, index, sample: sample(index) }
}

pub fn activated(set: &ModelSet) -> Record {
    Record::Activated { patch: set.patch.clone(), model_set: set.id.clone(), wall_ns: set.created_wall_ns }
}

/// A batch that nobody waits for.
pub fn quiet(records: Vec<Record>) -> Batch {
    Batch { records, on_durable: None }
}

/// Submits and waits for the answer.
pub fn write(store: &Store, records: Vec<Record>) -> Result<Durability, StoreError> {
    let (tell, told) = channel();
    let on_durable = Box::new(move |outcome| tell.send(outcome).unwrap());
    store.submit(Batch { records, on_durable: Some(on_durable) }).unwrap();
    told.recv().unwrap()
}

/// Waits for the samples of a session.
pub fn samples_of(store: &Store, session: u64) -> Result<SessionSamples, StoreError> {
    let (tell, told) = channel();
    store.reader().samples(session, Box::new(move |samples| tell.send(samples).unwrap()));
    told.recv().unwrap()
}

/// Waits for a model set.
pub fn set_of(store: &Store, id: &str) -> Result<ModelSet, StoreError> {
    let (tell, told) = channel();
    store.reader().model_set(id.to_owned(), Box::new(move |text| tell.send(text).unwrap()));
    told.recv().unwrap().map(|text| models_json::from_json(&text).unwrap())
}

/// The model sets of an open store that can be read, in words.
pub fn sets_in(store: &Store, restored: &Restored) -> Vec<String> {
    let read = restored.model_sets.iter().filter_map(|set| set_of(store, &set.id).ok());
    read.map(|set| format!("{set:?}")).collect()
}

pub fn asked(request: u64) -> Record {
    Record::Asked(Box::new(Asked {
        request,
        wall_ns: request as i64,
        who: format!("who {request}"),
        method: "Tare".to_owned(),
        before: "m-1".to_owned(),
        ..Asked::default()
    }))
}

pub fn answered(request: u64) -> Record {
    let result = format!("done {request}");
    Record::Answered(Box::new(Answered { request, wall_ns: request as i64, result, after: "m-2".to_owned() }))
}

pub fn entries(store: &Store, before: u64, most: u32) -> Result<Vec<AuditEntry>, StoreError> {
    let (tell, told) = channel();
    store.reader().audit(before, most, Box::new(move |entries| tell.send(entries).unwrap()));
    told.recv().unwrap()
}

pub fn load(number: u64) -> Record {
    let read = Reading {
        scans: 20,
        mean_n: 1.7 * number as f64 / 3.0,
        reasons: vec!["3 taxels have a fault".to_owned()],
        ..Reading::default()
    };
    Record::Load(Arc::new(Load {
        number,
        patch: PATCH.to_owned(),
        note: "on the wrist".to_owned(),
        force_n: number as f64 / 1.7,
        read,
        ..Load::default()
    }))
}

pub fn zeros(needs_confirmation: Option<&str>) -> Record {
    let needs_confirmation = needs_confirmation.map(str::to_owned);
    Record::Zero { patch: PATCH.to_owned(), zero: KeptZero { needs_confirmation, ..KeptZero::default() } }
}

/// Whether every zero of the patch needs confirmation.
pub fn needs_confirmation(restored: &Restored) -> bool {
    restored.zeros.iter().any(|(patch, zero)| patch == PATCH && zero.needs_confirmation.is_some())
}

/// A store whose events can be received.
pub fn open(path: &Path) -> (Store, Restored, Vec<Quarantined>, Receiver<StoreEvent>) {
    let (tell, told) = channel();
    let notify = Box::new(move |event| drop(tell.send(event)));
    let (store, restored, quarantined) = Store::open(path, notify).unwrap();
    (store, restored, quarantined, told)
}

/// A new folder, and where a store goes in it.
pub fn place() -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    (dir, path)
}

/// A closed store with two model sets, the second active, an ended session and one under way with 40 samples.
pub fn filled(path: &Path) -> [ModelSet; 2] {
    let sets = [model_set(1), model_set(2)];
    let (store, ..) = open(path);
    let [first, second] = sets.clone();
    let made = vec![Record::ModelSet(Arc::new(first)), session(1, SessionState::Active), activated(&sets[0])];
    write(&store, made).unwrap();
    write(&store, vec![Record::ModelSet(Arc::new(second)), activated(&sets[1])]).unwrap();
    let mut records = vec![session(2, SessionState::Ramping), ramp(2, 0)];
    records.extend((0..40).map(|index| sample_record(2, index)));
    write(&store, records).unwrap();
    store.close().unwrap();
    sets
}

/// splitmix64: each seed gives numbers of its own.
#[derive(Default)]
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }
}
