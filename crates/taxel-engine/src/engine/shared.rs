//! Boards that serve several patches: what one of these learns of such a board, the others must know.

use crate::plan::{PatchPlan, Plan};

/// Which boards several patches have.
#[derive(Clone, Debug)]
pub struct SharedBoards {
    /// Per patch and board: the other patches that have it, and its position there.
    others: Vec<Vec<Vec<(usize, usize)>>>,
    /// Per patch: it and all patches that share a board with it, directly or through others, ascending.
    groups: Vec<Vec<usize>>,
}

impl SharedBoards {
    /// Those of a plan.
    #[must_use]
    pub fn new(plan: &Plan) -> Self {
        let patches = &plan.patches;
        let others: Vec<Vec<Vec<(usize, usize)>>> = (0..patches.len()).map(|patch| others_of(patches, patch)).collect();
        let groups = (0..patches.len()).map(|patch| group_of(&others, patch)).collect();
        Self { others, groups }
    }

    /// The other patches that have a board of a patch, each with the board's position there.
    #[must_use]
    pub fn others(&self, patch: usize, board: usize) -> &[(usize, usize)] {
        self.others.get(patch).and_then(|boards| boards.get(board)).map_or(&[], Vec::as_slice)
    }

    /// Per board of a patch, whether another patch has it, too.
    #[must_use]
    pub fn of_patch(&self, patch: usize) -> Vec<bool> {
        self.others.get(patch).map_or_else(Vec::new, |boards| boards.iter().map(|others| !others.is_empty()).collect())
    }

    /// A patch and those that share a board with it, directly or through others: their boards are configured together,
    /// because a board that is configured forgets all its modules.
    #[must_use]
    pub fn group(&self, patch: usize) -> &[usize] {
        self.groups.get(patch).map_or(&[], Vec::as_slice)
    }
}

fn others_of(patches: &[PatchPlan], patch: usize) -> Vec<Vec<(usize, usize)>> {
    let boards = patches[patch].patch.boards().iter();
    let others = boards.map(|board| {
        let with = |(other, plan): (usize, &PatchPlan)| {
            let mut boards = plan.patch.boards().iter();
            let there = boards.position(|there| (there.bus, there.address) == (board.bus, board.address))?;
            (other != patch).then_some((other, there))
        };
        patches.iter().enumerate().filter_map(with).collect()
    });
    others.collect()
}

fn group_of(others: &[Vec<Vec<(usize, usize)>>], patch: usize) -> Vec<usize> {
    let mut group = vec![patch];
    let mut next = 0;
    while let Some(&member) = group.get(next) {
        next += 1;
        for &(other, _) in others[member].iter().flatten() {
            if !group.contains(&other) {
                group.push(other);
            }
        }
    }
    group.sort_unstable();
    group
}
