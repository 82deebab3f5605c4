//! Plans that contradict themselves.

use taxel_skin::{Board, BusIndex, Module};
use taxel_wire::CanId;

use crate::engine::routes::{ids_of_board, ids_of_module};
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
            let boards = a.devices.iter().zip(a.patch.boards());
            let signals: Vec<_> = boards.flat_map(|(device, at)| device.ids().map(|id| (at.bus, id))).collect();
            found.extend(taken(a, "signals", &signals, b));
            let gauge = a.gauge.as_ref().map(|gauge| (gauge.bus, gauge.signal.id));
            found.extend(taken(a, "gauge", gauge.as_slice(), b));
        }
    }
    found
}

fn conflicts_between(a: &PatchPlan, b: &PatchPlan) -> Vec<Conflict> {
    if !a.devices.is_empty() || !b.devices.is_empty() {
        return Vec::new(); // no skin boards on both sides
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

/// An identifier of what is described of a patch with which a skin board sends, too. Devices may share frames: each number has one
/// reader.
fn taken(of: &PatchPlan, what: &str, ids: &[(BusIndex, CanId)], with: &PatchPlan) -> Option<Conflict> {
    let mut boards = with.patch.boards().iter().filter(|_| with.devices.is_empty());
    let sends = |board: &Board, (bus, id): (BusIndex, CanId)| {
        let modules = board.modules.iter().flat_map(|(module, _)| ids_of_module(board, *module));
        let mut own = ids_of_board(board).into_iter().chain(modules).map(CanId::Standard);
        bus == board.bus && own.any(|own| own == id)
    };
    let found = |board: &Board| Some((board.address.get(), ids.iter().find(|id| sends(board, **id))?.1));
    let (board, id) = boards.find_map(found)?;
    let (patch, board_of) = (of.patch.name().to_owned(), with.patch.name());
    let why = format!(
        "identifier {id} of the {what} of patch `{patch}` is that of board {board} of patch `{board_of}`: expected one that no board \
         uses"
    );
    Some(Conflict { patch, why })
}
