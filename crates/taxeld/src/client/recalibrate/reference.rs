//! A force sensor as a reference: what its lines say, and when it holds still.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// The sensor has to hold still for so long.
const STEADY_FOR: Duration = Duration::from_millis(1_500);
/// From fewer values nobody can tell.
const VALUES_MIN: usize = 8;
/// It holds still if it stays within this share of its mean,
const SHARE_MAX: f64 = 0.02;
/// or within so many newtons.
const FLOOR_N: f64 = 0.1;
/// Less is no load for a skin.
const FORCE_MIN_N: f64 = 0.5;
/// It is another load once the force went away from that of the last one by this share of it.
const ANOTHER_SHARE: f64 = 0.1;
/// Longest line of a sensor.
const LINE_BYTES_MAX: usize = 4096;
/// Most values that are kept: 1.5 s of a sensor with 10 kHz.
const VALUES_MAX: usize = 15_000;

/// The newest values of a force sensor, by the clock of whoever receives them.
#[derive(Debug, Default)]
pub struct Reference {
    values: VecDeque<(Instant, f64)>,
    /// The force of the load that was read last, until the sensor has left it.
    done_n: Option<f64>,
}

/// A force that holds still.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steady {
    /// Its mean, N.
    pub force_n: f64,
    /// By how much it moved all the same, as a relative standard uncertainty: a rectangle from least to most.
    pub relative_sigma: f64,
}

impl Reference {
    /// Takes a value.
    pub fn take(&mut self, now: Instant, force_n: f64) {
        if self.done_n.is_some_and(|done| (force_n - done).abs() > ANOTHER_SHARE * done) {
            self.done_n = None;
        }
        self.values.push_back((now, force_n));
        while self.values.len() > VALUES_MAX {
            self.values.pop_front();
        }
        // One value older than the span stays: it proves that the span is covered.
        while self.values.get(1).is_some_and(|(time, _)| now.duration_since(*time) >= STEADY_FOR) {
            self.values.pop_front();
        }
    }

    /// A load that holds still now and was not read yet.
    pub fn new_load(&self, now: Instant) -> Option<Steady> {
        if self.done_n.is_some() {
            return None;
        }
        self.steady(now)
    }

    /// What the sensor held over the last span, if it held still and is not silent.
    pub fn steady(&self, now: Instant) -> Option<Steady> {
        let (first, last) = (self.values.front()?.0, self.values.back()?.0);
        let covered = last.duration_since(first) >= STEADY_FOR && now.duration_since(last) < STEADY_FOR / 3;
        if !covered || self.values.len() < VALUES_MIN {
            return None;
        }
        let forces = || self.values.iter().map(|(_, force)| *force);
        let (least, most) = (forces().fold(f64::INFINITY, f64::min), forces().fold(f64::NEG_INFINITY, f64::max));
        let force_n = forces().sum::<f64>() / self.values.len() as f64;
        let still = force_n >= FORCE_MIN_N && most - least <= (SHARE_MAX * force_n).max(FLOOR_N);
        still.then(|| Steady { force_n, relative_sigma: (most - least) / (12.0_f64.sqrt() * force_n) })
    }

    /// The load that holds still was read: no other is begun before the sensor has left it.
    pub fn done(&mut self, force_n: f64) {
        self.done_n = Some(force_n);
    }
}

/// Puts lines together of what comes.
#[derive(Debug, Default)]
pub struct Lines {
    part: Vec<u8>,
    ended: u64,
}

impl Lines {
    /// The forces of the lines that end within these bytes.
    ///
    /// # Errors
    /// A line that is no force or too long, with its number.
    pub fn take(&mut self, bytes: &[u8]) -> Result<Vec<f64>, String> {
        let mut forces = Vec::new();
        for &byte in bytes {
            if byte != b'\n' {
                if self.part.len() == LINE_BYTES_MAX {
                    return Err(format!(
                        "line {} of the reference has more than {LINE_BYTES_MAX} bytes",
                        self.ended + 1
                    ));
                }
                self.part.push(byte);
                continue;
            }
            self.ended += 1;
            forces.extend(force_of_line(self.ended, &String::from_utf8_lossy(&self.part))?);
            self.part.clear();
        }
        Ok(forces)
    }
}

