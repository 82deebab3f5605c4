//! Text from elsewhere that is shown on terminals and written into logs.

/// The first character of a text that is not shown as itself: a control character, which a terminal acts upon, a break of
/// the line, or one that is invisible or turns the direction of what follows, so that a text reads as another.
#[must_use]
pub fn unprintable(text: &str) -> Option<char> {
    text.chars().find(|&c| is_odd(c))
}

/// A text in which those characters are written as escapes (`\n`, `\u{202e}`), so that it is one line and reads as what it is.
#[must_use]
pub fn printable(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        if is_odd(c) { shown.extend(c.escape_default()) } else { shown.push(c) }
    }
    shown
}

/// A number of things in words: `1 taxel is`, `3 taxels are`.
#[must_use]
pub fn counted(number: usize, one: &str, several: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { several })
}

/// Rows under a header as lines, each column as wide as its widest cell.
#[must_use]
pub fn columns(header: &[&str], rows: &[Vec<String>]) -> Vec<String> {
    let header: Vec<String> = header.iter().map(|cell| (*cell).to_owned()).collect();
    let all = || std::iter::once(&header).chain(rows);
    let width = |column: usize| all().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max();
    let widths: Vec<usize> = (0..header.len()).map(|column| width(column).unwrap_or(0)).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:width$}"));
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    all().map(line).collect()
}

fn is_odd(c: char) -> bool {
    c.is_control()
        || matches!(u32::from(c), 0xAD | 0x061C | 0x180B..=0x180F | 0x200B..=0x200F | 0x2028..=0x202E | 0x2060..=0x206F)
        || matches!(u32::from(c), 0xFEFF | 0xFFF9..=0xFFFB | 0xE0000..=0xE0FFF)
        // Blank letters, joiners and variants of what stands before them.
        || matches!(u32::from(c), 0x034F | 0x115F | 0x1160 | 0x17B4 | 0x17B5 | 0x2800 | 0x3164 | 0xFE00..=0xFE0F | 0xFFA0)
        // Whatever a font makes of them.
        || matches!(u32::from(c), 0xE000..=0xF8FF | 0xF0000..=0x10FFFF)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let rows = [vec!["1".to_owned(), "left_forearm".to_owned()], vec!["12".to_owned(), String::new()]];
        assert_eq!(columns(&["id", "patch"], &rows), ["id  patch", "1   left_forearm", "12"]);
    }

    #[test]
    fn what_is_not_shown_as_itself_is_written_out() {
        assert_eq!(printable("a b\u{e9}\\n 1 N"), "a b\u{e9}\\n 1 N");
        assert_eq!(printable("a\nb\u{1b}[8m\u{202e}"), "a\\nb\\u{1b}[8m\\u{202e}");
        assert_eq!(unprintable(&printable("\u{0}\r\n\t\u{feff}\u{e0041}")), None);
    }

    #[test]
    fn what_a_terminal_acts_upon_or_nobody_sees_is_found() {
        for text in ["Ada", "Zoë Müller-Łoś", "山田 太郎", "order 5, rising; 12 % (k = 2)", ""] {
            assert_eq!(unprintable(text), None, "{text}");
        }
        let unseen = "\u{0}\n\t\u{1b}\u{7f}\u{9b}\u{ad}\u{200b}\u{200f}\u{2028}\u{202e}\u{2066}\u{feff}\u{e0041}";
        let blank = "\u{34f}\u{115f}\u{17b4}\u{2800}\u{3164}\u{fe0f}\u{ffa0}\u{e000}\u{10fffd}";
        for odd in unseen.chars().chain(blank.chars()) {
            assert_eq!(unprintable(&format!("ann{odd}x")), Some(odd), "U+{:04X}", u32::from(odd));
        }
    }
}
