//! The samples of a stored session, read for one call.

use taxel_engine::calibration::SessionSamples;
use taxel_proto::refusal::Refusal;
use taxel_proto::v1::ErrorReason;
use tokio::sync::oneshot;
use tonic::Status;

use crate::handle::SamplesSource;
use crate::status::engine_stopped;

/// Reads them. The turn goes the way of the question: where whoever asked has gone meanwhile, it is free again when the
/// store has answered and not before, so that calls which are made and given up do not pile up in the store.
pub(crate) async fn read<T: Send + 'static>(
    source: &SamplesSource,
    session: u64,
    turn: T,
) -> Result<(SessionSamples, T), Status> {
    let (tell, told) = oneshot::channel();
    source(session, Box::new(move |samples| drop(tell.send((samples, turn)))));
    let (samples, turn) = told.await.map_err(|_| engine_stopped())?;
    let samples = samples.map_err(|why| {
        let why = format!("the samples of session {session}: {why}");
        Refusal::failed_precondition(ErrorReason::DataDamaged, why).about("session", session)
    })?;
    Ok((samples, turn))
}
