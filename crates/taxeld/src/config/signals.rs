//! From the description of a skin's signals to devices, modules and the place of each taxel.

use std::collections::BTreeMap;
use std::time::Duration;

use taxel_engine::plan::{DevicePlan, DeviceSignal, ScanBegin, Sender};
use taxel_skin::{
    Board, BoardAddress, BusIndex, CountRange, Geometry, Module, ModuleKind, NormalsVerdict, Patch, SquareMillimetre,
    TaxelPose,
};
use taxel_wire::array::{CountField, FrameSpec};
use taxel_wire::bits::{BitField, ByteOrder, FrameMatch, Selector};
use taxel_wire::{CanId, Frame};

use super::number_words::OrderOfBytes;
use super::parts::PatchSection;
use super::signal_pages::{Cell, begins_once, counts_scans, pages};
use super::signal_parts::{
    ArraySection, FrameSection, MuxSection, NumberSection, PushSection, ScanWord, SignalsSection,
};

/// About so many taxels form a module, as on skin boards: a contact touches a few modules, and three taxels of one that
/// move together are a load.
const MODULE_TAXELS: usize = 12;
/// Most modules of a device, and most taxels of a module.
const MODULES_MAX: usize = 16;
const MODULE_TAXELS_MAX: usize = 255;
/// Most bits of a count; a longer number leaves out its lowest.
const COUNT_BITS: u32 = 16;
/// Most taxels of a patch: their numbers are of sixteen bits.
const TAXELS_MAX: usize = 14 * MODULES_MAX * MODULE_TAXELS_MAX;

/// A patch that is described by its signals.
pub struct Described {
    /// Devices as boards, groups of taxels as modules.
    pub patch: Patch,
    /// One per board.
    pub devices: Vec<DevicePlan>,
    /// Of a grid.
    pub geometry: Option<Geometry>,
    /// Area per taxel of a grid.
    pub area: Option<SquareMillimetre>,
}

/// What `[[patch.signals]]` and `[patch.array]` describe.
///
/// # Errors
/// In words, with the key, its value and what was expected.
pub fn describe(section: &PatchSection, bus: BusIndex) -> Result<Described, String> {
    let array = section.array.clone().unwrap_or_default();
    let mut places: BTreeMap<u8, Vec<Cell>> = BTreeMap::new();
    let mut total = 0;
    for (n, signals) in section.signals.iter().enumerate() {
        let name = if signals.name.is_empty() { format!("signals {}", n + 1) } else { signals.name.clone() };
        let named = |why: String| format!("{name}: {why}");
        let of_device = places.entry(signals.device).or_default();
        spread(signals, &name, of_device).map_err(named)?;
        total = total.max(of_device.len());
        if total > MODULES_MAX * MODULE_TAXELS_MAX {
            return Err(named(format!("device {} has more than {} taxels", signals.device, TAXELS_MAX / 14)));
        }
    }
    let range = numbers(&section.signals, array.numbers)?;
    let (mut boards, mut devices) = (Vec::new(), Vec::new());
    for (device, taxels) in places {
        let address = BoardAddress::new(device).map_err(|_| format!("device = {device}: expected 1 to 15"))?;
        boards.push(Board { bus, address, modules: modules(taxels.len(), array.columns) });
        devices.push(plan(device, &taxels, &array, range, section.listen_only)?);
    }
    let patch = Patch::new(&section.name, boards).map_err(|e| e.to_string())?.with_counts(range.counts);
    let grid = grid(&array, patch.taxels().len())?;
    let (geometry, area) = grid.map(|(geometry, area)| (Some(geometry), Some(area))).unwrap_or_default();
    Ok(Described { patch, devices, geometry, area })
}

