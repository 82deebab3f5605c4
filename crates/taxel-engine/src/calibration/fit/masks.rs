//! Which scans of which taxel are invalid, over a whole recording.

use std::ops::Range;

use taxel_skin::Time;

use crate::calibration::fit::dropouts::dropouts;
use crate::calibration::fit::scans::Scans;
use crate::intake::faults::detector::FaultDetector;
use crate::intake::faults::fault::Fault;
use crate::intake::faults::limits::FaultLimits;
use taxel_model::{Workers, map};

/// The faults of a recording. Unlike the live detector this one can go back: a fault counts from its onset.
#[derive(Clone, Debug)]
pub struct Masks {
    /// One per taxel, one value per scan.
    masked: Vec<Vec<bool>>,
    /// Scans of each fault, by taxel; and those without a reading.
    scans_of: Vec<[u32; Fault::ALL.len()]>,
    missing: Vec<u32>,
    /// Readings that stood alone, by taxel.
    dropouts: Vec<u32>,
}

impl Masks {
    /// Runs the live detector over the recording; each of `modules` is a range of taxels.
    pub fn find(scans: &Scans<'_>, modules: &[Range<usize>], limits: &FaultLimits) -> Self {
        let mut masks = Self::missing(scans);
        let mut detector = FaultDetector::new(scans.counts.len(), modules, *limits);
        let mut onset: Vec<Option<Time>> = vec![None; scans.counts.len()];
        let (mut row, mut faulty) = (Vec::new(), vec![false; modules.len()]);
        let times: Vec<Time> = scans.time_s.iter().map(|&t| Time::from_seconds(t)).collect();
        for i in 0..times.len() {
            for (m, range) in modules.iter().enumerate() {
                row.clear();
                row.extend(range.clone().map(|t| scans.counts[t][i] as f32));
                if !detector.push_reals(times[i], m, &row, 0) && !faulty[m] {
                    continue; // nearly always
                }
                for taxel in range.clone() {
                    masks.take(taxel, &times[..=i], &detector, &mut onset[taxel]);
                }
                faulty[m] = range.clone().any(|taxel| !detector.faults(taxel).is_empty());
            }
        }
        masks
    }

    /// Only what has no reading: for tables that are not recordings of a skin.
    pub fn missing(scans: &Scans<'_>) -> Self {
        let masked: Vec<Vec<bool>> =
            scans.counts.iter().map(|column| column.iter().map(|c| !c.is_finite()).collect()).collect();
        let missing = masked.iter().map(|m: &Vec<bool>| m.iter().filter(|m| **m).count() as u32).collect();
        let (scans_of, dropouts) = (vec![Default::default(); masked.len()], vec![0; masked.len()]);
        Self { scans_of, missing, dropouts, masked }
    }

    /// Also leaves out single readings that stand alone: for a fit.
    pub fn without_dropouts(mut self, scans: &Scans<'_>, workers: &dyn Workers) -> Self {
        let found = map(workers, scans.counts.len(), |taxel| dropouts(scans.counts[taxel], &self.masked[taxel]));
        for ((alone, masked), n) in found.into_iter().zip(&mut self.masked).zip(&mut self.dropouts) {
            *n = alone.len() as u32;
            alone.into_iter().for_each(|scan| masked[scan] = true);
        }
        self
    }

    /// How many single readings of the taxel were left out.
    pub fn dropouts(&self, taxel: usize) -> u32 {
        self.dropouts[taxel]
    }

    /// Takes the faults of a taxel at the last of these times, from their onset on.
    fn take(&mut self, taxel: usize, times: &[Time], detector: &FaultDetector, onset: &mut Option<Time>) {
        let (scan, faults) = (times.len() - 1, detector.faults(taxel));
        if faults.is_empty() {
            *onset = None;
            return;
        }
        for fault in faults.iter() {
            self.scans_of[taxel][fault as usize] += 1;
        }
        let since = detector.wrong_since(taxel);
        let first = match since {
            Some(since) if *onset != Some(since) => times[..scan].partition_point(|t| *t < since),
            _ => scan,
        };
        *onset = since;
        self.masked[taxel][first..=scan].fill(true);
    }

    /// Whether each scan of the taxel is to be left out.
    pub fn of(&self, taxel: usize) -> &[bool] {
        &self.masked[taxel]
    }

    /// Share of the scans that are left out, 0 to 1.
    pub fn share(&self, taxel: usize) -> f64 {
        let masked = &self.masked[taxel];
        masked.iter().filter(|m| **m).count() as f64 / masked.len().max(1) as f64
    }

    /// The fault that holds for most scans; `None` if it is the lack of readings, or there is none.
    pub fn main_fault(&self, taxel: usize) -> Option<Fault> {
        let scans = |fault: &Fault| self.scans_of[taxel][*fault as usize];
        // Of equals the first in the list: a rail or a freeze says more than the flicker of the module.
        let main = Fault::ALL.into_iter().rev().max_by_key(scans)?;
        (scans(&main) > self.missing[taxel]).then_some(main)
    }
}
