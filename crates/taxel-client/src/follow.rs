//! Follows the force of a patch: over one connection after the other, with the newest sample in hand.

use std::time::Duration;

use taxel_proto::code_name;
use taxel_proto::v1::force_service_client::ForceServiceClient;
use tokio::sync::watch;
use tonic::Status;

use crate::connect::{ConnectError, Options};
use crate::moment::Moment;
use crate::received::{Force, NoForce, Received};
use crate::stream::Samples;

/// The first pause before another connection; each is twice the one before.
const PAUSE_FIRST: Duration = Duration::from_millis(50);
/// The longest.
const PAUSE_MOST: Duration = Duration::from_secs(2);

/// What is known now.
#[derive(Clone, Debug, Default)]
struct Newest {
    received: Option<Received>,
    /// What is wrong with the connection, if something is.
    broken: Option<String>,
}

/// The newest force of a patch. Clones have one connection, which ends with the last of them.
#[derive(Clone, Debug)]
pub struct Forces {
    newest: watch::Receiver<Newest>,
    age_max: Option<Duration>,
}

/// Follows the force on the present tokio runtime, from now on and for as long as the result lives. Nobody need answer yet.
///
/// # Panics
/// Outside of a tokio runtime; [`blocking::follow`](crate::blocking::follow) needs none.
#[must_use]
pub fn follow(options: Options) -> Forces {
    let (forces, work) = start(options);
    tokio::spawn(work);
    forces
}

/// The force, and the work that has to be done for it.
pub(crate) fn start(options: Options) -> (Forces, impl Future<Output = ()> + Send) {
    let (to, newest) = watch::channel(Newest::default());
    (Forces { newest, age_max: options.age_max }, keep(options, to))
}

impl Forces {
    /// The newest force, if it may be acted on now. Never waits.
    ///
    /// # Errors
    /// [`NoForce`]: why it may not.
    pub fn force(&self) -> Result<Force, NoForce> {
        let newest = self.newest.borrow();
        let Some(received) = &newest.received else { return Err(NoForce::NothingYet(newest.broken.clone())) };
        match (received.force(Moment::now(), self.age_max), &newest.broken) {
            (Ok(force), _) => Ok(Force { total_n: force.total_n, age: force.age, sample: received.sample().clone() }),
            // What the daemon said last is no reason any more once it cannot be heard.
            (Err(_), Some(why)) => Err(NoForce::Lost(why.clone())),
            (Err(why), None) => Err(NoForce::Sample(why)),
        }
    }

    /// The newest sample, whether or not it is a force now.
    #[must_use]
    pub fn newest(&self) -> Option<Received> {
        self.newest.borrow().received.clone()
    }

    /// Waits until something else is known than at the last call: a sample, or that the connection was lost.
    pub async fn changed(&mut self) {
        if self.newest.changed().await.is_err() {
            std::future::pending::<()>().await; // nothing changes any more; the force grows old by itself
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
        Err(Ended::Status(status)) => format!("{}: {}", code_name(status.code()), status.message()),
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
    let client = ForceServiceClient::new(options.connect().await.map_err(Ended::Connect)?);
    let mut samples = Samples::open(client, options.patch.clone(), options.rate_hz).await?;
    while let Some(received) = samples.next().await? {
        newest.send_replace(Newest { received: Some(received), broken: None });
        *pause = PAUSE_FIRST;
    }
    Ok(())
}