/// What `[patch.push]` describes, with the grid of `[patch.array]`.
///
/// # Errors
/// In words, with the key, its value and what was expected.
pub fn pushed(section: &PatchSection, push: PushSection, bus: BusIndex) -> Result<Described, String> {
    let array = section.array.clone().unwrap_or_default();
    let (taxels, most) = (usize::from(push.taxels), MODULES_MAX * MODULE_TAXELS_MAX);
    if taxels == 0 || taxels > most {
        return Err(format!("push.taxels = {taxels}: expected 1 to {most}"));
    }
    let counts = CountRange::to(push.count_max)
        .ok_or_else(|| format!("push.count_max = {}: no range is left", push.count_max))?;
    let grid_alone =
        ArraySection { rows: array.rows, columns: array.columns, pitch_mm: array.pitch_mm, ..Default::default() };
    if array != grid_alone {
        return Err(
            "array: a patch whose scans are pushed has rows, columns and pitch_mm there and no other key".to_owned()
        );
    }
    let address = BoardAddress::new(1).map_err(|e| e.to_string())?;
    let board = Board { bus, address, modules: modules(taxels, array.columns) };
    let patch = Patch::new(&section.name, vec![board]).map_err(|e| e.to_string())?.with_counts(counts);
    let grid = grid(&array, taxels)?;
    let (geometry, area) = grid.map(|(geometry, area)| (Some(geometry), Some(area))).unwrap_or_default();
    Ok(Described { patch, devices: vec![DevicePlan::without_frames()], geometry, area })
}

/// Where each taxel of a section lies, in order.
fn spread(signals: &SignalsSection, name: &str, taxels: &mut Vec<Cell>) -> Result<(), String> {
    if !(4..=24).contains(&signals.length_bits) {
        return Err(format!("length_bits = {}: expected 4 to 24", signals.length_bits));
    }
    if signals.count == 0 || signals.frames == 0 {
        return Err("count and frames are at least 1".to_owned());
    }
    let order = byte_order(signals.byte_order);
    let first =
        BitField::new(signals.start_bit, signals.length_bits, order, signals.signed).map_err(|e| e.to_string())?;
    let stride = signals.stride_bits.unwrap_or(signals.length_bits);
    for frame in 0..u32::from(signals.frames) {
        let id = signals.id.saturating_add(frame.saturating_mul(signals.id_step));
        let mut mux = signals.mux.clone();
        if let Some(last) = mux.last_mut() {
            last.value = last.value.saturating_add(u64::from(frame) * u64::from(signals.mux_step));
        }
        let frames = FrameMatch { id: identifier(id, signals.extended)?, selectors: selectors(&mux)? };
        for n in 0..signals.count {
            let field = first.shifted(stride.saturating_mul(n)).map_err(|e| format!("taxel {n} of the frame: {e}"))?;
            taxels.push(Cell { frames: frames.clone(), field, name: name.to_owned() });
        }
    }
    Ok(())
}

/// Raw numbers and the counts that they become.
#[derive(Clone, Copy)]
struct Numbers {
    low: i64,
    shift: u8,
    counts: CountRange,
}

