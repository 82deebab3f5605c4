//! Where any other sensor keeps its pressure in a CAN frame, and what the number means.
//!
//! `pressure = raw * scale + offset` in the sensor's unit, as in a DBC file; then kilopascal; then, for a sensor that
//! reads the absolute pressure in the bag, ambient minus bag.

pub use crate::bits::ByteOrder;
use crate::bits::{BitField, PlaceError};
use crate::frame::{CanId, FD_BYTES, Frame, FrameKind};
use taxel_skin::Kilopascal;
use thiserror::Error;

/// The unit of `raw * scale + offset`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum PressureUnit {
    /// Pa.
    Pascal,
    /// hPa, the same as mbar.
    Hectopascal,
    /// kPa.
    #[default]
    Kilopascal,
    /// MPa.
    Megapascal,
    /// bar, 100 kPa.
    Bar,
    /// mbar, 0.1 kPa.
    Millibar,
    /// Pound-force per square inch, 0.45359237 kg * 9.80665 m/s2 / (25.4 mm)2.
    Psi,
    /// Conventional millimetre of mercury, 13.5951 g/cm3 * 9.80665 m/s2 * 1 mm.
    MillimetreMercury,
    /// Conventional inch of mercury, 25.4 mmHg.
    InchMercury,
    /// 101,325 / 760 Pa.
    Torr,
    /// Conventional millimetre of water, 1 g/cm3 * 9.80665 m/s2 * 1 mm.
    MillimetreWater,
    /// 10 mmH2O.
    CentimetreWater,
    /// 25.4 mmH2O.
    InchWater,
    /// Standard atmosphere, 101,325 Pa.
    Atmosphere,
    /// Technical atmosphere, 98,066.5 Pa.
    KilogramForce,
}

/// Each unit with its name and what it is in kPa, as a factor and a divisor: 1/1000 has no exact double and 1000 has.
/// Of NIST SP 811 (2008), appendix B.8, without its rounding.
const UNITS: [(PressureUnit, &str, f64, f64); 15] = [
    (PressureUnit::Pascal, "Pa", 1.0, 1e3),
    (PressureUnit::Hectopascal, "hPa", 1.0, 1e1),
    (PressureUnit::Kilopascal, "kPa", 1.0, 1.0),
    (PressureUnit::Megapascal, "MPa", 1e3, 1.0),
    (PressureUnit::Bar, "bar", 1e2, 1.0),
    (PressureUnit::Millibar, "mbar", 1.0, 1e1),
    (PressureUnit::Psi, "psi", 6.894_757_293_168_361, 1.0),
    (PressureUnit::MillimetreMercury, "mmHg", 133.322_387_415, 1e3),
    (PressureUnit::InchMercury, "inHg", 3_386.388_640_341, 1e3),
    (PressureUnit::Torr, "torr", 101.325, 760.0),
    (PressureUnit::MillimetreWater, "mmH2O", 9.806_65, 1e3),
    (PressureUnit::CentimetreWater, "cmH2O", 98.066_5, 1e3),
    (PressureUnit::InchWater, "inH2O", 249.088_91, 1e3),
    (PressureUnit::Atmosphere, "atm", 101.325, 1.0),
    (PressureUnit::KilogramForce, "kgf/cm2", 98.066_5, 1.0),
];

