//! A skin that is no skin board's: from the signals of a DBC file, or the scans of a program, to devices, modules and the
//! place of each taxel.

use std::time::Duration;

use taxel_dbc::{DbcFile, Place};
use taxel_engine::plan::{DevicePlan, DeviceSignal, ScanBegin, Sender};
use taxel_skin::{
    Board, BoardAddress, BusIndex, CountRange, Geometry, Module, ModuleKind, Patch, SquareMillimetre, Time,
};
use taxel_wire::array::{CountField, FrameSpec};
use taxel_wire::bits::{BitField, FrameMatch};
use taxel_wire::candump::parse_line;
use taxel_wire::{Frame, FrameKind};

use super::patch_section::{ArraySection, GridSection, PatchSection, PushSection};

/// About so many taxels form a module, as on skin boards: a contact touches a few modules, and three taxels of one that
/// move together are a load.
const MODULE_TAXELS: usize = 12;
/// Most modules of a device, and most taxels of a module.
const MODULES_MAX: usize = 16;
const MODULE_TAXELS_MAX: usize = 255;
/// A command waits no longer than this.
const COMMAND_WAITS_MAX: Duration = Duration::from_secs(60);
/// Most bits of a count; a longer number leaves out its lowest.
const COUNT_BITS: u32 = 16;

/// A patch whose boards are devices and whose modules are groups of taxels, and a plan for each device.
type Described = (Patch, Vec<DevicePlan>);

