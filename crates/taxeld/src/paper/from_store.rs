//! The samples of a stored session, and the known loads that were read on its patch.

use std::path::Path;
use std::sync::mpsc::channel;

use anyhow::{Context, bail};
use taxel_engine::Restored;
use taxel_engine::calibration::SessionSamples;
use taxel_report::paper::{Data, Weighing, Weighings};
use taxel_store::Store;

use crate::paper::session::{name, of_session};

/// Reads session `number` of the store at `path`, or its newest one.
///
/// # Errors
/// A store that cannot be opened, as while the daemon runs on it; no such session, or one whose samples are damaged.
pub(super) fn read(path: &Path, number: Option<u64>) -> anyhow::Result<Data> {
    let (store, restored, _) = Store::open(path, Box::new(|_| {}))?;
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
    let samples = samples(&store, view.number)?;
    store.close()?;
    let source = format!("session {} of patch {} in {}", view.number, view.patch, name(path));
    let data = of_session(source, &samples)?;
    let loads = loads(&restored, &view.patch);
    Ok(if loads.is_empty() {
        data.without_loads("no known load of this patch is in the store")
    } else {
        data.with_loads(loads)
    })
}

fn samples(store: &Store, number: u64) -> anyhow::Result<SessionSamples> {
    let (tell, told) = channel();
    store.read_samples(
        number,
        Box::new(move |samples| {
            // Whoever asked has gone only if this programme ends.
            let _ = tell.send(samples);
        }),
    );
    Ok(told.recv().context("the store gave no answer")??)
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
