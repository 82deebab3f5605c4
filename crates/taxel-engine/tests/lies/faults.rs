//! What goes wrong in a story, drawn from the list of all that can.

use std::time::Duration;

use taxel_sim::{Fault, ForeignScan, Skin};
use taxel_skin::{BoardAddress, Module, TaxelIndex};

use crate::dice::Dice;
use crate::house::Part;
use crate::kinds::Kind;

/// Something that goes wrong, and for how long.
#[derive(Clone, Debug)]
pub struct Trouble {
    pub kind: Kind,
    /// What the simulator breaks; empty for what befalls the daemon.
    pub faults: Vec<Fault>,
    pub lasts: Duration,
}

impl Trouble {
    /// Whether it can be felt on this patch.
    pub fn befalls(&self, part: &Part) -> bool {
        let befalls = |fault: &Fault| match *fault {
            // A module that does not acknowledge makes its board take another zero.
            Fault::BoardSilent(board)
            | Fault::PowerCycle { board, .. }
            | Fault::Glitch { board, .. }
            | Fault::SilentRetare(board)
            | Fault::OtherPeriod { board, .. }
            | Fault::ForeignNode { board, .. }
            | Fault::ModuleNoAck(board, _) => part.has_board(board),
            Fault::ModuleSilent(board, module)
            | Fault::ModuleUnplugged(board, module)
            | Fault::ModuleFlicker { board, module, .. } => part.has_module(board, module),
            Fault::TaxelFrozen(taxel)
            | Fault::TaxelStuck { taxel, .. }
            | Fault::TaxelNoisy { taxel, .. }
            | Fault::TaxelFlicker { taxel, .. } => part.has(taxel),
            _ => true,
        };
        self.faults.is_empty() || self.faults.iter().any(befalls)
    }
}

/// What a robot meets, and how often in 1,000 hours; what breaks stays broken for the day. Orders of
/// magnitude that nobody has measured.
pub const OF_A_ROBOT: [(Kind, f64); 7] = [
    (Kind::BoardRetare, 1.0),
    (Kind::NoAcks, 1.0),
    (Kind::PowerCycle, 5.0),
    (Kind::WarmRamp, 100.0),
    (Kind::TaxelStuck, 0.4),
    (Kind::TaxelNoisy, 0.3),
    (Kind::TaxelFlicker, 0.3),
];

/// One trouble of this kind somewhere on the skin.
pub fn trouble(kind: Kind, skin: &Skin, dice: &mut Dice) -> Trouble {
    let place = skin.patch().modules()[dice.below(skin.patch().modules().len())];
    let board = skin.patch().boards()[usize::from(place.board)].address;
    let (faults, lasts) = if (kind as usize) < Kind::ModuleSilent as usize {
        of_board(kind, board, place.module, dice)
    } else if (kind as usize) < Kind::TaxelFrozen as usize {
        of_module(kind, board, place.module, dice)
    } else if (kind as usize) < Kind::FramesLost as usize {
        of_taxels(kind, skin, dice)
    } else {
        of_the_rest(kind, dice)
    };
    Trouble { kind, faults, lasts }
}

fn of_board(kind: Kind, board: BoardAddress, module: Module, dice: &mut Dice) -> (Vec<Fault>, Duration) {
    let sign = if dice.chance(0.5) { 1 } else { -1 };
    let (fault, lasts) = match kind {
        Kind::Glitch => {
            let off = dice.span(0.05, 0.99);
            (Fault::Glitch { board, off }, off)
        }
        Kind::BoardRetare => (Fault::SilentRetare(board), Duration::from_millis(40)),
        Kind::NoAcks => (Fault::ModuleNoAck(board, module), dice.span(0.05, 2.0)),
        Kind::PowerCycle => {
            let off = dice.span(0.1, 10.0);
            (Fault::PowerCycle { board, off }, off)
        }
        Kind::OtherPeriod => {
            let period_ms = dice.pick(&[5, 10, 20, 30, 70, 100, 120, 200]);
            (Fault::OtherPeriod { board, period_ms }, dice.span(2.0, 60.0))
        }
        Kind::ForeignRest => {
            let sends = ForeignScan::Level(dice.pick(&[240, 240, 238, 242, 245]));
            (Fault::ForeignNode { board, sends }, dice.span(0.1, 20.0))
        }
        Kind::ForeignShifted => {
            let sends = ForeignScan::Shifted(sign * dice.octaves(1.0, 60.0) as i16);
            (Fault::ForeignNode { board, sends }, dice.span(0.1, 20.0))
        }
        _ => (Fault::BoardSilent(board), dice.span(0.05, 8.0)),
    };
    (vec![fault], lasts)
}

