//! What was found, in words and as the beginning of a configuration.

use std::fmt::Write as _;

use super::survey::Survey;

/// A text for people.
#[must_use]
pub fn text(survey: &Survey) -> String {
    let seconds = survey.seconds();
    let mut lines = vec![format!("{} frames in {seconds:.1} s", survey.frames)];
    lines.extend(survey.notices.iter().map(|(what, count)| format!("the bus: {count} x {what}")));
    if survey.boards().next().is_none() {
        lines.push("no skin board was heard: boards send once they are configured, `taxeld run` does that".to_owned());
    }
    for (address, board) in survey.boards() {
        let numbers = numbers(board.modules().map(|(number, _)| number));
        let period = board.period_ms().map_or_else(String::new, |ms| format!(", every {ms:.1} ms"));
        lines.push(format!("board {address}: modules {numbers}{period}"));
        lines.extend(board.modules().map(|(number, module)| {
            let (scans, (least, most), halves) = (module.scans, module.range, module.orphans());
            format!("  module {number}: {scans} scans, counts {least} to {most}, {halves} halves without a partner")
        }));
    }
    for (id, other) in &survey.others {
        let (frames, lengths) = (other.frames, numbers(other.lengths.iter().copied()));
        let (rate, last) = (frames as f64 / seconds.max(1e-3), &other.last);
        lines.push(format!("identifier {id}: {frames} frames, {rate:.1}/s, of {lengths} bytes, last {last:02x?}"));
    }
    lines.join("\n")
}

/// The beginning of a configuration: what was heard, with marks at what cannot be.
#[must_use]
pub fn beginning(survey: &Survey, interface: &str) -> String {
    let mut text = format!(
        r#"# Begun by `taxeld scan` with what was heard on the bus.
# Lines with `CHECK:` say what that leaves open. deploy/taxeld.toml explains every key.

[store]
path = "/var/lib/taxeld/taxeld.db"

[[bus]]
name = "skin"
interface = {}

# CHECK: one patch of all boards; name it, and make a patch of each part that has a bag of its own.
[[patch]]
name = "skin"
bus = "skin"
listen_only = true # CHECK: false lets the daemon configure the boards
"#,
        toml::Value::String(interface.to_owned())
    );
    match survey.boards().filter_map(|(_, board)| board.period_ms()).reduce(f64::max) {
        Some(period) => {
            let _ = writeln!(text, "period_ms = {}", period.round().clamp(1.0, 209.0));
        }
        None => text.push_str("# period_ms = 50 # CHECK: too few scans came to tell\n"),
    }
    text.push_str("# geometry = \"FILE\" # CHECK: a position file; boards are then in its order\nboards = [\n");
    for (address, board) in survey.boards().rev() {
        let modules = numbers(board.modules().map(|(number, _)| number));
        let _ = writeln!(text, "    {{ address = {address}, modules = \"{modules}\" }},");
        if address.get() == 14 {
            text.push_str(
                "    # CHECK: a hand has its fingertips and palm here: modules = \"0-4 fingertip, 8-11 palm\"\n",
            );
        }
    }
    text.push_str("]\n");
    text.push_str(
        "# CHECK: without the bag's pressure sensor there is no calibration, only force. Put in yours:\n\
         # gauge = { id = 0x3A1, signal = \"0|32@1-\", unit = \"Pa\" }\n",
    );
    text
}

/// Numbers as a configuration writes them, in runs: `0-3, 7`.
pub fn numbers(list: impl IntoIterator<Item = u8>) -> String {
    let list: Vec<u8> = list.into_iter().collect();
    let run = |run: &[u8]| match run {
        [first, .., last] => format!("{first}-{last}"),
        [only] => only.to_string(),
        [] => String::new(),
    };
    list.chunk_by(|a, b| a + 1 == *b).map(run).collect::<Vec<_>>().join(", ")
}
