//! One story: everything that happens on one skin within some minutes, and the judgement of every sample.

use std::sync::Arc;
use std::time::Duration;

use taxel_engine::plan::Plan;
use taxel_engine::snapshot::{ForceState, PatchSnapshot, Undetected};
use taxel_skin::Time;

use crate::allowed::{CHANCE_N, FORGOTTEN, HEARD_LATE, MODULES_APART, ON_UNREAD, UNPLACED, is_allowed};
use crate::daemon::Daemon;
use crate::dice::Dice;
use crate::disk::Disk;
use crate::figures::{Judged, STEADY};
use crate::hands::Hands;
use crate::house::{Course, SLOT, Setting, house};
use crate::judge::{LIE_SIGMAS, Lie, Stated, judge};
use crate::kinds::{Kind, Kinds};
use crate::mishaps::Mishaps;
use crate::operator::Operator;
use crate::stage::Stage;
use crate::store::Store;
use crate::suspects::{AFTERMATH, RETARES, Wrong};
use crate::tally::{LITTLE_N, Tally, unseen_in_watch_n};
use crate::truth::{AGE_MAX, HEARD_MAX};

/// A skin without so large a share of its taxels has names of its own, too: insensitive ones are a twentieth.
const MANY_EXCLUDED: f64 = 0.2;

/// Lies of one direction without a longer pause than what ended may still show.
#[derive(Clone, Copy)]
struct Spell {
    too_little: bool,
    began: Time,
    last: Time,
    worst_n: f64,
}

impl Spell {
    /// This one with another lie, or a new one that begins with it.
    fn with(spell: Option<Self>, lie: Lie, now: Time) -> Self {
        let new = Self { too_little: lie.too_little, began: now, last: now, worst_n: lie.excess_n };
        // A lie that is greater than ever is another: something has come to it.
        let same = |spell: &Self| {
            spell.too_little == lie.too_little
                && now < spell.last + AFTERMATH
                && lie.excess_n <= spell.worst_n + CHANCE_N
        };
        let of = |spell: Self| Self { last: now, worst_n: spell.worst_n.max(lie.excess_n), ..spell };
        spell.filter(same).map_or(new, of)
    }
}

/// A sample that lied.
#[derive(Clone, Copy, Debug)]
pub struct LyingSample {
    pub time: Time,
    pub lie: Lie,
    /// What it is named after.
    pub from: Option<Kind>,
    pub argued: bool,
    /// What may have moved the counts since its zero was taken.
    pub since_zero: Kinds,
}

/// What a story came to.
pub struct Outcome {
    pub tally: Tally,
    /// Everything that happened, a line each.
    pub lines: Vec<String>,
    /// Every sample that lied, oldest first.
    pub lies: Vec<LyingSample>,
}

/// Plays the story of this seed, `without` what goes wrong of these kinds; those that are `cleared` name no lie.
pub fn play(setting: Setting, seed: u64, without: Kinds, cleared: Kinds) -> Outcome {
    let mut story = Story::new(setting, seed, without, cleared);
    let length = story.length;
    let end = story.stage.now() + length;
    while story.stage.now() < end {
        story.slot();
    }
    let (ever, lied) = (story.stage.suspects.ever, story.tally.lies > 0);
    story.tally.story(ever, lied);
    Outcome { lines: story.stage.last_lines(usize::MAX), tally: story.tally, lies: story.lies }
}

struct Story {
    seed: u64,
    length: Duration,
    stage: Stage,
    hands: Hands,
    operator: Operator,
    mishaps: Mishaps,
    tally: Tally,
    state: ForceState,
    /// The name of the lie that is being told.
    lying: Option<String>,
    spell: Option<Spell>,
    /// When the zero of the last sample was taken, by its label, and whether the first sample at it lied.
    zero: (Option<i64>, bool),
    lies: Vec<LyingSample>,
    frames: Vec<taxel_wire::TimedFrame>,
}

