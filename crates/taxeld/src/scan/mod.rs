//! `taxeld scan`: listens, and says what is on a bus or in a log.

mod ports;
mod serial;
mod survey;
#[cfg(test)]
mod tests;
mod words;

use std::convert::Infallible;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context as _, bail};
use taxel_can::{Batch, BusEvent, FrameSource, SocketCan, SocketCanOptions, SourceError, each_bus_error};
use taxel_wire::FrameKind;

use crate::config;
use crate::open_log::{Wanted, open_log};
use crate::values::seconds;
use survey::Survey;
use taxel_files::say;

/// Frames per read of a log.
const FRAMES: usize = 4096;

/// What to listen to.
#[derive(Debug, clap::Args)]
pub struct ScanArgs {
    /// A candump log, plain or .gz, or a recording (.mcap), in place of a bus; `-` is the standard input.
    log: Option<PathBuf>,
    /// The network interface; with a log, the interface of its frames.
    #[arg(long)]
    interface: Option<String>,
    /// Ports of YARP in place of a bus, of this name server, ADDRESS:PORT; by default of that of YARP's own files.
    #[arg(long, value_name = "SERVER", num_args = 0..=1, conflicts_with_all = ["log", "interface", "out"])]
    yarp: Option<Option<String>>,
    #[command(flatten)]
    gauge: serial::Gauge,
    /// How long to listen to a bus, to ports or to a gauge.
    #[arg(long, default_value = "5", value_parser = |text: &str| seconds(text, 0.1, 3600.0))]
    seconds: f64,
    /// Write the beginning of a configuration; `-` is the standard output.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Listens and says what is there. Nothing is sent, but to a gauge what it is to be asked.
///
/// # Errors
/// A bus or file that cannot be read, a log without a frame or of several interfaces of which none was named, or a file that is
/// there already.
pub fn scan(args: &ScanArgs) -> anyhow::Result<()> {
    if let Some(out) = args.out.as_ref().filter(|out| !taxel_files::is_standard(out) && out.exists()) {
        bail!("{}: is there already", out.display());
    }
    taxel_files::announce(args.out.as_deref().as_slice(), &[])?;
    let over = Duration::from_secs_f64(args.seconds);
    if let Some(server) = &args.yarp {
        say!("{}", crate::runtime::runtime()?.block_on(ports::text(server.as_deref(), over))?);
        return Ok(());
    }
    if let Some(at) = &args.gauge.serial {
        say!("{}", crate::runtime::runtime()?.block_on(serial::text(&args.gauge, at, over))?);
        return Ok(());
    }
    let (survey, interface) = match (args.log.clone(), args.interface.clone()) {
        (Some(log), interface) => of_log(&taxel_files::named(log), interface)?,
        (None, Some(interface)) => crate::runtime::runtime()?.block_on(of_bus(interface, over))?,
        (None, None) => bail!("say what to listen to: --interface can0, --yarp, --serial /dev/ttyACM0, or a log"),
    };
    say!("{}", words::text(&survey));
    let Some(out) = &args.out else { return Ok(()) };
    if survey.boards().next().is_none() {
        bail!("{}: not written, since no skin board was heard", out.display());
    }
    let text = words::beginning(&survey, &interface);
    config::examine_text(out, &text).context("what was heard makes no configuration")?;
    taxel_files::write_text(out, &text)
}

async fn of_bus(interface: String, over: Duration) -> anyhow::Result<(Survey, String)> {
    let options = SocketCanOptions { interface: interface.clone(), ids: None, tx: false };
    let (mut bus, mut survey) = (SocketCan::open(options)?, Survey::default());
    if let Ok(ended) = tokio::time::timeout(over, take_all(&mut bus, &mut survey)).await {
        ended?;
    }
    Ok((survey, interface))
}

/// All frames of one interface of a log: of the one that is wanted, or of the only one that there is.
fn of_log(log: &Path, wanted: Option<String>) -> anyhow::Result<(Survey, String)> {
    let mut reader = open_log(log, Wanted { interface: wanted.clone(), ..Wanted::default() })?;
    let (mut survey, mut frames, mut more) = (Survey::default(), Vec::new(), true);
    while more {
        frames.clear();
        more = reader.next_batch(&mut frames, FRAMES);
        for timed in &frames {
            match timed.frame.kind {
                FrameKind::Error => each_bus_error(&timed.frame, |error| survey.error(&error)),
                _ => survey.frame(timed),
            }
        }
    }
    let report = reader.report();
    report.words().iter().for_each(|line| say::error_line(format_args!("{line}")));
    if let Some(fault) = report.frame_fault(wanted.as_deref()).or_else(|| report.time_fault()) {
        bail!("{}: {fault}", log.display());
    }
    match (wanted, report.interfaces.as_slice()) {
        (Some(interface), _) => Ok((survey, interface)),
        (None, [interface]) => Ok((survey, interface.clone())),
        (None, several) => bail!("the log has {}: say which with --interface", several.join(" and ")),
    }
}

/// Takes all that a bus gives, until it cannot be read any more.
async fn take_all(bus: &mut impl FrameSource, survey: &mut Survey) -> Result<Infallible, SourceError> {
    let mut batch = Batch::default();
    loop {
        bus.next(&mut batch).await?;
        batch.frames.iter().for_each(|frame| survey.frame(frame));
        for event in &batch.events {
            match event {
                BusEvent::Up | BusEvent::BufferGranted { .. } => {}
                BusEvent::Error { error, .. } => survey.error(error),
                other => survey.notice(other.to_string()),
            }
        }
    }
}
