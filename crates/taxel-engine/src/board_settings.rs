//! How the boards of a patch are set, as far as their counts depend on it, and which of their modules belong to it. Boards
//! that are set in another way rest at the same count and pass for sound, while every count is worth more or less than the
//! models say; and with other modules, or boards in another order, the models are those of other taxels.
//!
//! Model sets keep it in words, a line a board, and lines are compared fact by fact. What a line does not tell is not known, and
//! nothing follows from it.

mod commands;
mod modules;
mod signals;

use taxel_skin::{Board, CountRange};
use taxel_wire::icub::{BoardConfig, TriangleConfig};

use self::commands::Commands;
use self::modules::in_words;
use self::signals::Signals;
use crate::intake::bring_up::BoardSetup;
use crate::intake::cells::DevicePlan;

/// Modules of a skin board.
const MODULES: usize = 16;

/// The line of a board: a device, a skin board that is configured so, or one that somebody else has set. `counts` is the range of
/// the patch's counts.
pub fn line(board: &Board, device: Option<&DevicePlan>, setup: Option<&BoardSetup>, counts: CountRange) -> String {
    let (address, modules) = (board.address.get(), in_words(&board.modules));
    match (device, setup) {
        (Some(device), _) => format!("device {address}: {}; modules {modules}", of_device(device, counts)),
        (None, Some(setup)) => format!("board {address}: {}; modules {modules}", of_setup(setup)),
        (None, None) => format!("board {address}: settings unknown; modules {modules}"),
    }
}

fn of_setup(setup: &BoardSetup) -> String {
    let BoardConfig { kind, period_ms, no_load } = setup.board;
    let triangle =
        |t: &TriangleConfig| format!("{}-{}: shift {} cdc_offset {:#06x}", t.first, t.last, t.shift, t.cdc_offset);
    let triangles = setup.triangles.iter().map(triangle).collect::<Vec<_>>().join(", ");
    format!("type {kind} period {period_ms} ms no_load {no_load}; {triangles}")
}

/// How a number of its frames becomes a count, `(number - low) >> shift`, where one line tells that of all its taxels; which number
/// is which taxel; and what it is sent.
fn of_device(device: &DevicePlan, counts: CountRange) -> String {
    let numbers = || device.frames.iter().flat_map(|spec| &spec.counts).map(|(_, field)| (field.low, field.shift));
    let same = numbers().next().filter(|first| numbers().all(|other| other == *first));
    let mut facts = vec![range(counts)];
    facts.extend(same.map(|(low, shift)| format!("numbers from {low}, lowest {shift} bits left out")));
    facts.extend(Signals::of(&device.frames).map(|signals| signals.to_string()));
    facts.extend(Commands::of(device).map(|commands| commands.to_string()));
    facts.join("; ")
}

/// What counts there are, and how many are a unit of the models.
fn range(counts: CountRange) -> String {
    format!("counts from 0 to {}, {} to a unit", counts.top(), counts.per_unit())
}

/// What a line tells of a board.
struct Told<'a> {
    of: &'a str,
    address: u8,
    /// What of it each fact is of, and the fact.
    facts: Vec<(About, String)>,
}