impl Story {
    fn new(setting: Setting, seed: u64, without: Kinds, cleared: Kinds) -> Self {
        let root = Dice::new(seed);
        let mut dice = root.of(1);
        let length = setting.course.length(&mut dice);
        let number = setting.patches.draw(&mut dice);
        let house = house(setting, number);
        let watched = root.of(6).below(house.parts.len());
        let mut world = house.world.clone();
        world.reseed(seed);
        let listens_only = dice.chance(0.5);
        let scenes = house.parts.iter().map(|part| part.scene(listens_only, &mut dice)).collect();
        let plan = Arc::new(Plan { buses: 1, patches: scenes });
        let scene = &plan.patches[watched];
        let has_positions = scene.geometry.is_some();
        let scene = format!("fill: {}, positions: {}", scene.outputs.fill, scene.geometry.is_some());
        let begins_loaded = dice.chance(0.12) && setting.course == Course::Minutes;
        let now = world.now();
        let sets = house.parts.iter().map(|part| Arc::clone(&part.set)).collect();
        let store = Store::with(Disk::with(sets, &plan.patches));
        let daemon = Daemon::new(plan, store, root.of(2), now);
        let mut stage = Stage::new(house, (watched, has_positions), world, daemon, cleared);
        stage.tell(format!(
            "seed {seed}: skin {number}, patch `{}`, {:.0} s, listens only: {listens_only}, {scene}",
            stage.part().name(),
            length.as_secs_f64()
        ));
        let mut hands = Hands::new(root.of(3), now, (setting.course, length));
        if begins_loaded {
            hands.begin_loaded(&mut stage);
        }
        stage.changes(Duration::ZERO);
        stage.note_truth();
        let mishaps = Mishaps::new(root.of(4), &stage, (setting.course, length), without);
        let operator = Operator::new(root.of(5), &stage, (setting.course, length), listens_only);
        Self {
            seed,
            length,
            stage,
            hands,
            operator,
            mishaps,
            tally: Tally::new(),
            state: ForceState::default(),
            lying: None,
            spell: None,
            zero: (None, false),
            lies: Vec::new(),
            frames: Vec::new(),
        }
    }

    /// 10 ms pass.
    fn slot(&mut self) {
        let stage = &mut self.stage;
        self.mishaps.act(stage);
        self.operator.act(stage, &mut self.mishaps);
        self.hands.act(stage, self.operator.keeps_free(stage.now()));
        let end = stage.now() + SLOT;
        self.frames.clear();
        stage.world.advance(end, &mut self.frames);
        stage.note_truth();
        stage.daemon.advance(end, &self.frames);
        for frame in std::mem::take(&mut stage.daemon.sent) {
            stage.send(&frame);
        }
        let (watched, published) = (stage.watched, std::mem::take(&mut stage.daemon.published));
        for (_, snapshot) in published.into_iter().filter(|(patch, _)| *patch == watched) {
            self.stage.follow_zero(&snapshot);
            self.judge(&snapshot);
        }
        self.stage.follow();
        let now = self.stage.now();
        let force = &self.stage.daemon.newest[watched].force;
        let there = matches!(force.state, ForceState::Ok | ForceState::Degraded);
        let without = self.stage.suspects.force_is(there, now);
        self.tally.time(SLOT, self.stage.suspects.present(now), without);
        self.tally.figures.time(SLOT, there);
        if without.is_some_and(Kinds::is_empty) {
            self.tally.gone(SLOT, self.seed, &self.stage.daemon.newest[watched].force.reasons);
        }
    }

    fn judge(&mut self, snapshot: &Arc<PatchSnapshot>) {
        let (stage, force) = (&mut self.stage, &snapshot.force);
        if force.state != self.state {
            self.state = force.state;
            stage.tell(format!("force {:?}: {}", force.state, force.why()));
        }
        let Some(interval) = Stated::of(force) else { return };
        let kinds = stage.suspects.present(stage.now());
        let truth = stage.truth.range(snapshot.time - AGE_MAX, snapshot.time);
        let steady = stage.truth.steady(stage.now(), STEADY);
        self.tally.figures.sample(&Judged { force, truth, steady, quiet: kinds.is_empty() }, &interval);
        let stated = interval.interval(LIE_SIGMAS);
        let lie = judge(stated, truth);
        let zero = snapshot.tare.as_ref().map(|tare| tare.wall_ns);
        if zero != self.zero.0 {
            self.zero = (zero, lie.is_some_and(|lie| lie.too_little));
        }
        let spell = lie.map(|lie| Spell::with(self.spell, lie, stage.now()));
        self.spell = spell.or(self.spell);
        let without_load_in_zero = (stated.0, stated.1 + stage.in_zero_n());
        let by_zero = stage.in_zero_n() > 0.0 && judge(without_load_in_zero, truth).is_none();
        let rested = by_zero && lie.is_some_and(|lie| stage.is_of_what_rested(lie.excess_n));
        let wrong = |spell: Spell| Wrong {
            time: snapshot.time,
            too_little: spell.too_little,
            of_zero: self.zero.1,
            by_zero,
            rested,
            since: spell.began,
        };
        let lie = lie.zip(spell.map(wrong)).map(|(lie, wrong)| (lie, name(stage, snapshot, stated, lie, truth, wrong)));
        self.tally.sample(kinds, lie.is_some());
        match lie {
            None => {
                if self.lying.take().is_some() {
                    let text = reading(snapshot, truth);
                    stage.tell(format!("no lie any more: {text}"));
                }
            }
            Some((lie, (from, name))) => {
                let argued = is_allowed(&name, lie.excess_n);
                let since_zero = stage.suspects.since_zero();
                self.lies.push(LyingSample { time: snapshot.time, lie, from, argued, since_zero });
                if self.lying.as_ref() != Some(&name) {
                    let text = reading(snapshot, truth);
                    stage.tell(format!("LIE `{name}`: {text}"));
                    self.lying = Some(name.clone());
                }
                let ok = force.state == ForceState::Ok;
                self.tally.lie(&name, self.seed, ok, lie, || {
                    let mut lines = stage.last_lines(8);
                    lines.push(format!("{:8.2} s  {}", stage.seconds(), reading(snapshot, truth)));
                    lines.join("\n")
                });
            }
        }
    }
}

