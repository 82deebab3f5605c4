//! Limits and options of a patch: numbers of the file, checked, with the engine's defaults where it has none.

use std::time::Duration;

use taxel_engine::calibration::fit::{Branch, PlaysChoice};
use taxel_engine::plan::{DriftPlan, LiveLimits, SessionLimits};
use taxel_model::{Estimator, Exclusion, FitOptions, GaugeUncertainty, Order};
use taxel_skin::Kilopascal;

use super::fault::{Fault, within};
use super::fit_section::{AutoWord, EstimatorWord, FitSection, OrderWord, PlaysWord};
use super::parts::{BranchesWord, DriftSection, GaugeSection, LiveSection, SessionSection};
use super::signal_parts::PushSection;

/// When a taxel counts as touched or stale.
///
/// # Errors
/// The key, its value and what was expected.
pub fn live(section: &LiveSection, period: Duration) -> Result<LiveLimits, Fault> {
    let defaults = LiveLimits::default();
    let or = |key: &str, value: Option<f64>, default: f64, min: f64, max: f64| {
        within(&format!("live.{key}"), value.unwrap_or(default), min, max)
    };
    let periods = section.stale_periods.unwrap_or(3);
    within("live.stale_periods", f64::from(periods), 2.0, 100.0)?;
    if section.activation_sigmas == Some(0.0) && section.activation_floor_counts == Some(0.0) {
        let words = "live.activation_sigmas = 0 and live.activation_floor_counts = 0: expected one of them above 0, or every taxel \
                     would always count as touched";
        return Err(Fault::of("live.activation_sigmas", words));
    }
    Ok(LiveLimits {
        activation_sigmas: or("activation_sigmas", section.activation_sigmas, defaults.activation_sigmas, 0.0, 100.0)?,
        activation_floor_counts: or(
            "activation_floor_counts",
            section.activation_floor_counts,
            defaults.activation_floor_counts,
            0.0,
            255.0,
        )?,
        stale_after: period * periods,
        // No power was lost between two scans of a slow array.
        power_cycle_after: defaults.power_cycle_after.max(period * 3),
        stale_share_max: or("stale_share_max", section.stale_share_max, defaults.stale_share_max, 0.0, 1.0)?,
        ..defaults
    })
}

/// Whether and how far the zero follows the temperature.
///
/// # Errors
/// The key, its value and what was expected.
pub fn drift(section: &DriftSection) -> Result<DriftPlan, Fault> {
    let defaults = DriftPlan::default();
    let rate = section.rate_counts_per_min.unwrap_or(defaults.rate_max_counts_per_min);
    let bound = section.bound_counts.unwrap_or(defaults.bound_counts);
    Ok(DriftPlan {
        follow: section.follow,
        rate_max_counts_per_min: within("drift.rate_counts_per_min", rate, 0.01, 60.0)?,
        bound_counts: within("drift.bound_counts", bound, 0.1, 50.0)?,
    })
}

/// The rules of a session.
///
/// # Errors
/// The key, its value and what was expected.
pub fn session(section: &SessionSection, plays: PlaysWord) -> Result<SessionLimits, Fault> {
    let defaults = SessionLimits::default();
    let or = |key: &str, value: Option<f64>, default: f64, min: f64, max: f64| {
        within(&format!("session.{key}"), value.unwrap_or(default), min, max)
    };
    let seconds = |key: &str, value: Option<f64>, default: Duration, min, max| {
        or(key, value, default.as_secs_f64(), min, max).map(Duration::from_secs_f64)
    };
    let defaults = SessionLimits { pressurised_chamber: section.pressurised_chamber, ..defaults };
    let most = defaults.target_max_kpa();
    if let Some(kpa) = section.target_kpa.filter(|kpa| *kpa > most && !section.pressurised_chamber) {
        let words = format!(
            "session.target_kpa is {kpa}, expected 1 to {most}: a vacuum bag ends at the ambient pressure. For a chamber under \
             pressure set pressurised_chamber = true beside it"
        );
        return Err(Fault::of("session.target_kpa", words));
    }
    Ok(SessionLimits {
        target: Kilopascal(or("target_kpa", section.target_kpa, defaults.target.0, 1.0, most)?),
        noise_band: Kilopascal(or("noise_band_kpa", section.noise_band_kpa, defaults.noise_band.0, 0.0, 50.0)?),
        rise_max_kpa_per_s: or(
            "rise_max_kpa_per_s",
            section.rise_max_kpa_per_s,
            defaults.rise_max_kpa_per_s,
            0.1,
            1000.0,
        )?,
        branches: match section.branches {
            BranchesWord::Rising => Branch::Rising,
            BranchesWord::Both => Branch::Both,
        },
        fall_max_kpa_per_s: or(
            "fall_max_kpa_per_s",
            section.fall_max_kpa_per_s.or(section.rise_max_kpa_per_s),
            defaults.fall_max_kpa_per_s,
            0.1,
            1000.0,
        )?,
        fall_end: Kilopascal(or("fall_end_kpa", section.fall_end_kpa, defaults.fall_end.0, 0.0, 1000.0)?),
        plays: match plays {
            PlaysWord::Auto => PlaysChoice::Auto,
            PlaysWord::On => PlaysChoice::On,
            PlaysWord::Off => PlaysChoice::Off,
        },
        gauge_timeout: seconds("gauge_timeout_s", section.gauge_timeout_s, defaults.gauge_timeout, 0.01, 1.0)?,
        patience: seconds("patience_s", section.patience_s, defaults.patience, 1.0, 3600.0)?,
        vented_below: Kilopascal(or(
            "vented_below_kpa",
            section.vented_below_kpa,
            defaults.vented_below.0,
            0.1,
            1000.0,
        )?),
        ..defaults
    })
}

