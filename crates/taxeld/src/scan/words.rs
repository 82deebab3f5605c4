//! The findings in words, and as the beginning of a configuration.

use std::fmt::Write as _;

use taxel_can::BusError;

use super::compare::numbers;
use super::findings::{BoardFound, Findings, ModuleFound, OtherFound, PressureFound};

/// Most modules are triangles: the summary leaves their thermal pads out.
const THERMAL_PADS: [usize; 2] = [6, 10];

/// A text for people.
#[must_use]
pub fn text(findings: &Findings, differences: Option<&[String]>) -> String {
    let mut text = String::new();
    let (frames, seconds, load) = (findings.frames, findings.seconds, 100.0 * findings.load);
    let _ = writeln!(text, "{frames} frames in {seconds:.1} s, {load:.1} % of a 1 Mbit/s bus");
    for notice in &findings.notices {
        let _ = writeln!(text, "the bus: {notice}");
    }
    if let Some(errors) = &findings.errors {
        let kinds: Vec<String> = errors.kinds.iter().map(|(kind, count)| format!("{count} x {kind}")).collect();
        let counters =
            |(sending, receiving)| format!("; error counters up to {sending} sending, {receiving} receiving");
        let counters = errors.counters_max.map(counters).unwrap_or_default();
        let _ = writeln!(text, "error frames: {}{counters}", kinds.join("; "));
    }
    if findings
        .errors
        .as_ref()
        .is_some_and(|errors| errors.kinds.contains_key(BusError::Protocol { violations: 0 }.kind()))
    {
        text.push_str(
            "  protocol errors come of wrong bit timing, too: these boards sample at 50 to 60 % of a bit, Linux at 75 %; \
             try sample-point 0.6\n",
        );
    }
    if findings.boards.is_empty() {
        text.push_str("no skin board was heard: boards send once they are configured, `taxeld run` does that\n");
    }
    for (address, found) in &findings.boards {
        board(&mut text, *address, found);
    }
    if !findings.never_whole.is_empty() {
        let boards = findings.never_whole.iter().map(|(address, modules)| match numbers(modules) {
            modules if modules.is_empty() => format!("board {address}"),
            modules => format!("board {address} (modules {modules})"),
        });
        let boards = boards.collect::<Vec<_>>().join(", ");
        let _ =
            writeln!(text, "frames like those of {boards}, but no whole scan: other traffic, or halves that were lost");
    }
    for found in &findings.others {
        other(&mut text, found);
    }
    match differences {
        None => {}
        Some([]) => text.push_str("all is as the configuration says\n"),
        Some(lines) => {
            text.push_str("different from the configuration:\n");
            lines.iter().for_each(|line| {
                let _ = writeln!(text, "  {line}");
            });
        }
    }
    text
}

fn board(text: &mut String, address: u8, found: &BoardFound) {
    let modules = numbers(found.modules.keys());
    let period = found.period_ms.map_or_else(String::new, |ms| format!(", every {ms:.1} ms"));
    let celsius = found.celsius.map_or_else(String::new, |celsius| format!(", {celsius:.1} C"));
    let firmware = found.firmware.as_ref().map_or_else(String::new, |firmware| format!(", {firmware}"));
    let _ = writeln!(text, "board {address}: modules {modules}{period}{celsius}{firmware}");
    if found.overflows > 0 {
        let _ = writeln!(text, "  threw its send queue away {} times", found.overflows);
    }
    for (number, module) in &found.modules {
        let _ = writeln!(text, "  module {number}: {}", module_line(module));
    }
}

fn module_line(module: &ModuleFound) -> String {
    let taxels = || (0..module.mean.len()).filter(|k| !THERMAL_PADS.contains(k));
    let (least, most) =
        taxels().map(|k| module.mean[k]).fold((f64::INFINITY, 0.0_f64), |(a, b), v| (a.min(v), b.max(v)));
    let mut noise: Vec<f64> = taxels().map(|k| module.noise[k]).collect();
    noise.sort_by(f64::total_cmp);
    let noise = noise.get(noise.len() / 2).copied().unwrap_or(0.0);
    let mut line = format!("{} scans, mean counts {least:.0} to {most:.0}, noise {noise:.1}", module.scans);
    if module.pressed {
        let _ = write!(line, ", pressed: {}", module.kinds.join(" or "));
    }
    let mut add = |what: &str, list: String| {
        if !list.is_empty() {
            let _ = write!(line, "; {what} {list}");
        }
    };
    add("stuck values", numbers(&module.stuck));
    add("flickering values", numbers(&module.flickering));
    add("values out of range by its status", numbers(module.out_of_range.keys()));
    let times = |count: u64| if count > 0 { format!("{count} times") } else { String::new() };
    add("missed acknowledgements", times(module.no_acks));
    add("said that nothing is connected", times(module.not_connected));
    add("halves without a partner", times(module.orphans));
    add("silent at the end for", module.silent_s.map_or_else(String::new, |s| format!("{s:.1} s")));
    line
}

