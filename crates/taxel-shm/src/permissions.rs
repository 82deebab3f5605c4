//! Who may read pages, as the file system has it.

/// Who may read pages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Permissions {
    /// Mode of the pages; nobody but their owner may write.
    pub mode: u32,
    /// Number of their group; else that of the process.
    pub group: Option<u32>,
}
