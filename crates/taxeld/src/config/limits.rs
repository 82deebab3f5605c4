//! Limits and options of a patch: numbers of the file, checked, with the engine's defaults where it has none.

use std::time::Duration;

use taxel_engine::SCANS_MIN;
use taxel_engine::calibration::fit::Branch;
use taxel_engine::plan::{LiveLimits, SessionLimits, TarePlan};
use taxel_model::GaugeUncertainty;
use taxel_skin::Kilopascal;

use super::patch_section::{BranchesWord, GaugeSection, PatchSection, SessionSection};
use taxel_rig::Faults;

/// When a taxel counts as touched or stale.
pub fn live(section: &PatchSection, period: Duration, faults: &mut Faults) -> LiveLimits {
    // Of a port only change counts, and a live triangle may stay the same for three scans.
    let periods = section.stale_periods.unwrap_or(if section.port.is_some() { 8 } else { 3 });
    faults.range("stale_periods", f64::from(periods), 2.0, 100.0);
    let defaults = LiveLimits::default();
    LiveLimits {
        stale_after: period.saturating_mul(periods.into()),
        // No power was lost between two scans of a slow array.
        power_cycle_after: defaults.power_cycle_after.max(period * 3),
        ..defaults
    }
}

/// A slow array is watched until it has sent what a zero needs.
pub fn tare(section: &PatchSection, period: Duration) -> TarePlan {
    let defaults = TarePlan::default();
    let enough = period.saturating_mul(SCANS_MIN as u32);
    TarePlan { duration: defaults.duration.max(enough), at_start: section.tare_at_start }
}

/// The rules of a session.
pub fn session(section: &SessionSection, faults: &mut Faults) -> SessionLimits {
    let defaults = SessionLimits { pressurised_chamber: section.pressurised_chamber, ..SessionLimits::default() };
    let target = section.target_kpa.unwrap_or(defaults.target.0);
    // A ramp begins below `vented_below` and has to end above it.
    let (least, most) = (defaults.vented_below.0 + 1.0, defaults.target_max_kpa());
    let more = if section.pressurised_chamber { "" } else { ", or pressurised_chamber = true beside it" };
    faults.require("session.target_kpa", (least..=most).contains(&target), || {
        format!(" = {target}: expected {least} to {most}{more}")
    });
    let noise_band = section.noise_band_kpa.unwrap_or(defaults.noise_band.0);
    faults.range("session.noise_band_kpa", noise_band, 0.0, (target / 2.0).min(50.0));
    let steepest = section.rise_max_kpa_per_s.unwrap_or(defaults.steepest_kpa_per_s);
    faults.range("session.rise_max_kpa_per_s", steepest, 0.1, 1000.0);
    SessionLimits {
        target: Kilopascal(target),
        noise_band: Kilopascal(noise_band),
        steepest_kpa_per_s: steepest,
        branches: match section.branches {
            BranchesWord::Rising => Branch::Rising,
            BranchesWord::Both => Branch::Both,
        },
        ..defaults
    }
}

/// What is stated of what measures the pressure.
///
/// What is read off a dial is wrong by up to half of what it is read to, either way, and by that for all taxels.
pub fn gauge_uncertainty(gauge: &GaugeSection, faults: &mut Faults) -> GaugeUncertainty {
    let read_kpa = gauge.resolution_kpa.unwrap_or(0.0) / 12.0_f64.sqrt();
    GaugeUncertainty {
        gain_rel: faults.range("gauge.gain_uncertainty", gauge.gain_uncertainty, 0.0, 1.0),
        offset_kpa: faults
            .range("gauge.offset_uncertainty_kpa", gauge.offset_uncertainty_kpa, 0.0, 100.0)
            .hypot(read_kpa),
        noise_kpa: faults.range("gauge.noise_kpa", gauge.noise_kpa, 0.0, 100.0),
    }
}
