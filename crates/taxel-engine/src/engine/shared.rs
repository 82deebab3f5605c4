//! Boards that serve several patches: what one of these learns of such a board, the others must know.

use taxel_skin::Board;

use crate::plan::{PatchPlan, Plan};

/// Which boards several patches have.
#[derive(Clone, Debug)]
pub struct SharedBoards {
    /// Per patch and board: the other patches that have it, and its position there.
    others: Vec<Vec<Vec<(usize, usize)>>>,
}

impl SharedBoards {
    /// Those of a plan.
    pub fn new(plan: &Plan) -> Self {
        let patches = &plan.patches;
        Self { others: (0..patches.len()).map(|patch| others_of(patches, patch)).collect() }
    }

    /// The other patches that have a board of a patch, each with the board's position there.
    pub fn others(&self, patch: usize, board: usize) -> &[(usize, usize)] {
        self.others.get(patch).and_then(|boards| boards.get(board)).map_or(&[], Vec::as_slice)
    }

    /// Per board of a patch, whether another patch has it, too.
    pub fn of_patch(&self, patch: usize) -> Vec<bool> {
        self.others.get(patch).map_or_else(Vec::new, |boards| boards.iter().map(|others| !others.is_empty()).collect())
    }

    /// With each board that is `wanted` of a patch, that of all other patches that have it.
    pub fn spread(&self, wanted: &mut [Vec<bool>]) {
        for patch in 0..wanted.len() {
            for board in (0..wanted[patch].len()).filter(|board| wanted[patch][*board]).collect::<Vec<_>>() {
                for &(other, there) in self.others(patch, board) {
                    wanted[other][there] = true;
                }
            }
        }
    }
}

fn others_of(patches: &[PatchPlan], patch: usize) -> Vec<Vec<(usize, usize)>> {
    let of_board = |board: &Board| {
        let with = |(other, plan): (usize, &PatchPlan)| {
            let same = |there: &Board| (there.bus, there.address) == (board.bus, board.address);
            let there = plan.patch.boards().iter().position(same)?;
            (other != patch && plan.devices.is_empty()).then_some((other, there))
        };
        patches.iter().enumerate().filter_map(with).collect()
    };
    let own = &patches[patch];
    // The number of a described device only divides its patch, which has the device for itself.
    if own.devices.is_empty() {
        own.patch.boards().iter().map(of_board).collect()
    } else {
        vec![Vec::new(); own.patch.boards().len()]
    }
}

#[cfg(test)]
mod tests {
    use taxel_skin::{BoardAddress, BusIndex, Module, ModuleKind, Patch};

    use crate::plan::DevicePlan;

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
        let array = PatchPlan { devices: vec![DevicePlan::without_frames()], ..patch("array", &[(0, 13)]) };
        let beside = SharedBoards::new(&Plan { buses: 1, patches: vec![patch("arm", &[(0, 13)]), array] });
        assert_eq!([beside.of_patch(0), beside.of_patch(1)], [[false], [false]], "a device is no board of this number");
        // Board 13 of the first and board 12 of the last, which the third has both.
        let mut wanted = vec![vec![true], vec![false; 2], vec![false; 2], vec![false, true]];
        shared.spread(&mut wanted);
        assert_eq!(wanted, [vec![true], vec![false; 2], vec![true; 2], vec![false, true]]);
    }
}
