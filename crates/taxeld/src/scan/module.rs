//! One module: its scans, and what its twelve values did.

use taxel_skin::{ModuleKind, Time, VALUES_PER_MODULE};
use taxel_wire::icub::{ModuleScan, Pairer, StatusWord};

use super::findings::ModuleFound;

/// Head and tail of one scan are closer than this, and boards do not send faster.
const WINDOW: std::time::Duration = std::time::Duration::from_millis(15);
/// Intervals that are kept: minutes of any real period.
const INTERVALS_MAX: usize = 8_192;
/// From one scan to the next a hand does not change a count by more; noise and load together stay below.
const JUMP_COUNTS: f64 = 60.0;
/// Jumps a hundred scans from which a value flickers.
const JUMPS_PER_100: f64 = 2.0;
/// A module whose values moved by so much was pressed.
const PRESSED_COUNTS: u8 = 12;
/// Scans below which nothing is said of a value.
const SCANS_MIN: u64 = 8;

/// What the kinds are called, and which of the values are pads.
const KINDS: [(&str, ModuleKind); 4] = [
    ("triangle", ModuleKind::Triangle),
    ("fingertip", ModuleKind::Fingertip),
    ("palm-pad11", ModuleKind::PalmPad11),
    ("palm-pad7", ModuleKind::PalmPad7),
];

/// A module while somebody listens.
#[derive(Debug)]
pub struct ModuleWatch {
    pairer: Pairer,
    scans: u64,
    last: Option<Time>,
    intervals_ms: Vec<f32>,
    values: [ValueWatch; VALUES_PER_MODULE],
    no_acks: u64,
    not_connected: u64,
}

#[derive(Clone, Copy, Debug, Default)]
struct ValueWatch {
    sum: f64,
    /// Of squared steps from scan to scan: half of their mean is the noise's variance, whatever the load does.
    steps: f64,
    jumps: u64,
    last: Option<u8>,
    range: Option<(u8, u8)>,
    out_of_range: u64,
}

impl Default for ModuleWatch {
    fn default() -> Self {
        Self {
            pairer: Pairer::new(WINDOW),
            scans: 0,
            last: None,
            intervals_ms: Vec::new(),
            values: [ValueWatch::default(); VALUES_PER_MODULE],
            no_acks: 0,
            not_connected: 0,
        }
    }
}

impl ModuleWatch {
    /// A head frame.
    pub fn head(&mut self, time: Time, values: [u8; 7]) {
        self.pairer.head(time, values);
    }

    /// A tail frame.
    pub fn tail(&mut self, time: Time, values: [u8; 5], status: StatusWord) {
        if let Some(scan) = self.pairer.tail(time, values, status) {
            self.scan(&scan);
        }
    }

    fn scan(&mut self, scan: &ModuleScan) {
        self.scans += 1;
        if let Some(last) = self.last.replace(scan.time)
            && self.intervals_ms.len() < INTERVALS_MAX
        {
            self.intervals_ms.push((scan.time.seconds_since(last) * 1e3) as f32);
        }
        self.no_acks += u64::from(scan.status.no_ack());
        self.not_connected += u64::from(scan.status.not_connected());
        for (k, (watch, &value)) in self.values.iter_mut().zip(&scan.values).enumerate() {
            watch.push(value, scan.status.0 >> (4 + k) & 1 == 1);
        }
    }

    /// The times between its scans, milliseconds.
    #[must_use]
    pub fn intervals_ms(&self) -> &[f32] {
        &self.intervals_ms
    }

    /// What is known of it at `end`, when its board sends every `period_ms`.
    #[must_use]
    pub fn found(&self, end: Time, period_ms: Option<f64>) -> ModuleFound {
        let scans = self.scans.max(1) as f64;
        let orphans = self.pairer.orphans();
        let silent_s = self.last.map(|last| end.seconds_since(last));
        let long = period_ms.map_or(1.0, |ms| 5e-3 * ms).max(0.5);
        let moved = |k: usize| self.values[k].range.map_or(0, |(least, most)| most - least);
        let mut swings: Vec<u8> = (0..VALUES_PER_MODULE).map(moved).collect();
        swings.sort_unstable();
        let pressed = swings[VALUES_PER_MODULE - 2] >= PRESSED_COUNTS && self.scans >= SCANS_MIN;
        // A pad is not pressed: it moves by less than half of what most taxels do.
        let limit = if pressed { swings[VALUES_PER_MODULE / 2].max(PRESSED_COUNTS) / 2 } else { u8::MAX };
        let fits = |kind: &ModuleKind| kind.thermal_slots().iter().all(|&slot| moved(usize::from(slot)) <= limit);
        let enough = self.scans >= SCANS_MIN;
        let alive = self.values.iter().any(|value| value.steps > 0.0);
        let which = |wanted: &dyn Fn(&ValueWatch) -> bool| -> Vec<u8> {
            (0..VALUES_PER_MODULE as u8).filter(|&k| enough && wanted(&self.values[usize::from(k)])).collect()
        };
        let stuck = which(&|value| {
            let at_the_end = matches!(value.range, Some((0, 0) | (255, 255)));
            value.steps == 0.0 && (alive || at_the_end)
        });
        ModuleFound {
            scans: self.scans,
            orphans: orphans.heads + orphans.tails,
            silent_s: silent_s.filter(|silence| *silence > long),
            kinds: KINDS.iter().filter(|(_, kind)| fits(kind)).map(|(name, _)| *name).collect(),
            pressed,
            mean: self.values.iter().map(|value| value.sum / scans).collect(),
            noise: self.values.iter().map(|value| (0.5 * value.steps / (scans - 1.0).max(1.0)).sqrt()).collect(),
            range: self.values.iter().map(|value| value.range.unwrap_or_default()).collect(),
            stuck: stuck.into_iter().filter(|k| !(fits(&ModuleKind::Triangle) && matches!(k, 6 | 10))).collect(),
            flickering: which(&|value| value.jumps as f64 * 100.0 > JUMPS_PER_100 * scans && value.jumps > 1),
            out_of_range: (0..)
                .zip(&self.values)
                .filter(|(_, v)| v.out_of_range > 0)
                .map(|(k, v)| (k, v.out_of_range))
                .collect(),
            no_acks: self.no_acks,
            not_connected: self.not_connected,
        }
    }
}

impl ValueWatch {
    fn push(&mut self, value: u8, out_of_range: bool) {
        self.sum += f64::from(value);
        if let Some(last) = self.last.replace(value) {
            let step = f64::from(value) - f64::from(last);
            self.steps += step * step;
            self.jumps += u64::from(step.abs() > JUMP_COUNTS);
        }
        let (least, most) = self.range.unwrap_or((value, value));
        self.range = Some((least.min(value), most.max(value)));
        self.out_of_range += u64::from(out_of_range);
    }
}