/// The range of all taxels of a patch, which is one.
fn numbers(signals: &[SignalsSection], given: Option<[i64; 2]>) -> Result<Numbers, String> {
    let own = |s: &SignalsSection| {
        let span = 1_i64 << s.length_bits.min(62);
        if s.signed { (-span / 2, span / 2 - 1) } else { (0, span - 1) }
    };
    let all = || signals.iter().map(own);
    let (least, most) = (all().map(|r| r.0).min().unwrap_or(0), all().map(|r| r.1).max().unwrap_or(0));
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
fn modules(taxels: usize, columns: Option<u16>) -> Vec<(Module, ModuleKind)> {
    let row = columns.map_or(1, usize::from).max(1);
    let rows = if row <= 2 * MODULE_TAXELS { (MODULE_TAXELS as f64 / row as f64).round().max(1.0) as usize } else { 1 };
    let wanted = if row <= 2 * MODULE_TAXELS { rows * row } else { MODULE_TAXELS };
    let size = wanted.max(taxels.div_ceil(MODULES_MAX)).clamp(1, MODULE_TAXELS_MAX);
    let of = |first: usize| ModuleKind::Cells(size.min(taxels - first) as u8);
    (0..).map(Module::from_nibble).zip((0..taxels).step_by(size).map(of)).collect()
}

fn plan(
    device: u8,
    taxels: &[Cell],
    array: &ArraySection,
    range: Numbers,
    listen_only: bool,
) -> Result<DevicePlan, String> {
    let Numbers { low, shift, counts } = range;
    let of = |taxel: &usize| (*taxel as u16, CountField { field: taxels[*taxel].field, low, shift, top: counts.top() });
    let pages = pages(taxels)?;
    let frames = pages
        .iter()
        .map(|page| FrameSpec { frames: page.frames.clone(), counts: page.taxels.iter().map(of).collect() });
    let scans = scans(array)?;
    match &scans {
        ScanBegin::Time => {}
        ScanBegin::Frame(sync) => begins_once(sync, &pages)?,
        ScanBegin::Counter(counter) => counts_scans(*counter, &pages, taxels)?,
    }
    let status = array.status.as_ref().map(|s| Ok::<_, String>((signal(&s.frame, &s.number)?, i128::from(s.good))));
    let temperature = array.temperature.as_ref();
    let temperature = temperature.map(|t| Ok::<_, String>((signal(&t.frame, &t.number)?, t.scale, t.offset)));
    let commands = array.command.iter().filter(|command| command.device == device);
    let commands = commands.map(|command| {
        let wrong = || format!("array.command: data = \"{}\": expected up to 8 bytes in hexadecimal", command.data);
        let frame = Frame::data(identifier(command.id, command.extended)?, &hex(&command.data).ok_or_else(wrong)?);
        Ok::<_, String>((Duration::from_millis(u64::from(command.after_ms)), frame.ok_or_else(wrong)?))
    });
    Ok(DevicePlan {
        frames: frames.collect(),
        scans,
        status: status.transpose()?,
        temperature: temperature.transpose()?,
        commands: commands.collect::<Result<_, _>>()?,
        sender: if listen_only { Sender::Elsewhere } else { Sender::Patch },
    })
}

fn scans(array: &ArraySection) -> Result<ScanBegin, String> {
    match (array.scan, &array.sync, &array.counter) {
        (ScanWord::Time, ..) => Ok(ScanBegin::Time),
        (ScanWord::Frame, Some(sync), _) => Ok(ScanBegin::Frame(frame_match(sync)?)),
        (ScanWord::Frame, None, _) => Err("array.scan = \"frame\" needs array.sync, the frame".to_owned()),
        (ScanWord::Counter, _, Some(counter)) => Ok(ScanBegin::Counter(number(counter)?)),
        (ScanWord::Counter, _, None) => Err("array.scan = \"counter\" needs array.counter, its place".to_owned()),
    }
}

/// Positions and areas of a grid: the first taxel is the origin, columns go along x, rows along y, normals along z.
fn grid(array: &ArraySection, taxels: usize) -> Result<Option<(Geometry, SquareMillimetre)>, String> {
    let (rows, columns, pitch_mm) = match (array.rows, array.columns, array.pitch_mm) {
        (None, None, None) => return Ok(None),
        (Some(rows), Some(columns), Some(pitch_mm)) => (rows, columns, pitch_mm),
        _ => return Err("array: a grid needs rows, columns and pitch_mm".to_owned()),
    };
    if usize::from(rows) * usize::from(columns) != taxels {
        return Err(format!("array: {rows} rows of {columns} columns for {taxels} taxels: expected as many"));
    }
    if !(0.1..=100.0).contains(&pitch_mm) {
        return Err(format!("array.pitch_mm = {pitch_mm}: expected 0.1 to 100"));
    }
    let pose = |taxel: usize| {
        let (row, column) = (taxel / usize::from(columns), taxel % usize::from(columns));
        let position = [column, row].map(|n| n as f64 * pitch_mm * 1e-3);
        TaxelPose { position: [position[0], position[1], 0.0], normal: [0.0, 0.0, 1.0] }
    };
    let mut geometry = Geometry::from_poses((0..taxels).map(|taxel| Some(pose(taxel))).collect());
    // Equal normals are a placeholder in a file of positions; here somebody says that the grid is flat.
    geometry.normals = NormalsVerdict::Usable;
    geometry.remarks.clear();
    Ok(Some((geometry, SquareMillimetre(pitch_mm * pitch_mm))))
}

fn signal(frame: &FrameSection, place: &NumberSection) -> Result<DeviceSignal, String> {
    Ok(DeviceSignal { frames: frame_match(frame)?, field: number(place)? })
}

fn frame_match(frame: &FrameSection) -> Result<FrameMatch, String> {
    Ok(FrameMatch { id: identifier(frame.id, frame.extended)?, selectors: selectors(&frame.mux)? })
}

fn number(place: &NumberSection) -> Result<BitField, String> {
    let order = byte_order(place.byte_order);
    BitField::new(place.start_bit, place.length_bits, order, place.signed).map_err(|e| e.to_string())
}

fn selectors(mux: &[MuxSection]) -> Result<Vec<Selector>, String> {
    let selector = |mux: &MuxSection| {
        let order = byte_order(mux.byte_order);
        let field = BitField::new(mux.start_bit, mux.length_bits, order, false).map_err(|e| format!("mux: {e}"))?;
        let runs = mux.also.iter().map(|[first, last]| (i128::from(*first), i128::from(*last)));
        let values = joined(std::iter::once((mux.value.into(), mux.value.into())).chain(runs).collect());
        match values.iter().find(|(first, last)| first > last || *last > field.range().1) {
            Some((first, last)) if first > last => Err(format!("mux: no number is from {first} to {last}")),
            Some((_, last)) => Err(format!("mux: value {last} does not fit into {} bits", mux.length_bits)),
            None => Ok(Selector { field, values }),
        }
    };
    let selectors: Vec<Selector> = mux.iter().map(selector).collect::<Result<_, String>>()?;
    let never = |selector: &&Selector| {
        let with = |other: &Selector| other.field == selector.field && other.excludes(selector);
        selectors.iter().any(with)
    };
    match selectors.iter().find(never) {
        Some(selector) => {
            let bit = selector.field.bits().next().unwrap_or_default();
            Err(format!("mux: no number of bit {bit} selects the frame: two that exclude each other are asked for"))
        }
        None => Ok(selectors),
    }
}

/// Runs in order, those that touch as one.
fn joined(mut runs: Vec<(i128, i128)>) -> Vec<(i128, i128)> {
    runs.sort_unstable();
    let mut joined: Vec<(i128, i128)> = Vec::new();
    for (first, last) in runs {
        match joined.last_mut().filter(|run| first <= run.1 + 1 && first <= last) {
            Some(run) => run.1 = run.1.max(last),
            None => joined.push((first, last)),
        }
    }
    joined
}

/// A standard or an extended identifier.
pub fn identifier(id: u32, extended: bool) -> Result<CanId, String> {
    match u16::try_from(id) {
        _ if extended && id <= 0x1FFF_FFFF => Ok(CanId::Extended(id)),
        _ if extended => Err(format!("id {id:#x} has more than 29 bits")),
        Ok(id) if id <= 0x7FF => Ok(CanId::Standard(id)),
        _ => Err(format!("id {id:#x} has more than 11 bits: set extended = true")),
    }
}

fn byte_order(word: OrderOfBytes) -> ByteOrder {
    match word {
        OrderOfBytes::Little => ByteOrder::Little,
        OrderOfBytes::Big => ByteOrder::Big,
    }
}

/// Pairs of hexadecimal digits, spaces between them left out.
fn hex(text: &str) -> Option<Vec<u8>> {
    let digits: Vec<u8> =
        text.chars().filter(|c| *c != ' ').map(|c| c.to_digit(16).map(|d| d as u8)).collect::<Option<_>>()?;
    digits.len().is_multiple_of(2).then(|| digits.chunks(2).map(|pair| pair[0] << 4 | pair[1]).collect())
}

#[cfg(test)]
mod tests;
