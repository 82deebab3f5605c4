//! The samples of one stream, each with the time that it was on its way.

use std::time::Duration;

use taxel_proto::v1::force_service_client::ForceServiceClient;
use taxel_proto::v1::{ForceSample, GetForceRequest, StreamForceRequest};
use tonic::{Status, Streaming};

use crate::connect::Line;
use crate::freshness::{Reader, Received};
use crate::moment::Moment;

/// How often the daemon's clock is looked at. In between the clocks part by 6 ms at the very most.
const ASK_EVERY: Duration = Duration::from_secs(10);
/// An answer that takes longer says little of the clock.
const ANSWER_WITHIN: Duration = Duration::from_secs(2);

/// A stream of the force of a patch, and questions beside it that show the daemon's clock.
#[derive(Debug)]
pub struct Samples {
    client: ForceServiceClient<Line>,
    patch: String,
    reader: Reader,
    asked: Moment,
    stream: Streaming<ForceSample>,
    /// A sample that came, while the daemon's clock is looked at.
    came: Option<(ForceSample, Moment)>,
}

impl Samples {
    /// Subscribes; `patch` may be empty if the daemon has one, and without `rate_hz` each sample comes.
    ///
    /// # Errors
    /// What the daemon answers, or that it does not.
    pub async fn open(
        mut client: ForceServiceClient<Line>,
        patch: String,
        rate_hz: Option<f64>,
    ) -> Result<Self, Status> {
        let mut reader = Reader::default();
        ask(&mut client, &patch, &mut reader).await?;
        let asked = Moment::now();
        let request = StreamForceRequest { patch: patch.clone(), rate_hz };
        let stream = client.stream_force(request).await?.into_inner();
        Ok(Self { client, patch, reader, asked, stream, came: None })
    }

    /// The next sample; `None` once the daemon has ended the stream. A call that is dropped loses no sample.
    ///
    /// # Errors
    /// Why the stream was lost.
    pub async fn next(&mut self) -> Result<Option<Received>, Status> {
        if self.came.is_none() {
            self.came = self.stream.message().await?.map(|sample| (sample, Moment::now()));
        }
        let Some((sample, _)) = &self.came else { return Ok(None) };
        // The first frame that the daemon ever received shows its clock only now.
        let unknown = !self.reader.knows_the_clock() && has_a_time(sample);
        if unknown || self.asked.elapsed() > ASK_EVERY {
            ask(&mut self.client, &self.patch, &mut self.reader).await?;
            self.asked = Moment::now();
        }
        Ok(self.came.take().map(|(sample, at)| self.reader.take(sample, at)))
    }
}

fn has_a_time(sample: &ForceSample) -> bool {
    sample.monotonic_ns.is_some() && sample.age_s.is_some()
}

/// Looks at the daemon's clock. That nobody answers ends the stream: a daemon that streams answers, too.
async fn ask(client: &mut ForceServiceClient<Line>, patch: &str, reader: &mut Reader) -> Result<(), Status> {
    let left = Moment::now();
    let question = client.get_force(GetForceRequest { patch: patch.to_owned() });
    let late = |_| Status::deadline_exceeded(format!("no answer within {} s", ANSWER_WITHIN.as_secs()));
    let answer = tokio::time::timeout(ANSWER_WITHIN, question).await.map_err(late)??;
    reader.asked(left, answer.get_ref());
    Ok(())
}
