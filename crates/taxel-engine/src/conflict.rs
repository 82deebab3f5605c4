//! Plans that contradict themselves.

use taxel_skin::{BusIndex, Module};
use taxel_wire::CanId;

use crate::engine::routes::{Route, Routes, ids_of_board, ids_of_module};
use crate::plan::{PatchPlan, Plan};

/// A plan that contradicts itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Conflict {
    /// The patch whose configuration is to be mended.
    pub patch: String,
    /// What contradicts itself, in words.
    pub why: String,
}

/// What contradicts itself in a plan, all of it; an engine for such a plan would mistake one thing for another.
#[must_use]
pub fn conflicts(plan: &Plan) -> Vec<Conflict> {
    let mut found = Vec::new();
    for (i, a) in plan.patches.iter().enumerate() {
        for b in &plan.patches[i + 1..] {
            found.extend(conflicts_between(a, b));
        }
        for b in &plan.patches {
            found.extend(gauge_conflict(a, b));
        }
    }
    found
}

fn conflicts_between(a: &PatchPlan, b: &PatchPlan) -> Vec<Conflict> {
    if !a.devices.is_empty() || !b.devices.is_empty() {
        return identifier_conflict(a, b).into_iter().collect();
    }
    let (one, other) = (a.patch.name(), b.patch.name());
    let conflict = |why| Conflict { patch: other.to_owned(), why };
    let mut found = Vec::new();
    for (i, x) in a.patch.boards().iter().enumerate() {
        for (j, y) in b.patch.boards().iter().enumerate().filter(|(_, y)| (y.bus, y.address) == (x.bus, x.address)) {
            let board = x.address.get();
            let shared = x.modules.iter().filter(|(module, _)| y.modules.iter().any(|(other, _)| other == module));
            let twice = |module: &Module| {
                format!(
                    "module {module} of board {board} is in patch `{one}` and in patch `{other}`: expected in one only"
                )
            };
            found.extend(shared.map(|(module, _)| conflict(twice(module))));
            let settings = |plan: &PatchPlan, at: usize| plan.bring_up.get(at).map(|setup| setup.board);
            if settings(a, i) != settings(b, j) || a.period != b.period {
                found.push(conflict(format!(
                    "board {board} is configured by patch `{one}` and by patch `{other}` with other settings: expected the same \
                     period, type, no-load value and listen_only in both"
                )));
            }
        }
    }
    found
}

/// A frame of a skin board that a device is said to send, too.
fn identifier_conflict(a: &PatchPlan, b: &PatchPlan) -> Option<Conflict> {
    let (devices, boards) = if a.devices.is_empty() { (b, a) } else { (a, b) };
    if !boards.devices.is_empty() {
        return None; // devices may share frames: each number has one reader
    }
    let only_boards = Plan { buses: usize::from(u8::MAX) + 1, patches: vec![boards.clone()] };
    let routes = Routes::new(&only_boards);
    let sent =
        devices.devices.iter().zip(devices.patch.boards()).flat_map(|(device, at)| device.ids().map(|id| (at.bus, id)));
    let taken =
        |&(bus, id): &(BusIndex, CanId)| matches!(routes.of(bus, id), Route::Module { .. } | Route::Board { .. });
    let (_, id) = sent.into_iter().find(taken)?;
    let (patch, board_of) = (devices.patch.name().to_owned(), boards.patch.name());
    let why =
        format!("signals of patch `{patch}` have identifier {id}, with which a board of patch `{board_of}` sends");
    Some(Conflict { patch, why })
}

/// A frame of a gauge that a skin board sends, too.
fn gauge_conflict(gauged: &PatchPlan, with: &PatchPlan) -> Option<Conflict> {
    let gauge = gauged.gauge.as_ref().filter(|_| with.devices.is_empty())?;
    let CanId::Standard(id) = gauge.signal.id else { return None };
    let mut boards = with.patch.boards().iter().filter(|board| board.bus == gauge.bus);
    let board = boards.find(|board| {
        let mut modules = board.modules.iter().flat_map(|(module, _)| ids_of_module(board, *module));
        ids_of_board(board).contains(&id) || modules.any(|used| used == id)
    })?;
    let (patch, board_of, board) = (gauged.patch.name().to_owned(), with.patch.name(), board.address.get());
    let why = format!(
        "the gauge of patch `{patch}` has identifier {}, with which board {board} of patch `{board_of}` sends: expected one that no \
         board uses",
        gauge.signal.id
    );
    Some(Conflict { patch, why })
}
