//! A model set: what a session produced for a patch, with all it depends on.
//!
//! What is serializable here is so by the names of its fields: they are the format of MODELS.json, and its id depends on them.

mod curve_sigma;

use serde::{Deserialize, Serialize};
use taxel_model::{End, Extension, Plays, Sign, SkinSlope, TaxelModel};

use crate::baseline::TaxelBaseline;
use crate::loads::load::LoadsPlan;
use crate::recalibration::points::LoadPoint;

/// By how much a skin's gain differs between days, relative standard uncertainty: a calibration of one day cannot know
/// it. Capacitive insoles differed by -2.9 to +3.0 % between two days under the same loads (Hurkmans et al. 2006, Gait
/// and Posture 23, 118, the dynamic tests): a rectangle of half-width 3 %, so 3 % / sqrt(3).
pub const GAIN_OF_DAY_REL: f64 = 0.017;

/// By how much the gain differs between two recordings of one mounting, relative standard uncertainty. Matched to made-up
/// skins whose gain differs by 2 %, of which left-out readings show a part.
pub const GAIN_OF_RECORDING_REL: f64 = 0.01;

/// The same as [`Recorded::unloading_share`] of a skin whose falling pressure nobody recorded: anything from nothing to what a
/// capacitive insole showed, 13 % (Belli et al. 2023, Sensors 23, 4501, fitted without plays), so 13 % / sqrt(3), rounded up.
const UNLOADING_SHARE: f64 = 0.1;

/// Models of all taxels of a patch, immutable once made.
#[derive(Clone, Debug, Default)]
pub struct ModelSet {
    /// `m-` and the first 16 hexadecimal digits of the content's hash; made by the store's codec.
    pub id: String,
    /// The patch it is for.
    pub patch: String,
    /// When it was made, nanoseconds since 1970.
    pub created_wall_ns: i64,
    /// Number of the session it came from; `None` if it was fitted from a file or imported.
    pub session: Option<u64>,
    /// `monotone, order 3 in pressure` and the like: how it was fitted.
    pub method: String,
    /// Board settings that the counts depend on, and the modules of the patch, in words: one line a board.
    pub board_settings: Vec<String>,
    /// Count and noise at rest that the models refer to, one per taxel.
    pub baseline: Vec<TaxelBaseline>,
    /// Highest pressure that was calibrated, in kPa.
    pub pressure_max_kpa: f64,
    /// Relative standard uncertainty of the gauge's gain, shared by all taxels.
    pub gauge_gain_rel: f64,
    /// Standard uncertainty of the gauge's offset in kPa, shared by all taxels.
    pub gauge_offset_kpa: f64,
    /// Below this the skin does not answer, as play does it, kPa.
    pub dead_zone_kpa: f64,
    /// One model per taxel of the patch, in its order.
    pub taxels: Vec<TaxelModel>,
    /// What rising and falling pressure together tell beyond that; `None` after a session over the rising branch.
    pub recorded: Option<Recorded>,
    /// By what known loads corrected another set, where this one came to be that way.
    pub recalibrated: Option<Recalibrated>,
    /// What made it, of which its id does not depend.
    pub maker: Maker,
}

/// What made a model set, and of what.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Maker {
    /// Name and version of the programme that fitted it, for example `taxeld 0.1.0`; empty if that is not known.
    pub software: String,
    /// Whether its samples came of a simulator or of a replayed log.
    pub simulated: bool,
}

impl Maker {
    /// This programme.
    #[must_use]
    pub fn this(simulated: bool) -> Self {
        Self { software: concat!("taxeld ", env!("CARGO_PKG_VERSION")).to_owned(), simulated }
    }
}

/// So often a set may be corrected after a correction.
pub const EARLIER_MAX: usize = 32;

/// How a set came of another one by known loads.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recalibrated {
    /// Id of the set that was corrected.
    pub derived_from: String,
    /// Ids of the sets that this one was made of in the same way, the nearest first; at most [`EARLIER_MAX`].
    pub earlier: Vec<String>,
    /// Mean area of the taxels that the loads were read with, in mm2: with other areas the gain says nothing.
    pub area_mm2: f64,
    /// Whether the loads were read with taxels filled by their neighbours: without that, what lacks is in the gain.
    pub filled: bool,
    /// What its pressures were multiplied by.
    pub gain: f64,
    /// Standard uncertainty of the gain.
    pub gain_sigma: f64,
    /// Relative standard deviation from place to place that was assumed.
    pub place_rel: f64,
    /// Relative standard uncertainty that a load at a new place has by the correction; in `gauge_gain_rel`.
    pub relative_sigma: f64,
    /// The gains of this correction and all before it, multiplied.
    pub gain_in_all: f64,
    /// The loads: what was read, at the areas as configured, and what lay there.
    pub points: Vec<LoadPoint>,
}

impl ModelSet {
    /// Whether it was fitted to scans of a skin over time, and not to a table of counts and pressures.
    #[must_use]
    pub const fn is_of_skin(&self) -> bool {
        self.session.is_some() || self.recorded.is_some() || self.recalibrated.is_some()
    }

