//! Group 7: hysteresis. A play knows no time, so that steps of time and gaps are steps of the count.

use crate::stability::case::greatest;
use crate::stability::case::{Case, Outcome};
use crate::stability::taxels::random;
use crate::{Curve, PLAYS, PlayState, Plays, Sign};
use rand::RngExt;

/// Steps of the long walk.
const STEPS: u32 = 1_000_000;

pub(super) fn cases() -> Vec<Case> {
    let same = "max |dP|, kPa";
    vec![
        Case::of("7.1", "a path in 1 to 1000 steps a turn: any subdivision", same, 0.0, subdivision),
        Case::of("7.2", "zero steps: the same count 10,000 times", same, 0.0, zero_steps),
        Case::of("7.3", "a jump over the whole range against 100,000 small steps", same, 0.0, jump),
        Case::of("7.4", "resumption after a gap: one large step against the path that was missed", same, 0.0, gap),
        Case::of("7.5", "NaN and infinite counts leave the state as it was", same, 0.0, not_finite),
        Case::of(
            "7.6",
            "1e6 random steps stay within the plays' reach",
            "max |P - curve + sum w r| over sum w r",
            1.0 + 1e-12,
            bounded,
        ),
        Case::of(
            "7.7",
            "1e6 random steps stay monotone in the count",
            "largest step against the sign, kPa",
            1e-9,
            monotone,
        ),
        Case::of("7.8", "a closed inner loop leaves no trace", same, 0.0, inner_loop),
        Case::of("7.9", "radii of 0 give the curve", same, 0.0, no_radius),
        Case::of(
            "7.10",
            "radii beyond the range: the state stays where it began, nothing is added",
            same,
            0.0,
            huge_radius,
        ),
        Case::of("7.11", "the same walk twice", same, 0.0, replay),
    ]
}

/// Two plays, 150 to 250 counts.
fn plays(sign: Sign) -> Plays {
    Plays {
        range: [150.0, 250.0],
        sign,
        radii_counts: [8.0, 20.0, 0.0, 0.0],
        weights_kpa: [0.8, 0.4, 0.0, 0.0],
        slack_counts: 0.0,
    }
}

/// A curve with both a slope and a bend, kPa.
fn curve(plays: &Plays, count: f64) -> f64 {
    let chebyshev = vec![150.0, plays.sign.as_f64() * 100.0, 3.0];
    let [low, high] = plays.range;
    Curve { centre: 200.0, half_width: 50.0, chebyshev }.evaluate(count.clamp(low, high))
}

/// The pressure at a count after all that the plays have seen.
fn read(plays: &Plays, state: &mut PlayState, count: f64) -> f64 {
    curve(plays, count) + plays.bend_kpa(state, count)
}

fn signs() -> [Plays; 2] {
    [plays(Sign::Falling), plays(Sign::Rising)]
}

fn run(plays: &Plays, path: &[f64]) -> Vec<f64> {
    let mut state = PlayState::default();
    path.iter().map(|count| read(plays, &mut state, *count)).collect()
}

fn walk(seed: u64, steps: u32) -> Vec<f64> {
    let mut random = random(seed);
    // Beyond the range at both ends.
    (0..steps).map(|_| random.random_range(140.0..260.0)).collect()
}

/// From `from` to `to` in so many steps; ends at `to` exactly and never passes it.
fn stretch(from: f64, to: f64, steps: u32) -> impl Iterator<Item = f64> {
    let (low, high) = (from.min(to), from.max(to));
    (1..=steps).map(move |k| {
        if k == steps { to } else { (from + (to - from) * f64::from(k) / f64::from(steps)).clamp(low, high) }
    })
}

fn largest(differences: impl IntoIterator<Item = f64>) -> Outcome {
    Outcome::of_figure(greatest(differences.into_iter().map(f64::abs)))
}

fn subdivision() -> Outcome {
    let turns = walk(71, 40);
    let differences = signs().into_iter().flat_map(|plays| {
        let coarse = run(&plays, &turns);
        [1, 2, 7, 1000].map(|steps| {
            let mut state = PlayState::default();
            read(&plays, &mut state, turns[0]);
            let dense = turns.windows(2).map(|pair| {
                stretch(pair[0], pair[1], steps).fold(f64::NAN, |_, count| read(&plays, &mut state, count))
            });
            greatest(dense.collect::<Vec<_>>().iter().zip(&coarse[1..]).map(|(dense, coarse)| (dense - coarse).abs()))
        })
    });
    largest(differences.collect::<Vec<_>>())
}

fn zero_steps() -> Outcome {
    let differences = signs().into_iter().flat_map(|plays| {
        let mut state = PlayState::default();
        walk(72, 20).into_iter().map(move |count| {
            let first = read(&plays, &mut state, count);
            let stood = state;
            let again = (0..10_000).map(|_| read(&plays, &mut state, count) - first);
            let moved = greatest(again.map(f64::abs));
            if state == stood { moved } else { f64::NAN }
        })
    });
    largest(differences.collect::<Vec<_>>())
}

