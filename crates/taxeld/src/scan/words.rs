//! What was found, in words and as a line of a configuration.

use std::fmt::Write as _;

use taxel_skin::Time;

use super::module::ModuleWatch;
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
        lines.extend(
            board.modules().map(|(number, module)| format!("  module {number}: {}", of_module(module, survey.end()))),
        );
    }
    let boards = survey.boards().rev().map(|(address, board)| {
        let modules = numbers(board.modules().map(|(number, _)| number));
        format!("{{ address = {address}, modules = \"{modules}\" }}")
    });
    let boards: Vec<String> = boards.collect();
    if !boards.is_empty() {
        lines.push(format!("for its [[patch]]: boards = [{}]", boards.join(", ")));
    }
    for (id, other) in &survey.others {
        let (frames, lengths) = (other.frames, numbers(other.lengths.iter().copied()));
        let (rate, last) = (frames as f64 / seconds.max(1e-3), &other.last);
        lines.push(format!("identifier {id}: {frames} frames, {rate:.1}/s, of {lengths} bytes, last {last:02x?}"));
    }
    lines.join("\n")
}

fn of_module(module: &ModuleWatch, end: Time) -> String {
    let (least, most) = module.range();
    let mut line = format!("{} scans, counts {least} to {most}", module.scans);
    let times = |count: u64| if count > 0 { format!("{count} times") } else { String::new() };
    for (what, said) in [
        ("stuck values", numbers(module.stuck())),
        ("a trouble in its status", times(module.status_errors)),
        ("halves without a partner", times(module.orphans())),
        ("silent at the end for", module.silent_s(end).map_or_else(String::new, |s| format!("{s:.1} s"))),
    ] {
        if !said.is_empty() {
            let _ = write!(line, "; {what} {said}");
        }
    }
    line
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
