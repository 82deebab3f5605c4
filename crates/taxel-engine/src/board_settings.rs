//! How the boards of a patch are set, as far as their counts depend on it, and which of their modules belong to it. Boards
//! that are set in another way rest at the same count and pass for sound, while every count is worth more or less than the
//! models say; and with other modules, or boards in another order, the models are those of other taxels.
//!
//! Model sets keep it in words, a line a board, `board 13: type 0; shift 0-15 = 2; ...`. Lines are compared fact by fact, and facts
//! are known by their first word. What a line does not tell is not known, and nothing follows from it.

mod commands;
mod modules;
mod signals;

use taxel_skin::{Board, CountRange, Module};
use taxel_wire::icub::TriangleConfig;

use self::commands::commands;
use self::modules::in_words;
use self::signals::signals;
use crate::intake::bring_up::BoardSetup;
use crate::intake::cells::DevicePlan;

/// The line of a board: a device, a skin board that is configured so, or one that somebody else has set. `counts` is the range of
/// the patch's counts.
pub fn line(board: &Board, device: Option<&DevicePlan>, setup: Option<&BoardSetup>, counts: CountRange) -> String {
    let (what, mut facts) = match (device, setup) {
        (Some(device), _) => ("device", of_device(device)),
        (None, Some(setup)) => ("board", of_setup(setup, board)),
        (None, None) => ("board", Vec::new()),
    };
    facts.push(format!("counts 0 to {}, {} to a unit", counts.top(), counts.per_unit()));
    facts.push(format!("modules {}", in_words(&board.modules, modules::kind)));
    format!("{what} {}: {}", board.address.get(), facts.join("; "))
}

/// The period is left out: no count depends on it. A no-load value alone moves all counts by as much, and a force is made of
/// differences; but rest is told from a load by where the counts lie, so that a load that makes up for it passes for rest.
fn of_setup(setup: &BoardSetup, board: &Board) -> Vec<String> {
    let by_module = |what: &str, value: fn(&TriangleConfig) -> String| {
        // The last command that counts for a module.
        let of = |module: Module| setup.triangles.iter().rfind(|t| t.first <= module && module <= t.last).map(value);
        let told = board.modules.iter().filter(|(module, _)| of(*module).is_some()).copied();
        let words = in_words(&told.collect::<Vec<_>>(), |module, _| format!(" = {}", of(module).unwrap_or_default()));
        format!("{what} {words}")
    };
    vec![
        format!("type {}", setup.board.kind),
        format!("no_load {}", setup.board.no_load),
        by_module("shift", |triangle| triangle.shift.to_string()),
        by_module("cdc_offset", |triangle| format!("{:#06x}", triangle.cdc_offset)),
    ]
}

/// How a number of its frames becomes a count, `(number - low) >> shift`, where one line tells that of all its taxels; which number
/// is which taxel; and what it is sent.
fn of_device(device: &DevicePlan) -> Vec<String> {
    let numbers = || device.frames.iter().flat_map(|spec| &spec.counts).map(|(_, field)| (field.low, field.shift));
    let same = numbers().next().filter(|first| numbers().all(|other| other == *first));
    let numbers = same.map(|(low, shift)| format!("numbers from {low}, lowest {shift} bits left out"));
    [numbers, signals(&device.frames), commands(device)].into_iter().flatten().collect()
}

/// What a line tells of a board.
struct Told<'a> {
    name: &'a str,
    facts: Vec<&'a str>,
}

impl<'a> Told<'a> {
    /// Of a line; `None` if it is none of [`line()`].
    fn read(line: &'a str) -> Option<Self> {
        let (name, facts) = line.split_once(": ")?;
        Some(Self { name, facts: facts.split("; ").collect() })
    }

    /// The fact of this word.
    fn fact(&self, word: Option<&str>) -> Option<&'a str> {
        self.facts.iter().copied().find(|fact| fact.split(' ').next() == word)
    }

    /// The facts that have changed since, as far as both lines tell them: then and now.
    fn changes<'b>(&'b self, now: &'b Self) -> impl Iterator<Item = (&'b str, &'b str)> {
        let both = self.facts.iter().filter_map(|then| Some((*then, now.fact(then.split(' ').next())?)));
        both.filter(|(then, now)| then != now)
    }
}

/// Why what was gathered with boards of these lines says nothing of boards that are as they are `now`, in words that go
/// on from what was gathered; `None` where they are the same as far as is known. Boards are compared by their place: in
/// the order of the boards taxels have their numbers. One whose address no board had before has new electronics, on the same
/// pads.
pub fn difference(lines: &[String], now: &[String]) -> Option<String> {
    let then: Vec<Option<Told<'_>>> = lines.iter().map(|line| Told::read(line)).collect();
    let now: Vec<Told<'_>> = now.iter().filter_map(|line| Told::read(line)).collect();
    if let Some(why) = other_order(&then, &now) {
        return Some(why);
    }
    let known = then.iter().zip(&now).filter_map(|(then, now)| Some((then.as_ref()?, now)));
    let mut all = known.flat_map(|(then, now)| then.changes(now).map(|change| (now.name, change)));
    let (name, (then, now)) = all.next()?;
    let more = all.count();
    let more = if more == 0 { String::new() } else { format!(" (and {more} more)") };
    Some(format!("was gathered with {then} on {name}, where the configuration has {now}{more}"))
}

/// Why the boards are not in the order in which they were; `None` where they are, as far as all of them are known.
fn other_order(then: &[Option<Told<'_>>], now: &[Told<'_>]) -> Option<String> {
    let then: Vec<&str> = then.iter().map(|told| Some(told.as_ref()?.name)).collect::<Option<_>>()?;
    let now: Vec<&str> = now.iter().map(|told| told.name).collect();
    let mut pairs = now.iter().zip(&then);
    let moved = pairs.any(|(now, before)| now != before && then.contains(now));
    if then.is_empty() || (then.len() == now.len() && !moved) {
        return None;
    }
    let (then, now) = (then.join(", "), now.join(", "));
    Some(format!("was gathered with {then} in this order, where the configuration has {now}"))
}

/// What two sets of lines differ in, of each its own, so that the counts of both are not to be fitted together.
pub fn differ_in(lines: &[String], others: &[String]) -> Option<(String, String)> {
    if lines.len() != others.len() {
        return Some((lines.join("; "), others.join("; ")));
    }
    let mut pairs = lines.iter().zip(others);
    pairs.find(|(a, b)| !mean_the_same(a, b)).map(|(a, b)| (a.clone(), b.clone()))
}

fn mean_the_same(a: &str, b: &str) -> bool {
    let (Some(one), Some(other)) = (Told::read(a), Told::read(b)) else { return a == b };
    let is_configured = |told: &Told<'_>| told.fact(Some("type")).is_some();
    one.name == other.name && is_configured(&one) == is_configured(&other) && one.changes(&other).next().is_none()
}

#[cfg(test)]
mod tests;
