//! Patches for the tests of all folders.

use taxel_skin::{Board, BoardAddress, BusIndex, Module, ModuleKind, Patch};

/// A board with modules of these kinds, numbered from 0.
pub fn board(bus: u8, address: u8, kinds: &[ModuleKind]) -> Board {
    let modules = (0..).map(Module::from_nibble).zip(kinds.iter().copied()).collect();
    Board { bus: BusIndex(bus), address: BoardAddress::new(address).unwrap(), modules }
}

/// One board of bus 0 with modules of these kinds.
pub fn patch(kinds: &[ModuleKind]) -> Patch {
    Patch::new("p", vec![board(0, 1, kinds)]).unwrap()
}
