//! Boards that serve several patches: what one of these learns of such a board, the others must know.

use std::sync::Arc;

use taxel_wire::array::FrameSpec;
use taxel_wire::bits::{FrameMatch, Selector};

use crate::plan::{PatchPlan, Plan, Sender};

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

    /// The plan in which every patch of a described device knows what one of them does: how the device tells that it is well,
    /// since while it is not its counts are nobody's force, and what it is sent, since a device that is configured may take a zero
    /// for all. Patches may know it of each other in a row, so that there are as many rounds as patches.
    pub fn with_devices_of_all(&self, plan: &Arc<Plan>) -> Arc<Plan> {
        let mut told = Arc::clone(plan);
        for _ in 0..plan.patches.len() {
            let known = Arc::clone(&told);
            for (patch, own) in known.patches.iter().enumerate() {
                for (board, device) in own.devices.iter().enumerate() {
                    let others = || {
                        let others = self.others(patch, board).iter();
                        others.filter_map(|&(other, there)| known.patches[other].devices.get(there))
                    };
                    let status = others().find_map(|other| other.status.clone()).filter(|_| device.status.is_none());
                    let sent = others().find(|other| other.is_configured()).filter(|_| !device.is_configured());
                    if status.is_none() && sent.is_none() {
                        continue;
                    }
                    let device = &mut Arc::make_mut(&mut told).patches[patch].devices[board];
                    device.status = device.status.take().or(status);
                    if let Some(sent) = sent {
                        (device.commands, device.sender) = (sent.commands.clone(), Sender::OtherPatch);
                    }
                }
            }
        }
        told
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
    let own = &patches[patch];
    let others = (0..own.patch.boards().len()).map(|board| {
        let with = |(other, plan): (usize, &PatchPlan)| {
            let there = (0..plan.patch.boards().len()).find(|&there| are_one((own, board), (plan, there)))?;
            (other != patch).then_some((other, there))
        };
        patches.iter().enumerate().filter_map(with).collect()
    });
    others.collect()
}

/// Whether a board of one patch and one of another are the same thing. Skin boards are by their address. The number of a
/// described device only divides its patch: two of them are the same if counts of both come in one frame. A frame that
/// begins the scans of several, or one that a number in it gives to one of them, is none.
fn are_one(a: (&PatchPlan, usize), b: (&PatchPlan, usize)) -> bool {
    let (here, there) = (&a.0.patch.boards()[a.1], &b.0.patch.boards()[b.1]);
    let same = match (a.0.devices.get(a.1), b.0.devices.get(b.1)) {
        (None, None) => here.address == there.address,
        (Some(one), Some(other)) => {
            let of_other = |spec: &FrameSpec| other.frames.iter().any(|its| overlap(&spec.frames, &its.frames));
            one.frames.iter().any(of_other)
        }
        _ => false,
    };
    here.bus == there.bus && same
}

/// Whether one frame can be meant by both.
fn overlap(a: &FrameMatch, b: &FrameMatch) -> bool {
    let apart = |one: &Selector, other: &Selector| {
        let meet = |x: &(i128, i128), y: &(i128, i128)| x.0 <= y.1 && y.0 <= x.1;
        one.field == other.field && !one.values.iter().any(|x| other.values.iter().any(|y| meet(x, y)))
    };
    a.id == b.id && !a.selectors.iter().any(|one| b.selectors.iter().any(|other| apart(one, other)))
}

#[cfg(test)]
mod tests {
    use std::time::Duration;
    use taxel_skin::{Board, BoardAddress, BusIndex, Module, ModuleKind, Patch};
    use taxel_wire::bits::{BitField, ByteOrder};
    use taxel_wire::{CanId, Frame};

    use crate::intake::cells::{DevicePlan, DeviceSignal, ScanBegin};

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

    /// Their numbers only divide a patch: each of two arrays on a bus is the first device of its own.
    #[test]
    fn described_devices_are_shared_by_their_frames_and_by_nothing_else() {
        let of = |id, selectors| FrameMatch { id: CanId::Extended(id), selectors };
        let with = |name: &str, ids: &[u32]| {
            // One frame may be of several devices, told apart by its first byte: the hundreds here.
            let selected = |id: u32| Selector {
                field: BitField::new(0, 8, ByteOrder::Little, false).unwrap(),
                values: vec![(i128::from(id / 100), i128::from(id / 100))],
            };
            let frame = |&id: &u32| FrameSpec { frames: of(id % 100, vec![selected(id)]), counts: Vec::new() };
            // A master's frame begins the scans of all.
            let scans = ScanBegin::Frame(of(80, Vec::new()));
            let frames = ids.iter().map(frame).collect();
            let device = DevicePlan { frames, scans, ..DevicePlan::without_frames() };
            PatchPlan { devices: vec![device], ..patch(name, &[(0, 1)]) }
        };
        let patches =
            vec![with("palm", &[10, 11]), with("finger", &[12, 110]), with("half", &[11]), patch("arm", &[(0, 1)])];
        let mut plan = Plan { buses: 1, patches };
        let shared = SharedBoards::new(&plan);
        let others = (0..4).map(|patch| shared.others(patch, 0).to_vec());
        assert!(others.eq([vec![(2, 0)], Vec::new(), vec![(0, 0)], Vec::new()]));
        let field = BitField::new(0, 8, ByteOrder::Little, false).unwrap();
        plan.patches[2].devices[0].status = Some((DeviceSignal { frames: of(90, Vec::new()), field }, 0));
        plan.patches[0].devices[0].commands = vec![(Duration::ZERO, Frame::data(CanId::Extended(1), &[1]).unwrap())];
        plan.patches[0].devices[0].sender = Sender::Patch;
        let told = shared.with_devices_of_all(&Arc::new(plan));
        let knows = told.patches.iter().map(|patch| patch.devices.first().is_some_and(|d| d.status.is_some()));
        assert!(knows.eq([true, false, true, false]), "the palm is of the same device as the half");
        let waits = told
            .patches
            .iter()
            .map(|patch| (patch.configures(), patch.devices.first().is_some_and(|d| d.sender == Sender::OtherPatch)));
        assert!(
            waits.eq([(true, false), (false, false), (true, true), (false, false)]),
            "what one sends, all wait for"
        );
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
        // Board 13 of the first and board 12 of the last, which the third has both.
        let mut wanted = vec![vec![true], vec![false; 2], vec![false; 2], vec![false, true]];
        shared.spread(&mut wanted);
        assert_eq!(wanted, [vec![true], vec![false; 2], vec![true; 2], vec![false, true]]);
    }
}
