//! From where on a skin is not at rest. In counts, unless they say otherwise; "recorded" are the days and seconds of the module's
//! head, simulated windows are those of the tests.

/// Fewest scans that tell anything.
pub const SCANS_MIN: u64 = 10;
/// Least share of the taxels that can be compared which has to be sound.
pub(super) const SOUND_SHARE_MIN: f64 = 1.0 / 3.0;
/// Least noise that a taxel is credited with: rounding alone makes 0.29.
pub(super) const NOISE_MIN_COUNTS: f64 = 0.5;

// Still?

/// Most that the median taxel drifts from begin to end of the window, beside what noise explains.
pub(super) const DRIFT_MAX: f64 = 0.4;
/// Margin for the error of a figure that was estimated from noisy scans, in its standard errors.
pub(super) const STANDARD_ERRORS: f64 = 4.0;
/// Three of a module's taxels with so many times the noise that they are known to have: of 20 scans once in 1e9 windows.
pub(super) const THIRD_NOISE_MAX: f64 = 1.9;
/// A taxel that moves further from half to half has jumped, in standard errors: by chance one in a hundred thousand
/// (`a_taxel_at_rest_keeps_its_zero`).
pub(super) const STEADY_ERRORS_MAX: f64 = 5.0;
/// And in counts, so that rounding is no movement.
pub(super) const STEADY_COUNTS_MAX: f64 = 1.0;
/// So many taxels of a module may be broken. More that jump are a load that came or went, and more that stand still as far towards
/// load as the second may are a load.
pub(super) const BROKEN_MAX: f64 = 1.0;
/// Most of [`super::RestWindow::unlikeness`]: of 62 seconds of the recorded insole none has more than 4.6 (`insole_tests.rs`).
pub(super) const UNLIKENESS_MAX: f64 = 5.0;

// Where, towards load? By the models, from day to day.

/// The median taxel.
pub(super) const MOVED_MEDIAN_MAX: f64 = 3.5;
/// The median taxel of a module, beyond that of all.
pub(super) const MOVED_MODULE_MAX: f64 = 5.0;
/// The second and the third taxel of a module, beyond the median of all. Two may be odd, three that lie together are a load; at a
/// corner of the skin, or where modules meet, a load lies on two taxels of each.
pub(super) const MOVED_FEW_MAX: [f64; 2] = [16.0, 8.0];
/// The same by a zero that holds now: it knows only of temperature and hysteresis.
pub(super) const MOVED_FEW_FROM_ZERO_MAX: [f64; 2] = [8.0, 2.5];
/// The median taxel, away from load: beyond, it is another zero of the boards.
pub(super) const MOVED_AWAY_MAX: f64 = 10.0;

// Lighter than its zero? The median taxel, a module, its third taxel.

pub(super) const LIFT_MEDIAN_MAX: f64 = 0.75;
pub(super) const LIFT_MODULE_MAX: f64 = 1.5;
pub(super) const LIFT_THIRD_MAX: f64 = 2.5;
