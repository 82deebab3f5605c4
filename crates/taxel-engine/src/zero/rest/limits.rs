//! From where on a skin is not at rest.

/// Limits of the test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestLimits {
    /// Fewest scans.
    pub scans_min: u64,
    /// Least share of the comparable taxels that must be sound.
    pub sound_share_min: f64,
    /// Most that the median taxel may have moved into the direction of load, in counts.
    pub moved_median_max: f64,
    /// Most that a module may have moved into the direction of load beyond the median of all, in counts.
    pub moved_module_max: f64,
    /// Most that the third taxel of a module may have moved into the direction of load beyond the median of all, in
    /// counts: two may be odd, three that lie together are a load.
    pub moved_third_max: f64,
    /// Most that the second taxel of a module may have moved so, in counts: a load at a corner of the skin, or where
    /// modules meet, lies on two taxels of each of them.
    pub moved_second_max: f64,
    /// The same against a zero that holds now, for the third taxel and for the second.
    pub moved_third_from_zero_max: f64,
    /// See [`RestLimits::moved_third_from_zero_max`].
    pub moved_second_from_zero_max: f64,
    /// Most that the median taxel may drift in a minute by temperature, in counts.
    pub drift_per_minute_max: f64,
    /// Most that the median taxel may have moved the other way, in counts: beyond, it is another zero.
    pub moved_away_max: f64,
    /// Most that the median taxel may drift from begin to end of the window, in counts, beside what noise explains.
    pub drift_max: f64,
    /// Most that the median taxel of a module may move from the first half of the window to the second, in counts,
    /// beside what noise explains.
    pub half_module_max: f64,
    /// Most that the median taxel's noise may exceed its noise at rest, as a factor.
    pub noise_ratio_max: f64,
    /// Most that the median taxel may become lighter than its zero, in counts.
    pub lift_median_max: f64,
    /// Most that a module may become lighter than its zero, in counts.
    pub lift_module_max: f64,
    /// Most that the third taxel of a module may become lighter than its zero, in counts.
    pub lift_third_max: f64,
}

impl Default for RestLimits {
    fn default() -> Self {
        Self {
            scans_min: 10,
            sound_share_min: 1.0 / 3.0,
            moved_median_max: 3.5,
            moved_module_max: 5.0,
            moved_third_max: 8.0,
            moved_second_max: 16.0,
            moved_third_from_zero_max: 2.5,
            moved_second_from_zero_max: 8.0,
            drift_per_minute_max: 1.0,
            moved_away_max: 10.0,
            drift_max: 0.4,
            half_module_max: 0.5,
            noise_ratio_max: 2.5,
            lift_median_max: 0.75,
            lift_module_max: 1.5,
            lift_third_max: 2.5,
        }
    }
}
