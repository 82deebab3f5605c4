//! Delays, counted by the microsecond: memory does not grow with the time that is measured.

/// Each microsecond up to here is counted by itself; what is longer is counted together, and the longest is known.
const FINE_US: usize = 20_000;

/// Counted delays.
#[derive(Clone)]
pub struct Histogram {
    counts: Vec<u64>,
    beyond: u64,
    total: u64,
    most_us: f64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { counts: vec![0; FINE_US], beyond: 0, total: 0, most_us: 0.0 }
    }
}

impl Histogram {
    pub fn add_ns(&mut self, ns: i64) {
        let ns = ns.max(0);
        match self.counts.get_mut((ns / 1_000) as usize) {
            Some(count) => *count += 1,
            None => self.beyond += 1,
        }
        self.total += 1;
        self.most_us = self.most_us.max(ns as f64 * 1e-3);
    }

    pub fn add(&mut self, other: &Self) {
        self.counts.iter_mut().zip(&other.counts).for_each(|(own, other)| *own += other);
        self.beyond += other.beyond;
        self.total += other.total;
        self.most_us = self.most_us.max(other.most_us);
    }

    pub fn total(&self) -> u64 {
        self.total
    }

    /// In us, the end of the microsecond in which this share is reached; the longest of all beyond 20 ms. NaN of none.
    pub fn quantile_us(&self, share: f64) -> f64 {
        let wanted = (share * self.total as f64).ceil().max(1.0) as u64;
        let mut seen = 0;
        let found = self.counts.iter().position(|count| {
            seen += count;
            seen >= wanted
        });
        match found {
            Some(us) => ((us + 1) as f64).min(self.most_us),
            None if self.total > 0 => self.most_us,
            None => f64::NAN,
        }
    }

    /// p50, p99, p99.9 and the longest, as cells of a table.
    pub fn cells(&self) -> String {
        let [p50, p99, p999] = [0.5, 0.99, 0.999].map(|share| self.quantile_us(share));
        format!("{p50:.0} | {p99:.0} | {p999:.0} | {:.0}", self.most_us)
    }
}
