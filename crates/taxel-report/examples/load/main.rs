//! What the daemon does under load, beside what the machine itself does in the same run.
//!
//! `cargo build --release && cargo run --release -p taxel-report --example load -- target/release/taxeld SCENE [--seconds N]`
//!
//! | scene | what |
//! |---|---|
//! | `rates` | 64 subscribers at 1 kHz |
//! | `unread` | 10 readers at 100 Hz, without and beside 50 streams at 1 kHz that nobody reads |
//! | `idle` | 10 readers at 100 Hz, without and beside 2,000 sockets that say nothing, and how long a new client waits |
//! | `buses` | ten simulated buses, 5,000 taxels, 100 subscribers |
//! | `raw` | frame to client beside a minimal server on bare tonic |
//!
//! It starts the daemon as a process on simulated buses and reads it as clients do, all on one thread. A scene's output is
//! rows of the tables in `tests/README.md`. `--seconds` is how long each case is watched.

mod crowd;
mod histogram;
mod jitter;
mod live;
mod raw;
mod rows;
mod scenes;

use std::path::Path;
use std::time::Duration;

use anyhow::{Context, bail};

const USAGE: &str = "usage: load TAXELD rates|unread|idle|buses|raw [--seconds N]";

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let (taxeld, scene, seconds) = match words[..] {
        [raw::ARGUMENT, messages] => return raw::serve(Path::new(messages)),
        [taxeld, scene] => (Path::new(taxeld), scene, None),
        [taxeld, scene, "--seconds", seconds] => (Path::new(taxeld), scene, Some(seconds)),
        _ => bail!(USAGE),
    };
    let seconds =
        seconds.map(|text| text.parse().ok().filter(|s| (0.1..=1e6).contains(s)).context(USAGE)).transpose()?;
    let span = |usual| Duration::from_secs_f64(seconds.unwrap_or(usual));
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    match scene {
        "rates" => runtime.block_on(scenes::rates(taxeld, span(60.0))),
        "unread" => runtime.block_on(scenes::unread(taxeld, span(10.0))),
        "idle" => runtime.block_on(scenes::idle(taxeld, span(10.0))),
        "buses" => runtime.block_on(scenes::buses(taxeld, span(60.0))),
        "raw" => runtime.block_on(scenes::raw(taxeld, span(5.0))),
        other => bail!("no scene `{other}`; {USAGE}"),
    }
}
