//! `taxeld top`: the force, the skin, its boards and what happens, living in a terminal.

mod draw;
mod state;
mod terminal;

use std::fs::File;
use std::io::{IsTerminal, Write};
use std::time::Duration;

use chrono::Local;
use taxel_client::{Moment, Samples, Server};
use taxel_proto::v1::{PatchRequest, StreamRequest, TareRequest, WatchEventsRequest};
use tokio::sync::mpsc;
use tokio::time::{MissedTickBehavior, interval, sleep};

use super::connect::Daemon;
use super::failure::{Failure, Outcome};
use super::json;
use state::{News, Top};
use terminal::Screen;

/// The screen is drawn so often, and whatever is shown of the force judged anew.
const DRAW_EVERY: Duration = Duration::from_millis(100);
/// The skin is read so often, in Hz: it changes no faster on a screen of characters.
const TAXELS_HZ: f64 = 10.0;
/// How often health is asked for, and a daemon that ended looked for.
const ASK_EVERY: Duration = Duration::from_secs(1);

/// The force with its interval and its last seconds, the skin, boards, gauge and events.
///
/// Keys: t takes the zero, c says how to calibrate, r records each sample as a line of JSON in a file of this folder, q ends.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  taxeld top\n  taxeld top --patch palm --server 127.0.0.1:50051")]
pub struct TopArgs {
    #[command(flatten)]
    server: Server,
}

/// Runs it until `q` or Ctrl-C.
///
/// # Errors
/// No terminal, or no daemon to begin with.
pub async fn top(args: TopArgs) -> Outcome {
    if !(std::io::stdin().is_terminal() && std::io::stdout().is_terminal()) {
        return Err(Failure::refused("`taxeld top` needs a terminal").help("taxeld watch"));
    }
    let daemon = Daemon::at(&args.server).await?;
    let (to, mut news) = mpsc::channel(64);
    let mut screen = Screen::open(to.clone())?;
    let mut recording = None;
    let mut top = Top { colour: crate::tone::coloured(), ..Top::default() };
    tokio::spawn(follow(daemon.clone(), to.clone()));
    let mut draw = interval(DRAW_EVERY);
    draw.set_missed_tick_behavior(MissedTickBehavior::Skip);
    loop {
        tokio::select! {
            _ = draw.tick() => screen.draw(&top)?,
            one = news.recv() => match one {
                None | Some(News::Key('q')) => return Ok(()),
                Some(News::Key('t')) => {
                    top.said = "taking the zero: hands off".to_owned();
                    let (daemon, to) = (daemon.about(&top.patch), to.clone());
                    tokio::spawn(async move { to.send(News::Said(tare(&daemon).await)).await });
                }
                Some(News::Key('r')) => top.said = toggle(&mut recording),
                Some(one) => {
                    if let (News::Force(force), Some((file, _))) = (&one, &mut recording) {
                        writeln!(file, "{}", json::text("ForceSample", force.sample())?)?;
                    }
                    top.take(one, Moment::now());
                }
            },
        }
    }
}

/// Follows the daemon for as long as somebody looks; one that ends is looked for again.
async fn follow(daemon: Daemon, to: mpsc::Sender<News>) {
    while !to.is_closed() {
        let why = once(&daemon, &to).await.err().map_or_else(|| "it ended".to_owned(), |why| why.to_string());
        let _ = to.send(News::Said(format!("the daemon is not heard: {why}"))).await; // nobody looks any more
        sleep(ASK_EVERY).await;
    }
}

/// Passes on what one connection brings.
async fn once(daemon: &Daemon, to: &mpsc::Sender<News>) -> Outcome {
    let skin = daemon.skin().get_skin(PatchRequest { patch: daemon.patch() }).await?.into_inner();
    let patch = skin.patch.clone();
    let taxels = StreamRequest { patch: patch.clone(), rate_hz: Some(TAXELS_HZ) };
    let events = WatchEventsRequest { patch: patch.clone(), after: 0, follow: true };
    let mut forces = Samples::open(daemon.force(), patch, None).await?;
    let mut taxels = daemon.skin().stream_taxels(taxels).await?.into_inner();
    let mut events = daemon.skin().watch_events(events).await?.into_inner();
    let mut health = interval(ASK_EVERY);
    let mut news = Some(News::Skin(skin));
    while let Some(one) = news {
        if to.send(one).await.is_err() {
            return Ok(());
        }
        news = tokio::select! {
            force = forces.next() => force?.map(News::Force),
            taxels = taxels.message() => taxels?.map(News::Taxels),
            event = events.message() => event?.map(News::Event),
            _ = health.tick() => Some(News::Health(daemon.skin().get_health(()).await?.into_inner())),
        };
    }
    Ok(())
}

async fn tare(daemon: &Daemon) -> String {
    let request = TareRequest { patch: daemon.patch(), confirmed_by: String::new() };
    match daemon.skin().tare(request).await.map_err(Failure::from) {
        Ok(zero) => format!("zero {} taken", zero.into_inner().epoch),
        Err(failure) => format!("{failure}; {}", failure.help_for("tare").unwrap_or_default()),
    }
}

/// Begins a recording, or ends the one that runs; gives what to say of it.
fn toggle(recording: &mut Option<(File, String)>) -> String {
    if let Some((_, name)) = recording.take() {
        return format!("{name} is written");
    }
    let name = Local::now().format("force-%Y%m%d-%H%M%S.jsonl").to_string();
    match File::create_new(&name) {
        Ok(file) => {
            *recording = Some((file, name.clone()));
            format!("recording to {name}; r ends it")
        }
        Err(error) => format!("{name}: {error}"),
    }
}
