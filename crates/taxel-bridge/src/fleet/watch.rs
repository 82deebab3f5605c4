//! `taxel-bridge fleet`: reads a router and shows all robots.

use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::time::Duration;

use prost::Message;
use taxel_client::Moment;
use taxel_proto::v1::{ForceSample, Health, ListModelSetsResponse, ModelSetSummary};
use taxel_skin::printable;
use tokio::sync::mpsc;
use tokio::time::{Instant, MissedTickBehavior};
use zenoh::Session;
use zenoh::handlers::{FifoChannel, FifoChannelHandler};
use zenoh::pubsub::Subscriber;
use zenoh::sample::{Sample, SampleKind};

use crate::config::ZenohSection;
use crate::fleet::book::Book;
use crate::fleet::{keys, table};
use crate::link::{self, tried};
use crate::ros::node::wall_ns;
use crate::signals::asked_to_end;

/// Messages that may wait here: a hundred from each of a hundred robots. Beyond that Zenoh waits, and the router drops.
const QUEUE: usize = 10_000;
/// A robot is asked for its models so often while they are not known.
const MODELS_EVERY: Duration = Duration::from_secs(2);
/// A robot that does not answer by then is asked again later.
const MODELS_WITHIN: Duration = Duration::from_secs(2);
/// A force sample has some hundred bytes, the health of a robot with ten buses some ten thousand.
const MESSAGE_BYTES_MAX: usize = 256 << 10;
/// Clears a terminal and goes to its upper left corner.
const CLEAR: &str = "\x1b[2J\x1b[H";

/// Which router, and how it is shown.
#[derive(Debug, clap::Args)]
pub struct FleetArgs {
    /// The router, for example tcp/localhost:7447.
    #[arg(long, value_name = "ENDPOINT")]
    router: Option<String>,
    /// A configuration file of Zenoh, for TLS.
    #[arg(long, value_name = "FILE")]
    zenoh_config: Option<PathBuf>,
    /// One JSON object a line: `{"rows": [...]}` at the rate, `{"event": "vanished", "robot": ...}` at once.
    #[arg(long)]
    json: bool,
    /// Seconds from one table to the next.
    #[arg(long, value_name = "S", default_value_t = 1.0)]
    every: f64,
    /// End after so many tables.
    #[arg(long, value_name = "N")]
    tables: Option<u64>,
    /// An older force is none, in seconds.
    #[arg(long, value_name = "S", default_value_t = 1.0)]
    age_max: f64,
}

struct View {
    session: Session,
    book: Book,
    begun: Moment,
    json: bool,
}

fn seconds(name: &str, seconds: f64) -> anyhow::Result<Duration> {
    let fits = (0.05..=3600.0).contains(&seconds);
    anyhow::ensure!(fits, "{name} {seconds}: expected 0.05 to 3600");
    Ok(Duration::from_secs_f64(seconds))
}

/// Shows the fleet until it is ended.
///
/// # Errors
/// If the arguments cannot be used, the session breaks or nobody takes the output.
pub async fn watch(args: FleetArgs) -> anyhow::Result<()> {
    let (every, age_max) = (seconds("--every", args.every)?, seconds("--age-max", args.age_max)?);
    let session = link::open(&ZenohSection { router: args.router, config: args.zenoh_config }).await?;
    let queue = || FifoChannel::new(QUEUE);
    let alive = session.liveliness().declare_subscriber(keys::ALL_ALIVE).history(true).with(queue()).await;
    let alive = tried("listening for robots", alive)?;
    let forces = tried("listening for forces", session.declare_subscriber(keys::ALL_FORCES).with(queue()).await)?;
    let health = tried("listening for health", session.declare_subscriber(keys::ALL_HEALTH).with(queue()).await)?;
    let begun = Moment::now();
    let mut view = View { session, book: Book::new(age_max), begun, json: args.json };
    let (mut shown, mut ask) = (0, tokio::time::interval(MODELS_EVERY));
    let mut show = tokio::time::interval_at(Instant::now() + every, every);
    // Whoever has not taken the last tables gets no table of then, but the next one of now, and with all that came meanwhile.
    show.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let (models, mut answers) = mpsc::channel::<Models>(64);
    let ended = asked_to_end();
    tokio::pin!(ended);
    loop {
        tokio::select! {
            biased;
            asked = &mut ended => return asked,
            sample = next(&alive) => view.alive(&sample?)?,
            sample = next(&forces) => view.force(&sample?),
            sample = next(&health) => view.health(&sample?),
            Some((robot, sets)) = answers.recv() => {
                let now = view.begun.elapsed();
                view.book.models(&robot, sets, now);
            }
            _ = ask.tick() => view.ask_for_models(&models),
            _ = show.tick() => {
                view.show()?;
                shown += 1;
                if args.tables.is_some_and(|tables| shown >= tables) {
                    return Ok(());
                }
            }
        }
    }
}

