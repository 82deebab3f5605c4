//! Plays where they could do harm: at light touch, in minor loops and after an overload.

use super::tests::{PERIOD_S, Skin};
use super::*;
use crate::zero::rest::tests::Noise;

const TAXELS: usize = 20;
const TOP_KPA: f64 = 70.0;

/// How the skin's hysteresis really is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Truth {
    /// Plays in pressure that an earlier load has left behind.
    Plays,
    /// The same, never loaded before.
    Virgin,
    /// A loop whose width is in proportion to the pressure: it closes at rest.
    Closing,
    /// None.
    None,
}

impl Truth {
    /// The pressure that the counts follow.
    fn felt(self, kpa: &[f64]) -> Vec<f64> {
        let plays = [(1.5, 0.3), (4.0, 0.3), (9.0, 0.4)];
        let scale = |p: f64| if self == Self::Closing { 35.0 * (1.0 + p.max(0.0) / 15.0).ln() } else { p };
        let back = |u: f64| if self == Self::Closing { 15.0 * ((u / 35.0).exp() - 1.0) } else { u };
        let start =
            |r: f64| if matches!(self, Self::Plays | Self::Closing) { scale(kpa[0]) + r } else { scale(kpa[0]) };
        let mut z = plays.map(|(r, _)| start(r));
        let step = |p: &f64| {
            let u = scale(*p);
            z.iter_mut().zip(plays).for_each(|(z, (r, _))| *z = z.max(u - r).min(u + r));
            back(z.iter().zip(plays).map(|(z, (_, w))| w * z).sum())
        };
        if self == Self::None { kpa.to_vec() } else { kpa.iter().map(step).collect() }
    }
}

fn recorded(truth: Truth, kpa: Vec<f64>, seed: u64) -> Skin {
    let (felt, mut noise) = (truth.felt(&kpa), Noise(seed));
    let mut column = |gain: f64| {
        let count = |p: &f64| (235.0 - gain * p / (p + 80.0) + 0.8 * noise.normal()).round();
        felt.iter().map(count).collect()
    };
    let counts = (0..TAXELS).map(|taxel| column(150.0 + 3.0 * taxel as f64)).collect();
    Skin { time_s: (0..kpa.len()).map(|i| i as f64 * PERIOD_S).collect(), kpa, counts }
}

/// Straight from turn to turn at 3.5 kPa a second, with a rest of 4 s at the begin.
fn path(turns: &[f64]) -> Vec<f64> {
    let mut kpa = vec![turns[0]; 200];
    for pair in turns.windows(2) {
        let n = ((pair[1] - pair[0]).abs() / 3.5 / PERIOD_S).ceil().max(1.0) as usize;
        kpa.extend((1..=n).map(|k| pair[0] + (pair[1] - pair[0]) * k as f64 / n as f64));
    }
    kpa
}

/// Root mean square error of the area-mean from scan `first` on, kPa, by a set that was fitted with these plays, and
/// whether it has any.
fn error_kpa(calibration: &Skin, plays: bool, judged: &Skin, first: usize) -> (f64, bool) {
    let set = fit(&calibration.scans(), &FitRecipe { plays, ..FitRecipe::default() }, &OneByOne).unwrap();
    let applied = apply(&judged.scans(), &set, Tare::Auto).unwrap();
    let read = || applied.columns.iter().flatten();
    assert!(read().count() == TAXELS, "{}", applied.zero.words);
    let area = |i: usize| read().map(|column| column.kpa[i]).sum::<f64>() / TAXELS as f64 - judged.kpa[i];
    let squares: f64 = (first..judged.kpa.len()).map(|i| area(i).powi(2)).sum();
    ((squares / (judged.kpa.len() - first) as f64).sqrt(), set.plays(0).is_some())
}

#[test]
fn plays_make_neither_light_touches_nor_minor_loops_nor_the_time_after_an_overload_worse() {
    let paths = [
        ("light touches", path(&[0.0, 6.0, 0.0, 4.0, 0.0, 6.0, 0.0])),
        ("minor loops", path(&[0.0, 35.0, 25.0, 38.0, 22.0, 35.0, 25.0, 35.0, 0.0])),
        ("after an overload", path(&[0.0, 95.0, 0.0, 6.0, 0.0, 25.0, 0.0])),
        ("full cycles", path(&[0.0, TOP_KPA, 0.0, TOP_KPA, 0.0])),
    ];
    for truth in [Truth::Plays, Truth::Virgin, Truth::Closing, Truth::None] {
        let calibration = recorded(truth, [path(&[0.0, TOP_KPA, 0.0]), vec![0.0; 250]].concat(), 1);
        for (name, kpa) in &paths {
            let judged = recorded(truth, kpa.clone(), 2);
            let over = kpa.iter().rposition(|p| *p > TOP_KPA).map_or(200, |last| last + 1);
            let error = |plays| error_kpa(&calibration, plays, &judged, over);
            let ((auto, on), (off, _)) = (error(true), error(false));
            assert!(auto <= 1.02 * off, "{truth:?}, {name}: {auto} kPa with plays {on}, {off} kPa without");
            let pure = matches!(truth, Truth::Plays | Truth::Virgin);
            assert!(
                !pure || (on && auto < 0.75 * off),
                "{truth:?}, {name}: {auto} kPa with plays {on}, {off} kPa without"
            );
        }
    }
}
