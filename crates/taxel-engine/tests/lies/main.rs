//! Everything at once, on simulated time, with the true force known: how often does a published force lie?
//!
//! A *lie* is a published force of state OK or DEGRADED whose stated interval does not hold the truth. A *story* is what
//! happens to one skin within one to five minutes: loads, a pump, faults, an operator, a store, all drawn from a seed.
//! How to run it and how to read it: `tests/README.md` at the top of the repository.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod allowed;
mod daemon;
mod dice;
#[path = "../common/disk.rs"]
#[allow(dead_code)]
mod disk;
mod faults;
mod figures;
mod hands;
mod house;
mod inquiry;
#[path = "../common/judge.rs"]
mod judge;
mod kinds;
mod mishaps;
mod operator;
#[path = "../common/rig.rs"]
#[allow(dead_code)]
mod rig;
mod stage;
mod store;
mod story;
mod suspects;
mod tally;
mod truth;

use std::collections::BTreeMap;
use std::panic::catch_unwind;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use crate::figures::{Bounds, Figures};
use crate::house::{Course, Patches, Setting};
use crate::story::Outcome;
use crate::tally::Tally;

/// What 500 stories of one patch must not be worse than: what they came to, and a twentieth to a tenth.
const BOUNDS: Bounds = Bounds {
    ok_min: 0.945,
    force_min: 0.88,
    open_max: 0.05,
    undetected_max_n: 0.75,
    sigma_max_n: 0.57, // grows with the loads that are weighed, so also with the time that has a force
    width_max_n: 2.05,
    error_max: 0.2,
    sigma_over_error_max: 1.3,
    covered_min: 0.93,
    score_max_n: 5.4,
    phantom_max: 0.002,
};

/// The numbers of the first stories of one patch, committed: who changes what a skin says changes them, and people read it.
const COURSES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/lies/courses.csv");
const COURSES_STORIES: u64 = 20;
/// Numbers that differ by less than this share are the same.
const SAME: f64 = 2e-3;

/// The number that an environment variable holds.
fn variable(name: &str) -> Option<u64> {
    let text = std::env::var(name).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{name} is `{text}`, expected a whole number")))
}

/// One patch, unless `LIES_PATCHES` is 2; minutes, unless `LIES_COURSE` says otherwise.
fn setting() -> Setting {
    let patches = match variable("LIES_PATCHES") {
        None | Some(1) => Patches::One,
        Some(2) => Patches::Two,
        Some(other) => panic!("LIES_PATCHES is {other}, expected 1 or 2"),
    };
    let course = match std::env::var("LIES_COURSE").as_deref() {
        Err(_) | Ok("minutes") => Course::Minutes,
        Ok("half-hour") => Course::HalfHour,
        Ok("day") => Course::Day,
        Ok(other) => panic!("LIES_COURSE is {other}, expected minutes, half-hour or day"),
    };
    Setting { patches, course }
}

/// Plays stories of ascending seeds on all cores, while `more` says so of the number of stories begun and the time
/// simulated; what they came to.
fn play_all(setting: Setting, first: u64, more: impl Fn(u64, Duration) -> bool + Sync) -> Tally {
    play_each(setting, first, more, |_, _| ())
}

/// The same; `each` is told of every story.
fn play_each(
    setting: Setting,
    first: u64,
    more: impl Fn(u64, Duration) -> bool + Sync,
    each: impl Fn(u64, &Outcome) + Sync,
) -> Tally {
    let next = AtomicU64::new(first);
    let (whole, panicked) = (Mutex::new(Tally::new()), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..cores() {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if !more(seed - first, whole.lock().unwrap().simulated) {
                        break;
                    }
                    let outcome = catch_unwind(|| inquiry::play(setting, seed));
                    match outcome {
                        Ok(outcome) => {
                            each(seed, &outcome);
                            whole.lock().unwrap().add(&outcome.tally);
                        }
                        Err(_) => panicked.lock().unwrap().push(seed),
                    }
                }
            });
        }
    });
    let (whole, panicked) = (whole.into_inner().unwrap(), panicked.into_inner().unwrap());
    assert!(panicked.is_empty(), "stories that panicked: {panicked:?}");
    whole
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Prints what stories came to, which took the time since `begin`.
fn tell(whole: &Tally, begin: Instant) {
    let (took, cores) = (begin.elapsed().as_secs_f64(), cores());
    let rate = whole.simulated.as_secs_f64() / took / cores as f64;
    println!("{whole}\n{took:.0} s on {cores} cores: {rate:.0} simulated seconds a second and core");
    for (name, liars) in whole.most_frequent().into_iter().take(tally::NAMES_SHOWN) {
        println!("\n## {name}: LIES_SEED={}\n{}", liars.seed, liars.example);
    }
}

fn assert_no_lies(whole: &Tally) {
    let unargued: Vec<String> = whole
        .not_argued()
        .into_iter()
        .map(|(name, liars)| {
            format!("{name}: {} samples, worst {:.3} N, LIES_SEED={}", liars.samples, liars.worst_n, liars.seed)
        })
        .collect();
    assert!(
        unargued.is_empty(),
        "lies in {} of {} stories:\n{}",
        whole.lying_stories,
        whole.stories,
        unargued.join("\n")
    );
}

