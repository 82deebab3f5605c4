//! A drive whose registers are written over Modbus: an electronic regulator behind an analogue module, a vacuum gripper.

use std::time::Duration;

use serde::Deserialize;

use super::question::{Expects, Question, Refers};
use crate::Faults;
use crate::drive::Order;
use crate::modbus::{Framing, Register, Request};
use crate::talk::Speech;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Keys {
    slave: u8,
    address: u16,
    set: Vec<Cell>,
    vent: Vec<Cell>,
    hold: Option<Vec<Cell>>,
    step_kpa: f64,
    #[serde(default)]
    zero: f64,
    set_point: Option<String>,
    pressure: Option<String>,
}

/// What goes into a register.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(untagged, expecting = "expected numbers of 0 to 65535, \"kpa\" and \"ms\"")]
enum Cell {
    Number(u16),
    Word(Word),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Word {
    /// The set point, in steps.
    Kpa,
    /// The drive's own limit.
    Ms,
}

/// Its registers.
#[derive(Debug)]
pub(super) struct Registers {
    keys: Keys,
    own_limit: Duration,
    refers: Refers,
    framing: Framing,
    set_point: Option<Register>,
    pressure: Option<Register>,
}

impl Registers {
    pub(super) fn new(
        keys: Keys,
        own_limit: Option<Duration>,
        (refers, framing): (Refers, Framing),
        faults: &mut Faults,
    ) -> Self {
        let set_points = |cells: &[Cell]| cells.iter().filter(|cell| matches!(cell, Cell::Word(Word::Kpa))).count();
        let lists = [
            ("modbus.set", 1, Some(&keys.set)),
            ("modbus.vent", 0, Some(&keys.vent)),
            ("modbus.hold", 0, keys.hold.as_ref()),
        ];
        for (key, most, cells) in lists.into_iter().filter_map(|(key, most, cells)| Some((key, most, cells?))) {
            faults.require(key, (1..=100).contains(&cells.len()), || ": expected 1 to 100 registers".to_owned());
            let found = set_points(cells);
            faults.require(key, most == 0 || found == 1, || ": expected the set point once, as \"kpa\"".to_owned());
            faults.require(key, most == 1 || found == 0, || ": \"kpa\" belongs to set".to_owned());
        }
        faults.require("modbus.step_kpa", keys.step_kpa.is_normal(), || {
            format!(" = {}: expected what a step of the set point is", keys.step_kpa)
        });
        let mut register = |key: &str, text: &Option<String>| {
            let text = text.as_deref()?;
            let register = faults.read(key, text, Register::new(text))?;
            Some(Register { slave: keys.slave, ..register })
        };
        let set_point = register("modbus.set_point", &keys.set_point);
        let pressure = register("modbus.pressure", &keys.pressure);
        faults.require("modbus.set_point", keys.set.len() == 1 || keys.set_point.is_some(), || {
            " is missing: where the set point is read back, as in \"holding 1\"".to_owned()
        });
        Self { keys, own_limit: own_limit.unwrap_or_default(), refers, framing, set_point, pressure }
    }

    pub(super) const fn holds(&self) -> bool {
        self.keys.hold.is_some()
    }

    pub(super) fn questions(&self, order: Order) -> Vec<Question> {
        let keys = &self.keys;
        let sent = if let Order::Set(kpa) = order { self.steps(kpa) } else { 0 };
        let cells = match order {
            Order::Silence => return Vec::new(),
            Order::Set(_) => Some(&keys.set),
            Order::Hold => keys.hold.as_ref(),
            Order::Vent => Some(&keys.vent),
        };
        let value = |cell: &Cell| match *cell {
            Cell::Number(number) => number,
            Cell::Word(Word::Kpa) => sent,
            Cell::Word(Word::Ms) => u16::try_from(self.own_limit.as_millis()).unwrap_or(u16::MAX),
        };
        let command = cells.map(|cells| {
            let values = cells.iter().map(value).collect();
            let write = Request::Write { slave: keys.slave, address: keys.address, values };
            let key = "modbus.set".to_owned();
            Question { speech: Speech::Modbus(write, self.framing), expects: Expects::Taken, key }
        });
        let read = |register: &Option<Register>, expects, key: &str| {
            let speech = Speech::Modbus(Request::Read((*register)?), self.framing);
            Some(Question { speech, expects, key: key.to_owned() })
        };
        let set_point = Expects::SetPoint { sent: f64::from(sent), within: 0.5 };
        let set_point = read(&self.set_point, set_point, "modbus.set_point").filter(|_| matches!(order, Order::Set(_)));
        let pressure = Expects::Pressure { unit_kpa: 1.0, refers: self.refers };
        let pressure = read(&self.pressure, pressure, "modbus.pressure");
        command.into_iter().chain(set_point).chain(pressure).collect()
    }

    /// A set point as the register has it.
    fn steps(&self, kpa: f64) -> u16 {
        (self.keys.zero + self.refers.turned(kpa) / self.keys.step_kpa).round() as u16 // saturates
    }
}
