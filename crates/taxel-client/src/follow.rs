//! Follows the force of a patch: over one connection after the other, with the newest sample in hand.

use std::time::{Duration, Instant};

use taxel_proto::v1::force_service_client::ForceServiceClient;
use taxel_proto::v1::{ForceSample, GetForceRequest, StreamForceRequest};
use tokio::sync::watch;
use tokio::task::JoinHandle;
use tonic::Status;

use crate::connect::{ConnectError, Line, Options};
use crate::freshness::{Force, NoForce, Reader, Received};

/// The first pause before another connection; each is twice the one before.
const PAUSE_FIRST: Duration = Duration::from_millis(50);
/// The longest.
const PAUSE_MOST: Duration = Duration::from_secs(2);
/// How often the daemon's clock is looked at. In between the clocks part by 6 ms at the very most.
const ASK_EVERY: Duration = Duration::from_secs(10);
/// An answer that takes longer says little of the clock.
const ANSWER_WITHIN: Duration = Duration::from_secs(2);

/// What is known now.
#[derive(Clone, Debug, Default)]
struct Newest {
    received: Option<Received>,
    /// What is wrong with the connection, if something is.
    broken: Option<String>,
}

/// The newest force of a patch. Dropped, the connection ends.
#[derive(Debug)]
pub struct Forces {
    newest: watch::Receiver<Newest>,
    age_max: Duration,
    task: Option<JoinHandle<()>>,
}

/// Follows the force on the present tokio runtime, from now on and for as long as the result lives. Nobody need answer yet.
///
/// # Panics
/// Outside of a tokio runtime; [`blocking::follow`](crate::blocking::follow) needs none.
#[must_use]
pub fn follow(options: Options) -> Forces {
    let (mut forces, work) = start(options);
    forces.task = Some(tokio::spawn(work));
    forces
}

/// The force, and the work that has to be done for it.
pub(crate) fn start(options: Options) -> (Forces, impl Future<Output = ()> + Send) {
    let (to, newest) = watch::channel(Newest::default());
    let age_max = options.age_max;
    (Forces { newest, age_max, task: None }, keep(options, to))
}

impl Forces {
    /// The newest force, if it may be acted on now. Never waits.
    ///
    /// # Errors
    /// [`NoForce`]: why it may not.
    pub fn force(&self) -> Result<Force, NoForce> {
        let newest = self.newest.borrow();
        let Some(received) = &newest.received else { return Err(NoForce::NothingYet(newest.broken.clone())) };
        match (received.usable(Instant::now(), self.age_max), &newest.broken) {
            (Ok((total_n, age)), _) => Ok(Force { total_n, age, sample: received.sample().clone() }),
            (Err(NoForce::TooOld(..)), Some(why)) => Err(NoForce::Lost(why.clone())),
            (Err(why), _) => Err(why),
        }
    }

    /// Waits until something else is known than at the last call: a sample, or that the connection was lost.
    pub async fn changed(&mut self) {
        if self.newest.changed().await.is_err() {
            std::future::pending::<()>().await; // nothing changes any more; the force grows old by itself
        }
    }
}

impl Drop for Forces {
    fn drop(&mut self) {
        if let Some(task) = &self.task {
            task.abort();
        }
    }
}

/// Connects again and again until nobody listens any more.
async fn keep(options: Options, newest: watch::Sender<Newest>) {
    let mut pause = PAUSE_FIRST;
    loop {
        let told = tokio::select! {
            () = newest.closed() => return,
            told = once(&options, &newest, &mut pause) => told,
        };
        newest.send_modify(|newest| newest.broken = Some(told));
        tokio::select! {
            () = newest.closed() => return,
            () = tokio::time::sleep(pause) => {}
        }
        pause = (2 * pause).min(PAUSE_MOST);
    }
}

/// Reads one stream to its end, and says why it ended.
async fn once(options: &Options, newest: &watch::Sender<Newest>, pause: &mut Duration) -> String {
    match stream(options, newest, pause).await {
        Ok(()) => "the daemon ended the stream".to_owned(),
        Err(Ended::Connect(error)) => error.to_string(),
        Err(Ended::Status(status)) => format!("{:?}: {}", status.code(), status.message()),
    }
}

/// Why a stream ended.
enum Ended {
    Connect(ConnectError),
    Status(Status),
}

impl From<Status> for Ended {
    fn from(status: Status) -> Self {
        Self::Status(status)
    }
}

async fn stream(options: &Options, newest: &watch::Sender<Newest>, pause: &mut Duration) -> Result<(), Ended> {
    let mut client = ForceServiceClient::new(options.connect().await.map_err(Ended::Connect)?);
    let mut reader = Reader::new(Instant::now());
    ask(&mut client, options, &mut reader).await?;
    let request = StreamForceRequest { patch: options.patch.clone(), rate_hz: options.rate_hz };
    let mut samples = client.stream_force(request).await?.into_inner();
    let mut asked = Instant::now();
    while let Some(sample) = samples.message().await? {
        let at = Instant::now();
        // The first frame that the daemon ever received shows its clock only now.
        let unknown = !reader.knows_the_clock() && has_a_time(&sample);
        if unknown || asked.elapsed() > ASK_EVERY {
            ask(&mut client, options, &mut reader).await?;
            asked = Instant::now();
        }
        let received = reader.take(sample, at);
        newest.send_replace(Newest { received: Some(received), broken: None });
        *pause = PAUSE_FIRST;
    }
    Ok(())
}

fn has_a_time(sample: &ForceSample) -> bool {
    sample.monotonic_ns.is_some() && sample.age_s.is_some()
}

/// Looks at the daemon's clock. That nobody answers ends the stream: a daemon that streams answers, too.
async fn ask(client: &mut ForceServiceClient<Line>, options: &Options, reader: &mut Reader) -> Result<(), Status> {
    let left = Instant::now();
    let question = client.get_force(GetForceRequest { patch: options.patch.clone() });
    let late = |_| Status::deadline_exceeded(format!("no answer within {} s", ANSWER_WITHIN.as_secs()));
    let answer = tokio::time::timeout(ANSWER_WITHIN, question).await.map_err(late)??;
    reader.asked(left, answer.get_ref());
    Ok(())
}
