//! Who makes certificates: the service only brings together what they are made of.

use std::sync::Arc;

use taxel_engine::calibration::{SessionSamples, SessionView};
use taxel_engine::loads::Load;
use taxel_engine::model_set::ModelSet;

/// What a certificate is made of.
#[derive(Clone, Debug)]
pub struct CertificateOf {
    /// The models.
    pub set: Arc<ModelSet>,
    /// The same as ExportModelSet gives them.
    pub models_json: String,
    /// Position in the plan of the patch that they are for.
    pub patch: usize,
    /// The session that they came from.
    pub session: Arc<SessionView>,
    /// What it gathered.
    pub samples: SessionSamples,
    /// The known loads of the patch.
    pub loads: Vec<Arc<Load>>,
}

/// A certificate that was made.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MadeCertificate {
    /// Its number.
    pub number: String,
    /// For programmes.
    pub json: String,
    /// For people.
    pub html: String,
}

/// Makes a certificate, or says why the set cannot be certified. It is called on a thread that may compute.
pub type CertificateMaker = Arc<dyn Fn(&CertificateOf) -> Result<MadeCertificate, String> + Send + Sync>;