impl PressureUnit {
    /// The unit of this name, in letters of any size; `None` if it is none of [`PressureUnit::NAMES`].
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let name = name.trim();
        let is = |known: &str| known.eq_ignore_ascii_case(name) && !name.starts_with("mP"); // no megapascal, but a millipascal
        UNITS.iter().find(|(_, known, ..)| is(known)).map(|(unit, ..)| *unit)
    }

    /// The names of all units.
    pub const NAMES: &str = "Pa, hPa, kPa, MPa, bar, mbar, psi, mmHg, inHg, torr, mmH2O, cmH2O, inH2O, atm, kgf/cm2";

    /// `value` of this unit in kPa.
    #[must_use]
    pub fn to_kilopascal(self, value: f64) -> f64 {
        let (factor, divisor) = self.in_kilopascal();
        value * factor / divisor
    }

    /// `kpa` in this unit.
    #[must_use]
    pub fn from_kilopascal(self, kpa: f64) -> f64 {
        let (factor, divisor) = self.in_kilopascal();
        kpa * divisor / factor
    }

    fn in_kilopascal(self) -> (f64, f64) {
        let row = UNITS.iter().find(|(unit, ..)| *unit == self);
        row.map_or((1.0, 1.0), |(_, _, factor, divisor)| (*factor, *divisor))
    }
}

/// What the sensor measures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PressureMeaning {
    /// Ambient minus bag, what loads the skin, by itself.
    #[default]
    Differential,
    /// The absolute pressure in the bag; the differential is ambient minus it.
    AbsoluteBag {
        /// The air pressure around the bag in kPa, above 0; 101.325 at sea level.
        ambient_kpa: f64,
    },
}

/// One pressure in the frames of one identifier.
///
/// `start_bit` counts as [`BitField`] says.
///
/// Numbers of more than 53 bits are rounded to the nearest double.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignalSpec {
    /// The identifier of the sensor's frames.
    pub id: CanId,
    /// First bit, 0 to 511.
    pub start_bit: u16,
    /// Width of the number, 1 to 64.
    pub length_bits: u16,
    /// Which end comes first.
    pub byte_order: ByteOrder,
    /// Two's complement, or unsigned.
    pub signed: bool,
    /// Unit per raw step; finite, not 0.
    pub scale: f64,
    /// Unit at raw 0; finite.
    pub offset: f64,
    /// The unit.
    pub unit: PressureUnit,
    /// What is measured.
    pub meaning: PressureMeaning,
}

/// What is wrong with a spec, or with a pressure that it should carry.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum SignalError {
    /// The identifier has too many bits.
    #[error("identifier {id} is too large, expected at most {max}")]
    Id {
        /// The identifier.
        id: CanId,
        /// The largest of its kind.
        max: CanId,
    },
    /// No frame has a number there.
    #[error(transparent)]
    Place(#[from] PlaceError),
    /// A step of zero or of no size at all.
    #[error("scale is {0}, expected a finite number other than 0")]
    Scale(f64),
    /// Not a number to add.
    #[error("offset is {0}, expected a finite number")]
    Offset(f64),
    /// Not an air pressure.
    #[error("ambient pressure is {0} kPa, expected a finite number above 0")]
    Ambient(f64),
    /// The pressure to send needs a raw number that the width does not hold.
    #[error("{kpa} kPa needs the raw number {raw}, expected {min} to {max}")]
    Overflow {
        /// The pressure.
        kpa: f64,
        /// What it would be; may be NaN.
        raw: f64,
        /// Smallest raw number.
        min: i128,
        /// Largest raw number.
        max: i128,
    },
}

/// Why a frame gives no pressure.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum SignalRefusal {
    /// Another identifier: of no concern.
    #[error("frame {found} is not of the signal")]
    NotThisSignal {
        /// The frame's identifier.
        found: CanId,
    },
    /// A remote frame, which asks for the signal.
    #[error("a {0:?} frame, expected a data frame")]
    Kind(FrameKind),
    /// The frame ends before the number does.
    #[error("frame {id} has {found} bytes, expected at least {needed}")]
    Short {
        /// The frame's identifier.
        id: CanId,
        /// Its number of bytes.
        found: u8,
        /// Bytes up to the number's end.
        needed: u8,
    },
    /// Scale and offset take the raw number out of what a double holds.
    #[error("frame {id}: raw number {raw} is no finite pressure")]
    NotFinite {
        /// The frame's identifier.
        id: CanId,
        /// The raw number.
        raw: i128,
    },
    /// The spec was never valid.
    #[error(transparent)]
    Spec(#[from] SignalError),
}

