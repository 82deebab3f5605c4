//! The samples of sessions: blocks of those that were committed together, each proven by a checksum as it is read. Ramps are
//! facts.

use std::collections::BTreeMap;

use rusqlite::{Connection, params};
use serde::{Deserialize, Serialize};
use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::calibration::SessionSamples;
use taxel_engine::counts::Counts;
use taxel_engine::record::{RampBaseline, Sample};
use taxel_skin::CountRange;

use crate::error::StoreError;
use crate::facts::{self, Key, checksum};

/// The kind of fact that a ramp is: by the number of its session and its own.
const RAMP: &str = "ramp";

/// How findings name the samples of a session.
pub(crate) fn name_of(session: u64) -> String {
    format!("samples of session {session}")
}

/// A ramp's zero: mean and noise of each taxel, without a number where there is none.
#[derive(Serialize, Deserialize)]
struct StoredRamp {
    taxels: Vec<[Option<f64>; 2]>,
    gauge_kpa: Option<f64>,
}

pub(crate) fn put_ramp(connection: &Connection, session: u64, ramp: &RampBaseline) -> Result<(), StoreError> {
    let number = |value: f64| value.is_finite().then_some(value);
    let taxels = ramp.taxels.iter().map(|&TaxelBaseline { mean, noise }| [number(mean), number(noise)]).collect();
    let stored = StoredRamp { taxels, gauge_kpa: ramp.gauge_kpa.and_then(number) };
    facts::put(connection, Key { kind: RAMP, name: &session.to_string(), number: ramp.ramp.into() }, &stored)
}

/// Samples of a session that are committed together.
pub(crate) struct Block {
    pub(crate) session: u64,
    first: u64,
    pub(crate) count: u64,
    bytes: Vec<u8>,
}

impl Block {
    pub(crate) const fn new(session: u64, first: u64) -> Self {
        Self { session, first, count: 0, bytes: Vec::new() }
    }

    /// Adds a sample: ramp, time, pressure, greatest count, how many counts, and these; all little-endian.
    pub(crate) fn add(&mut self, sample: &Sample) {
        let counts = sample.counts.counts();
        self.count += 1;
        self.bytes.extend(sample.ramp.to_le_bytes());
        self.bytes.extend(sample.time_ns.to_le_bytes());
        self.bytes.extend(sample.pressure_kpa.to_le_bytes());
        self.bytes.extend(counts.range().top().to_le_bytes());
        self.bytes.extend((counts.len() as u32).to_le_bytes());
        self.bytes.extend(counts.all().iter().flat_map(|raw| raw.to_le_bytes()));
    }

    pub(crate) fn write(&self, connection: &Connection) -> rusqlite::Result<()> {
        let Self { session, first, count, bytes } = self;
        let sum = sum_of(*session, *first, *count, bytes);
        connection
            .prepare_cached("INSERT INTO samples (session, first, count, block, sum) VALUES (?1, ?2, ?3, ?4, ?5)")?
            .execute(params![session, first, count, bytes, sum])?;
        Ok(())
    }
}

fn sum_of(session: u64, first: u64, count: u64, block: &[u8]) -> Vec<u8> {
    checksum(&[b"samples", &session.to_le_bytes(), &first.to_le_bytes(), &count.to_le_bytes(), block])
}

/// The samples of a block; nothing if it ends in the middle of one.
fn read_block(block: &[u8]) -> Option<Vec<Sample>> {
    let (mut rest, mut samples) = (block, Vec::new());
    while !rest.is_empty() {
        let ramp = u16::from_le_bytes(take(&mut rest)?);
        let time_ns = i64::from_le_bytes(take(&mut rest)?);
        let pressure_kpa = f64::from_le_bytes(take(&mut rest)?);
        let range = CountRange::to(u16::from_le_bytes(take(&mut rest)?))?;
        let count = u32::from_le_bytes(take(&mut rest)?) as usize;
        let (pairs, _) = rest.split_off(..count.checked_mul(2)?)?.as_chunks();
        let raw: Vec<u16> = pairs.iter().map(|pair| u16::from_le_bytes(*pair)).collect();
        samples.push(Sample { ramp, time_ns, pressure_kpa, counts: Counts::new(&raw, range).into() });
    }
    Some(samples)
}

fn take<const N: usize>(rest: &mut &[u8]) -> Option<[u8; N]> {
    let (first, behind) = rest.split_first_chunk()?;
    *rest = behind;
    Some(*first)
}

/// How many samples each session has, as its blocks say.
pub(crate) fn counted(connection: &Connection) -> rusqlite::Result<BTreeMap<u64, u64>> {
    let mut statement = connection.prepare("SELECT session, sum(count) FROM samples GROUP BY session")?;
    statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?.collect()
}

/// How many ramps a session has.
pub(crate) fn ramps(connection: &Connection, session: u64) -> rusqlite::Result<u64> {
    let mut statement = connection.prepare_cached("SELECT count(*) FROM facts WHERE kind = ?1 AND name = ?2")?;
    statement.query_row(params![RAMP, session.to_string()], |row| row.get(0))
}

/// All ramps and samples of a session, or why they cannot be trusted.
pub(crate) fn read(connection: &Connection, session: u64) -> Result<SessionSamples, String> {
    let mut all = SessionSamples::default();
    let name = session.to_string();
    for number in 0..ramps(connection, session).map_err(words)? {
        let found = facts::get::<StoredRamp>(connection, Key { kind: RAMP, name: &name, number }).map_err(words)?;
        let ramp = found.unwrap_or_else(|| Err("it is missing".to_owned()));
        let StoredRamp { taxels, gauge_kpa } = ramp.map_err(|why| format!("ramp {number}: {why}"))?;
        let taxels = taxels
            .into_iter()
            .map(|[mean, noise]| TaxelBaseline { mean: mean.unwrap_or(f64::NAN), noise: noise.unwrap_or(f64::NAN) });
        let ramp = u16::try_from(number).map_err(|_| format!("{number} is no number of a ramp"))?;
        all.ramps.push(RampBaseline { ramp, taxels: taxels.collect(), gauge_kpa });
    }
    let mut statement = connection
        .prepare_cached("SELECT first, count, block, sum FROM samples WHERE session = ?1 ORDER BY first")
        .map_err(words)?;
    let mut rows = statement.query([session]).map_err(words)?;
    while let Some(row) = rows.next().map_err(words)? {
        let (first, count): (u64, u64) = (row.get(0).map_err(words)?, row.get(1).map_err(words)?);
        let (block, sum): (Vec<u8>, Vec<u8>) = (row.get(2).map_err(words)?, row.get(3).map_err(words)?);
        let there = all.samples.len() as u64;
        if first != there {
            return Err(format!("samples {there} to {first} are missing"));
        }
        let samples = read_block(&block).filter(|samples| samples.len() as u64 == count);
        match samples.filter(|_| sum == sum_of(session, first, count, &block)) {
            Some(samples) => all.samples.extend(samples),
            None => return Err(format!("the checksum of the samples from {first} on is wrong")),
        }
    }
    Ok(all)
}

/// Deletes all ramps and samples of a session.
pub(crate) fn delete(connection: &Connection, session: u64) -> rusqlite::Result<()> {
    connection.execute("DELETE FROM samples WHERE session = ?1", [session])?;
    facts::delete_all(connection, RAMP, &session.to_string())
}

fn words(error: rusqlite::Error) -> String {
    error.to_string()
}
