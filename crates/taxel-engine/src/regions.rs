//! Which taxels form each module and each board of a patch, worked out once.

use std::ops::Range;
use std::sync::Arc;
use taxel_skin::{CountRange, ModuleKind, Patch};

/// The parts of a patch as ranges of taxel numbers; modules and boards follow each other without gaps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Regions {
    modules: Vec<Range<usize>>,
    kinds: Vec<ModuleKind>,
    boards: Vec<Range<usize>>,
    /// Modules of each board.
    board_modules: Vec<Range<usize>>,
    module_of: Arc<[u16]>,
    counts: CountRange,
}

impl Regions {
    /// The parts of `patch`.
    #[must_use]
    pub fn new(patch: &Patch) -> Self {
        let append = |range: &mut Range<usize>, by: Range<usize>| {
            *range = if range.start == range.end { by } else { range.start..by.end };
        };
        let boards = patch.boards().len();
        let (mut by_board, mut board_modules) = (vec![0..0; boards], vec![0..0; boards]);
        let mut modules = Vec::new();
        for (index, site) in patch.modules().iter().enumerate() {
            let first = usize::from(site.first_taxel);
            let range = first..first + site.kind.taxel_slots().len();
            append(&mut by_board[usize::from(site.board)], range.clone());
            append(&mut board_modules[usize::from(site.board)], index..index + 1);
            modules.push(range);
        }
        Self {
            modules,
            kinds: patch.modules().iter().map(|site| site.kind).collect(),
            boards: by_board,
            board_modules,
            module_of: patch.taxels().iter().map(|site| site.module).collect(),
            counts: patch.counts(),
        }
    }

    /// The taxels of each module.
    #[must_use]
    pub fn modules(&self) -> &[Range<usize>] {
        &self.modules
    }

    /// What the values of each module are.
    #[must_use]
    pub fn kinds(&self) -> &[ModuleKind] {
        &self.kinds
    }

    /// The taxels of each board.
    #[must_use]
    pub fn boards(&self) -> &[Range<usize>] {
        &self.boards
    }

    /// The modules of each board.
    #[must_use]
    pub fn board_modules(&self) -> &[Range<usize>] {
        &self.board_modules
    }

    /// The module of each taxel.
    #[must_use]
    pub const fn module_of(&self) -> &Arc<[u16]> {
        &self.module_of
    }

    /// The range of their raw counts.
    #[must_use]
    pub const fn counts(&self) -> CountRange {
        self.counts
    }

    /// How many taxels there are.
    #[must_use]
    pub fn taxels(&self) -> usize {
        self.module_of.len()
    }
}
