//! `taxeld events`: what happened since the daemon's start.

use std::collections::VecDeque;

use taxel_proto::v1::{Event, EventKind, PatchRequest, WatchEventsRequest};

use super::connect::{Daemon, Server};
use super::failure::Outcome;
use super::places::Places;
use super::{json, table};

/// What happened: zeros taken and lost, faults, activations, sessions, buses; oldest first.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld events                      # the last 100\n  taxeld events --follow --json | jq .text\n  taxeld events --last 1000 | grep 'zero lost'"
)]
pub struct EventsArgs {
    #[command(flatten)]
    server: Server,
    /// So many of the newest.
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
    let daemon = args.server.connect().await?;
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
    let mut places = Named::default();
    for event in &newest {
        show(&args, &daemon, &mut places, event).await?;
    }
    if !args.follow {
        return Ok(());
    }
    let last = newest.back().map_or(0, |event| event.number);
    let mut stream = daemon.skin().watch_events(request(last, true)).await?.into_inner();
    while let Some(event) = stream.message().await? {
        show(&args, &daemon, &mut places, &event).await?;
    }
    Ok(())
}

async fn show(args: &EventsArgs, daemon: &Daemon, named: &mut Named, event: &Event) -> Outcome {
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
        format!(": {}", named.places(daemon, &event.patch).await.name(event.taxels.iter().copied()))
    };
    say!("{}{of} {}: {}{taxels}", table::moment(event.time.as_ref()), word(event.kind()), event.text);
    Ok(())
}

/// The places of the taxels of the patch that was asked for last: most often there is only one.
#[derive(Default)]
struct Named {
    patch: String,
    places: Places,
}

impl Named {
    async fn places(&mut self, daemon: &Daemon, patch: &str) -> &Places {
        if self.patch != patch {
            // Without a layout taxels have numbers and no places.
            let skin = daemon.skin().get_skin(PatchRequest { patch: patch.to_owned() }).await;
            self.places = skin.map(|skin| Places::of(skin.get_ref())).unwrap_or_default();
            patch.clone_into(&mut self.patch);
        }
        &self.places
    }
}

const fn word(kind: EventKind) -> &'static str {
    match kind {
        EventKind::Unspecified => "event",
        EventKind::Tared => "zero taken",
        EventKind::ZeroLost => "zero lost",
        EventKind::FaultsCame => "faults",
        EventKind::FaultsWent => "faults gone",
        EventKind::Activated => "activated",
        EventKind::Session => "session",
        EventKind::BusUp => "bus up",
        EventKind::BusDown => "bus down",
    }
}