/// How models are fitted.
///
/// # Errors
/// The key, its value and what was expected.
pub fn fit_options(section: &FitSection, gauge: GaugeUncertainty) -> Result<FitOptions, Fault> {
    let defaults = FitOptions::default();
    if let OrderWord::Fixed(order) = section.order {
        within("fit.order", f64::from(order), 1.0, 10.0)?;
    }
    if section.estimator == EstimatorWord::Paper && section.plays == PlaysWord::On {
        let words = "fit.plays is \"on\", but the paper's estimator compensates no hysteresis";
        return Err(Fault::of("fit.plays", words));
    }
    if section.estimator == EstimatorWord::Paper && section.max_interval_share.is_some() {
        let words = "fit.max_interval_share is set, but the paper's estimator excludes by min_swing_counts alone";
        return Err(Fault::of("fit.max_interval_share", words));
    }
    Ok(FitOptions {
        order: match section.order {
            OrderWord::Fixed(order) => Order::Fixed(order),
            OrderWord::Auto(AutoWord::Auto) => Order::Auto,
        },
        exact: section.exact,
        estimator: match section.estimator {
            EstimatorWord::PressureBinned => Estimator::PressureBinned,
            EstimatorWord::PerSample => Estimator::PerSample,
            EstimatorWord::Paper => Estimator::Paper,
        },
        exclusion: Exclusion {
            min_swing_counts: within("fit.min_swing_counts", section.min_swing_counts, 0.0, 255.0)?,
            max_interval_share: match section.max_interval_share {
                Some(share) => within("fit.max_interval_share", share, 0.001, 100.0)?,
                None => defaults.exclusion.max_interval_share,
            },
            ..defaults.exclusion
        },
        gauge,
        ..defaults
    })
}

/// What is stated of the bag's gauge, or of what measures the pressure that is pushed with the scans.
///
/// # Errors
/// The key that is out of its range, or stated of no pressure.
pub fn gauge_uncertainty(gauge: Option<&GaugeSection>, push: Option<&PushSection>) -> Result<GaugeUncertainty, Fault> {
    if let Some(g) = gauge {
        return Ok(GaugeUncertainty {
            gain_rel: within("gauge.gain_uncertainty", g.gain_uncertainty, 0.0, 1.0)?,
            offset_kpa: within("gauge.offset_uncertainty_kpa", g.offset_uncertainty_kpa, 0.0, 100.0)?,
            noise_kpa: within("gauge.noise_kpa", g.noise_kpa, 0.0, 100.0)?,
        });
    }
    let Some(p) = push else { return Ok(GaugeUncertainty::default()) };
    let stated = [
        ("push.pressure_gain_uncertainty", p.pressure_gain_uncertainty, 1.0),
        ("push.pressure_offset_uncertainty_kpa", p.pressure_offset_uncertainty_kpa, 100.0),
        ("push.pressure_noise_kpa", p.pressure_noise_kpa, 100.0),
    ];
    if let Some((key, ..)) = stated.iter().find(|(_, value, _)| *value != 0.0 && !p.pressure) {
        return Err(Fault::of(
            *key,
            format!("{key} is stated, but push.pressure = false: no pressure comes with the scans"),
        ));
    }
    let [gain_rel, offset_kpa, noise_kpa] = stated.map(|(key, value, most)| within(key, value, 0.0, most));
    Ok(GaugeUncertainty { gain_rel: gain_rel?, offset_kpa: offset_kpa?, noise_kpa: noise_kpa? })
}