/// No argued lies beyond their budgets, and the force is there.
fn assert_argued_are_few(whole: &Tally) {
    let beyond = whole.beyond_budget();
    assert!(beyond.is_empty(), "argued lies beyond their budgets:\n{}", beyond.join("\n"));
    let share = whole.quiet_share_without_force();
    assert!(share < 0.01, "{share} of the fault-free time without a force");
}

/// The numbers of the stories from `first` on, by seed: lies, then those of [`Figures::NAMES`].
fn numbers_of(setting: Setting, first: u64, stories: u64) -> BTreeMap<u64, Vec<f64>> {
    let numbers = Mutex::new(BTreeMap::new());
    play_each(
        setting,
        first,
        |begun, _| begun < stories,
        |seed, outcome| {
            let mut line = vec![outcome.tally.lies as f64];
            line.extend(outcome.tally.figures.numbers());
            numbers.lock().unwrap().insert(seed, line);
        },
    );
    numbers.into_inner().unwrap()
}

fn in_lines(numbers: &BTreeMap<u64, Vec<f64>>) -> String {
    let line = |(seed, line): (&u64, &Vec<f64>)| {
        let line: Vec<String> = line.iter().map(|number| format!("{number:.4}")).collect();
        format!("{seed},{}\n", line.join(","))
    };
    let head = format!("seed,lies,{}\n", Figures::NAMES.join(","));
    head + &numbers.iter().map(line).collect::<String>()
}

#[test]
fn twenty_stories_come_to_the_numbers_that_are_committed() {
    if variable("LIES_SEED").is_some() {
        return;
    }
    let is = in_lines(&numbers_of(Setting::minutes(Patches::One), 0, COURSES_STORIES));
    if std::env::var_os("LIES_WRITE").is_some() {
        std::fs::write(COURSES, &is).unwrap();
    }
    let was = std::fs::read_to_string(COURSES).unwrap();
    let same = |(a, b): (&str, &str)| match (a.parse::<f64>(), b.parse::<f64>()) {
        (Ok(a), Ok(b)) => (a - b).abs() <= SAME * a.abs().max(1.0),
        _ => a == b,
    };
    let lines = |(was, is): (&str, &str)| was.split(',').zip(is.split(',')).all(same);
    let differ = was.lines().zip(is.lines()).filter(|pair| !lines(*pair));
    let differ: Vec<String> = differ.map(|(was, is)| format!("was {was}\nis  {is}")).collect();
    assert!(
        differ.is_empty() && was.lines().count() == is.lines().count(),
        "{}\nIf that is meant, run this test with LIES_WRITE=1 and commit courses.csv.",
        differ.join("\n")
    );
}

/// `LIES_OUT=FILE`, and `LIES_STORIES` of them from `LIES_SEED` on: what `tests/lies.py` compares of two builds.
#[test]
#[ignore = "writes a line a story: LIES_OUT=FILE cargo test --release -p taxel-engine --test lies -- --ignored a_line"]
fn a_line_a_story_for_the_differential_player() {
    let out = std::env::var_os("LIES_OUT").expect("LIES_OUT names the file");
    let (first, stories) = (variable("LIES_SEED").unwrap_or(0), variable("LIES_STORIES").unwrap_or(200));
    std::fs::write(out, in_lines(&numbers_of(setting(), first, stories))).unwrap();
}

/// So many stories, played and printed, that hold no lie but argued ones; nothing where one seed is asked for.
fn no_lies_in(stories: u64, setting: Setting) -> Option<Tally> {
    if variable("LIES_SEED").is_some() {
        return None;
    }
    let begin = Instant::now();
    let whole = play_all(setting, 0, |begun, _| begun < stories);
    tell(&whole, begin);
    assert_no_lies(&whole);
    Some(whole)
}

#[test]
fn five_hundred_stories_hold_no_lie_but_argued_ones() {
    let Some(whole) = no_lies_in(500, Setting::minutes(Patches::One)) else { return };
    assert_argued_are_few(&whole);
    let worse = whole.figures.beyond(&BOUNDS);
    assert!(worse.is_empty(), "worse than it was:\n{}", worse.join("\n"));
}

#[test]
fn a_hundred_stories_of_two_patches_hold_no_lie_but_argued_ones() {
    no_lies_in(100, Setting::minutes(Patches::Two));
}

#[test]
fn ten_half_hours_without_a_fault_hold_no_lie() {
    no_lies_in(10, Setting { patches: Patches::One, course: Course::HalfHour });
}

#[test]
#[ignore = "as long as it says: LIES_MINUTES=900 cargo test --release -p taxel-engine --test lies -- --ignored a_long"]
fn a_long_run_holds_no_lie_but_argued_ones() {
    let wanted = Duration::from_secs(60 * variable("LIES_MINUTES").unwrap_or(10_000));
    let begin = Instant::now();
    let whole = play_all(setting(), variable("LIES_SEED").unwrap_or(1_000_000), |_, simulated| simulated < wanted);
    tell(&whole, begin);
    assert_no_lies(&whole);
    assert_argued_are_few(&whole);
}

/// `LIES_SEED=n` tells the whole story of one seed; without it nothing is told.
#[test]
fn the_story_of_a_named_seed_holds_no_lie_but_argued_ones() {
    let Some(seed) = variable("LIES_SEED").filter(|_| variable("LIES_MINUTES").is_none()) else { return };
    let outcome = inquiry::play(setting(), seed);
    println!("{}\n\n{}", outcome.lines.join("\n"), outcome.tally);
    assert_no_lies(&outcome.tally);
}
