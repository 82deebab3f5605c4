//! Small things that several commands print.

use indicatif::ProgressStyle;

/// A line of comma-separated values; a cell with a comma, a quote or a line break is quoted.
pub fn csv_line(cells: &[String]) -> String {
    let quoted = |cell: &String| {
        if cell.contains([',', '"', '\n', '\r']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell.clone() }
    };
    cells.iter().map(quoted).collect::<Vec<_>>().join(",")
}

/// The style of a living line.
pub fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_with_a_comma_or_a_quote_is_quoted() {
        let cells = ["a".to_owned(), "b, c".to_owned(), "say \"no\"".to_owned(), String::new()];
        assert_eq!(csv_line(&cells), "a,\"b, c\",\"say \"\"no\"\"\",");
    }
}
