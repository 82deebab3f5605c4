//! How the boards of a patch are set, as far as their counts depend on it, and which of their modules belong to it. Boards
//! that are set in another way rest at the same count and pass for sound, while every count is worth more or less than the
//! models say; and with other modules, or boards in another order, the models are those of other taxels.
//!
//! Model sets keep it in words, a line a board, `board 13: type 0; shift 0-15 = 2; ...`. Lines are compared fact by fact, and facts
//! are known by their first word. What a line does not tell is not known, and nothing follows from it.

use taxel_skin::{Board, CountRange, Module, ModuleKind};
use taxel_wire::icub::TriangleConfig;

use crate::intake::bring_up::BoardSetup;
use crate::intake::cells::{DevicePlan, Sender};

/// The line of a board: a device, a skin board that is configured so, or one that somebody else has set. `counts` is the range of
/// the patch's counts.
pub fn line(board: &Board, device: Option<&DevicePlan>, setup: Option<&BoardSetup>, counts: CountRange) -> String {
    let (what, mut facts) = match (device, setup) {
        (Some(device), _) => ("device", of_device(device)),
        (None, Some(setup)) => ("board", of_setup(setup, board)),
        (None, None) => ("board", Vec::new()),
    };
    facts.push(format!("counts 0 to {}, {} to a unit", counts.top(), counts.per_unit()));
    facts.push(format!("modules {}", in_words(&board.modules, kind)));
    format!("{what} {}: {}", board.address.get(), facts.join("; "))
}

/// The period is left out: no count depends on it. A no-load value alone moves all counts by as much, and a force is made of
/// differences; but an unloaded skin is told from a load by where the counts lie, so that a load that makes up for it passes for rest.
fn of_setup(setup: &BoardSetup, board: &Board) -> Vec<String> {
    let by_module = |what: &str, value: fn(&TriangleConfig) -> String| {
        // The last command that counts for a module.
        let of = |module: Module| setup.triangles.iter().rfind(|t| t.first <= module && module <= t.last).map(value);
        let known = board.modules.iter().filter(|(module, _)| of(*module).is_some()).copied();
        let words = in_words(&known.collect::<Vec<_>>(), |module, _| format!(" = {}", of(module).unwrap_or_default()));
        format!("{what} {words}")
    };
    vec![
        format!("type {}", setup.board.kind),
        format!("no_load {}", setup.board.no_load),
        by_module("shift", |triangle| triangle.shift.to_string()),
        by_module("cdc_offset", |triangle| format!("{:#06x}", triangle.cdc_offset)),
    ]
}

/// How a number of its frames becomes a count, `(number - low) >> shift`, where one line tells that of all its taxels; a sum over
/// which number is which taxel, and one over what it is sent, which may set a gain or a range. Nothing at rest would tell either.
fn of_device(device: &DevicePlan) -> Vec<String> {
    let fields = || device.frames.iter().flat_map(|spec| spec.counts.iter().map(move |count| (&spec.frames, count)));
    let scale = || fields().map(|(_, (_, count))| (count.low, count.shift));
    let same = scale().next().filter(|first| scale().all(|other| other == *first));
    let numbers = same.map(|(low, shift)| format!("numbers from {low}, lowest {shift} bits left out"));
    let places: Vec<_> = fields().map(|(frames, (taxel, count))| (frames, taxel, count.field)).collect();
    let signals = (!places.is_empty()).then(|| format!("signals {:08x}", sum(&format!("{places:?}"))));
    let commands = match (device.commands.is_empty(), device.sender) {
        (true, Sender::Elsewhere) => None, // nobody knows
        (true, Sender::Patch) => Some("commands none".to_owned()),
        (false, _) => {
            let frames: Vec<_> = device.commands.iter().map(|(_, frame)| frame).collect(); // when they are sent does not count
            Some(format!("commands {:08x}", sum(&format!("{frames:?}"))))
        }
    };
    [numbers, signals, commands].into_iter().flatten().collect()
}

/// FNV-1a of 32 bits (Fowler, Noll, Vo): a short number for much text, against mistakes, not against forgers.
pub fn sum(text: &str) -> u32 {
    text.bytes().fold(0x811c_9dc5, |sum, byte| (sum ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

/// Modules, ascending, with a word for each; those in a row that have the same word are listed together.
fn in_words(modules: &[(Module, ModuleKind)], word: impl Fn(Module, ModuleKind) -> String) -> String {
    let words: Vec<(Module, String)> = modules.iter().map(|&(module, kind)| (module, word(module, kind))).collect();
    let runs = words.chunk_by(|a, b| a.0.get() + 1 == b.0.get() && a.1 == b.1);
    let in_words = runs.map(|run| match run {
        [(only, word)] => format!("{only}{word}"),
        [(first, word), .., (last, _)] => format!("{first}-{last}{word}"),
        [] => String::new(),
    });
    in_words.collect::<Vec<_>>().join(", ")
}

/// The word behind the numbers of modules of this kind, with the blank before it.
fn kind(_: Module, kind: ModuleKind) -> String {
    match kind {
        ModuleKind::Triangle => String::new(),
        ModuleKind::Fingertip => " fingertip".to_owned(),
        ModuleKind::PalmPad11 => " palm-pad11".to_owned(),
        ModuleKind::PalmPad7 => " palm-pad7".to_owned(),
        ModuleKind::Cells(taxels) => format!(" of {taxels} taxels"),
    }
}

/// What a line tells of a board.
struct Line<'a> {
    name: &'a str,
    facts: Vec<&'a str>,
}

impl<'a> Line<'a> {
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
    let then: Vec<Option<Line<'_>>> = lines.iter().map(|line| Line::read(line)).collect();
    let now: Vec<Line<'_>> = now.iter().filter_map(|line| Line::read(line)).collect();
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
fn other_order(then: &[Option<Line<'_>>], now: &[Line<'_>]) -> Option<String> {
    let then: Vec<&str> = then.iter().map(|line| Some(line.as_ref()?.name)).collect::<Option<_>>()?;
    let now: Vec<&str> = now.iter().map(|line| line.name).collect();
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
    let (Some(one), Some(other)) = (Line::read(a), Line::read(b)) else { return a == b };
    let is_configured = |line: &Line<'_>| line.fact(Some("type")).is_some();
    one.name == other.name && is_configured(&one) == is_configured(&other) && one.changes(&other).next().is_none()
}

#[cfg(test)]
mod tests;
