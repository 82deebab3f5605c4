//! From a frame's identifier to whom it concerns, in one table look-up a frame; the kernel's filters come from it too.

use std::collections::BTreeSet;

use taxel_skin::{Board, BusIndex, Module};
use taxel_wire::CanId;

use crate::plan::Plan;

/// Whom an identifier concerns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Route {
    /// Nobody here.
    Foreign,
    /// A module of a patch: positions of both.
    Module {
        /// Position of the patch in the plan.
        patch: u8,
        /// Position of the module in the patch.
        module: u16,
    },
    /// A board of a patch: positions of both. Replies, thermometer, overflow notices.
    Board {
        /// Position of the patch in the plan.
        patch: u8,
        /// Position of the board in the patch.
        board: u8,
    },
    /// Gauges or devices that are described by their signals, of one patch or several.
    Described,
}

/// Standard identifiers have 11 bits.
const STANDARD_IDS: usize = 0x800;

/// With which a skin board sends for itself: firmware reply, thermometer (two type nibbles are in use), overflow notice.
pub fn ids_of_board(board: &Board) -> [u16; 4] {
    [0x200, 0x30E, 0x30F, 0x705].map(|id| id | u16::from(board.address.get()) << 4)
}

/// With which it sends the counts of a module: periodic skin, legacy skin, and the class in which one firmware build sends its tails.
pub fn ids_of_module(board: &Board, module: Module) -> [u16; 3] {
    [0x400, 0x300, 0x600].map(|class| class | u16::from(board.address.get()) << 4 | u16::from(module.get()))
}

/// The routes of all buses.
#[derive(Clone, Debug)]
pub struct Routes {
    /// Per bus, by standard identifier.
    standard: Vec<[Route; STANDARD_IDS]>,
    /// Extended identifiers of gauges and devices; skin boards have none.
    extended: BTreeSet<(BusIndex, u32)>,
}

impl Routes {
    /// The routes that a plan needs and no others.
    #[must_use]
    pub fn new(plan: &Plan) -> Self {
        let mut routes = Self { standard: vec![[Route::Foreign; STANDARD_IDS]; plan.buses], extended: BTreeSet::new() };
        for (p, patch) in plan.patches.iter().enumerate() {
            for (device, board) in patch.devices.iter().zip(patch.patch.boards()) {
                device.ids().for_each(|id| routes.set_any(board.bus, id));
            }
            let boards = if patch.devices.is_empty() { patch.patch.boards() } else { &[] };
            for (b, board) in boards.iter().enumerate() {
                let route = Route::Board { patch: p as u8, board: b as u8 };
                ids_of_board(board).into_iter().for_each(|id| routes.set(board.bus, id, route));
            }
            let modules = if patch.devices.is_empty() { patch.patch.modules() } else { &[] };
            for (m, site) in modules.iter().enumerate() {
                let board = &patch.patch.boards()[site.board as usize];
                let route = Route::Module { patch: p as u8, module: m as u16 };
                ids_of_module(board, site.module).into_iter().for_each(|id| routes.set(board.bus, id, route));
            }
            if let Some(gauge) = &patch.gauge {
                routes.set_any(gauge.bus, gauge.signal.id);
            }
        }
        routes
    }

    fn set_any(&mut self, bus: BusIndex, id: CanId) {
        match id {
            CanId::Standard(id) => self.set(bus, id, Route::Described),
            CanId::Extended(id) => {
                self.extended.insert((bus, id));
            }
        }
    }

    fn set(&mut self, bus: BusIndex, id: u16, route: Route) {
        if let Some(slot) = self.standard.get_mut(bus.0 as usize).and_then(|ids| ids.get_mut(id as usize)) {
            *slot = route;
        }
    }

    /// Whom a frame with this identifier concerns.
    #[must_use]
    pub fn of(&self, bus: BusIndex, id: CanId) -> Route {
        match id {
            CanId::Standard(id) => {
                let ids = self.standard.get(bus.0 as usize);
                ids.and_then(|ids| ids.get(id as usize)).copied().unwrap_or(Route::Foreign)
            }
            CanId::Extended(id) if self.extended.contains(&(bus, id)) => Route::Described,
            CanId::Extended(_) => Route::Foreign,
        }
    }

    /// Every identifier of a bus that concerns somebody, ascending: what the kernel has to let through.
    #[must_use]
    pub fn wanted(&self, bus: BusIndex) -> Vec<CanId> {
        let standard = self.standard.get(bus.0 as usize).into_iter().flatten().enumerate();
        let standard =
            standard.filter(|(_, route)| **route != Route::Foreign).map(|(id, _)| CanId::Standard(id as u16));
        let extended = self.extended.iter().filter(|(b, _)| *b == bus).map(|&(_, id)| CanId::Extended(id));
        standard.chain(extended).collect()
    }
}

#[cfg(test)]
mod tests {
    use taxel_sim::GaugeConfig;
    use taxel_skin::{ModuleKind, Patch};
    use taxel_wire::signal::SignalSpec;

    use super::*;
    use crate::plan::{Gauge, PatchPlan};

    /// A patch of module 0 of a board, with a gauge.
    fn patch(address: u8, gauge: CanId) -> PatchPlan {
        let board = crate::tests::board(0, address, &[ModuleKind::Triangle]);
        let signal = SignalSpec { id: gauge, ..GaugeConfig::default().signal };
        let gauge = Some(Gauge::new(BusIndex(0), signal));
        PatchPlan { gauge, ..PatchPlan::new(Patch::new("p", vec![board]).unwrap()) }
    }

    #[test]
    fn the_kernel_lets_through_what_concerns_somebody_and_nothing_twice() {
        use CanId::{Extended, Standard};
        let gauges = [Extended(0x3000), Extended(0x1000), Extended(0x3000), Standard(0x123)];
        let patches = (10..14).zip(gauges).map(|(address, gauge)| patch(address, gauge)).collect();
        let routes = Routes::new(&Plan { buses: 2, patches });
        for gauge in gauges {
            assert_eq!([0, 1].map(|bus| routes.of(BusIndex(bus), gauge)), [Route::Described, Route::Foreign]);
        }
        assert_eq!(routes.of(BusIndex(0), Extended(0x2000)), Route::Foreign);
        assert_eq!(routes.of(BusIndex(0), Standard(0x4B0)), Route::Module { patch: 1, module: 0 });
        let of_boards = [0x2_0, 0x3_0, 0x3_E, 0x3_F, 0x4_0, 0x6_0, 0x7_5].map(|id: u16| (id & 0xF0) << 4 | id & 0xF);
        let mut wanted: Vec<u16> = (0xA..=0xD).flat_map(|board| of_boards.map(|id| id | board << 4)).collect();
        wanted.push(0x123);
        wanted.sort_unstable();
        let wanted: Vec<CanId> = wanted.into_iter().map(Standard).chain([Extended(0x1000), Extended(0x3000)]).collect();
        assert_eq!(routes.wanted(BusIndex(0)), wanted);
        assert_eq!([1, 2].map(|bus| routes.wanted(BusIndex(bus))), [Vec::new(), Vec::new()]);
    }
}
