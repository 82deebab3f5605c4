//! From a frame's identifier to whom it concerns, in one table look-up a frame; the kernel's filters come from it too.

use taxel_skin::BusIndex;
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
    /// The gauge of one patch or several.
    Gauge,
}

/// Standard identifiers have 11 bits.
const STANDARD_IDS: usize = 0x800;

/// The routes of all buses.
#[derive(Clone, Debug)]
pub struct Routes {
    /// Per bus, by standard identifier.
    standard: Vec<[Route; STANDARD_IDS]>,
    /// Extended identifiers of gauges; skin boards have none.
    extended: Vec<(BusIndex, u32)>,
}

impl Routes {
    /// The routes that a plan needs and no others.
    #[must_use]
    pub fn new(plan: &Plan) -> Self {
        let mut routes = Self { standard: vec![[Route::Foreign; STANDARD_IDS]; plan.buses], extended: Vec::new() };
        for (p, patch) in plan.patches.iter().enumerate() {
            for (b, board) in patch.patch.boards().iter().enumerate() {
                let address = u16::from(board.address.get()) << 4;
                let route = Route::Board { patch: p as u8, board: b as u8 };
                // firmware reply, thermometer (two type nibbles are in use), overflow notice
                for id in [0x200 | address, 0x300 | address | 0xE, 0x300 | address | 0xF] {
                    routes.set(board.bus, id, route);
                }
                routes.set(board.bus, 0x700 | address | 0x5, route);
            }
            for (m, site) in patch.patch.modules().iter().enumerate() {
                let board = &patch.patch.boards()[site.board as usize];
                let low = u16::from(board.address.get()) << 4 | u16::from(site.module.get());
                let route = Route::Module { patch: p as u8, module: m as u16 };
                // periodic skin, legacy skin, and the class in which one firmware build sends its tails
                for class in [0x400, 0x300, 0x600] {
                    routes.set(board.bus, class | low, route);
                }
            }
            if let Some(gauge) = &patch.gauge {
                match gauge.signal.id {
                    CanId::Standard(id) => routes.set(gauge.bus, id, Route::Gauge),
                    CanId::Extended(id) => routes.extended.push((gauge.bus, id)),
                }
            }
        }
        routes
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
            CanId::Extended(id) if self.extended.contains(&(bus, id)) => Route::Gauge,
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