    /// Whether it says what taxels in use read at rest. A set of a table that has no scan at rest does not.
    #[must_use]
    pub fn knows_rest(&self) -> bool {
        let mut usable = self.taxels.iter().zip(&self.baseline).filter(|(model, _)| model.is_usable()).peekable();
        usable.peek().is_none() || usable.any(|(_, rest)| rest.mean.is_finite())
    }

    /// The set with `zero` for the rest of its usable taxels, if it says nothing of any.
    #[must_use]
    pub fn with_rest(&self, zero: &[TaxelBaseline]) -> Option<Self> {
        (!self.knows_rest()).then(|| Self { baseline: zero.to_vec(), ..self.clone() })
    }

    /// Number of the session whose samples can certify it.
    ///
    /// # Errors
    /// Why no session can, in words.
    pub fn certifying_session(&self) -> Result<u64, String> {
        let id = &self.id;
        match (self.session, self.derived_from()) {
            (Some(session), _) => Ok(session),
            (None, Some(source)) => {
                Err(format!("{id} was made of {source} by known loads: ask for the certificate of that"))
            }
            (None, None) => Err(format!(
                "{id} was imported, fitted from a file or merged, not made of one session here: there are no samples to \
                 certify it by"
            )),
        }
    }

    /// Id of the set that this one was made of by known loads.
    #[must_use]
    pub fn derived_from(&self) -> Option<&str> {
        self.origins().next()
    }

    /// Ids of all sets that this one was made of by known loads, the nearest first.
    pub fn origins(&self) -> impl Iterator<Item = &str> {
        self.recalibrated.iter().flat_map(|of| std::iter::once(&of.derived_from).chain(&of.earlier)).map(String::as_str)
    }

    /// Why the set says nothing of a patch whose loads are read so, in words: those that corrected it were read otherwise, and what
    /// was in these is in the gain.
    #[must_use]
    pub fn unfit_for_sum(&self, plan: &LoadsPlan) -> Option<String> {
        let of = self.recalibrated.as_ref()?;
        let differs = plan.differs_from(of.area_mm2, of.filled)?;
        Some(format!(
            "when the loads that corrected `{}` were read, {differs}: activate `{}`, which it was made of, or set it as it was",
            self.id, of.derived_from
        ))
    }

    /// Which way pressure moves the count of each taxel: +1, -1, or 0 where no usable model says.
    #[must_use]
    pub fn signs(&self) -> Vec<i8> {
        let sign = |model: &TaxelModel| match (model.is_usable(), model.sign) {
            (false, _) => 0,
            (true, Sign::Rising) => 1,
            (true, Sign::Falling) => -1,
        };
        self.taxels.iter().map(sign).collect()
    }

    /// What is known of a taxel in use; `None` without a recording of both branches.
    #[must_use]
    pub fn in_use(&self, taxel: usize) -> Option<&RecordedTaxel> {
        self.recorded.as_ref()?.taxels.get(taxel)?.as_ref()
    }

    /// A taxel's hysteresis; `None` where it is not compensated.
    #[must_use]
    pub fn plays(&self, taxel: usize) -> Option<&Plays> {
        self.in_use(taxel)?.plays.as_ref()
    }

    /// By how much a load that decreases may be read too high, standard uncertainty: a share as `force/unloading.rs` takes it.
    #[must_use]
    pub fn unloading_share(&self) -> f64 {
        self.recorded.as_ref().and_then(|recorded| recorded.unloading_share).unwrap_or(UNLOADING_SHARE)
    }

    /// How the curve in use of each taxel goes on beyond its calibrated range; `None` without a usable one.
    #[must_use]
    pub fn extensions(&self) -> Vec<Option<Extension>> {
        let end = |taxel: usize| {
            let model = self.taxels.get(taxel).filter(|model| model.is_usable())?;
            Some(End { curve: model.served()?, range: model.range?, sign: model.sign })
        };
        let skin = SkinSlope::of((0..self.taxels.len()).filter_map(end));
        (0..self.taxels.len()).map(|taxel| skin?.extend(&end(taxel)?)).collect()
    }
}

/// What a fit to rising and falling pressure, of a recording or a session, knows of the skin in use.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recorded {
    /// Counts were averaged over so many seconds, and are to be when the models are applied; 0 is not at all.
    pub smooth_s: f64,
    /// Plays follow the mean over so many seconds before, readings the newest count; 0 where both follow smoothed counts.
    pub plays_mean_s: f64,
    /// So many neighbouring taxels form a module.
    pub module_size: usize,
    /// How far the counts stay away from their zero when the load has gone, root mean square over the taxels; `None` where that was
    /// not measured.
    pub zero_return_counts: Option<f64>,
    /// By how much all taxels alike read wrong while the pressure falls, less what plays take off: a share of the root of the load that
    /// has gone times that which is left, where that is less. `None` without both branches.
    pub unloading_share: Option<f64>,
    /// Median error with plays over that without, on the part of the falling branch that neither was fitted to.
    pub plays_error_ratio: Option<f64>,
    /// One entry per taxel; `None` where it was not fitted.
    pub taxels: Vec<Option<RecordedTaxel>>,
}

/// One taxel in use.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordedTaxel {
    /// Swing of the count over that of the pressure, counts per kPa; positive.
    pub sensitivity: f64,
    /// The hysteresis as plays; `None` where they are off.
    pub plays: Option<Plays>,
}
