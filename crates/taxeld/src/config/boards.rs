//! The boards of a patch, and how each is configured.

use taxel_engine::plan::BoardSetup;
use taxel_skin::{Board, BoardAddress, BusIndex, Module, parse_modules};
use taxel_wire::icub::{BoardConfig, TriangleConfig};

use super::file::{BusSource, Config};
use super::patch_section::{BoardSection, PatchSection};
use taxel_rig::Faults;

/// 15 is the address of all boards of a bus: what is sent to it configures each of them.
const EVERYONE: u8 = 15;

/// Boards with their modules, and how each is configured. Nothing where one of them is wrong, which is noted.
pub fn boards(section: &PatchSection, bus: BusIndex, faults: &mut Faults) -> Option<(Vec<Board>, Vec<BoardSetup>)> {
    let of_one_board = section.boards.chunk_by(|a, b| a.address == b.address);
    let mut first = 0;
    let found: Vec<_> = of_one_board
        .map(|entries| {
            first += entries.len();
            board(entries, first - entries.len(), (section, bus), faults)
        })
        .collect();
    found.into_iter().collect()
}

/// The board of entries with one address; `at` is the position of the first in the file.
fn board(
    entries: &[BoardSection],
    at: usize,
    (section, bus): (&PatchSection, BusIndex),
    faults: &mut Faults,
) -> Option<(Board, BoardSetup)> {
    let head = entries.first()?;
    let key = format!("boards[{at}].address");
    let address = faults.take(&key, BoardAddress::new(head.address));
    faults.require(
        &key,
        head.address != EVERYONE || section.listen_only,
        || ": a command to 15 goes to all boards of the bus: set listen_only = true",
    );
    let (mut all, mut triangles) = (Vec::new(), Vec::new());
    for (position, entry) in entries.iter().enumerate().map(|(n, entry)| (at + n, entry)) {
        let key = format!("boards[{position}].modules");
        let why = |why| format!("board {}: {why}", entry.address);
        // A port has all boards of its part, in its order, also those of which the patch has nothing.
        let is_none = section.port.is_some() && entry.modules.is_empty();
        let listed =
            if is_none { Vec::new() } else { faults.take(&key, parse_modules(&entry.modules).map_err(why))? };
        if let Some((module, _)) = listed.iter().find(|(module, _)| all.iter().any(|(other, _)| other == module)) {
            faults.note(&key, format!("board {}: module {module} is there twice", entry.address));
        }
        let is_same = (entry.board_type, entry.no_load) == (head.board_type, head.no_load);
        faults.require(&format!("boards[{position}]"), is_same, || {
            format!(": board {}: board_type and no_load are of the whole board: expected one", entry.address)
        });
        let numbers: Vec<Module> = listed.iter().map(|(module, _)| *module).collect();
        triangles.extend(runs(&numbers).map(|(first, last)| {
            let (shift, cdc_offset) = (entry.shift.unwrap_or(2), entry.cdc_offset.unwrap_or(0x2200));
            TriangleConfig { first, last, shift, enabled: true, cdc_offset }
        }));
        all.extend(listed);
    }
    all.sort_by_key(|(module, _)| module.get());
    let board =
        BoardConfig { kind: head.board_type, period_ms: section.period_ms as u8, no_load: head.no_load.unwrap_or(240) };
    Some((Board { bus, address: address?, modules: all }, BoardSetup { board, triangles }))
}

/// First and last of each run of consecutive modules.
fn runs(modules: &[Module]) -> impl Iterator<Item = (Module, Module)> {
    let runs = modules.chunk_by(|a, b| a.get() + 1 == b.get());
    runs.filter_map(|run| Some((*run.first()?, *run.last()?)))
}
/// The position of a bus.
pub fn bus_index(config: &Config, key: &str, name: &str, faults: &mut Faults) -> Option<BusIndex> {
    let position = config.bus.iter().position(|bus| bus.name == name);
    if position.is_none() {
        let written = config.bus.iter().filter(|bus| bus.source != BusSource::Line);
        let names = written.map(|b| b.name.as_str()).collect::<Vec<_>>().join(", ");
        faults.note(key, format!("bus `{name}` is not among the buses: {names}"));
    }
    position.and_then(|position| u8::try_from(position).ok()).map(BusIndex)
}
