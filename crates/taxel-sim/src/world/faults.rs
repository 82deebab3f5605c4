//! What goes wrong in a world.

use super::World;
use crate::converter::{Converter, Flicker, TaxelAilment};
use crate::dielectric::LSB_PER_COUNT;
use crate::faults::{Fault, FaultError, ForeignScan};
use crate::foreign::ForeignNode;
use crate::rng::{Rng, Stream};
use taxel_skin::{BoardAddress, Module, TaxelIndex};

impl World {
    /// Makes something go wrong, from now on.
    ///
    /// # Errors
    /// [`FaultError`] for a board or taxel that does not exist.
    pub fn inject(&mut self, fault: Fault) -> Result<(), FaultError> {
        self.set_board_fault(fault, true)
    }

    /// Ends a fault of this kind at this place; its numbers do not matter. What happens once cannot be repaired.
    ///
    /// # Errors
    /// [`FaultError`] for a board or taxel that does not exist.
    pub fn repair(&mut self, fault: Fault) -> Result<(), FaultError> {
        self.set_board_fault(fault, false)
    }

    fn set_board_fault(&mut self, fault: Fault, on: bool) -> Result<(), FaultError> {
        match fault {
            Fault::BoardSilent(board) => {
                let index = self.faulty_board(board)?;
                self.boards[index].silent = on;
                self.bus.discard(index);
            }
            Fault::PowerCycle { board, off } => {
                let index = self.faulty_board(board)?;
                if on {
                    self.boards[index].power_off(self.now + off);
                    self.bus.discard(index);
                }
            }
            Fault::Glitch { board, off } => {
                let index = self.faulty_board(board)?;
                if on {
                    self.boards[index].hang(self.now + off);
                    self.bus.discard(index);
                }
            }
            Fault::SilentRetare(board) => {
                let index = self.faulty_board(board)?;
                if on {
                    self.boards[index].retare();
                }
            }
            Fault::OtherPeriod { board, period_ms } => {
                let index = self.faulty_board(board)?;
                self.boards[index].other_period_ms = on.then_some(period_ms);
            }
            Fault::ForeignNode { board, sends } => {
                let index = self.faulty_board(board)?;
                self.foreign[index] = on.then(|| self.foreign_node(index, sends));
            }
            _ => return self.set_module_fault(fault, on),
        }
        Ok(())
    }

    fn foreign_node(&self, index: usize, sends: ForeignScan) -> ForeignNode {
        let board = &self.boards[index];
        let phase = Rng::new(self.seed, Stream::Foreign(index)).uniform();
        ForeignNode::new(board.pretended(sends), board.period(), self.now + board.period().mul_f64(phase))
    }

    fn set_module_fault(&mut self, fault: Fault, on: bool) -> Result<(), FaultError> {
        match fault {
            Fault::ModuleSilent(board, module) => self.module(board, module)?.ailments.silent = on,
            Fault::ModuleUnplugged(board, module) => self.module(board, module)?.ailments.unplugged = on,
            Fault::ModuleNoAck(board, module) => self.module(board, module)?.ailments.no_ack = on,
            Fault::ModuleFlicker { board, module, probability, depth_counts } => {
                let flicker = on.then_some(Flicker { probability, depth_counts });
                self.module(board, module)?.ailments.flicker = flicker;
            }
            _ => return self.set_taxel_fault(fault, on),
        }
        Ok(())
    }

    fn set_taxel_fault(&mut self, fault: Fault, on: bool) -> Result<(), FaultError> {
        let rng = |taxel: TaxelIndex| Rng::new(self.seed, Stream::TaxelFault(taxel.get()));
        let (taxel, ailment) = match fault {
            Fault::TaxelFrozen(taxel) => (taxel, TaxelAilment::Frozen),
            Fault::TaxelStuck { taxel, value } => (taxel, TaxelAilment::Stuck(value)),
            Fault::TaxelNoisy { taxel, sd_counts } => {
                (taxel, TaxelAilment::Noisy { sd_lsb: sd_counts * LSB_PER_COUNT, rng: rng(taxel) })
            }
            Fault::TaxelFlicker { taxel, probability } => {
                (taxel, TaxelAilment::Flicker { probability, on: false, rng: rng(taxel) })
            }
            other => {
                self.set_other_fault(other, on);
                return Ok(());
            }
        };
        let patch = self.skin.patch();
        let taxels = patch.taxels().len();
        let site = *patch.taxels().get(taxel.get()).ok_or(FaultError::Taxel { taxel: taxel.0, taxels })?;
        let module = patch.modules()[usize::from(site.module)];
        let converter = self.boards[usize::from(module.board)].converter(module.module);
        let place = &mut converter.ailments.taxels[usize::from(site.slot)];
        let same = |old: &TaxelAilment| std::mem::discriminant(old) == std::mem::discriminant(&ailment);
        if on {
            *place = Some(Box::new(ailment));
        } else if place.as_deref().is_some_and(same) {
            *place = None;
        }
        Ok(())
    }

    /// Faults of the bus, the gauge, the bag and the room.
    fn set_other_fault(&mut self, fault: Fault, on: bool) {
        let chance = |probability: f64| if on { probability } else { 0.0 };
        match fault {
            Fault::FramesLost { probability } => self.receiver.loss_probability = chance(probability),
            Fault::FramesDuplicated { probability } => self.receiver.duplicate_probability = chance(probability),
            Fault::FramesSwapped { probability } => self.receiver.swap_probability = chance(probability),
            Fault::FramesHeld { span, within } if on => self.receiver.hold(self.now, span, within),
            Fault::FramesReplayed { span, within } if on => self.receiver.replay(self.now, span, within),
            Fault::GaugeSilent => self.gauge.silent = on,
            Fault::GaugeStuck => self.gauge.stuck = on,
            Fault::GaugeOffset { kpa } => self.gauge.jump_kpa = if on { kpa } else { 0.0 },
            Fault::GaugeSpikes { probability, kpa } => self.gauge.spikes = on.then_some((probability, kpa)),
            Fault::BagLeak { leak_s } => self.bag.fault_leak_s = on.then_some(leak_s),
            Fault::Warming { kelvin, over } if on => {
                let begin_s = self.now.seconds_since(self.start);
                self.temperature.warm(kelvin, begin_s, over.as_secs_f64());
            }
            _ => {}
        }
    }

    fn module(&mut self, board: BoardAddress, module: Module) -> Result<&mut Converter, FaultError> {
        let index = self.faulty_board(board)?;
        Ok(self.boards[index].converter(module))
    }

    fn faulty_board(&self, board: BoardAddress) -> Result<usize, FaultError> {
        self.board(board).ok_or(FaultError::Board(board))
    }
}
