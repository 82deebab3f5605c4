//! The samples of a session, as a table in pieces.

use futures_util::stream::{self, StreamExt};
use taxel_engine::calibration::export::{sample_row, table_head};
use taxel_engine::calibration::{Sample, SessionSamples};
use taxel_proto::refusal::Refusal;
use taxel_proto::v1;
use taxel_proto::v1::ErrorReason;
use tonic::Status;

use crate::backend::ask;
use crate::service::Service;
use crate::shares::Held;
use crate::stream::MessageStream;

/// Scans of one piece: of 230 taxels 100 kB.
const PIECE_SCANS: usize = 100;

impl Service {
    /// The table of a session that exists.
    pub(crate) async fn export(&self, held: Held, session: u64) -> Result<MessageStream<v1::SampleTable>, Status> {
        let samples = ask(held, |told| self.backend.samples(session, told)).await;
        let (samples, _) = samples.map_err(|refusal| refusal.about("session", session))?;
        let Some(first_ns) = samples.samples.first().map(|sample| sample.time_ns) else {
            let why = format!("session {session} has no samples");
            return Err(Refusal::failed_precondition(ErrorReason::SessionWrongState, why).into());
        };
        let view = self.session(session)?; // as it is now that the samples are read
        let plan = self.handle.plan.patches.iter().find(|plan| plan.patch.name() == view.patch);
        let head = plan.map(|plan| table_head(&plan.about(&view), &samples)).unwrap_or_default();
        let pieces = samples.samples.len().div_ceil(PIECE_SCANS);
        let rows = stream::iter(0..pieces).map(move |number| rows(&samples, number, first_ns));
        let pieces = stream::once(std::future::ready(head)).chain(rows);
        Ok(pieces.map(|text| Ok(v1::SampleTable { text })).boxed())
    }
}

fn rows(samples: &SessionSamples, piece: usize, first_ns: i64) -> String {
    let row = |sample: &Sample| {
        let counts = sample.counts.counts();
        let raw = (0..counts.len()).filter_map(|taxel| counts.raw(taxel)).map(u32::from);
        let since_ns = sample.time_ns.saturating_sub(first_ns);
        sample_row(since_ns, sample.pressure_kpa, raw, u32::from(sample.ramp) + 1)
    };
    samples.samples.iter().skip(piece * PIECE_SCANS).take(PIECE_SCANS).map(row).collect()
}
