//! A question to a drive, and what its answer has to be.

use serde::Deserialize;

use crate::talk::Speech;

/// What the drive's numbers refer to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Reference {
    /// 20 is 20 below the air outside.
    #[default]
    BelowAmbient,
    /// -20 is 20 below the air outside.
    Ambient,
    /// The pressure itself: `ambient_kpa` less 20.
    Absolute,
}

/// Between kPa below ambient and kPa as the drive counts them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Refers {
    pub(super) reference: Reference,
    pub(super) ambient_kpa: f64,
}

impl Refers {
    /// From one to the other, whichever it is.
    pub(super) fn turned(self, kpa: f64) -> f64 {
        match self.reference {
            Reference::BelowAmbient => kpa,
            Reference::Ambient => -kpa,
            Reference::Absolute => self.ambient_kpa - kpa,
        }
    }
}

/// A question to the drive.
#[derive(Clone, Debug)]
pub struct Question {
    /// What is sent, and what its answer looks like.
    pub speech: Speech,
    pub(super) expects: Expects,
}

/// What its answer has to be.
#[derive(Clone, Copy, Debug)]
pub(super) enum Expects {
    /// As it looks.
    Taken,
    /// The set point that was sent, within so much, in the unit of the answer.
    SetPoint { sent: f64, within: f64 },
    /// What the drive's own gauge reads: so many kPa is one, and what they refer to.
    Pressure { unit_kpa: f64, refers: Refers },
}

impl Question {
    /// What the number of an answer says: kPa below ambient, where it is what the drive's own gauge reads.
    ///
    /// # Errors
    /// The set point is not the one that was sent.
    pub fn judge(&self, number: Option<f64>) -> Result<Option<f64>, String> {
        match (self.expects, number) {
            (Expects::SetPoint { sent, within }, Some(taken)) if (taken - sent).abs() > within => {
                Err(format!("its set point is {taken} where {sent:.2} was sent"))
            }
            (Expects::Pressure { unit_kpa, refers }, Some(number)) => Ok(Some(refers.turned(unit_kpa * number))),
            _ => Ok(None),
        }
    }
}
