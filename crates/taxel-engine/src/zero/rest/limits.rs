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
/// Most that the median taxel of a module moves from the first half to the second, beside what noise explains.
pub(super) const HALF_MODULE_MAX: f64 = 0.5;
/// Margin for the error of a figure that was estimated from noisy scans, in its standard errors.
pub(super) const STANDARD_ERRORS: f64 = 4.0;
/// Three of a module's taxels that all move by so many standard errors from half to half: once in 20,000 windows by chance, of 23
/// modules with ten taxels.
pub(super) const THIRD_ERRORS_MAX: f64 = 3.3;
/// Three of a module's taxels with so many times the noise that they are known to have: of 20 scans once in 1e9 windows.
pub(super) const THIRD_NOISE_MAX: f64 = 1.9;
/// The median taxel's noise over what it is known to be, for skins of small modules.
pub(super) const NOISE_RATIO_MAX: f64 = 2.5;
/// A taxel that moves further from half to half has jumped, in standard errors: by chance one in a hundred thousand
/// (`a_taxel_at_rest_keeps_its_zero`).
pub(super) const STEADY_ERRORS_MAX: f64 = 5.0;
/// And in counts, so that rounding is no movement.
pub(super) const STEADY_COUNTS_MAX: f64 = 1.0;
/// So many of a module, or of the skin, that jump are a load that came or went, however few of a module's taxels it lies on. One
/// alone may be broken, and of a large skin one more for each `TAXELS_PER_BROKEN`.
pub(super) const JUMPS: usize = 2;
pub(super) const TAXELS_PER_BROKEN: usize = 500;
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
/// Most that temperature moves all taxels by in a minute since that zero, and at all.
pub(super) const DRIFT_PER_MINUTE_MAX: f64 = 1.0;
pub(super) const DRIFT_SINCE_ZERO_MAX: f64 = 3.5;
/// So many taxels of a module that stand still that far towards load are a load.
pub(super) const STANDING: usize = 2;
/// The median taxel, away from load: beyond, it is another zero of the boards.
pub(super) const MOVED_AWAY_MAX: f64 = 10.0;

// Lighter than its zero? The median taxel, a module, its third taxel.

pub(super) const LIFT_MEDIAN_MAX: f64 = 0.75;
pub(super) const LIFT_MODULE_MAX: f64 = 1.5;
pub(super) const LIFT_THIRD_MAX: f64 = 2.5;
