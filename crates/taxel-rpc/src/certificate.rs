//! The certificate of a model set: the service brings together what it is made of, and somebody else makes it.

use std::sync::Arc;

use taxel_engine::model_set::ModelSet;
use taxel_proto::refusal::Refusal;
use taxel_proto::v1;
use taxel_proto::v1::ErrorReason;
use tonic::Status;

use crate::access::caller::Caller;
use crate::aside::aside;
use crate::certificate_maker::{CertificateOf, MadeCertificate};
use crate::samples::read;
use crate::service::Service;
use crate::shares::{Place, What};
use crate::status::samples_not_kept;

impl Service {
    /// The certificate of a model set, with a place that is to be held until it is out.
    pub(crate) async fn certificate(
        &self,
        caller: &Caller,
        set: Arc<ModelSet>,
    ) -> Result<(v1::Certificate, Place), Status> {
        let missing = || {
            Refusal::failed_precondition(
                ErrorReason::NotOffered,
                "this build makes no certificates (cargo feature `certificate`)",
            )
        };
        let maker = self.handle.certificates.clone().ok_or_else(missing)?;
        let source = self.handle.samples.clone().ok_or_else(samples_not_kept)?;
        let not_here = || {
            let id = &set.id;
            let why = match (set.session, set.derived_from()) {
                (Some(session), _) => {
                    format!("{id} is of session {session}, which is not in the store: deleted, or of another daemon")
                }
                (None, Some(source)) => {
                    format!("{id} was made of {source} by known loads: ask for the certificate of that")
                }
                (None, None) => format!(
                    "{id} was imported, fitted from a file or merged, not made of one session here: there are no \
                     samples to certify it by"
                ),
            };
            Refusal::failed_precondition(ErrorReason::SamplesMissing, why).about("model_set", id)
        };
        let session = set.session.ok_or_else(not_here)?;
        let session = self.sessions().into_iter().find(|view| view.number == session && view.patch == set.patch);
        let session = session.ok_or_else(not_here)?;
        let patch = self.patch(&set.patch)?;
        let loads = self.handle.catalogue.borrow().validations.get(patch).map(Arc::clone);
        let loads = loads.iter().flat_map(|view| view.loads.iter().map(|judged| Arc::clone(&judged.load))).collect();
        let place = self.place(What::Export, caller)?;
        let number = session.number;
        let (samples, place) = read(&source, number, place).await?;
        let (model_set, to_json) = (set.id.clone(), self.handle.codec.to_json);
        // A whole session is gone through several times: no stream should wait for that.
        let make = move || -> Result<MadeCertificate, Refusal> {
            let models_json = to_json(&set).map_err(Refusal::fault)?;
            let made = maker(&CertificateOf { set, models_json, patch, session, samples, loads });
            made.map_err(|why| Refusal::failed_precondition(ErrorReason::NotFitted, why).about("session", number))
        };
        let (made, place) = aside(place, make).await?;
        let MadeCertificate { number, json, html } = made?;
        Ok((v1::Certificate { model_set, number, json, html }, place))
    }
}
