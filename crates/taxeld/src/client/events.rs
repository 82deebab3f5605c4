//! `taxeld events`: what happened since the daemon's start.

use taxel_proto::v1::{Event, WatchEventsRequest};

use super::connect::{Asked, Daemon};
use super::failure::Outcome;
use super::{json, table};

/// What happened: zeros taken and lost, faults, activations, sessions, buses; oldest first.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld events | tail -20\n  taxeld events --follow --json | jq .text\n  taxeld events | grep 'zero lost'"
)]
pub struct EventsArgs {
    #[command(flatten)]
    asked: Asked,
    /// Go on with what happens.
    #[arg(long, short)]
    follow: bool,
}

/// Runs it.
///
/// # Errors
/// No daemon, a lost connection, or a patch that is not there.
pub async fn events(args: EventsArgs) -> Outcome {
    let daemon = args.asked.daemon().await?;
    let request = WatchEventsRequest { patch: daemon.patch.clone(), after: 0, follow: args.follow };
    let mut stream = daemon.skin().watch_events(request).await?.into_inner();
    while let Some(event) = stream.message().await? {
        show(&args.asked, &daemon, &event).await?;
    }
    Ok(())
}

async fn show(asked: &Asked, daemon: &Daemon, event: &Event) -> Outcome {
    if asked.json {
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
