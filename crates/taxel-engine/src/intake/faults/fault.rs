//! The faults that a taxel can have.

use std::fmt;

use crate::names::named;

named! {
    /// What is wrong with a taxel.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
    #[repr(u8)]
    pub enum Fault {
        /// At an end of the converter's range: the true value lies beyond.
        Rail = "saturated",
        /// Has stopped to change while others, or its known noise, say that it must.
        Frozen = "frozen",
        /// Goes back and forth by far more than noise: a contact or converter flickers.
        Jumping = "jumping",
        /// Has never changed since it was first heard.
        Dead = "dead",
        /// Most of its module jumps or sits on a rail, so that the rest cannot be trusted either.
        ModuleFlicker = "module flicker",
        /// The module's status word says that this value is out of range.
        StatusOutOfRange = "out of range by status",
        /// The module's status word says that nothing is connected.
        NotConnected = "not connected",
        /// The module's status word reports a lost acknowledgement.
        NoAck = "no acknowledgement",
        /// Its module has been silent for too long.
        Stale = "silent",
        /// Its module's scans come faster than its board can send them.
        TooFast = "too fast",
    }
}

/// A set of faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct FaultSet(u16);

impl FaultSet {
    /// Whether there is none.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether `fault` is among them.
    #[must_use]
    pub const fn contains(self, fault: Fault) -> bool {
        self.0 & (1 << fault as u16) != 0
    }

    /// The set with `fault` in it.
    #[must_use]
    pub const fn with(self, fault: Fault) -> Self {
        Self(self.0 | 1 << fault as u16)
    }

    /// Its faults, in the order of [`Fault::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Fault> {
        Fault::ALL.into_iter().filter(move |&fault| self.contains(fault))
    }

    /// The faults of both.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Its faults that `other` has not.
    #[must_use]
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    pub(super) const fn set(&mut self, fault: Fault, on: bool) {
        let bit = 1 << fault as u16;
        self.0 = if on { self.0 | bit } else { self.0 & !bit };
    }
}

impl fmt::Display for FaultSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, fault) in self.iter().enumerate() {
            write!(f, "{}{}", if i == 0 { "" } else { ", " }, fault.name())?;
        }
        Ok(())
    }
}
