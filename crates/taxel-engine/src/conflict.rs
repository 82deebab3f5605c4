//! Plans that contradict themselves.

use std::fmt;

use taxel_skin::BusIndex;
use taxel_wire::CanId;

use crate::engine::routes::{Route, Routes};
use crate::plan::{PatchPlan, Plan};

/// A plan that contradicts itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Conflict {
    /// Two patches read the same module.
    SharedModule {
        /// The two patches.
        patches: [String; 2],
        /// The board's address.
        board: u8,
        /// The module's number.
        module: u8,
    },
    /// Two patches want other settings of one board.
    SharedBoard {
        /// The two patches.
        patches: [String; 2],
        /// The board's address.
        board: u8,
    },
    /// A device is said to send with an identifier that a skin board sends with.
    DeviceOnBoard {
        /// The patch of the device.
        patch: String,
        /// The identifier.
        id: CanId,
        /// The patch whose board it is.
        board_of: String,
    },
    /// The gauge has an identifier that a board sends with.
    GaugeOnBoard {
        /// The patch whose gauge it is.
        patch: String,
        /// The identifier.
        id: CanId,
        /// The patch whose board it is.
        board_of: String,
        /// The board's address.
        board: u8,
    },
}

impl fmt::Display for Conflict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SharedModule { patches: [a, b], board, module } => {
                write!(f, "module {module} of board {board} is in patch `{a}` and in patch `{b}`: expected in one only")
            }
            Self::SharedBoard { patches: [a, b], board } => {
                write!(
                    f,
                    "board {board} is configured by patch `{a}` and by patch `{b}` with other settings: expected \
                           the same period, type, no-load value and listen_only in both"
                )
            }
            Self::DeviceOnBoard { patch, id, board_of } => {
                write!(
                    f,
                    "signals of patch `{patch}` have identifier {id}, with which a board of patch `{board_of}` sends"
                )
            }
            Self::GaugeOnBoard { patch, id, board_of, board } => {
                write!(
                    f,
                    "the gauge of patch `{patch}` has identifier {id}, with which board {board} of patch \
                           `{board_of}` sends: expected one that no board uses"
                )
            }
        }
    }
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
    let patches = || [a.patch.name().to_owned(), b.patch.name().to_owned()];
    let mut found = Vec::new();
    for (i, x) in a.patch.boards().iter().enumerate() {
        for (j, y) in b.patch.boards().iter().enumerate().filter(|(_, y)| (y.bus, y.address) == (x.bus, x.address)) {
            let board = x.address.get();
            let shared = x.modules.iter().filter(|(module, _)| y.modules.iter().any(|(other, _)| other == module));
            found.extend(shared.map(|(module, _)| Conflict::SharedModule {
                patches: patches(),
                board,
                module: module.get(),
            }));
            let settings = |plan: &PatchPlan, at: usize| plan.bring_up.get(at).map(|setup| setup.board);
            if settings(a, i) != settings(b, j) || a.period != b.period {
                found.push(Conflict::SharedBoard { patches: patches(), board });
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
    Some(Conflict::DeviceOnBoard {
        patch: devices.patch.name().to_owned(),
        id,
        board_of: boards.patch.name().to_owned(),
    })
}

/// Skin frames of class 3, 4 and 6 carry board and module in their identifiers, replies the board alone.
fn gauge_conflict(gauged: &PatchPlan, with: &PatchPlan) -> Option<Conflict> {
    let gauge = gauged.gauge.as_ref().filter(|_| with.devices.is_empty())?;
    let CanId::Standard(id) = gauge.signal.id else { return None };
    let board = with.patch.boards().iter().find(|board| {
        let low = u16::from(board.address.get()) << 4;
        let modules = board.modules.iter().map(|(module, _)| low | u16::from(module.get()));
        let skin = modules.flat_map(|low| [0x400 | low, 0x300 | low, 0x600 | low]);
        let replies = [0x200 | low, 0x300 | low | 0xE, 0x300 | low | 0xF, 0x700 | low | 0x5];
        board.bus == gauge.bus && skin.chain(replies).any(|used| used == id)
    })?;
    Some(Conflict::GaugeOnBoard {
        patch: gauged.patch.name().to_owned(),
        id: gauge.signal.id,
        board_of: with.patch.name().to_owned(),
        board: board.address.get(),
    })
}
