//! Hysteresis as plays: what a count means depends on the way it was reached.
//!
//! A play operator of radius r follows the count only when the count leaves the band z - r .. z + r, like the far end
//! of a loose joint (Prandtl-Ishlinskii; Kuhnen 2003, "Modeling, identification and compensation of complex hysteretic
//! nonlinearities"). With z_k the plays' outputs and sigma the sign of the taxel (+1 where counts rise with pressure),
//! P = p(C) - sigma sum w_k max(z_k - y_k - s, 0), w_k >= 0. There p is the curve of a load that is put on from rest, y_k is where
//! such a load would have left the same play, and s >= 0 is how far noise alone drags a play ahead. So such a load reads the curve,
//! and one that falls reads lower. The map is from count to pressure already: nothing is left to invert.
//!
//! A play knows no time, so that neither the sampling rate nor a gap can make it unstable.

use crate::model::Sign;
use serde::{Deserialize, Serialize};

/// How many plays a model has at most; the others have a radius of 0, and add nothing.
pub const PLAYS: usize = 4;

/// The plays about a taxel's curve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plays {
    /// Least and greatest calibrated count.
    pub range: [f64; 2],
    /// Which way the counts answer.
    pub sign: Sign,
    /// Radii, counts; not negative.
    pub radii_counts: [f64; PLAYS],
    /// Weights, kPa per count; not negative.
    pub weights_kpa: [f64; PLAYS],
    /// So far noise alone drags a play ahead of a load that lies there, counts; not negative.
    pub slack_counts: f64,
}

/// Where the plays of one taxel stand, as loads: counts, turned so that load is positive. The default is that nothing was read yet.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlayState(Option<[f64; PLAYS]>);

impl Plays {
    /// What the history adds to the curve at `count`: between -2 sum w_k r_k and 0, kPa.
    ///
    /// A count that is not finite gives NaN and leaves the state as it was.
    pub fn bend_kpa(&self, state: &mut PlayState, count: f64) -> f64 {
        if !count.is_finite() {
            return f64::NAN;
        }
        // A load beyond the calibrated range moves the plays, too: when it goes they turn where it turned. Beyond rest
        // there is no load.
        let load = (self.sign.as_f64() * count).max(self.ends()[0]);
        let mut plays = state.0.unwrap_or_else(|| self.radii_counts.map(|r| self.unknown(load, r)));
        let mut lag_kpa = 0.0;
        for ((z, r), w) in plays.iter_mut().zip(self.radii_counts).zip(self.weights_kpa) {
            *z = z.max(load - r).min(load + r);
            lag_kpa += w * (*z - self.risen(load, r) - self.slack_counts).max(0.0);
        }
        state.0 = Some(plays);
        -lag_kpa
    }

    /// Where the range ends, rest first, turned so that load is positive, as loads are here.
    fn ends(&self) -> [f64; 2] {
        let [a, b] = self.range.map(|count| self.sign.as_f64() * count);
        [a.min(b), a.max(b)]
    }

    /// Where a play stands at a load that only rose from rest.
    fn risen(&self, load: f64, r: f64) -> f64 {
        (self.ends()[0] + r).max(load - r)
    }

    /// Where a play stands at its first load, of whose past nothing is known: midway between where a pressure that only
    /// rose from rest would have left it and where one that only fell from the top would have. At rest both are the same:
    /// the last load has gone, and the play hangs back on the side of the load. Without this a touch that begins at rest
    /// would begin in the middle of the loop, which at rest is too low.
    fn unknown(&self, load: f64, r: f64) -> f64 {
        let ([rest, top], risen) = (self.ends(), self.risen(load, r));
        if 2.0 * r >= top - rest {
            return risen; // no load within the range moves it
        }
        risen + ((top - r).min(load + r) - risen) / 2.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_load_that_is_put_on_from_rest_is_not_bent_and_one_that_falls_reads_lower() {
        for sign in [Sign::Falling, Sign::Rising] {
            let (radii_counts, weights_kpa) = ([4.0, 10.0, 1.0, 4.0], [0.8, 0.4, 0.1, 0.3]);
            let plays = Plays { range: [175.0, 225.0], sign, radii_counts, weights_kpa, slack_counts: 0.0 };
            let load = |counts: f64| 200.0 + sign.as_f64() * (counts - 25.0);
            let mut state = PlayState::default();
            for counts in [0.0, 3.0, 17.0, 40.0] {
                assert_eq!(plays.bend_kpa(&mut state, load(counts)), 0.0, "{counts}");
            }
            let back = plays.bend_kpa(&mut state, load(12.0));
            // The plays stand at 16, 22, 13 and 16 counts; a first loading would have left them at 8, 10, 11 and 8.
            assert!((back + 0.8 * 8.0 + 0.4 * 12.0 + 0.1 * 2.0 + 0.3 * 8.0).abs() < 1e-9, "{back}");
            let slack = Plays { slack_counts: 5.0, ..plays.clone() }.bend_kpa(&mut state, load(12.0));
            assert!((slack + 0.8 * 3.0 + 0.4 * 7.0 + 0.3 * 3.0).abs() < 1e-9, "{slack}");
            assert!(plays.bend_kpa(&mut state, load(0.0)).abs() < 1e-9, "at rest nothing is left");
        }
    }
}