fn jump() -> Outcome {
    let differences = signs().into_iter().flat_map(|plays| {
        let ends = [140.0, 260.0, 140.0];
        let mut state = PlayState::default();
        read(&plays, &mut state, ends[0]);
        let slow: Vec<f64> = ends
            .windows(2)
            .map(|pair| stretch(pair[0], pair[1], 100_000).fold(f64::NAN, |_, c| read(&plays, &mut state, c)))
            .collect();
        run(&plays, &ends)[1..].iter().zip(slow).map(|(fast, slow)| fast - slow).collect::<Vec<_>>()
    });
    largest(differences.collect::<Vec<_>>())
}

fn gap() -> Outcome {
    let before = walk(74, 100);
    let differences = signs().into_iter().map(|plays| {
        let mut heard = PlayState::default();
        before.iter().for_each(|count| _ = read(&plays, &mut heard, *count));
        let (mut missed, last) = (heard, before[before.len() - 1]);
        stretch(last, 161.5, 3600).for_each(|count| _ = read(&plays, &mut heard, count));
        read(&plays, &mut missed, 161.5);
        // From here on both have the same state: whatever comes reads the same.
        greatest(walk(75, 100).iter().map(|c| (read(&plays, &mut heard, *c) - read(&plays, &mut missed, *c)).abs()))
    });
    largest(differences.collect::<Vec<_>>())
}

fn not_finite() -> Outcome {
    let mut readings_of_nothing = 0;
    let differences: Vec<f64> = signs()
        .into_iter()
        .flat_map(|plays| {
            let path = walk(76, 100);
            let mut state = PlayState::default();
            let poisoned: Vec<f64> = path
                .iter()
                .map(|count| {
                    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                        readings_of_nothing += usize::from(!read(&plays, &mut state, bad).is_nan());
                    }
                    read(&plays, &mut state, *count)
                })
                .collect();
            run(&plays, &path).into_iter().zip(poisoned).map(|(clean, poisoned)| clean - poisoned).collect::<Vec<_>>()
        })
        .collect();
    let mut outcome = largest(differences);
    outcome.require(readings_of_nothing == 0, || format!("{readings_of_nothing} readings of what is no count"));
    outcome
}

fn bounded() -> Outcome {
    let shares = signs().into_iter().map(|plays| {
        let reach: f64 = plays.weights_kpa.iter().zip(plays.radii_counts).map(|(w, r)| w * r).sum();
        let mut state = PlayState::default();
        greatest(
            walk(77, STEPS).into_iter().map(|c| (read(&plays, &mut state, c) - curve(&plays, c) + reach).abs() / reach),
        )
    });
    largest(shares)
}

fn monotone() -> Outcome {
    let worst = signs().into_iter().map(|plays| {
        let (mut state, mut others) = (PlayState::default(), random(78));
        let against = walk(79, STEPS).into_iter().map(|count| {
            let other: f64 = others.random_range(140.0..260.0);
            let (mut one, mut two) = (state, state);
            let rise = read(&plays, &mut one, count) - read(&plays, &mut two, other);
            read(&plays, &mut state, count);
            -rise * (count - other).signum() * plays.sign.as_f64()
        });
        against.fold(0.0, |worst: f64, step| if step.is_nan() { step } else { worst.max(step) })
    });
    largest(worst)
}

fn inner_loop() -> Outcome {
    let differences = signs().into_iter().flat_map(|plays| {
        let (mut state, mut random) = (PlayState::default(), random(80));
        read(&plays, &mut state, 150.0);
        (0..1000)
            .map(|k| {
                // Up to a new turn; back by any part of the way; and up to the turn again.
                let top = 151.0 + 0.09 * f64::from(k);
                let before = read(&plays, &mut state, top);
                read(&plays, &mut state, random.random_range(150.0..top));
                read(&plays, &mut state, top) - before
            })
            .collect::<Vec<_>>()
    });
    largest(differences.collect::<Vec<_>>())
}

fn no_radius() -> Outcome {
    let plays = Plays { radii_counts: [0.0; PLAYS], ..plays(Sign::Falling) };
    let path = walk(81, 10_000);
    largest(run(&plays, &path).iter().zip(&path).map(|(kpa, count)| kpa - curve(&plays, *count)))
}

fn huge_radius() -> Outcome {
    let plays = Plays { radii_counts: [1e300, 1e6, 0.0, 0.0], ..plays(Sign::Falling) };
    let path = walk(82, 10_000);
    largest(run(&plays, &path).iter().zip(&path).map(|(kpa, count)| kpa - curve(&plays, *count)))
}

fn replay() -> Outcome {
    let path = walk(83, 10_000);
    let plays = plays(Sign::Rising);
    largest(run(&plays, &path).iter().zip(run(&plays, &path)).map(|(one, two)| one - two))
}
