//! `taxeld record`: force, taxels and events of a daemon, also on another machine, as MCAP.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use anyhow::Context;
use prost::Message;
use taxel_mcap::{Folder, Limits, Queue, Recorder, Topic, open_file};
use taxel_proto::Timestamp;
use taxel_proto::v1::{GetSkinRequest, StreamForceRequest, StreamTaxelsRequest, WatchEventsRequest};
use tokio::signal::unix::{SignalKind, signal};
use tokio::task::JoinSet;

use super::connect::{Daemon, Server};
use super::failure::{Failure, Outcome};

/// What was gathered goes to the disk after so long.
const FLUSH_EVERY: Duration = Duration::from_secs(1);

/// Records what a daemon streams: the force of its patches and its events, as MCAP files in a folder.
///
/// The frames of its buses are recorded by the daemon itself ([record] in its configuration), and only they can be replayed.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld record --out recordings --server https://robot:50052 --tls keys\n  taxeld record --out recordings --taxels --seconds 60"
)]
pub struct RecordArgs {
    #[command(flatten)]
    server: Server,
    /// The folder that the files go to; made if absent.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Every taxel, too: several times as much.
    #[arg(long)]
    taxels: bool,
    /// End after so long; without it, with Ctrl-C.
    #[arg(long, value_name = "S", value_parser = crate::values::parse_seconds)]
    seconds: Option<f64>,
    /// Megabytes that all recordings of the folder may take together; the oldest go.
    #[arg(long, value_name = "MB", default_value_t = 2048, value_parser = clap::value_parser!(u64).range(16..=1_000_000_000))]
    budget_mb: u64,
}

/// Runs it until the time is over, Ctrl-C, or the connection is lost.
///
/// # Errors
/// No daemon, a lost connection, or a disk that did not take everything.
pub async fn record(args: RecordArgs) -> Outcome {
    let daemon = args.server.connect().await?;
    let skin = daemon.skin().get_skin(GetSkinRequest { patch: daemon.patch() }).await;
    let patches = match skin {
        Ok(skin) => vec![skin.into_inner().patch],
        // Without a name, of several: all of them.
        Err(status) if daemon.patch().is_empty() => names(&daemon).await.map_err(|_| Failure::from(status))?,
        Err(status) => return Err(status.into()),
    };
    let topic = |name: String, message| Topic { name: format!("/taxeld/{name}"), message };
    let mut topics: Vec<Topic> = patches.iter().map(|patch| topic(format!("force/{patch}"), "ForceSample")).collect();
    topics.extend(patches.iter().map(|patch| topic(format!("taxels/{patch}"), "TaxelSample")));
    topics.push(topic("events".to_owned(), "Event"));
    let folder = Folder::open(&args.out).with_context(|| args.out.display().to_string())?;
    let about = BTreeMap::from([("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned())]);
    let (recorder, queue) = Recorder::start(folder, limits(args.budget_mb), topics, about, Box::new(open_file))?;
    say!("recording {} into {}", patches.join(", "), args.out.display());
    let mut tasks = JoinSet::new();
    for (at, patch) in patches.iter().enumerate() {
        tasks.spawn(force(daemon.clone(), patch.clone(), at, queue.clone()));
        if args.taxels {
            tasks.spawn(taxels(daemon.clone(), patch.clone(), patches.len() + at, queue.clone()));
        }
    }
    tasks.spawn(events(daemon.clone(), 2 * patches.len(), queue));
    let over = async {
        match args.seconds {
            Some(seconds) => tokio::time::sleep(Duration::from_secs_f64(seconds)).await,
            None => std::future::pending().await,
        }
    };
    let mut terminate = signal(SignalKind::terminate()).context("the signal that ends it")?;
    let ended = tokio::select! {
        _ = terminate.recv() => Ok(()),
        interrupted = tokio::signal::ctrl_c() => interrupted.map_err(Failure::from),
        () = over => Ok(()),
        Some(ended) = tasks.join_next() => match ended {
            Ok(Ok(())) => Err(Failure::Broken(anyhow::anyhow!("the daemon ended a stream"))),
            Ok(Err(failure)) => Err(failure),
            Err(lost) => Err(Failure::Broken(lost.into())),
        },
    };
    tasks.abort_all();
    let status = recorder.finish();
    if let Some(problem) = status.problem {
        return Err(Failure::Broken(anyhow::anyhow!(
            "{}: {problem}; {} messages lost",
            args.out.display(),
            status.lost
        )));
    }
    if status.lost > 0 {
        crate::say::error_line(format_args!("{} messages are not in the recording: the disk was behind", status.lost));
    }
    ended
}

/// The names of all patches.
async fn names(daemon: &Daemon) -> Outcome<Vec<String>> {
    let health = daemon.skin().get_health(taxel_proto::v1::GetHealthRequest {}).await?.into_inner();
    Ok(health.patches.into_iter().map(|patch| patch.patch).collect())
}

fn limits(budget_mb: u64) -> Limits {
    Limits {
        budget_bytes: budget_mb * 1_000_000,
        file_bytes: (budget_mb / 2).min(64) * 1_000_000,
        file_age: Duration::from_secs(600),
        keep_free_bytes: 0,
        flush_every: FLUSH_EVERY,
        retry_after: Duration::from_secs(10),
    }
}

async fn force(daemon: Daemon, patch: String, topic: usize, queue: Queue) -> Outcome {
    let request = StreamForceRequest { patch, rate_hz: None };
    let mut stream = daemon.force().stream_force(request).await?.into_inner();
    while let Some(sample) = stream.message().await? {
        queue.give(topic, label(sample.time.as_ref()), sample.encode_to_vec());
    }
    Ok(())
}

async fn taxels(daemon: Daemon, patch: String, topic: usize, queue: Queue) -> Outcome {
    let request = StreamTaxelsRequest { patch, rate_hz: None };
    let mut stream = daemon.skin().stream_taxels(request).await?.into_inner();
    while let Some(sample) = stream.message().await? {
        queue.give(topic, label(sample.time.as_ref()), sample.encode_to_vec());
    }
    Ok(())
}

async fn events(daemon: Daemon, topic: usize, queue: Queue) -> Outcome {
    let request = WatchEventsRequest { patch: daemon.patch(), after: None };
    let mut stream = daemon.skin().watch_events(request).await?.into_inner();
    while let Some(event) = stream.message().await? {
        queue.give(topic, label(event.time.as_ref()), event.encode_to_vec());
    }
    Ok(())
}

/// A moment in nanoseconds since 1970; the present for what has none yet.
fn label(time: Option<&Timestamp>) -> u64 {
    let present = || SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as i64);
    let of = |time: &Timestamp| time.seconds.saturating_mul(1_000_000_000).saturating_add(i64::from(time.nanos));
    u64::try_from(time.map_or_else(present, of)).unwrap_or(0)
}
