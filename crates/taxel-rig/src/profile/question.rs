//! A question to a drive, and what its answer has to be.

use serde::Deserialize;

use crate::modbus::Request;
use crate::talk::Speech;
use crate::template::quoted;

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
    /// The key of the profile that says so.
    pub(super) key: String,
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
                Err(format!("received set point {taken}, expected {sent:.2}"))
            }
            (Expects::Pressure { unit_kpa, refers }, Some(number)) => Ok(Some(refers.turned(unit_kpa * number))),
            _ => Ok(None),
        }
    }

    /// What is sent, and what is expected, in words.
    #[must_use]
    pub fn words(&self) -> [String; 2] {
        match &self.speech {
            Speech::Text { poll, template } => [quoted(poll), quoted(template.text())],
            Speech::Modbus(request, _) => {
                let (slave, address) = request.of();
                match request {
                    Request::Write { values, .. } => {
                        [format!("{values:?} to register {address} of slave {slave}"), "that it took them".to_owned()]
                    }
                    Request::Read(_) => {
                        [format!("a question for register {address} of slave {slave}"), "a number".to_owned()]
                    }
                }
            }
        }
    }

    /// What was sent, received and expected where no right answer came, and what to do; `why` is what was wrong with the last one.
    #[must_use]
    pub fn missed(&self, received: &[u8], why: Option<&str>) -> String {
        let ([sent, expected], key) = (self.words(), &self.key);
        match (why, received) {
            (Some(why), _) => format!("sent {sent}, {why}; if what came is right, change {key} of its profile"),
            (None, []) => format!(
                "sent {sent}, received nothing, expected {expected} ({key}); is it on, are its line and rate those of `at`, does it answer this?"
            ),
            (None, bytes) => {
                let came = quoted(&String::from_utf8_lossy(bytes));
                format!("sent {sent}, received {came}, expected {expected} ({key}); is its rate that of `at`?")
            }
        }
    }
}
