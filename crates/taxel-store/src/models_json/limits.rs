//! What a MODELS.json may hold at most. Whoever reads one knows neither its writer nor, before the end, its size, so each
//! bound is checked while the text is read and before anything of it takes memory.

/// Longest text that is read or written. 2,880 taxels, all that fit on one bus, take 20 MB with every figure there is.
pub(crate) const TEXT_BYTES_MAX: usize = 32 << 20;

/// Longest string of a set in memory: the settings of a board with 16 modules take 800 bytes.
pub(super) const WORDS_BYTES_MAX: usize = 2 << 10;

/// Most lines of board settings: one per board.
pub(super) const SETTINGS_MAX: usize = 256;

/// Most flags of a taxel: there are ten sorts.
pub(super) const FLAGS_MAX: usize = 64;

/// Most taxels of a set: their numbers are 16 bit.
pub(super) const TAXELS_MAX: usize = u16::MAX as usize;

/// Whether a text of so many bytes can be read.
pub(crate) fn check_length(bytes: usize) -> Result<(), String> {
    if bytes > TEXT_BYTES_MAX {
        return Err(format!("the text takes {bytes} bytes, the limit is {TEXT_BYTES_MAX}"));
    }
    Ok(())
}

/// So many characters of a text that is not understood are shown.
const SHOWN_CHARS_MAX: usize = 200;

/// The beginning of a text.
pub(super) fn shown(text: &str) -> String {
    match text.char_indices().nth(SHOWN_CHARS_MAX) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}
