//! How large a programme is: its file, and the part of it that is loaded.

use std::path::Path;

use anyhow::Context;

/// Both sizes in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Of all segments that are loaded: code and data, without debug information.
    pub loaded_bytes: u64,
    /// Of the file.
    pub file_bytes: u64,
}

/// A segment that is loaded (`PT_LOAD`).
const LOADED: u64 = 1;

/// Sizes of a 64-bit little-endian ELF file, as the ELF-64 object file format has them.
///
/// # Errors
/// If it cannot be read or is something else.
pub fn size(file: &Path) -> anyhow::Result<Size> {
    let bytes = std::fs::read(file)?;
    let loaded_bytes = loaded(&bytes).with_context(|| format!("{} is not a 64-bit ELF file", file.display()))?;
    Ok(Size { loaded_bytes, file_bytes: bytes.len() as u64 })
}

fn loaded(bytes: &[u8]) -> Option<u64> {
    // Magic, 64 bits, little endian.
    bytes.starts_with(b"\x7fELF\x02\x01").then_some(())?;
    let (headers, header_bytes, count) = (number(bytes, 0x20, 8)?, number(bytes, 0x36, 2)?, number(bytes, 0x38, 2)?);
    let mut total = 0_u64;
    for index in 0..count {
        let header = usize::try_from(headers.checked_add(index * header_bytes)?).ok()?;
        if number(bytes, header, 4)? == LOADED {
            total = total.checked_add(number(bytes, header.checked_add(0x20)?, 8)?)?;
        }
    }
    Some(total)
}

/// The little-endian number of `length` bytes at `at`.
fn number(bytes: &[u8], at: usize, length: usize) -> Option<u64> {
    let field = bytes.get(at..at.checked_add(length)?)?;
    Some(field.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_programme_loads_less_than_its_file_holds_with_debug_information() {
        let this = size(&std::env::current_exe().unwrap()).unwrap();
        assert!(this.loaded_bytes > 100_000 && this.loaded_bytes < this.file_bytes, "{this:?}");
    }

    proptest! {
        #[test]
        fn no_bytes_panic(mut bytes in proptest::collection::vec(any::<u8>(), 0..200), elf: bool) {
            if elf && bytes.len() >= 6 {
                bytes[..6].copy_from_slice(b"\x7fELF\x02\x01");
            }
            let _ = loaded(&bytes);
        }
    }
}
