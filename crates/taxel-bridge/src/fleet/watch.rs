//! `taxel-bridge fleet`: reads a router and shows all robots.

use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::time::Duration;

use prost::Message;
use taxel_client::{Moment, Received};
use taxel_proto::v1::ForceSample;
use zenoh::handlers::FifoChannel;
use zenoh::sample::Sample;

use crate::config::ZenohSection;
use crate::fleet::book::{Book, rows, table};
use crate::fleet::robot;
use crate::link::{self, tried};
use crate::{asked_to_end, ticks};

/// Messages that may wait here: a hundred from each of a hundred robots. Beyond that Zenoh waits, and the router drops.
const QUEUE: usize = 10_000;
/// From one table to the next.
const SHOW_EVERY: Duration = Duration::from_secs(1);
/// A single table shows what came in this time: everything that a robot tells comes once a second.
const ONCE_AFTER: Duration = Duration::from_secs(3);
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
    /// One JSON object a line, `{"rows": [...]}`.
    #[arg(long)]
    json: bool,
    /// Show what comes in three seconds, and end.
    #[arg(long)]
    once: bool,
}

/// Shows the fleet until it is ended.
///
/// # Errors
/// If the router's configuration cannot be used, the session breaks or nobody takes the output.
pub async fn watch(args: FleetArgs) -> anyhow::Result<()> {
    let session = link::open(&ZenohSection { router: args.router, config: args.zenoh_config }).await?;
    let told = tried("listening", session.declare_subscriber(robot::FORCES).with(FifoChannel::new(QUEUE)).await)?;
    let mut book = Book::default();
    let mut show = ticks(if args.once { ONCE_AFTER } else { SHOW_EVERY });
    show.tick().await; // the first comes at once, before anything was told
    let ended = asked_to_end();
    tokio::pin!(ended);
    loop {
        tokio::select! {
            biased;
            asked = &mut ended => return asked,
            sample = told.recv_async() => take(&mut book, &tried("the session", sample)?),
            _ = show.tick() => {
                print(&book, args.json)?;
                if args.once {
                    return Ok(());
                }
            }
        }
    }
}

/// Writes down what a robot told.
fn take(book: &mut Book, sample: &Sample) {
    let key = sample.key_expr().as_str();
    let Some((robot, patch)) = robot::robot_and_patch(key) else { return };
    match ForceSample::decode(&*sample.payload().to_bytes()) {
        Ok(force) => drop(book.insert((robot.to_owned(), patch.to_owned()), Received::now(force))),
        Err(error) => tracing::warn!(key, "a message that cannot be read: {error}"),
    }
}

fn print(book: &Book, json: bool) -> anyhow::Result<()> {
    let rows = rows(book, Moment::now());
    let mut out = std::io::stdout().lock();
    if json {
        writeln!(out, "{}", serde_json::json!({ "rows": rows }))?;
    } else {
        let clear = if out.is_terminal() { CLEAR } else { "" };
        write!(out, "{clear}{}", table(&rows))?;
    }
    Ok(out.flush()?)
}