fn other(text: &mut String, found: &OtherFound) {
    let lengths = numbers(&found.lengths);
    let _ =
        writeln!(text, "identifier {}: {} frames, {:.1}/s, of {lengths} bytes", found.id, found.frames, found.per_s);
    for pressure in &found.pressures {
        let _ = writeln!(text, "  could be a pressure: {}", pressure_line(pressure));
    }
}

fn pressure_line(found: &PressureFound) -> String {
    let sign = if found.signed { "signed" } else { "unsigned" };
    let (least, most) = found.kpa;
    let how = if found.moving { "moves" } else { "stands" };
    format!(
        "{sign}, {} bits from bit {}, {} endian, in {}: {how} at {least:.2} to {most:.2} kPa, {}",
        found.length_bits, found.start_bit, found.byte_order, found.unit, found.meaning
    )
}

/// The beginning of a configuration: what was heard, with marks at what cannot be.
#[must_use]
pub fn beginning(findings: &Findings, interface: &str) -> String {
    let mut text = String::from(
        "# Begun by `taxeld scan` with what was heard on the bus.\n# Lines with `CHECK:` say what that leaves open. \
         deploy/taxeld.toml explains every key.\n\n[store]\npath = \"/var/lib/taxeld/taxeld.db\"\n\n[[bus]]\nname = \"skin\"\n",
    );
    let _ = writeln!(text, "interface = {}", toml::Value::String(interface.to_owned()));
    text.push_str(
        "\n# CHECK: one patch of all boards; name it, and make a patch of each part that has a bag of its own.\n[[patch]]\n\
         name = \"skin\"\nbus = \"skin\"\nlisten_only = true # CHECK: false lets the daemon configure the boards\n",
    );
    let periods = findings.boards.values().filter_map(|board| board.period_ms);
    match periods.reduce(f64::max) {
        Some(period) => {
            let _ = writeln!(text, "period_ms = {}", period.round().clamp(1.0, 209.0));
        }
        None => text.push_str("# period_ms = 50 # CHECK: too few scans came to tell\n"),
    }
    text.push_str("# geometry = \"FILE\" # CHECK: a position file; boards are then in its order\n");
    text.push_str("boards = [\n");
    for (address, board) in findings.boards.iter().rev() {
        let _ = writeln!(text, "    {{ address = {address}, modules = \"{}\" }},", modules_with_kinds(board));
        if *address == 14 {
            text.push_str(
                "    # CHECK: a hand has its fingertips and palm here: modules = \"0-4 fingertip, 8-11 palm\"\n",
            );
        }
    }
    text.push_str("]\n");
    let gauges = || findings.others.iter().filter_map(|other| Some((other, other.pressures.first()?)));
    match gauges().find(|(_, found)| found.moving).or_else(|| gauges().next()) {
        Some((other, found)) => gauge(&mut text, other, found),
        None => text.push_str("# CHECK: nothing on the bus could be the pressure in the bag: no gauge\n"),
    }
    text
}

/// The modules; those that were pressed and cannot be triangles with what they can be.
fn modules_with_kinds(board: &BoardFound) -> String {
    let kind = |module: &ModuleFound| match module.kinds.last() {
        // Fewer taxels fit less often, so they are the better guess.
        Some(kind) if module.pressed && !module.kinds.contains(&"triangle") => format!(" {kind}"),
        _ => String::new(),
    };
    let list: Vec<(u8, String)> = board.modules.iter().map(|(number, module)| (*number, kind(module))).collect();
    let runs = list.chunk_by(|a, b| a.0 + 1 == b.0 && a.1 == b.1);
    let runs =
        runs.filter_map(|run| Some(format!("{}{}", numbers(run.iter().map(|(number, _)| number)), run.first()?.1)));
    runs.collect::<Vec<_>>().join(", ")
}

fn gauge(text: &mut String, other: &OtherFound, found: &PressureFound) {
    let PressureFound { start_bit, length_bits, unit, kpa: (least, most), .. } = found;
    let number = u32::from_str_radix(&other.id, 16).unwrap_or_default(); // as candump writes it
    let id = if other.extended && number <= 0x7FF { number | 0x8000_0000 } else { number };
    let (order, sign) = (u8::from(found.byte_order == "little"), if found.signed { '-' } else { '+' });
    let ambient = if found.meaning == "absolute" { ", ambient_kpa = 101.325" } else { "" };
    let _ = writeln!(text, "# CHECK: is this the bag's pressure? It read {least:.2} to {most:.2} kPa.");
    if !ambient.is_empty() {
        text.push_str("# CHECK: ambient_kpa is the pressure of the air here\n");
    }
    let _ = writeln!(
        text,
        "gauge = {{ id = {id:#X}, signal = \"{start_bit}|{length_bits}@{order}{sign}\", unit = \"{unit}\"{ambient} }}"
    );
}