/// What a lie may come from, and what it is called: that, what lay on the skin, and which way it went.
fn name(
    stage: &Stage,
    snapshot: &PatchSnapshot,
    stated: (f64, f64),
    lie: Lie,
    (least, greatest): (f64, f64),
    wrong: Wrong,
) -> (Option<Kind>, String) {
    let now = stage.now();
    let excluded = f64::from(snapshot.force.excluded) / snapshot.taxels.len() as f64;
    let apart = apart(stage, snapshot.time, stated);
    let forgotten = stage.daemon.has_forgotten() && lie.too_little;
    let mutes = stage.suspects.mutes(now).filter(|_| apart == HEARD_LATE);
    // Only what keeps modules from being heard makes them late.
    let apart = if apart == HEARD_LATE && mutes.is_none() { "" } else { apart };
    let from = mutes.or_else(|| stage.suspects.principal(stage.suspects.present(now), wrong));
    let root = match from {
        Some(kind) => kind.name(),
        None if excluded > MANY_EXCLUDED => "no fault, but many taxels excluded",
        None => "no fault",
    };
    let last_second = stage.truth.range(now - Duration::from_secs(1), now);
    let last_seconds = stage.truth.range(now - Duration::from_secs(8), now);
    let load = if stage.world.true_pressure().0 > 0.3 {
        "bag presses"
    } else if greatest <= 0.0 {
        if last_seconds.1 > 0.0 { "after a load" } else { "nothing lies there" }
    } else if greatest - least > 0.02 * greatest || last_second.1 - last_second.0 > 0.02 * greatest {
        "load changes"
    } else if greatest < 0.3 {
        "light load rests"
    } else {
        "load rests"
    };
    let way = match lie.too_little {
        true if snapshot.force.active == 0 => "reads nothing",
        true => "too little",
        false => "too much",
    };
    let little_n = match from {
        Some(Kind::ZeroWhileChanging) => unseen_in_watch_n(snapshot.taxels.len()),
        _ => LITTLE_N,
    };
    let size = if lie.excess_n < little_n { " by a little" } else { "" };
    let forgotten = if forgotten && RETARES.iter().any(|kind| kind.name() == root) { FORGOTTEN } else { "" };
    let unplaced = from.is_none() && lie.too_little && !stage.has_positions && snapshot.force.excluded > 0;
    let unplaced = if unplaced { UNPLACED } else { "" };
    let unread = if lie.too_little && bears_on_excluded_n(stage) >= lie.excess_n { ON_UNREAD } else { "" };
    (from, format!("{root}; {load}; {way}{size}{apart}{forgotten}{unplaced}{unread}"))
}

/// How much of the true force lies about taxels without a model, N.
fn bears_on_excluded_n(stage: &Stage) -> f64 {
    let excluded = stage.house.parts[stage.watched].excluded();
    stage.world.true_force_about(|taxel| excluded.contains(&taxel)).0
}

/// Whether a statement would be true if each module had been read at another moment of what a sample may be of, or of what
/// a module may be of that is not heard any more.
fn apart(stage: &Stage, time: Time, stated: (f64, f64)) -> &'static str {
    let true_within = |age: Duration| judge(stated, stage.truth.range_of_modules(time - age, time)).is_none();
    if true_within(AGE_MAX) {
        MODULES_APART
    } else if true_within(HEARD_MAX) {
        HEARD_LATE
    } else {
        ""
    }
}

fn reading(snapshot: &PatchSnapshot, (least, greatest): (f64, f64)) -> String {
    let force = &snapshot.force;
    let number = |newton: Option<taxel_skin::Newton>| newton.map_or(f64::NAN, |newton| newton.0);
    let at: Time = snapshot.time;
    format!(
        "{:?} {:.3} N, sigma {:.3} N, undetected {:.3} N, {} active, {} excluded, truth {least:.3} to {greatest:.3} N \
         (frame of {at:?}; {})",
        force.state,
        number(force.total),
        number(force.total_sigma),
        number(force.undetected.map(Undetected::at_most)),
        force.active,
        force.excluded,
        force.why()
    )
}
