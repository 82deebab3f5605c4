//! What was found, in words and as the beginning of a configuration.

use std::path::Path;

use taxel_skin::{BoardAddress, Module, ModuleKind, written_modules};

use super::survey::{Board, Survey};
use crate::setup::{self, BoardDraft, BoardValues, PatchDraft, USUAL};

/// The address of a hand's board.
const HAND: u8 = 14;

/// A text for people.
pub fn text(survey: &Survey) -> String {
    let seconds = survey.seconds();
    let mut lines = vec![format!("{} frames in {seconds:.1} s", survey.frames)];
    lines.extend(survey.notices.iter().map(|(what, count)| format!("the bus: {count} x {what}")));
    if survey.boards().next().is_none() {
        lines.push("no skin board was heard: boards send once they are configured, `taxeld run` does that".to_owned());
    }
    for (address, board) in survey.boards() {
        let numbers = written_modules(&triangles(board));
        let period = board.period_ms().map_or_else(String::new, |ms| format!(", every {ms:.1} ms"));
        lines.push(format!("board {address}: modules {numbers}{period}"));
        lines.extend(board.modules().map(|(number, module)| {
            let (scans, (least, most), halves) = (module.scans, module.range, module.orphans());
            format!("  module {number}: {scans} scans, counts {least} to {most}, {halves} halves without a partner")
        }));
    }
    for (id, other) in &survey.others {
        let lengths: Vec<String> = other.lengths.iter().map(u8::to_string).collect();
        let (frames, lengths) = (other.frames, lengths.join(", "));
        let (rate, last) = (frames as f64 / seconds.max(1e-3), &other.last);
        lines.push(format!("identifier {id}: {frames} frames, {rate:.1}/s, of {lengths} bytes, last {last:02x?}"));
    }
    lines.join("\n")
}

/// Its modules: which of them are none, nobody hears.
fn triangles(board: &Board) -> Vec<(Module, ModuleKind)> {
    board.modules().map(|(module, _)| (module, ModuleKind::Triangle)).collect()
}

/// The beginning of a configuration: what was heard, with marks at what cannot be.
pub fn beginning(survey: &Survey, interface: &str) -> String {
    let mut open = vec![
        "one patch of all boards: name it, and make a patch of each part that has a bag of its own".to_owned(),
        "geometry = \"FILE\" is missing, a position file; boards are then in its order".to_owned(),
    ];
    let period = survey.boards().filter_map(|(_, board)| board.period_ms()).reduce(f64::max);
    if period.is_none() {
        open.push("too few scans came to tell period_ms".to_owned());
    }
    if survey.boards().any(|(address, _)| address.get() == HAND) {
        open.push("a hand has fingertips and palm on board 14: modules = \"0-4 fingertip, 8-11 palm\"".to_owned());
    }
    let period_ms = period.map_or(50, |ms| ms.round().clamp(1.0, 209.0) as i64);
    let values = BoardValues { period_ms, board_type: 0, no_load: 240 };
    let board = |(address, board): (BoardAddress, &Board)| BoardDraft {
        address: address.get(),
        values,
        modules: vec![(USUAL, triangles(board))],
    };
    let draft = PatchDraft {
        name: "skin".to_owned(),
        bus: "skin".to_owned(),
        interface: Some(interface.to_owned()),
        boards: survey.boards().rev().map(board).collect(),
        listens: Some("CHECK: false lets the daemon configure the boards"),
        period_ms,
        open,
        ..PatchDraft::default()
    };
    setup::text("Begun by `taxeld scan` with what was heard on the bus.", &[draft], Path::new(""))
}
