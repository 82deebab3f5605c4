//! The samples of a session, block by block.

use futures_util::stream::{self, StreamExt};
use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::calibration::export::table_head;
use taxel_engine::calibration::{RampBaseline, Sample, SessionSamples};
use taxel_proto::v1;
use tonic::Status;

use crate::backend::ask;
use crate::convert::known;
use crate::service::Service;
use crate::shares::Held;
use crate::stream::MessageStream;

/// Samples of one message: of 230 taxels 125 kB.
const BLOCK_SAMPLES: usize = 500;

impl Service {
    /// The samples of a session that exists, as a stream of blocks, at least one.
    pub(crate) async fn export(&self, held: Held, session: u64) -> Result<MessageStream<v1::SampleBlock>, Status> {
        let samples = ask(held, |told| self.backend.samples(session, told)).await;
        let (samples, _) = samples.map_err(|refusal| refusal.about("session", session))?;
        let view = self.session(session)?; // as it is now that the samples are read
        let plan = self.handle.plan.patches.iter().find(|plan| plan.patch.name() == view.patch);
        let head = plan.map(|plan| table_head(&plan.about(&view), &samples)).unwrap_or_default();
        let blocks = samples.samples.len().div_ceil(BLOCK_SAMPLES).max(1);
        let message = move |number| {
            let table_head = if number == 0 { head.clone() } else { String::new() };
            Ok(v1::SampleBlock { table_head, ..block(&samples, number) })
        };
        Ok(stream::iter(0..blocks).map(message).boxed())
    }
}

fn block(samples: &SessionSamples, number: usize) -> v1::SampleBlock {
    let message = |sample: &Sample| v1::SessionSample {
        ramp: u32::from(sample.ramp) + 1,
        monotonic_ns: sample.time_ns,
        pressure_kpa: sample.pressure_kpa,
        counts: (0..sample.counts.counts().len())
            .filter_map(|taxel| sample.counts.counts().raw(taxel))
            .map(u32::from)
            .collect(),
    };
    let those = samples.samples.iter().skip(number * BLOCK_SAMPLES).take(BLOCK_SAMPLES);
    let ramps = if number == 0 { samples.ramps.iter().map(|ramp| zero(samples, ramp)).collect() } else { Vec::new() };
    v1::SampleBlock {
        samples: those.map(message).collect(),
        samples_in_all: samples.samples.len() as u64,
        ramps,
        table_head: String::new(),
    }
}

fn zero(samples: &SessionSamples, ramp: &RampBaseline) -> v1::RampZero {
    let rest =
        |taxel: &TaxelBaseline| v1::RestCount { mean_counts: known(taxel.mean), noise_counts: known(taxel.noise) };
    v1::RampZero {
        ramp: u32::from(ramp.ramp) + 1,
        samples: samples.samples.iter().filter(|sample| sample.ramp == ramp.ramp).count() as u64,
        taxels: ramp.taxels.iter().map(rest).collect(),
        gauge_kpa: ramp.gauge_kpa.and_then(known),
    }
}
