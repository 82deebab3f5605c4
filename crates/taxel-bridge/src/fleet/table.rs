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
    fn a_table_says_what_is_and_a_dash_where_nothing_is_known() {
        let row = Row {
            robot: "icub".into(),
            patch: "arm".into(),
            state: "OK".into(),
            force_n: Some(4.904),
            sigma_n: Some(0.21),
            excluded: Some(11),
            model_set: "m-1".into(),
            ..Row::default()
        };
        let reasons = vec!["nothing new for 9.1 s".to_owned()];
        let silent = Row { robot: "r1".into(), patch: "leg".into(), state: "SILENT".into(), reasons, ..Row::default() };
        let text = text(&[row, silent]);
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines[0], "robot  patch  state   force N       excluded  model set  why");
        assert_eq!(lines[1], "icub   arm    OK      4.90 +- 0.21  11        m-1");
        assert_eq!(lines[2], "r1     leg    SILENT  -             -         -          nothing new for 9.1 s");
    }

    #[test]
    fn what_a_robot_says_forges_no_row_and_is_no_command_to_the_terminal() {
        let forged = "\nicub02  arm  OK  4.90 +- 0.10\u{1b}[2J".to_owned();
        let row = Row { state: "OK".into(), simulated: true, reasons: vec![forged], ..Row::default() };
        let text = text(&[row]);
        assert_eq!((text.lines().count(), text.contains('\u{1b}')), (2, false), "{text}");
        assert!(text.contains("OK, simulated"), "{text}");
    }
}