/// What `[patch.array]` describes by its file.
///
/// # Errors
/// In words, with the message and the signal, or the key, its value and what was expected.
pub fn describe(
    (section, array): (&PatchSection, &ArraySection),
    file: &DbcFile,
    bus: BusIndex,
) -> Result<Described, String> {
    let mut taxels = Vec::new();
    for pattern in &array.taxels {
        taxels.extend(file.matching(pattern)?);
    }
    let range = numbers(&taxels, array.numbers)?;
    let devices: Vec<&[Place<'_>]> = taxels.chunk_by(|a, b| a.sender() == b.sender()).collect();
    let returns = |n: usize| devices[..n].iter().any(|earlier| earlier[0].sender() == devices[n][0].sender());
    if let Some(n) = (0..devices.len()).find(|n| returns(*n)) {
        let (taxel, sender) = (devices[n][0].name, devices[n][0].sender());
        return Err(format!(
            "{taxel}: taxels of {sender} are before it and others between: expected those of each sender one after the other"
        ));
    }
    let (mut boards, mut plans) = (Vec::new(), Vec::new());
    for (number, taxels) in (1_u8..).zip(devices) {
        let most = MODULES_MAX * MODULE_TAXELS_MAX;
        if taxels.len() > most {
            return Err(format!("{} taxels of {}: expected at most {most}", taxels.len(), taxels[0].sender()));
        }
        let address = BoardAddress::new(number).map_err(|_| "taxels of more than 15 senders: expected 1 to 15")?;
        boards.push(Board { bus, address, modules: modules(taxels.len(), section.grid) });
        plans.push(device(taxels, (array, file), range, section.listen_only)?);
    }
    let patch = Patch::new(&section.name, boards).map_err(|e| e.to_string())?.with_counts(range.counts);
    Ok((patch, plans))
}

/// What `push` describes.
///
/// # Errors
/// In words, with the key, its value and what was expected.
pub fn pushed(section: &PatchSection, push: PushSection, bus: BusIndex) -> Result<Described, String> {
    let (taxels, most) = (usize::from(push.taxels), MODULES_MAX * MODULE_TAXELS_MAX);
    if taxels == 0 || taxels > most {
        return Err(format!("push.taxels = {taxels}: expected 1 to {most}"));
    }
    let most = push.count_max.unwrap_or(255);
    let counts = CountRange::to(most).ok_or_else(|| format!("push.count_max = {most}: no range is left"))?;
    let address = BoardAddress::new(1).map_err(|e| e.to_string())?;
    let board = Board { bus, address, modules: modules(taxels, section.grid) };
    let patch = Patch::new(&section.name, vec![board]).map_err(|e| e.to_string())?.with_counts(counts);
    Ok((patch, vec![DevicePlan::without_frames()]))
}

/// Raw numbers and the counts that they become.
#[derive(Clone, Copy)]
struct Numbers {
    low: i64,
    shift: u8,
    counts: CountRange,
}

/// The range of all taxels of a patch, which is one.
fn numbers(taxels: &[Place<'_>], given: Option<[i64; 2]>) -> Result<Numbers, String> {
    if let Some(place) = taxels.iter().find(|place| !(4..=24).contains(&place.length_bits())) {
        return Err(format!("signal {}: a taxel of {} bits, expected 4 to 24", place.name, place.length_bits()));
    }
    let all = || taxels.iter().map(|place| place.field.range()); // of 24 bits at most
    let least = all().map(|range| range.0 as i64).min().unwrap_or(0);
    let most = all().map(|range| range.1 as i64).max().unwrap_or(0);
    let [low, high] = given.unwrap_or([least, most]);
    if low < least || high > most || low >= high {
        return Err(format!("array.numbers = [{low}, {high}]: expected two of {least} to {most}, the lower one first"));
    }
    let span = (high - low) as u64;
    let shift = (u64::BITS - span.leading_zeros()).saturating_sub(COUNT_BITS) as u8;
    let counts = CountRange::to((span >> shift) as u16).ok_or("array.numbers: no range is left")?;
    Ok(Numbers { low, shift, counts })
}

/// Groups of consecutive taxels, whole rows of a grid where these are short.
fn modules(taxels: usize, grid: Option<GridSection>) -> Vec<(Module, ModuleKind)> {
    let row = grid.map_or(1, |grid| usize::from(grid.columns)).max(1);
    let rows = (MODULE_TAXELS as f64 / row as f64).round().max(1.0) as usize;
    let wanted = if row <= 2 * MODULE_TAXELS { rows * row } else { MODULE_TAXELS };
    let size = wanted.max(taxels.div_ceil(MODULES_MAX)).clamp(1, MODULE_TAXELS_MAX);
    let of = |first: usize| ModuleKind::Cells(size.min(taxels - first) as u8);
    (0..).map(Module::from_nibble).zip((0..taxels).step_by(size).map(of)).collect()
}

fn device(
    taxels: &[Place<'_>],
    (array, file): (&ArraySection, &DbcFile),
    range: Numbers,
    listen_only: bool,
) -> Result<DevicePlan, String> {
    let Numbers { low, shift, counts } = range;
    let pages = pages(taxels)?;
    let count =
        |taxel: &usize| (*taxel as u16, CountField { field: taxels[*taxel].field, low, shift, top: counts.top() });
    let frames = pages
        .iter()
        .map(|(frames, taxels)| FrameSpec { frames: (*frames).clone(), counts: taxels.iter().map(count).collect() });
    let scans = match (&array.sync, &array.counter) {
        (None, None) => ScanBegin::Time,
        (Some(sync), None) => {
            let sync = file.one(sync)?.frames;
            // Else it would begin a scan in the middle of one.
            if pages.iter().any(|(frames, _)| !sync.excludes(frames) && !sync.is_within(frames)) {
                return Err(format!(
                    "array.sync: frames {} also come in the middle of a scan, so that none would be whole: expected a signal \
                     that is in the first of them alone",
                    sync.id
                ));
            }
            ScanBegin::Frame(sync)
        }
        (None, Some(counter)) => {
            let place = file.one(counter)?;
            if let Some(taxel) = taxels.iter().find(|taxel| !place.is_beside(taxel)) {
                let (counter, taxel) = (place.name, taxel.name);
                return Err(format!("signal {counter}: expected a counter of all taxels, and {taxel} has none"));
            }
            let counter = ("array.counter", place.field);
            pages.iter().try_for_each(|(frames, of)| no_overlap(frames, numbered(taxels, of).chain([counter])))?;
            ScanBegin::Counter(place.field)
        }
        (Some(_), Some(_)) => return Err("array.sync and array.counter are both there: expected one".to_owned()),
    };
    let status = array.status.as_ref().map(|text| status(text, file)).transpose()?;
    Ok(DevicePlan {
        frames: frames.collect(),
        scans,
        status,
        commands: array.commands.iter().map(|text| command(text)).collect::<Result<_, _>>()?,
        sender: if listen_only { Sender::Elsewhere } else { Sender::Patch },
    })
}

/// `Message.Signal`, or with the number for good `Message.Signal = 1`.
fn status(text: &str, file: &DbcFile) -> Result<(DeviceSignal, i128), String> {
    let (name, good) = text.split_once('=').unwrap_or((text, "0"));
    let wrong = |_| format!("array.status = \"{text}\": expected a number behind =, as in \"Bag.State = 1\"");
    let place = file.one(name.trim())?;
    let good: i64 = good.trim().parse().map_err(wrong)?;
    Ok((DeviceSignal { frames: place.frames, field: place.field }, i128::from(good)))
}

/// A frame and when it is sent after the beginning, as candump writes them: `(0.030) 123#01FF`.
fn command(text: &str) -> Result<(Duration, Frame), String> {
    let text = text.trim();
    let (after, frame) = text.strip_prefix('(').and_then(|rest| rest.split_once(')')).unwrap_or(("0.0", text));
    let line = format!("({after}) can {}", frame.trim());
    let line = parse_line(line.as_bytes()).ok().filter(|line| line.frame.kind == FrameKind::Data);
    let wrong = || {
        format!(
            "array.commands: \"{text}\": expected a frame as candump writes it, up to 8 bytes, with seconds in brackets before \
             it where it waits, as in \"123#01FF\" or \"(0.030) 18FF0010#02\""
        )
    };
    let line = line.filter(|line| line.time <= Time::default() + COMMAND_WAITS_MAX).ok_or_else(wrong)?;
    Ok((line.time.since(Time::default()), line.frame))
}

/// The frames that come once a scan, each with the positions of its taxels: one identifier, or one choice of its selectors.
type Pages<'a> = Vec<(&'a FrameMatch, Vec<usize>)>;

/// The pages of a device, in the order of their taxels.
///
/// # Errors
/// Two taxels that share some frames and not all: what makes up a scan is not known. Two taxels that share a bit.
fn pages<'a>(taxels: &'a [Place<'a>]) -> Result<Pages<'a>, String> {
    let mut pages: Pages<'_> = Vec::new();
    for (number, taxel) in taxels.iter().enumerate() {
        match pages.iter_mut().find(|(frames, _)| !frames.excludes(&taxel.frames)) {
            Some((frames, of)) if **frames == taxel.frames => of.push(number),
            Some((frames, of)) => {
                return Err(format!(
                    "signal {} and signal {} are together in some frames {} and not in others, so that no frame comes once a \
                     scan: expected the same selectors, or such as exclude each other",
                    taxels[of[0]].name, taxel.name, frames.id
                ));
            }
            None => pages.push((&taxel.frames, vec![number])),
        }
    }
    pages.iter().try_for_each(|(frames, of)| no_overlap(frames, numbered(taxels, of)))?;
    Ok(pages)
}

/// Names and fields of these taxels.
fn numbered<'a>(taxels: &'a [Place<'a>], of: &'a [usize]) -> impl Iterator<Item = (&'a str, BitField)> {
    of.iter().map(|taxel| (taxels[*taxel].name, taxels[*taxel].field))
}

/// No bit is part of two numbers, or of a number and what selects its frame.
fn no_overlap<'a>(frames: &FrameMatch, numbers: impl Iterator<Item = (&'a str, BitField)>) -> Result<(), String> {
    let mut used: Vec<Option<&str>> = vec![None; 512];
    let selectors = frames.selectors.iter().map(|selector| ("what selects the frame", selector.field));
    for (name, field) in selectors.chain(numbers) {
        for bit in field.bits() {
            if let Some(other) = used[usize::from(bit)].replace(name) {
                return Err(format!("{name}: bit {bit} of frame {} is also part of {other}", frames.id));
            }
        }
    }
    Ok(())
}

/// Positions and area of a grid.
///
/// # Errors
/// In words, with the key, its value and what was expected.
pub fn grid(grid: GridSection, taxels: usize) -> Result<(Geometry, SquareMillimetre), String> {
    let GridSection { rows, columns, pitch_mm } = grid;
    if usize::from(rows) * usize::from(columns) != taxels {
        return Err(format!("grid: {rows} rows of {columns} columns for {taxels} taxels: expected as many"));
    }
    if !(0.1..=100.0).contains(&pitch_mm) {
        return Err(format!("grid.pitch_mm = {pitch_mm}: expected 0.1 to 100"));
    }
    Ok((Geometry::grid(rows, columns, pitch_mm), SquareMillimetre(pitch_mm * pitch_mm)))
}

#[cfg(test)]
mod tests;
