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

#[cfg(test)]
mod tests {
    use taxel_skin::{Board, BoardAddress, BusIndex, Module, ModuleKind, Patch};

    use super::*;

    /// One module of each board, given by bus and address.
    fn patch(name: &str, boards: &[(u8, u8)]) -> PatchPlan {
        let board = |(module, &(bus, address)): (usize, &(u8, u8))| Board {
            bus: BusIndex(bus),
            address: BoardAddress::new(address).unwrap(),
            modules: vec![(Module::new(module as u8).unwrap(), ModuleKind::Triangle)],
        };
        PatchPlan::new(Patch::new(name, boards.iter().enumerate().map(board).collect()).unwrap())
    }

    #[test]
    fn who_shares_boards_with_whom() {
        let patches = vec![
            patch("upper", &[(0, 13)]),
            patch("far", &[(0, 9), (1, 13)]),
            patch("middle", &[(0, 12), (0, 13)]),
            patch("lower", &[(0, 11), (0, 12)]),
        ];
        let shared = SharedBoards::new(&Plan { buses: 2, patches });
        let of = |patch: usize, board: usize| shared.others(patch, board).to_vec();
        assert_eq!([of(0, 0), of(2, 0), of(2, 1), of(3, 1)], [vec![(2, 1)], vec![(3, 1)], vec![(0, 0)], vec![(2, 0)]]);
        assert!([of(1, 0), of(1, 1), of(3, 0), of(0, 1), of(4, 0)].iter().all(Vec::is_empty));
        let shares = (0..5).map(|patch| shared.of_patch(patch));
        assert!(shares.eq([vec![true], vec![false; 2], vec![true; 2], vec![false, true], Vec::new()]));
        let groups = (0..5).map(|patch| shared.group(patch));
        assert!(groups.eq([[0, 2, 3].as_slice(), &[1], &[0, 2, 3], &[0, 2, 3], &[]]));
    }
}
