//! What a MODELS.json may hold at most. Whoever reads one knows neither its writer nor, before the end, its size, so each
//! bound is checked while the text is read and before anything of it takes memory.

/// Longest text that is read or written. 2,880 taxels, all that fit on one bus, take 20 MB with every figure there is.
pub(crate) const TEXT_BYTES_MAX: usize = 32 << 20;

/// Most values of a text. The same 2,880 taxels have a million.
const VALUES_MAX: usize = 1_500_000;

/// Longest string of a text as it stands there, escapes included.
const STRING_BYTES_MAX: usize = 8 << 10;

/// Longest string of a set in memory: the settings of a board with 16 modules take 800 bytes.
pub(super) const WORDS_BYTES_MAX: usize = 2 << 10;

/// Most lines of board settings: one per board.
pub(super) const SETTINGS_MAX: usize = 256;

/// Most flags of a taxel: there are ten sorts.
pub(super) const FLAGS_MAX: usize = 64;

/// Most figures of a status.
pub(super) const FIGURES_MAX: usize = 8;

/// Most taxels of a set: their numbers are 16 bit.
pub(super) const TAXELS_MAX: usize = u16::MAX as usize;

/// Lists and objects within each other: the format has six levels.
const DEPTH_MAX: usize = 16;

/// Looks once over a text, without reading it, whether it is small enough to be read.
pub(super) fn check_size(text: &str) -> Result<(), String> {
    check_length(text.len())?;
    let (mut values, mut depth, mut line) = (0_usize, 0_usize, 1_usize);
    // Where the string began that is being read; whether its next byte is escaped.
    let (mut string, mut escaped) = (None, false);
    let refuse =
        |line, what: &str, limit| Err(format!("line {line}: {what} are more than {limit}, which is the limit"));
    for (at, byte) in text.bytes().enumerate() {
        if let Some(begin) = string {
            match byte {
                _ if escaped => escaped = false,
                b'\\' => escaped = true,
                b'"' => string = None,
                _ if at - begin > STRING_BYTES_MAX => return refuse(line, "the bytes of a string", STRING_BYTES_MAX),
                _ => {}
            }
            continue;
        }
        match byte {
            b'"' => string = Some(at),
            b'\n' => line += 1,
            b'[' | b'{' => depth += 1,
            b']' | b'}' => depth = depth.saturating_sub(1),
            b',' => values += 1,
            _ => {}
        }
        if depth > DEPTH_MAX {
            return refuse(line, "the lists and objects within each other", DEPTH_MAX);
        }
        if values > VALUES_MAX {
            return refuse(line, "the values so far", VALUES_MAX);
        }
    }
    Ok(())
}

/// Whether a text of so many bytes can be read.
pub(crate) fn check_length(bytes: usize) -> Result<(), String> {
    if bytes > TEXT_BYTES_MAX {
        return Err(format!("the text takes {bytes} bytes, the limit is {TEXT_BYTES_MAX}"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &str) -> String {
        check_size(text).unwrap_err()
    }

    #[test]
    fn a_string_may_be_as_long_as_the_limit_and_no_longer() {
        let of = |bytes: usize| format!("[\n\"{}\"]", "a".repeat(bytes));
        assert_eq!(check_size(&of(STRING_BYTES_MAX)), Ok(()));
        for bytes in [STRING_BYTES_MAX + 1, 3 * STRING_BYTES_MAX] {
            assert_eq!(refused(&of(bytes)), "line 2: the bytes of a string are more than 8192, which is the limit");
        }
        // The next one is counted from its own beginning.
        assert_eq!(check_size(&format!("[{0},{0}]", of(STRING_BYTES_MAX))), Ok(()));
    }

    #[test]
    fn lists_and_objects_are_counted_where_they_are_none_of_a_strings_bytes() {
        let deepest = format!("{}{}", "[".repeat(DEPTH_MAX / 2), "{".repeat(DEPTH_MAX / 2));
        assert_eq!(check_size(&deepest), Ok(()));
        for one_more in ["[", "{"] {
            let text = format!("\n\n{deepest}{one_more}");
            let expected = "line 3: the lists and objects within each other are more than 16, which is the limit";
            assert_eq!(refused(&text), expected);
        }
        assert_eq!(check_size(&"[]{}".repeat(DEPTH_MAX)), Ok(()), "they end, too");
        for text in ["\"]", r#""\"]"#, r#""\\\"]"#] {
            let within = text.replace(']', &"[".repeat(DEPTH_MAX + 1));
            assert_eq!(check_size(&format!("{within}\"")), Ok(()), "{text}");
        }
        for text in [r#""a"]"#, r#""\"a"]"#, r#""\\"]"#] {
            assert!(check_size(&text.replace(']', &"[".repeat(DEPTH_MAX + 1))).is_err(), "{text}");
        }
    }

    #[test]
    fn values_are_counted_to_the_limit() {
        assert_eq!(check_size(&",".repeat(VALUES_MAX)), Ok(()));
        let expected = "line 2: the values so far are more than 1500000, which is the limit";
        assert_eq!(refused(&format!("\n{}", ",".repeat(VALUES_MAX + 1))), expected);
    }

    #[test]
    fn a_text_may_be_as_long_as_the_limit_and_no_longer() {
        assert_eq!(check_length(TEXT_BYTES_MAX), Ok(()));
        assert_eq!(
            check_length(TEXT_BYTES_MAX + 1).unwrap_err(),
            "the text takes 33554433 bytes, the limit is 33554432"
        );
    }
}
