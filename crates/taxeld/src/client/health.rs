//! `taxeld health`: buses, boards, zeros and faulty taxels, and by its exit code whether all is well.

use taxel_client::troubles;
use taxel_proto::v1::{BoardHealth, BusHealth, Health, PatchHealth};
use taxel_skin::counted;

use super::connect::{Asked, Daemon};
use super::failure::{Failure, Outcome};
use super::json;
use super::places::Places;
use super::table::Tone;

/// State of buses, boards, gauges, zeros and taxels. Exit code 3 if a bus is down, a board is silent, a zero is invalid, or a
/// patch with an active model set has no force.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld health || echo 'look at the skin'\n  taxeld health --json | jq '.problems[]'"
)]
pub struct HealthArgs {
    #[command(flatten)]
    asked: Asked,
}

/// Runs it.
///
/// # Errors
/// What is not well, or no daemon.
pub async fn health(args: HealthArgs) -> Outcome {
    let daemon = args.asked.daemon().await?;
    let health = daemon.skin().get_health(()).await?.into_inner();
    if args.asked.json {
        json::print("Health", &health)?;
    } else {
        print(&daemon, &health).await?;
    }
    let wrong = troubles(&health);
    if wrong.is_empty() { Ok(()) } else { Err(Failure::refused(wrong.join("; "))) }
}

/// A gauge whose last reading is older is silent, in seconds; `calibrate` is refused then.
const GAUGE_SILENT_S: f64 = 2.0;

async fn print(daemon: &Daemon, health: &Health) -> Outcome {
    if health.engine_stalled_s.is_some() {
        say!("the engine does not run: what follows was so before, and may not be so now");
    }
    health.buses.iter().for_each(|bus| say!("{}", of_bus(bus)));
    for board in &health.boards {
        say!("{}", of_board(board));
        board.warnings.iter().for_each(|warning| say!("  {warning}"));
    }
    for patch in &health.patches {
        of_patch(patch, &daemon.places(&patch.patch).await?).iter().for_each(|line| say!("{line}"));
    }
    say!("streams: {} of {}", health.streams, health.streams_max);
    health.problems.iter().for_each(|problem| say!("problem: {problem}"));
    Ok(())
}

fn of_bus(bus: &BusHealth) -> String {
    let state = match (bus.up, bus.problem.as_str()) {
        (true, "") => Tone::Good.paint("up"),
        (true, problem) => format!("{}, last error: {problem}", Tone::Warn.paint("up")),
        (false, problem) => format!("{}: {problem}", Tone::Bad.paint("DOWN")),
    };
    let counts =
        format!("{} frames, {} foreign, {} malformed, {} dropped", bus.frames, bus.foreign, bus.malformed, bus.dropped);
    let malformed = if bus.malformed > 0 { format!("; last malformed: {}", bus.last_malformed) } else { String::new() };
    format!("bus {}: {state}; {counts}{malformed}", bus.bus)
}

fn of_board(board: &BoardHealth) -> String {
    let firmware = if board.firmware.is_empty() { String::new() } else { format!(", firmware {}", board.firmware) };
    let warmth = board.celsius.map_or_else(String::new, |celsius| format!(", {celsius:.1} degC"));
    let BoardHealth { address, patch, bring_up, scans, orphans, status_errors, .. } = board;
    let modules = format!("{} of {} modules send", board.modules_fresh, board.modules_enabled);
    let counts = format!("{scans} scans, {orphans} half scans, {status_errors} status errors");
    format!("board {address} of {patch}: {bring_up}, {modules}, {counts}{firmware}{warmth}")
}

fn of_patch(patch: &PatchHealth, places: &Places) -> Vec<String> {
    let mut lines = Vec::new();
    if let Some(tare) = &patch.tare {
        let zero = match tare.valid {
            true => format!("{} {}", tare.epoch, Tone::Good.paint("valid")),
            false => Tone::Bad.paint("INVALID"),
        };
        lines.push(format!("patch {}: zero {zero}: {}", patch.patch, tare.reason));
    }
    if patch.has_gauge {
        lines.push(match patch.gauge_kpa.zip(patch.gauge_age_s) {
            None => format!("  gauge: {}: no reading has come since the daemon started", Tone::Bad.paint("SILENT")),
            Some((kpa, age_s)) if age_s > GAUGE_SILENT_S => {
                let silent = Tone::Bad.paint("SILENT");
                format!("  gauge: {silent}: its last reading, {kpa:.2} kPa, came {age_s:.0} s ago")
            }
            Some((kpa, age_s)) => format!("  gauge: {kpa:.2} kPa, {:.0} ms old", 1e3 * age_s),
        });
    }
    if !patch.no_force.is_empty() {
        lines.push(format!("  {}: {}", Tone::Bad.paint("NO FORCE"), patch.no_force));
    }
    let mut by_fault: std::collections::BTreeMap<&str, Vec<u32>> = std::collections::BTreeMap::new();
    for faulty in &patch.faulty {
        for fault in &faulty.faults {
            by_fault.entry(fault).or_default().push(faulty.taxel);
        }
    }
    for (fault, taxels) in by_fault {
        let number = counted(taxels.len(), "taxel", "taxels");
        lines.push(format!("  {number} faulty ({fault}): {}", places.name(taxels.iter().copied())));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_proto::v1::TareStatus;

    #[test]
    fn a_patch_with_a_model_set_and_no_force_is_a_trouble_and_the_gauge_is_a_line() {
        let tare = Some(TareStatus { valid: true, ..Default::default() });
        let patch = PatchHealth { patch: "palm".to_owned(), tare, has_gauge: true, ..Default::default() };
        let said = |patch: &PatchHealth| {
            let lines = of_patch(patch, &Places::default()).join("\n");
            anstream::adapter::strip_str(&lines).to_string()
        };
        assert!(said(&patch).contains("gauge: SILENT: no reading has come"), "{}", said(&patch));
        let heard = PatchHealth { gauge_kpa: Some(0.12), gauge_age_s: Some(0.02), ..patch.clone() };
        assert!(said(&heard).contains("gauge: 0.12 kPa, 20 ms old"), "{}", said(&heard));
        let lost = PatchHealth { gauge_age_s: Some(75.0), ..heard };
        assert!(said(&lost).contains("gauge: SILENT: its last reading, 0.12 kPa, came 75 s ago"), "{}", said(&lost));
        let without = PatchHealth { no_force: "no taxel has a zero".to_owned(), ..patch };
        assert!(said(&without).contains("NO FORCE: no taxel has a zero"), "{}", said(&without));
        let troubles = taxel_client::troubles(&Health { patches: vec![without], ..Health::default() });
        assert_eq!(troubles, ["palm: no force: no taxel has a zero"]);
    }
}
