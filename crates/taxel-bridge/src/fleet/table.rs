//! All robots as a table in a terminal.

use taxel_skin::{columns, printable};

use crate::fleet::book::Row;

const HEAD: [&str; 7] = ["robot", "patch", "state", "force N", "excluded", "model set", "why"];

/// Robots write into it what they like, but no other rows and nothing that a terminal obeys.
fn cells(row: &Row) -> Vec<String> {
    let force = row.force_n.map(|n| row.sigma_n.map_or(format!("{n:.2}"), |sigma| format!("{n:.2} +- {sigma:.2}")));
    let none = || "-".to_owned();
    let cells = [
        row.robot.clone(),
        row.patch.clone(),
        if row.simulated { format!("{}, simulated", row.state) } else { row.state.clone() },
        force.unwrap_or_else(none),
        row.excluded.map_or_else(none, |excluded| excluded.to_string()),
        if row.model_set.is_empty() { none() } else { row.model_set.clone() },
        row.reasons.join("; "),
    ];
    cells.map(|cell| printable(&cell)).to_vec()
}

/// The table.
pub fn text(rows: &[Row]) -> String {
    let rows: Vec<_> = rows.iter().map(cells).collect();
    columns(&HEAD, &rows).join("\n") + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_robot_says_forges_no_row_and_is_no_command_to_the_terminal() {
        let forged = "\nicub02  arm  OK  4.90 +- 0.10\u{1b}[2J".to_owned();
        let row = Row { state: "OK".into(), simulated: true, reasons: vec![forged], ..Row::default() };
        let text = text(&[row]);
        assert_eq!((text.lines().count(), text.contains('\u{1b}')), (2, false), "{text}");
        assert!(text.contains("OK, simulated  - "), "{text}");
    }
}
