//! The certificate of a model set: the service brings together what it is made of, and somebody else makes it.

use std::sync::Arc;

use taxel_engine::model_set::ModelSet;
use taxel_proto::refusal::Refusal;
use taxel_proto::v1;
use taxel_proto::v1::ErrorReason;
use tonic::Status;

use crate::backend::ask;
use crate::certificate_maker::{CertificateOf, MadeCertificate};
use crate::service::{Held, Service, aside};
use crate::status::samples_of;

impl Service {
    /// The certificate of a model set.
    pub(crate) async fn certificate(&self, held: Held, set: Arc<ModelSet>) -> Result<v1::Certificate, Status> {
        let missing = || {
            Refusal::failed_precondition(
                ErrorReason::NotOffered,
                "this build makes no certificates (cargo feature `certificate`)",
            )
        };
        let maker = self.backend.certificates().ok_or_else(missing)?;
        let refused = |why| Refusal::failed_precondition(ErrorReason::SamplesMissing, why).about("model_set", &set.id);
        let number = set.certifying_session().map_err(refused)?;
        let session = self.sessions().into_iter().find(|view| view.number == number && view.patch == set.patch);
        let session = session.ok_or_else(|| {
            let id = &set.id;
            refused(format!("{id} is of session {number}, which is not in the store: deleted, or of another daemon"))
        })?;
        let patch = self.patch(&set.patch)?;
        let loads = self.handle.catalogue.borrow().validations.get(patch).map(Arc::clone);
        let loads = loads.iter().flat_map(|view| view.loads.iter().map(|judged| Arc::clone(&judged.load))).collect();
        let (samples, held) = ask(held, |told| self.backend.samples(number, told)).await?;
        let samples = samples_of(number, samples)?;
        let (model_set, backend) = (set.id.clone(), Arc::clone(&self.backend));
        // A whole session is gone through several times: no stream should wait for that.
        let make = move || -> Result<MadeCertificate, Refusal> {
            let models_json = backend.to_json(&set).map_err(Refusal::fault)?;
            let made = maker(&CertificateOf { set, models_json, patch, session, samples, loads });
            made.map_err(|why| Refusal::failed_precondition(ErrorReason::NotFitted, why).about("session", number))
        };
        let MadeCertificate { number, json, html } = aside(held, make).await??;
        Ok(v1::Certificate { model_set, number, json, html })
    }
}
