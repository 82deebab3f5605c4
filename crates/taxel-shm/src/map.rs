//! Memory that is shared with other processes. All `unsafe` of this crate is in this file.

use std::fs::File;
use std::io;
use std::num::NonZeroUsize;
use std::ptr::NonNull;

use nix::sys::mman::{MapFlags, ProtFlags, mlock, mmap, munmap};

use crate::latch::Words;
use crate::layout::PAGE_BYTES;

/// A mapped page.
#[derive(Debug)]
pub(crate) struct Map(NonNull<Words>);

// SAFETY: the memory is only ever reached through shared references to atomics, from whichever thread, and stays mapped
// until the one owner is dropped.
unsafe impl Send for Map {}
// SAFETY: as above.
unsafe impl Sync for Map {}

impl Map {
    /// Maps a page for its writer, and keeps it in memory where the system allows that.
    ///
    /// The file must be at least a page long.
    pub(crate) fn for_writing(file: &File) -> io::Result<Self> {
        let map = Self::new(file, ProtFlags::PROT_READ | ProtFlags::PROT_WRITE)?;
        // SAFETY: the whole page is mapped. Without the privilege it may be swapped out, which only costs time.
        let _ = unsafe { mlock(map.0.cast(), PAGE_BYTES) };
        Ok(map)
    }

    /// Maps a page read-only: its words may be loaded, relaxed, and a store ends the process.
    ///
    /// The file must be at least a page long.
    pub(crate) fn for_reading(file: &File) -> io::Result<Self> {
        Self::new(file, ProtFlags::PROT_READ)
    }

    fn new(file: &File, protection: ProtFlags) -> io::Result<Self> {
        const LENGTH: NonZeroUsize = NonZeroUsize::new(PAGE_BYTES).unwrap();
        // SAFETY: a new mapping at an address that the kernel chooses replaces nothing. It begins at a page, so it is
        // aligned for words, and any bytes are valid `AtomicU64`s. Others write it through atomics alone.
        let at = unsafe { mmap(None, LENGTH, protection, MapFlags::MAP_SHARED, file, 0) }?;
        Ok(Self(at.cast()))
    }

    /// The words of the page.
    pub(crate) fn words(&self) -> &Words {
        // SAFETY: the page is mapped and aligned, see `new`, and stays so until `drop`, which needs the owner.
        unsafe { self.0.as_ref() }
    }
}

impl Drop for Map {
    fn drop(&mut self) {
        // SAFETY: the mapping is ours, of this length, and nobody has a reference into it any more.
        let _ = unsafe { munmap(self.0.cast(), PAGE_BYTES) };
    }
}
