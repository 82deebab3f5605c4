//! What an export of a session came to.

/// What came of a session. Its file is in its place if all samples came.
#[derive(Default)]
pub struct Exported {
    /// Samples that came.
    pub written: u64,
    /// Samples that there are.
    pub in_all: u64,
}