/// The module, if it is not of the whole board; and what of it.
type About = (Option<usize>, &'static str);

impl<'a> Told<'a> {
    /// Of a line; `None` if it is none of [`line()`].
    fn read(line: &'a str) -> Option<Self> {
        let (name, told) = line.split_once(": ")?;
        let (of, address) = name.split_once(' ').filter(|(of, _)| ["board", "device"].contains(of))?;
        let mut read = Self { of, address: address.parse().ok()?, facts: Vec::new() };
        if of == "board" {
            read.facts.push(((None, "counts"), range(CountRange::BYTE))); // a skin board sends bytes, however it is set
        }
        for part in told.split("; ") {
            read.take(part)?;
        }
        Some(read)
    }

    /// Takes a part of the line. The period is left out: no count depends on it. A no-load value alone moves all counts by as
    /// much, and a force is made of differences; but rest is told from a load by where the counts lie, so that a load that makes
    /// up for it passes for rest.
    fn take(&mut self, part: &str) -> Option<()> {
        let words: Vec<&str> = part.split(' ').collect();
        let what = match words[..] {
            ["type", kind, "period", _, "ms", "no_load", no_load] => {
                self.facts.push(((None, "type"), format!("type {kind}")));
                self.facts.push(((None, "no_load"), format!("no_load {no_load}")));
                return Some(());
            }
            ["settings", "unknown"] | [""] => return Some(()),
            ["counts", ..] => "counts",
            ["numbers", ..] => "numbers",
            ["signals", _] => "signals",
            ["commands", _, ..] | ["no", "commands"] => "commands",
            ["modules", _, ..] => "modules",
            _ => return self.take_triangles(part),
        };
        self.facts.push(((None, what), part.to_owned()));
        Some(())
    }

    /// Shift and offset of each module: those of the last command that counts for it.
    fn take_triangles(&mut self, part: &str) -> Option<()> {
        let mut of_modules = [None; MODULES];
        for triangle in part.split(", ") {
            let (modules, told) = triangle.split_once(": ")?;
            let (first, last) = modules.split_once('-')?;
            let (first, last): (usize, usize) = (first.parse().ok()?, last.parse().ok()?);
            of_modules.get_mut(first..=last)?.fill(Some(told.split_once(" cdc_offset ")?));
        }
        for (module, settings) in of_modules.into_iter().enumerate() {
            let Some((shift, offset)) = settings else { continue };
            self.facts.push(((Some(module), "shift"), shift.to_owned()));
            self.facts.push(((Some(module), "cdc_offset"), format!("cdc_offset {offset}")));
        }
        Some(())
    }

    fn name(&self) -> String {
        format!("{} {}", self.of, self.address)
    }

    /// The facts that have changed since, as far as both lines tell them: of what, then and now.
    fn changes<'b>(&'b self, now: &'b Self) -> impl Iterator<Item = (About, &'b str, &'b str)> {
        let is = |about: About| now.facts.iter().find(|(of, _)| *of == about).map(|(_, fact)| fact.as_str());
        let both = self.facts.iter().filter_map(move |(about, fact)| Some((*about, fact.as_str(), is(*about)?)));
        both.filter(|(_, then, is)| then != is)
    }

    /// Whether it is configured, so far as that is known.
    fn is_configured(&self) -> bool {
        self.facts.iter().any(|((_, what), _)| *what == "type")
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
    let mut all = known.flat_map(|(then, now)| then.changes(now).map(|change| (now.name(), change)));
    let (name, ((module, _), then, now)) = all.next()?;
    let place = module.map_or_else(|| name.clone(), |module| format!("module {module} of {name}"));
    let more = all.count();
    let more = if more == 0 { String::new() } else { format!(" (and {more} more)") };
    Some(format!("was gathered with {then} on {place}, where the configuration has {now}{more}"))
}

/// Why the boards are not in the order in which they were; `None` where they are, as far as all of them are known.
fn other_order(then: &[Option<Told<'_>>], now: &[Told<'_>]) -> Option<String> {
    let then: Vec<&Told<'_>> = then.iter().map(Option::as_ref).collect::<Option<_>>()?;
    let moved = |(place, board): (usize, &Told<'_>)| {
        let had = |at: usize| then.get(at).is_some_and(|then| then.address == board.address);
        !had(place) && (0..then.len()).any(had)
    };
    let moved = now.iter().enumerate().any(moved);
    if then.is_empty() || (then.len() == now.len() && !moved) {
        return None;
    }
    let list = |boards: &mut dyn Iterator<Item = &Told<'_>>| boards.map(Told::name).collect::<Vec<_>>().join(", ");
    let (then, now) = (list(&mut then.into_iter()), list(&mut now.iter()));
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
    let same_board = one.name() == other.name() && one.is_configured() == other.is_configured();
    same_board && one.changes(&other).next().is_none()
}

#[cfg(test)]
mod tests;
