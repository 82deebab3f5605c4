//! A short number for much data.

/// FNV-1a of 32 bits (Fowler, Noll, Vo): against mistakes, not against forgers.
pub struct Fnv(u32);

impl Default for Fnv {
    fn default() -> Self {
        Self(0x811c_9dc5)
    }
}

impl Fnv {
    /// Takes more.
    pub fn push(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u32::from(*byte)).wrapping_mul(0x0100_0193);
        }
    }

    /// Of all that was taken.
    pub const fn sum(&self) -> u32 {
        self.0
    }
}