impl SignalSpec {
    /// # Errors
    /// [`SignalError`] for the first field that is out of its range. Every other method says the same.
    pub fn validate(&self) -> Result<(), SignalError> {
        let max = match self.id {
            CanId::Standard(_) => CanId::Standard(0x7FF),
            CanId::Extended(_) => CanId::Extended(0x1FFF_FFFF),
        };
        if self.id > max {
            return Err(SignalError::Id { id: self.id, max });
        }
        self.field()?;
        if !self.scale.is_finite() || self.scale == 0.0 {
            return Err(SignalError::Scale(self.scale));
        }
        if !self.offset.is_finite() {
            return Err(SignalError::Offset(self.offset));
        }
        match self.meaning {
            PressureMeaning::AbsoluteBag { ambient_kpa } if !(ambient_kpa.is_finite() && ambient_kpa > 0.0) => {
                Err(SignalError::Ambient(ambient_kpa))
            }
            _ => Ok(()),
        }
    }

    /// The differential pressure in `frame`, always finite. Bytes after the number may hold anything.
    ///
    /// # Errors
    /// [`SignalRefusal::NotThisSignal`] for another identifier, else what is wrong with the frame.
    pub fn decode(&self, frame: &Frame) -> Result<Kilopascal, SignalRefusal> {
        if frame.id != self.id || frame.kind == FrameKind::Error {
            return Err(SignalRefusal::NotThisSignal { found: frame.id });
        }
        if !matches!(frame.kind, FrameKind::Data | FrameKind::Fd) {
            return Err(SignalRefusal::Kind(frame.kind));
        }
        self.validate()?;
        let field = self.field()?;
        let bytes = frame.bytes();
        let short =
            || SignalRefusal::Short { id: frame.id, found: bytes.len() as u8, needed: field.bytes_needed() as u8 };
        let raw = field.read(bytes).ok_or_else(short)?;
        let pressure = self.unit.to_kilopascal(raw as f64 * self.scale + self.offset);
        let kpa = match self.meaning {
            PressureMeaning::Differential => pressure,
            PressureMeaning::AbsoluteBag { ambient_kpa } => ambient_kpa - pressure,
        };
        if kpa.is_finite() { Ok(Kilopascal(kpa)) } else { Err(SignalRefusal::NotFinite { id: frame.id, raw }) }
    }

    /// The shortest data frame that holds the number nearest to `pressure`, all other bits 0: one of CAN FD where the
    /// number lies beyond eight bytes.
    ///
    /// # Errors
    /// [`SignalError::Overflow`] if the number does not fit or `pressure` is not finite, else a fault of the spec.
    pub fn encode(&self, pressure: Kilopascal) -> Result<Frame, SignalError> {
        self.validate()?;
        let field = self.field()?;
        let kpa = match self.meaning {
            PressureMeaning::Differential => pressure.0,
            PressureMeaning::AbsoluteBag { ambient_kpa } => ambient_kpa - pressure.0,
        };
        let raw = ((self.unit.from_kilopascal(kpa) - self.offset) / self.scale).round();
        let (min, max) = field.range();
        let overflow = SignalError::Overflow { kpa: pressure.0, raw, min, max };
        // The cast saturates far outside of any range and makes NaN zero, hence the test before it.
        if !raw.is_finite() || !(min..=max).contains(&(raw as i128)) {
            return Err(overflow);
        }
        let mut data = [0; FD_BYTES];
        let data = &mut data[..field.bytes_needed()];
        let kind = if data.len() > 8 { FrameKind::Fd } else { FrameKind::Data };
        field.write(raw as i128, data);
        Frame::new(self.id, kind, data).ok_or(overflow)
    }

    fn field(&self) -> Result<BitField, SignalError> {
        Ok(BitField::new(self.start_bit, self.length_bits, self.byte_order, self.signed)?)
    }
}

#[cfg(test)]
mod tests;