fn of_module(kind: Kind, board: BoardAddress, module: Module, dice: &mut Dice) -> (Vec<Fault>, Duration) {
    let fault = match kind {
        Kind::ModuleUnplugged => Fault::ModuleUnplugged(board, module),
        Kind::ModuleFlicker => {
            let (probability, depth_counts) = (dice.octaves(0.01, 0.5), dice.octaves(3.0, 60.0));
            Fault::ModuleFlicker { board, module, probability, depth_counts }
        }
        _ => Fault::ModuleSilent(board, module),
    };
    (vec![fault], dice.span(0.05, 20.0))
}

fn of_taxels(kind: Kind, skin: &Skin, dice: &mut Dice) -> (Vec<Fault>, Duration) {
    let taxels = skin.patch().taxels().len();
    let faults = (0..dice.pick(&[1, 1, 1, 2, 5])).map(|_| {
        let taxel = TaxelIndex(dice.below(taxels) as u16);
        match kind {
            Kind::TaxelStuck => Fault::TaxelStuck { taxel, value: dice.pick(&[0, 120, 200, 230, 238, 240, 242, 255]) },
            Kind::TaxelNoisy => Fault::TaxelNoisy { taxel, sd_counts: dice.octaves(1.0, 20.0) },
            Kind::TaxelFlicker => Fault::TaxelFlicker { taxel, probability: dice.octaves(0.02, 0.6) },
            _ => Fault::TaxelFrozen(taxel),
        }
    });
    (faults.collect(), dice.span(0.5, 120.0))
}

fn of_the_rest(kind: Kind, dice: &mut Dice) -> (Vec<Fault>, Duration) {
    let sign = if dice.chance(0.5) { 1.0 } else { -1.0 };
    let probability = dice.octaves(0.002, 0.5);
    let lasts = dice.span(0.5, 60.0);
    let fault = match kind {
        Kind::FramesLost => Fault::FramesLost { probability },
        Kind::FramesDuplicated => Fault::FramesDuplicated { probability },
        Kind::FramesSwapped => Fault::FramesSwapped { probability },
        Kind::FramesHeld => {
            let span = dice.span(0.05, 3.0);
            // What waited must come faster than new frames do, or the wait would never end.
            let within = dice.span(0.002, 0.2).min(span.mul_f64(0.4));
            return (vec![Fault::FramesHeld { span, within }], span);
        }
        Kind::FramesReplayed => {
            let within = dice.span(0.002, 1.0);
            return (vec![Fault::FramesReplayed { span: dice.span(0.1, 10.0), within }], within);
        }
        Kind::GaugeSilent => Fault::GaugeSilent,
        Kind::GaugeStuck => Fault::GaugeStuck,
        Kind::GaugeOffset => Fault::GaugeOffset { kpa: sign * dice.octaves(0.2, 10.0) },
        Kind::GaugeSpikes => Fault::GaugeSpikes { probability: probability / 5.0, kpa: sign * dice.octaves(1.0, 50.0) },
        Kind::BagLeak => Fault::BagLeak { leak_s: dice.octaves(2.0, 60.0) },
        Kind::WarmStep => {
            let over = dice.span(1.0, 20.0);
            return (vec![Fault::Warming { kelvin: sign * dice.octaves(0.5, 8.0), over }], over);
        }
        Kind::WarmRamp => {
            let over = dice.span(60.0, 300.0);
            return (vec![Fault::Warming { kelvin: sign * dice.octaves(1.0, 15.0), over }], over);
        }
        Kind::BusOff => return (Vec::new(), dice.span(0.05, 3.0)),
        Kind::StoreFails => return (Vec::new(), dice.span(5.0, 20.0)),
        _ => return (Vec::new(), dice.span(0.05, 6.0)),
    };
    (vec![fault], lasts)
}
