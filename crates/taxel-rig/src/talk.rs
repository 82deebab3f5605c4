//! What is asked of a gauge or a drive, and what it says, on one way to it.

use crate::lines::Lines;
use crate::modbus::{Framing, Request};
use crate::template::Template;

/// A question, and what its answer looks like.
#[derive(Clone, Debug, PartialEq)]
pub enum Speech {
    /// Text.
    Text {
        /// What it answers with a line; empty where it prints by itself.
        poll: String,
        /// What a line looks like.
        template: Template,
    },
    /// Modbus.
    Modbus(Request, Framing),
}

/// A talk, from when the way was opened.
#[derive(Debug)]
pub struct Talk {
    lines: Lines,
    /// What came of an answer that is not whole.
    came: Vec<u8>,
    transaction: u16,
}

impl Talk {
    /// Nothing was said. Who says nothing unasked begins with a whole line.
    #[must_use]
    pub fn begin(is_asked: bool) -> Self {
        let lines = if is_asked { Lines::from_the_first() } else { Lines::default() };
        Self { lines, came: Vec::new(), transaction: 0 }
    }

    /// The bytes of a question. What was not answered until then is not waited for any more.
    #[must_use]
    pub fn question(&mut self, speech: &Speech) -> Vec<u8> {
        self.came.clear();
        self.transaction = self.transaction.wrapping_add(1);
        match speech {
            Speech::Text { poll, .. } => poll.clone().into_bytes(),
            Speech::Modbus(request, framing) => request.question(*framing, self.transaction),
        }
    }

    /// Takes what was read: the answers in it, each with its number in the device's unit, or why it is none.
    pub fn take(&mut self, speech: &Speech, bytes: &[u8]) -> Vec<Result<Option<f64>, String>> {
        self.came.extend_from_slice(bytes);
        match speech {
            Speech::Text { poll, template } => {
                let mut lines = self.lines.take(&std::mem::take(&mut self.came));
                lines.retain(|line| line != poll.trim()); // an echo of the question
                lines.iter().map(|line| template.read(line)).collect()
            }
            Speech::Modbus(request, framing) => {
                request.answer(*framing, self.transaction, &mut self.came).into_iter().collect()
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
