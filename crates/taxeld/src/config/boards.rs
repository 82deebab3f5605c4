//! The boards of a patch, how each is configured, and where in the file two patches contradict each other.

use taxel_engine::conflict::Conflict;
use taxel_engine::plan::BoardSetup;
use taxel_skin::{Board, BoardAddress, BusIndex, Module};
use taxel_wire::icub::{BoardConfig, TriangleConfig};

use super::file::Config;
use super::modules::{KindWord, modules};
use super::parts::BoardSection;

/// A board and its modules.
///
/// # Errors
/// What is wrong and what was expected.
pub fn board(section: &BoardSection, bus: BusIndex) -> Result<Board, String> {
    let address = BoardAddress::new(section.address).map_err(|e| e.to_string())?;
    let modules = modules(section.modules.get_ref(), section.kind).map_err(|e| format!("board {address}: {e}"))?;
    Ok(Board { bus, address, modules })
}

/// How a board is configured.
///
/// # Errors
/// What is wrong and what was expected.
pub fn setup(section: &BoardSection, period_ms: u8) -> Result<BoardSetup, String> {
    let board = BoardConfig { kind: section.board_type, period_ms, no_load: section.no_load };
    let mut triangles = Vec::new();
    let numbers = |text: &str| modules(text, KindWord::Twelve).map(|list| list.into_iter().map(|(m, _)| m).collect());
    let enabled: Vec<Module> = modules(section.modules.get_ref(), section.kind)?.into_iter().map(|(m, _)| m).collect();
    for (first, last) in runs(&enabled) {
        let (shift, cdc_offset) = (section.shift, section.cdc_offset);
        triangles.push(TriangleConfig { first, last, shift, enabled: true, cdc_offset });
    }
    for exception in &section.exception {
        let list: Vec<Module> = numbers(&exception.modules)?;
        if let Some(stranger) = list.iter().find(|m| !enabled.contains(m)) {
            return Err(format!("board {}: exception for module {stranger}, which is not enabled", section.address));
        }
        for (first, last) in runs(&list) {
            let (shift, cdc_offset) = (exception.shift, exception.cdc_offset);
            triangles.push(TriangleConfig { first, last, shift, enabled: true, cdc_offset });
        }
    }
    Ok(BoardSetup { board, triangles })
}

/// First and last of each run of consecutive modules.
fn runs(modules: &[Module]) -> Vec<(Module, Module)> {
    modules.chunk_by(|a, b| a.get() + 1 == b.get()).filter_map(|run| Some((*run.first()?, *run.last()?))).collect()
}

/// A contradiction, and the lines of the file whose boards contradict each other.
#[must_use]
pub fn placed(config: &Config, conflict: &Conflict) -> String {
    let (patches, address): (&[String], u8) = match conflict {
        Conflict::SharedModule { patches, board, .. } | Conflict::SharedBoard { patches, board } => (patches, *board),
        Conflict::GaugeOnBoard { board_of, board, .. } => (std::slice::from_ref(board_of), *board),
        Conflict::DeviceOnBoard { .. } => return conflict.to_string(),
    };
    let sections = config.patch.iter().filter(|patch| patches.contains(&patch.name));
    let boards = sections.flat_map(|patch| patch.board.iter().filter(|board| board.address == address));
    let lines: Vec<String> = boards.map(|board| board.line).filter(|line| *line > 0).map(|l| l.to_string()).collect();
    match lines.len() {
        0 => conflict.to_string(),
        1 => format!("{conflict} (line {})", lines[0]),
        _ => format!("{conflict} (lines {})", lines.join(" and ")),
    }
}

/// The key that a contradiction is to be mended at.
#[must_use]
pub fn key_of(config: &Config, conflict: &Conflict) -> String {
    let position = |name: &String| config.patch.iter().position(|patch| patch.name == *name);
    let (patch, below) = match conflict {
        Conflict::SharedModule { patches: [_, patch], board, .. }
        | Conflict::SharedBoard { patches: [_, patch], board } => {
            let section = config.patch.iter().find(|section| section.name == *patch);
            let board = section.and_then(|section| section.board.iter().position(|b| b.address == *board));
            (patch, board.map_or_else(String::new, |board| format!(".board[{board}]")))
        }
        Conflict::GaugeOnBoard { patch, .. } => (patch, ".gauge.id".to_owned()),
        Conflict::DeviceOnBoard { patch, .. } => (patch, String::new()),
    };
    position(patch).map_or_else(String::new, |position| format!("patch[{position}]{below}"))
}