async fn next(subscriber: &Subscriber<FifoChannelHandler<Sample>>) -> anyhow::Result<Sample> {
    tried("the session", subscriber.recv_async().await)
}

/// A robot and its model sets in use.
type Models = (String, Vec<ModelSetSummary>);

impl View {
    fn alive(&mut self, sample: &Sample) -> anyhow::Result<()> {
        let Some((robot, _)) = keys::split(sample.key_expr().as_str()) else { return Ok(()) };
        let here = sample.kind() == SampleKind::Put;
        if self.book.alive(robot, here, self.begun.elapsed()) {
            let event = if here { "appeared" } else { "vanished" };
            if self.json {
                print(&format!("{}\n", serde_json::json!({ "event": event, "robot": robot })))?;
            } else if !std::io::stdout().is_terminal() {
                print(&format!("{} {event}\n", printable(robot)))?;
            }
        }
        Ok(())
    }

    fn force(&mut self, sample: &Sample) {
        let key = sample.key_expr().as_str();
        let Some((robot, patch)) =
            keys::split(key).and_then(|(robot, rest)| Some((robot, rest.strip_prefix("force/")?)))
        else {
            return;
        };
        match decoded::<ForceSample>(sample) {
            Ok(force) => self.book.force(robot, patch, force, self.begun.elapsed()),
            Err(error) => tracing::warn!(key, "no force sample: {error}"),
        }
    }

    fn health(&mut self, sample: &Sample) {
        let key = sample.key_expr().as_str();
        let Some((robot, _)) = keys::split(key) else { return };
        match decoded::<Health>(sample) {
            Ok(health) => self.book.health(robot, health, self.begun.elapsed()),
            Err(error) => tracing::warn!(key, "no health: {error}"),
        }
    }

    fn ask_for_models(&self, answers: &mpsc::Sender<Models>) {
        for robot in self.book.unknown_models() {
            let (session, answers) = (self.session.clone(), answers.clone());
            tokio::spawn(async move {
                let Ok(replies) = session.get(keys::models(&robot)).timeout(MODELS_WITHIN).await else { return };
                while let Ok(reply) = replies.recv_async().await {
                    let bytes = reply.result().map(|sample| sample.payload().to_bytes().into_owned());
                    if let Ok(Ok(sets)) = bytes.map(|bytes| ListModelSetsResponse::decode(&*bytes)) {
                        // A full channel: the robot is asked again.
                        let _ = answers.try_send((robot.clone(), sets.model_sets));
                    }
                }
            });
        }
    }

    fn show(&self) -> anyhow::Result<()> {
        let rows = self.book.rows(self.begun.elapsed());
        if self.json {
            return print(&format!("{}\n", serde_json::json!({ "rows": rows })));
        }
        let (here, gone) = self.book.count();
        let clear = if std::io::stdout().is_terminal() { CLEAR } else { "" };
        let mut told = format!("{clear}{here} robots, {gone} vanished\n");
        if self.book.refused() > 0 {
            told += &format!("{} messages of more robots or patches than fit here\n", self.book.refused());
        }
        print(&(told + &table::text(&rows, wall_ns() / 1_000_000_000)))
    }
}

/// What a robot says of itself, which is kept as long as the robot is known.
fn decoded<M: Message + Default>(sample: &Sample) -> Result<M, String> {
    let bytes = sample.payload().to_bytes();
    if bytes.len() > MESSAGE_BYTES_MAX {
        return Err(format!("{} bytes, expected at most {MESSAGE_BYTES_MAX}", bytes.len()));
    }
    M::decode(&*bytes).map_err(|error| error.to_string())
}

fn print(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes())?;
    Ok(out.flush()?)
}
