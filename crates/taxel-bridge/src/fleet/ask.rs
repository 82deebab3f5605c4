//! `taxel-bridge ask`: asks one robot of a router, and sends it a model set.

use std::io::Write as _;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, bail};
use prost::Message;
use taxel_proto::v1::{Event, ImportModelSetRequest, ImportModelSetResponse, ListEventsRequest, ListEventsResponse};
use taxel_skin::printable;
use zenoh::Session;

use crate::config::ZenohSection;
use crate::fleet::keys;
use crate::fleet::table::ago;
use crate::link::{self, tried};
use crate::ros::node::wall_ns;

/// A robot that has not answered by then is not there.
const ANSWER_WITHIN: Duration = Duration::from_secs(110);

/// Which router, and what is asked for.
#[derive(Debug, clap::Args)]
pub struct AskArgs {
    /// The router, for example tcp/localhost:7447.
    #[arg(long, value_name = "ENDPOINT")]
    router: Option<String>,
    /// A configuration file of Zenoh, for TLS.
    #[arg(long, value_name = "FILE")]
    zenoh_config: Option<PathBuf>,
    #[command(subcommand)]
    question: Question,
}

#[derive(Debug, clap::Subcommand)]
enum Question {
    /// What happened at a robot lately, newest first: zeros, faults, activations, sessions, connections.
    Events {
        /// Its name in the fleet.
        robot: String,
        /// Only those of this patch and of buses.
        #[arg(long, default_value = "")]
        patch: String,
        /// Most of them, 1 to 1000.
        #[arg(long, value_name = "N", default_value_t = 20)]
        count: u32,
        /// One JSON object a line.
        #[arg(long)]
        json: bool,
    },
    /// Sends a model set into a robot's store. It is not used before somebody at that robot activates it.
    Import {
        /// Its name in the fleet; its bridge has to have `imports = true`.
        robot: String,
        /// The models, as `taxeld models export` writes them.
        models: PathBuf,
        /// Take curves, too, that do not look like those of the patch.
        #[arg(long)]
        insist: bool,
    },
}

/// Asks, and prints or writes the answer.
///
/// # Errors
/// If the robot does not answer or refuses, or a file cannot be read or written.
pub async fn ask(args: AskArgs) -> anyhow::Result<()> {
    let session = link::open(&ZenohSection { router: args.router, config: args.zenoh_config }).await?;
    match args.question {
        Question::Events { robot, patch, count, json } => {
            let request = ListEventsRequest { patch, page_size: count, ..ListEventsRequest::default() };
            let told: ListEventsResponse = answer(&session, &robot, keys::events(&robot), &request).await?;
            let now_s = wall_ns() / 1_000_000_000;
            let lines = told.events.iter().map(|event| if json { object(event) } else { line(event, now_s) });
            Ok(std::io::stdout().write_all(lines.collect::<String>().as_bytes())?)
        }
        Question::Import { robot, models, insist } => {
            let json = std::fs::read_to_string(&models).with_context(|| format!("reading {}", models.display()))?;
            let request = ImportModelSetRequest { json, insist };
            let taken: ImportModelSetResponse = answer(&session, &robot, keys::import(&robot), &request).await?;
            println!("{}", taken.model_set);
            eprintln!("{robot} has it; it is not in use until somebody at that robot activates it");
            Ok(())
        }
    }
}

/// The first answer of a robot.
async fn answer<A: Message + Default>(
    session: &Session,
    robot: &str,
    key: String,
    request: &impl Message,
) -> anyhow::Result<A> {
    let asked = session.get(&key).payload(request.encode_to_vec()).timeout(ANSWER_WITHIN).await;
    let replies = tried("asking", asked)?;
    let Ok(reply) = replies.recv_async().await else {
        bail!("{robot} does not answer at {key}: expected a robot of this router whose bridge offers that");
    };
    match reply.result() {
        Ok(sample) => A::decode(&*sample.payload().to_bytes()).with_context(|| format!("the answer at {key}")),
        Err(refusal) => bail!("{robot}: {}", printable(&String::from_utf8_lossy(&refusal.payload().to_bytes()))),
    }
}

fn time_s(event: &Event) -> i64 {
    event.time.as_ref().map_or(0, |time| time.seconds)
}

fn kind(event: &Event) -> String {
    event.kind().as_str_name().trim_start_matches("EVENT_KIND_").to_ascii_lowercase()
}

fn line(event: &Event, now_s: i64) -> String {
    let patch = if event.patch.is_empty() { "-" } else { &event.patch };
    format!("{:>12}  {}  {}  {}\n", ago(now_s - time_s(event)), printable(patch), kind(event), printable(&event.text))
}

fn object(event: &Event) -> String {
    let object = serde_json::json!({
        "number": event.number, "time_s": time_s(event), "kind": kind(event), "patch": event.patch, "text": event.text,
        "taxels": event.taxels, "session": event.session, "model_set": event.model_set, "bus": event.bus,
    });
    format!("{object}\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_proto::Timestamp;
    use taxel_proto::v1::EventKind;

    #[test]
    fn an_event_is_a_line_for_people_and_an_object_for_programs() {
        let mut event = Event {
            number: 3,
            time: Some(Timestamp { seconds: 1_000, nanos: 0 }),
            patch: "arm".into(),
            text: "the zero was taken\n".trim().into(),
            ..Event::default()
        };
        event.set_kind(EventKind::ZeroLost);
        assert_eq!(line(&event, 1_005), "   5.0 s ago  arm  zero_lost  the zero was taken\n");
        let object: serde_json::Value = serde_json::from_str(&object(&event)).unwrap();
        assert_eq!(
            (&object["number"], &object["time_s"], &object["kind"]),
            (&3.into(), &1_000.into(), &"zero_lost".into())
        );
    }
}
