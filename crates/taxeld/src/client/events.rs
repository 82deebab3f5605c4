//! `taxeld events`: what happened since the daemon's start.

use std::collections::VecDeque;

use taxel_client::Server;
use taxel_proto::v1::{Event, WatchEventsRequest};

use super::connect::Daemon;
use super::failure::Outcome;
use super::{json, table};

/// What happened: zeros taken and lost, faults, activations, sessions, buses; oldest first.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld events                      # the last 100\n  taxeld events --follow --json | jq .text\n  taxeld events --last 1000 | grep 'zero lost'"
)]
pub struct EventsArgs {
    #[command(flatten)]
    server: Server,
    /// Events to show, the newest.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=1000))]
    last: u32,
    /// Go on with what happens.
    #[arg(long, short)]
    follow: bool,
    /// Print each as a line of JSON.
    #[arg(long)]
    json: bool,
}

/// Runs it.
///
/// # Errors
/// No daemon, a lost connection, or a patch that is not there.
pub async fn events(args: EventsArgs) -> Outcome {
    let daemon = Daemon::at(&args.server).await?;
    let patch = daemon.patch();
    let request = |after, follow| WatchEventsRequest { patch: patch.clone(), after, follow };
    let mut stream = daemon.skin().watch_events(request(0, false)).await?.into_inner();
    let mut newest = VecDeque::new();
    while let Some(event) = stream.message().await? {
        if newest.len() == args.last as usize {
            newest.pop_front();
        }
        newest.push_back(event);
    }
    for event in &newest {
        show(&args, &daemon, event).await?;
    }
    if !args.follow {
        return Ok(());
    }
    let last = newest.back().map_or(0, |event| event.number);
    let mut stream = daemon.skin().watch_events(request(last, true)).await?.into_inner();
    while let Some(event) = stream.message().await? {
        show(&args, &daemon, &event).await?;
    }
    Ok(())
}

async fn show(args: &EventsArgs, daemon: &Daemon, event: &Event) -> Outcome {
    if args.json {
        return json::print("Event", event);
    }
    if event.skipped > 0 {
        say!("({} events between are no longer kept)", event.skipped);
    }
    let of = if event.patch.is_empty() { String::new() } else { format!(" {}", event.patch) };
    let taxels = if event.taxels.is_empty() {
        String::new()
    } else {
        // Without a layout taxels have numbers and no places.
        let places = daemon.places(&event.patch).await.unwrap_or_default();
        format!(": {}", places.name(event.taxels.iter().copied()))
    };
    say!("{}{of} {}: {}{taxels}", table::moment(event.time.as_ref()), event.kind, event.text);
    Ok(())
}
