//! What is asked of a gauge, and what it says, on one way to it.

use crate::lines::Lines;
use crate::modbus::{Framing, Register};
use crate::template::Template;

/// How a gauge talks.
#[derive(Clone, Debug, PartialEq)]
pub enum Speech {
    /// Text.
    Text {
        /// The question that it answers with a line; empty where it prints by itself.
        poll: String,
        /// What a line looks like.
        template: Template,
    },
    /// Modbus.
    Modbus(Register, Framing),
}

/// A talk, from when the way to the gauge was opened.
#[derive(Debug)]
pub struct Talk {
    speech: Speech,
    lines: Lines,
    /// What came of an answer that is not whole.
    came: Vec<u8>,
    transaction: u16,
}

impl Talk {
    /// Nothing was said.
    #[must_use]
    pub fn begin(speech: Speech) -> Self {
        let lines = if speech.is_asked() { Lines::from_the_first() } else { Lines::default() };
        Self { speech, lines, came: Vec::new(), transaction: 0 }
    }

    /// The next question. What was not answered until then is not waited for any more.
    #[must_use]
    pub fn question(&mut self) -> Vec<u8> {
        self.came.clear();
        self.transaction = self.transaction.wrapping_add(1);
        match &self.speech {
            Speech::Text { poll, .. } => poll.clone().into_bytes(),
            Speech::Modbus(register, framing) => register.question(*framing, self.transaction),
        }
    }

    /// Takes what was read: the readings in it, each in the gauge's unit, or why it is none.
    pub fn take(&mut self, bytes: &[u8]) -> Vec<Result<f64, String>> {
        match &self.speech {
            Speech::Text { poll, template } => {
                let mut lines = self.lines.take(bytes);
                lines.retain(|line| line != poll.trim()); // an echo of the question
                lines.iter().map(|line| template.read(line).map_err(|why| why.to_string())).collect()
            }
            Speech::Modbus(register, framing) => {
                self.came.extend_from_slice(bytes);
                register.answer(*framing, self.transaction, &mut self.came).into_iter().collect()
            }
        }
    }

    /// Whether bytes come that will never make a line.
    #[must_use]
    pub const fn babbles(&self) -> bool {
        self.lines.is_endless()
    }
}

impl Speech {
    /// Whether it says nothing unless it is asked.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        !matches!(self, Self::Text { poll, .. } if poll.is_empty())
    }
}
