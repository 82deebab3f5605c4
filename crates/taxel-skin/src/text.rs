//! Texts of which nobody says in which encoding they are: UTF-8 or, as some editors and shells save them, UTF-16.

/// The text of these bytes, without a byte order mark. Bytes that are none are replaced: what matters in our files is ASCII.
#[must_use]
pub fn decode(bytes: &[u8]) -> String {
    match utf16_order(bytes) {
        Some(order) => {
            let units = bytes[2..].chunks_exact(2).map(|pair| order([pair[0], pair[1]]));
            char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
        }
        None => {
            let text = String::from_utf8_lossy(bytes);
            text.strip_prefix('\u{feff}').unwrap_or(&text).to_owned()
        }
    }
}

fn utf16_order(begin: &[u8]) -> Option<fn([u8; 2]) -> u16> {
    match begin {
        [0xFF, 0xFE, ..] => Some(u16::from_le_bytes),
        [0xFE, 0xFF, ..] => Some(u16::from_be_bytes),
        _ => None,
    }
}
