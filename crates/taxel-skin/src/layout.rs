//! Which boards, modules and values make up a patch, and in which order its taxels are numbered.

use crate::count_range::CountRange;
use crate::ids::{BoardAddress, BusIndex, Module};
use thiserror::Error;

/// Every module sends twelve values, in a head frame of seven and a tail frame of five.
pub const VALUES_PER_MODULE: usize = 12;

/// Values of a board: rows of iCub's position files, and of the vector of a skin port.
pub const VALUES_PER_BOARD: usize = 16 * VALUES_PER_MODULE;

/// What the twelve values of a module are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ModuleKind {
    /// The standard triangle: ten taxels, thermal pads at values 6 and 10.
    #[default]
    Triangle,
    /// A fingertip: twelve taxels, no pad.
    Fingertip,
    /// A palm module with its one pad at value 11.
    PalmPad11,
    /// A palm module with its one pad at value 7.
    PalmPad7,
    /// So many taxels of a sensor that is described by its signals, no pad.
    Cells(u8),
}

/// The values of the largest module there can be.
const ALL_SLOTS: [u8; 255] = {
    let mut slots = [0; 255];
    let mut slot = 0;
    while slot < slots.len() {
        slots[slot] = slot as u8;
        slot += 1;
    }
    slots
};

impl ModuleKind {
    /// The values that are pressure taxels, ascending.
    #[must_use]
    pub const fn taxel_slots(self) -> &'static [u8] {
        match self {
            Self::Triangle => &[0, 1, 2, 3, 4, 5, 7, 8, 9, 11],
            Self::Fingertip => &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11],
            Self::PalmPad11 => &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10],
            Self::PalmPad7 => &[0, 1, 2, 3, 4, 5, 6, 8, 9, 10, 11],
            Self::Cells(taxels) => ALL_SLOTS.split_at(taxels as usize).0,
        }
    }

    /// The values that are thermal pads, ascending.
    #[must_use]
    pub const fn thermal_slots(self) -> &'static [u8] {
        match self {
            Self::Triangle => &[6, 10],
            Self::Fingertip | Self::Cells(_) => &[],
            Self::PalmPad11 => &[11],
            Self::PalmPad7 => &[7],
        }
    }
}

/// One skin board of a patch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Board {
    /// The bus it sits on.
    pub bus: BusIndex,
    /// Its CAN address.
    pub address: BoardAddress,
    /// Its enabled modules, ascending, each once.
    pub modules: Vec<(Module, ModuleKind)>,
}

/// A module as a patch sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ModuleSite {
    /// Position of its board in [`Patch::boards`].
    pub board: u8,
    /// Its number on the board.
    pub module: Module,
    /// What its values are.
    pub kind: ModuleKind,
    /// Patch index of its first taxel; the others follow.
    pub first_taxel: u16,
}

/// A pressure taxel as a patch sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TaxelSite {
    /// Position of its module in [`Patch::modules`].
    pub module: u16,
    /// Which of the module's twelve values it is.
    pub slot: u8,
}

/// Why boards cannot form a patch.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum LayoutError {
    /// A patch without modules has nothing to measure.
    #[error("patch `{patch}` has no enabled module")]
    Empty {
        /// The patch.
        patch: String,
    },
    /// The same board was listed twice.
    #[error("patch `{patch}` lists board {address} of bus {bus} twice")]
    DuplicateBoard {
        /// The patch.
        patch: String,
        /// The bus.
        bus: u8,
        /// The board.
        address: BoardAddress,
    },
    /// The same module was listed twice, or the modules are not ascending.
    #[error("patch `{patch}`, board {address}: module {module} must come once and in ascending order")]
    ModuleOrder {
        /// The patch.
        patch: String,
        /// The board.
        address: BoardAddress,
        /// The offending module.
        module: Module,
    },
}

/// A named group of taxels: boards in list order, modules ascending, values ascending without thermal pads.
///
/// This order numbers the taxels everywhere: in model sets, CSV columns and RPC messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Patch {
    name: String,
    boards: Vec<Board>,
    modules: Vec<ModuleSite>,
    taxels: Vec<TaxelSite>,
    counts: CountRange,
}

impl Patch {
    /// # Errors
    /// [`LayoutError`] if there is no module, or a board or module comes twice.
    pub fn new(name: impl Into<String>, boards: Vec<Board>) -> Result<Self, LayoutError> {
        let patch = name.into();
        let mut modules = Vec::new();
        let mut taxels = Vec::new();
        for (position, board) in boards.iter().enumerate() {
            let twice = boards[..position].iter().any(|b| (b.bus, b.address) == (board.bus, board.address));
            if twice {
                return Err(LayoutError::DuplicateBoard { patch, bus: board.bus.0, address: board.address });
            }
            for (n, &(module, kind)) in board.modules.iter().enumerate() {
                if n > 0 && board.modules[n - 1].0 >= module {
                    return Err(LayoutError::ModuleOrder { patch, address: board.address, module });
                }
                let index = modules.len() as u16;
                modules.push(ModuleSite { board: position as u8, module, kind, first_taxel: taxels.len() as u16 });
                taxels.extend(kind.taxel_slots().iter().map(|&slot| TaxelSite { module: index, slot }));
            }
        }
        if modules.is_empty() {
            return Err(LayoutError::Empty { patch });
        }
        Ok(Self { name: patch, boards, modules, taxels, counts: CountRange::BYTE })
    }

