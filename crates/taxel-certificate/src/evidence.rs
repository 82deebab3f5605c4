//! What a certificate is made of.

use std::sync::Arc;

use taxel_engine::calibration::export::About;
use taxel_engine::calibration::{SessionSamples, SessionView};
use taxel_engine::loads::Load;
use taxel_engine::model_set::ModelSet;

use crate::entered::Entered;

/// Everything that a certificate is made of.
#[derive(Clone, Copy, Debug)]
pub struct Evidence<'a> {
    /// The models.
    pub set: &'a ModelSet,
    /// The same as they are exported, whose hash goes into the certificate.
    pub models_json: &'a str,
    /// The session that they came from.
    pub session: &'a SessionView,
    /// What it gathered.
    pub samples: &'a SessionSamples,
    /// What the table of them says of the patch.
    pub about: &'a About,
    /// The known loads of the patch, also those of other sets.
    pub loads: &'a [Arc<Load>],
    /// What people state.
    pub entered: &'a Entered,
    /// Where each taxel is, in words.
    pub places: &'a [String],
    /// Modules that the session was told to do without, in words.
    pub left_out: &'a [String],
    /// Name and version of the programme that makes the certificate.
    pub software: &'a str,
}

impl Evidence<'_> {
    /// Whether no skin was measured: a simulator or a replayed log sent the samples.
    pub(crate) const fn is_simulated(&self) -> bool {
        self.set.maker.simulated || self.about.simulated
    }

    /// Whether set, session and samples belong together.
    ///
    /// # Errors
    /// Why they do not.
    pub(crate) fn check(&self) -> Result<(), String> {
        let (set, session) = (self.set, self.session);
        let number = set.certifying_session()?;
        if number != session.number || set.patch != session.patch {
            return Err(format!("{} is of session {number} of patch {}, which is not here", set.id, set.patch));
        }
        let Some(zero) = self.samples.ramps.first() else {
            return Err(format!("session {number} has no ramp in the store"));
        };
        let same = |a: f64, b: f64| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
        let is_own = zero.taxels.len() == set.baseline.len()
            && zero.taxels.iter().zip(&set.baseline).all(|(a, b)| same(a.mean, b.mean) && same(a.noise, b.noise));
        if !is_own {
            return Err(format!(
                "{} was not made of session {number} of this store: its zero is not the one of the session's first ramp",
                set.id
            ));
        }
        let taxels = set.taxels.len();
        if self.samples.samples.is_empty() {
            return Err(format!("session {number} has no sample in the store"));
        }
        if self.samples.samples.iter().any(|sample| sample.counts.counts().len() != taxels) {
            return Err(format!("session {number} has samples of another number of taxels than {}: {taxels}", set.id));
        }
        Ok(())
    }
}
