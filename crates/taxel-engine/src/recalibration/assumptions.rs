//! How much readings of a sound skin scatter from place to place, and what else has to be assumed.

use crate::loads::factor::PLACE_REL;

/// What a recalibration takes for granted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Assumptions {
    /// Relative standard deviation of what a sound skin reads from place to place, [`PLACE_REL_MIN`] to [`PLACE_REL_MAX`].
    pub place_rel: f64,
    /// Standard deviation that does not grow with the load, in the unit of the points; 0 or more.
    pub floor: f64,
    /// Whether an offset that all taxels have in common is looked for beside the gain. Only for points in kPa.
    pub offset: bool,
}

impl Assumptions {
    /// Masses laid on a patch, in newton: [`PLACE_REL`] from place to place, and 0.1 N of a zero that is 0.1 kPa off over 30
    /// taxels.
    pub const MASSES: Self = Self { place_rel: PLACE_REL, floor: 0.1, offset: false };

    /// A chamber or a bag that loads the whole skin, in kPa: how far the mean over all taxels lies from the gauge on the
    /// very recording that the curves were fitted to (`left_calibration` in taxel-model's README), root mean square: 2.0 %
    /// above 30 kPa, 3 to 4 kPa below.
    pub const PRESSURES: Self = Self { place_rel: 0.02, floor: 3.0, offset: false };

    /// What is wrong with them, in words.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        let (place, floor) = (self.place_rel, self.floor);
        if !(PLACE_REL_MIN..=PLACE_REL_MAX).contains(&place) {
            return Some(format!(
                "the scatter from place to place is {place}, expected {PLACE_REL_MIN} to {PLACE_REL_MAX}"
            ));
        }
        let wrong = !(floor.is_finite() && floor >= 0.0);
        wrong.then(|| format!("the least scatter is {floor}, expected a number of 0 or more"))
    }
}

/// No skin of taxels with gaps is known to scatter less.
pub const PLACE_REL_MIN: f64 = 0.01;

/// A skin that scatters more than this cannot be set right by one gain.
pub const PLACE_REL_MAX: f64 = 0.2;