    /// The same taxels with counts of another range than eight bits.
    #[must_use]
    pub const fn with_counts(mut self, counts: CountRange) -> Self {
        self.counts = counts;
        self
    }

    /// The range of its raw counts.
    #[must_use]
    pub const fn counts(&self) -> CountRange {
        self.counts
    }

    /// The patch's name, for example `left_forearm`.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Boards in list order.
    #[must_use]
    pub fn boards(&self) -> &[Board] {
        &self.boards
    }

    /// Whether any of its boards is on this bus.
    #[must_use]
    pub fn is_on(&self, bus: BusIndex) -> bool {
        self.boards.iter().any(|board| board.bus == bus)
    }

    /// Modules in the order of their taxels.
    #[must_use]
    pub fn modules(&self) -> &[ModuleSite] {
        &self.modules
    }

    /// What the module at this position is called: `board 13 module 10`, as its board numbers it. Beyond the last, its position.
    #[must_use]
    pub fn module_name(&self, module: usize) -> String {
        let site =
            self.modules().get(module).and_then(|site| Some((self.boards().get(usize::from(site.board))?, site)));
        match site {
            Some((board, site)) => format!("board {} module {}", board.address, site.module),
            None => format!("module {module}"),
        }
    }

    /// Pressure taxels; the position is the [`crate::TaxelIndex`].
    #[must_use]
    pub fn taxels(&self) -> &[TaxelSite] {
        &self.taxels
    }

    /// The row of a taxel in iCub's position files: 192 x board position + 12 x module + value.
    #[must_use]
    pub fn port_index(&self, taxel: usize) -> Option<usize> {
        let site = self.taxels.get(taxel)?;
        let module = &self.modules[site.module as usize];
        Some(
            VALUES_PER_BOARD * module.board as usize
                + VALUES_PER_MODULE * module.module.get() as usize
                + site.slot as usize,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangles(range: std::ops::Range<u8>) -> Vec<(Module, ModuleKind)> {
        range.map(|m| (Module::from_nibble(m), ModuleKind::Triangle)).collect()
    }

    fn board(address: u8, modules: Vec<(Module, ModuleKind)>) -> Board {
        Board { bus: BusIndex(0), address: BoardAddress::new(address).unwrap(), modules }
    }

    #[test]
    fn the_papers_forearm_has_230_taxels_in_port_order() {
        let patch = Patch::new("left_forearm", vec![board(13, triangles(0..16)), board(12, triangles(0..7))]).unwrap();
        assert_eq!(patch.taxels().len(), 230);
        assert_eq!(patch.port_index(6), Some(7), "value 6 is a thermal pad");
        assert_eq!(patch.port_index(160), Some(192));
        assert_eq!(patch.port_index(230), None);
    }

    #[test]
    fn a_module_is_called_by_its_board_and_its_number_there() {
        let patch = Patch::new("p", vec![board(13, triangles(4..6)), board(12, triangles(0..7))]).unwrap();
        let names = [0, 1, 2, 9].map(|module| patch.module_name(module));
        assert_eq!(names, ["board 13 module 4", "board 13 module 5", "board 12 module 0", "module 9"]);
    }

    #[test]
    fn every_value_is_either_taxel_or_pad() {
        for kind in [ModuleKind::Triangle, ModuleKind::Fingertip, ModuleKind::PalmPad11, ModuleKind::PalmPad7] {
            let mut all = [kind.taxel_slots(), kind.thermal_slots()].concat();
            all.sort_unstable();
            assert_eq!(all, (0..12).collect::<Vec<u8>>());
        }
    }

    #[test]
    fn doubled_boards_and_modules_are_refused() {
        let twice = Patch::new("p", vec![board(13, triangles(0..2)), board(13, triangles(2..4))]);
        assert!(matches!(twice, Err(LayoutError::DuplicateBoard { .. })));
        let module = (Module::from_nibble(3), ModuleKind::Triangle);
        assert!(matches!(Patch::new("p", vec![board(13, vec![module, module])]), Err(LayoutError::ModuleOrder { .. })));
        assert!(matches!(Patch::new("p", vec![]), Err(LayoutError::Empty { .. })));
    }
}