/// The force in a line of a sensor, N: the last of its values. `None` for an empty line, and for a first line of words.
///
/// # Errors
/// The line's number and what stands there.
fn force_of_line(number: u64, line: &str) -> Result<Option<f64>, String> {
    let word = line.rsplit(',').next().unwrap_or_default().trim();
    if word.is_empty() || line.trim_start().starts_with('#') {
        return Ok(None);
    }
    match word.parse::<f64>() {
        Ok(force) if force.is_finite() => Ok(Some(force)),
        Err(_) if number == 1 => Ok(None),
        _ => Err(format!("line {number} of the reference: `{}` is no number of newtons", short(word))),
    }
}

fn short(word: &str) -> String {
    word.chars().take(40).flat_map(char::escape_debug).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The loads that a sensor at 100 Hz with this course would begin, each taken as read at once.
    fn loads(seconds: f64, force_n: impl Fn(f64) -> f64) -> Vec<f64> {
        let (begin, mut reference, mut found) = (Instant::now(), Reference::default(), Vec::new());
        for i in 0..(100.0 * seconds) as u32 {
            let t = 0.01 * f64::from(i);
            let now = begin + Duration::from_secs_f64(t);
            reference.take(now, force_n(t));
            if let Some(steady) = reference.new_load(now) {
                assert!(steady.relative_sigma <= 0.06, "{steady:?}");
                reference.done(steady.force_n);
                found.push(steady.force_n);
            }
        }
        found
    }

    #[test]
    fn each_load_that_holds_still_is_found_once_and_what_moves_is_not() {
        let step = |t: f64| match t {
            t if t < 5.0 => 10.0,
            t if t < 10.0 => 10.0 + 2.0 * (t - 5.0),
            t if t < 15.0 => 20.0,
            t if t < 18.0 => 0.0,
            _ => 20.0,
        };
        let found = loads(25.0, step);
        assert_eq!(found.len(), 3, "{found:?}");
        assert!((found[0] - 10.0).abs() < 0.1 && (found[1] - 20.0).abs() < 0.2 && (found[2] - 20.0).abs() < 0.2);
        assert!(loads(10.0, |t| 10.0 + (3.0 * t).sin()).is_empty(), "it sways");
        assert!(loads(10.0, |_| 0.2).is_empty(), "nothing lies there");
        assert!(loads(1.4, |_| 5.0).is_empty(), "too short");
    }

    #[test]
    fn a_sensor_that_falls_silent_holds_nothing() {
        let (begin, mut reference) = (Instant::now(), Reference::default());
        (0..200).for_each(|i| reference.take(begin + Duration::from_millis(10 * i), 5.0));
        assert!(reference.steady(begin + Duration::from_millis(2_000)).is_some());
        assert_eq!(reference.steady(begin + Duration::from_millis(3_000)), None);
    }

    #[test]
    fn a_line_gives_its_last_value_and_nonsense_is_refused_with_its_place() {
        assert_eq!(force_of_line(1, "t_s,force_n"), Ok(None));
        assert_eq!(force_of_line(2, "12.5, 4.9 "), Ok(Some(4.9)));
        assert_eq!(force_of_line(3, "4.9"), Ok(Some(4.9)));
        assert_eq!(force_of_line(4, "# a remark"), Ok(None));
        assert!(force_of_line(5, "1.0,nan").unwrap_err().contains("line 5"));
        assert!(force_of_line(6, "1.0,x").unwrap_err().contains("`x`"));
        let mut lines = Lines::default();
        assert_eq!(lines.take(b"t,f\n1,2.5\n1,3"), Ok(vec![2.5]));
        assert_eq!(lines.take(b".5\n\n1,4\n"), Ok(vec![3.5, 4.0]));
        assert!(lines.take(&[b'7'; 5_000]).unwrap_err().contains("line 6 of the reference has more than 4096 bytes"));
    }
}
