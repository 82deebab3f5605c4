//! `taxeld scan`: listens, and says what is on a bus or in a log.

mod compare;
mod findings;
mod module;
mod pressure;
mod survey;
#[cfg(test)]
mod tests;
mod words;

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context as _, bail};
use taxel_can::{Batch, BusEvent, FrameSource, LogReport, Pace, Replay, SocketCan, SocketCanOptions, SourceError};
use taxel_skin::BusIndex;

use crate::check::read;
use crate::config::{self, Config, Scene};
use crate::files;
use crate::log_words::{cut_off, expect_frames, tell};
use crate::open_log::{Wanted, open_log};
use crate::output;
use crate::say;
use findings::Findings;
use survey::Survey;

/// What to listen to.
#[derive(Debug, clap::Args)]
pub struct ScanArgs {
    /// A candump log, plain or .gz, or a recording (.mcap), in place of a bus; `-` is the standard input.
    log: Option<PathBuf>,
    /// The network interface; with a log, the interface of its frames.
    #[arg(long)]
    interface: Option<String>,
    /// How long to listen to a bus.
    #[arg(long, default_value = "5", value_parser = parse_seconds)]
    seconds: f64,
    /// Say what is different from this configuration.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Write the beginning of a configuration; `-` is the standard output.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// What `--json` prints.
#[derive(serde::Serialize)]
struct Report<'a> {
    findings: &'a Findings,
    /// Absent without a configuration to compare with.
    differences: Option<&'a [String]>,
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok().filter(|s| *s >= 0.1 && *s <= 3600.0);
    seconds.ok_or_else(|| "expected 0.1 to 3600 seconds".to_owned())
}

/// Listens and says what is there. Nothing is sent.
///
/// # Errors
/// A bus or file that cannot be read, a log without a frame or of several interfaces of which none was named, a
/// configuration that cannot be used, or a file that is there already.
pub fn scan(args: &ScanArgs) -> anyhow::Result<()> {
    if args.log.is_none() && args.interface.is_none() {
        bail!("say what to listen to: --interface can0, or a log");
    }
    if let Some(out) = args.out.as_ref().filter(|out| !files::is_standard(out) && out.exists()) {
        bail!("{}: is there already", out.display());
    }
    if args.out.as_deref().is_some_and(files::is_standard) {
        say::step_aside();
    }
    let scene = args.config.as_deref().map(read).transpose()?;
    let bus = scene.as_ref().map(|(config, _)| bus_of(config, args.interface.as_deref())).transpose()?;
    let runtime = crate::runtime::runtime()?;
    let Heard { mut findings, interface, .. } = runtime.block_on(listen(args, scene.as_ref().zip(bus)))?;
    let differences = scene.as_ref().zip(bus).map(|((_, scene), bus)| {
        compare::name_no_gauge_among_taxels(&mut findings, &scene.plan, bus);
        compare::differences(&findings, &scene.plan, bus)
    });
    if args.json {
        let report = Report { findings: &findings, differences: differences.as_deref() };
        say!("{}", serde_json::to_string_pretty(&report)?);
    } else {
        say!("{}", words::text(&findings, differences.as_deref()).trim_end());
    }
    match &args.out {
        Some(out) => write_beginning(&findings, &interface, out),
        None => Ok(()),
    }
}

/// Which bus of the configuration is looked at: that of the interface, or the only one.
fn bus_of(config: &Config, interface: Option<&str>) -> anyhow::Result<BusIndex> {
    let named = |name: &str| config.bus.iter().position(|bus| bus.interface.as_deref() == Some(name));
    let position = match (interface, config.bus.as_slice()) {
        (Some(name), _) => named(name).with_context(|| format!("no bus of the configuration has interface {name}"))?,
        (None, [_]) => 0,
        (None, buses) => bail!("the configuration has {} buses: say which with --interface", buses.len()),
    };
    Ok(BusIndex(u8::try_from(position)?))
}

/// What was heard, and on which interface.
struct Heard {
    findings: Findings,
    interface: String,
    /// Why the times of a log tell nothing.
    times: Option<String>,
}

async fn listen(args: &ScanArgs, scene: Option<(&(Config, Scene), BusIndex)>) -> anyhow::Result<Heard> {
    if let Some(log) = args.log.clone().map(files::named) {
        let interface = scene.and_then(|((config, _), bus)| config.bus[usize::from(bus.0)].interface.clone());
        let heard = of_log(&log, args.interface.clone().or(interface)).await?;
        if scene.is_some() || !heard.findings.boards.is_empty() {
            heard.times.as_ref().map_or(Ok(()), |fault| bail!("{}: {fault}", log.display()))?;
        }
        return Ok(heard);
    }
    let interface = args.interface.clone().unwrap_or_default();
    let options = SocketCanOptions { interface: interface.clone(), ids: None, tx: false };
    let (mut bus, mut survey) = (SocketCan::open(options)?, Survey::default());
    let over = tokio::time::sleep(Duration::from_secs_f64(args.seconds));
    tokio::select! {
        result = take_all(&mut bus, &mut survey, false) => result?,
        () = over => {}
    }
    Ok(Heard { findings: survey.findings(), interface, times: None })
}

/// All frames of one interface of a log: of the one that is wanted, or of the only one that there is.
async fn of_log(log: &Path, wanted: Option<String>) -> anyhow::Result<Heard> {
    let reader = open_log(log, Wanted::interface(wanted.clone()))?;
    let (mut replay, mut survey) = (Replay::new(reader, Pace::AsFastAsPossible), Survey::default());
    if let Err(fault) = take_all(&mut replay, &mut survey, true).await {
        cut_off(&fault);
    }
    let report = replay.report();
    let times = report.time_fault();
    tell(report);
    expect_frames(log, wanted.as_deref(), report)?;
    let interface = wanted.map_or_else(|| only_interface(report), Ok)?;
    Ok(Heard { findings: survey.findings(), interface, times })
}

/// The interface of all frames.
fn only_interface(report: &LogReport) -> anyhow::Result<String> {
    match report.interfaces.as_slice() {
        [interface] => Ok(interface.clone()),
        several => bail!("the log has {}: say which with --interface", several.join(" and ")),
    }
}

/// Takes all that a source gives, until it ends.
async fn take_all(source: &mut impl FrameSource, survey: &mut Survey, is_log: bool) -> Result<(), SourceError> {
    let mut batch = Batch::default();
    while !batch.end {
        source.next(&mut batch).await?;
        batch.frames.iter().for_each(|frame| survey.frame(frame));
        for event in &batch.events {
            match event {
                BusEvent::Up | BusEvent::BufferGranted { .. } => {}
                BusEvent::Down { reason } => survey.notice(format!("went down: {reason}")),
                BusEvent::SourceDown { why } => survey.notice(format!("went down: {why}")),
                BusEvent::Error { error, .. } => survey.error(error),
                BusEvent::Dropped { .. } if is_log => {} // the report of the log says so, and where
                BusEvent::Dropped { frames } => survey.notice(format!("the kernel lost {frames} frames")),
                BusEvent::Malformed { frames } => survey.notice(format!("{frames} reads were no classic CAN frame")),
            }
        }
    }
    Ok(())
}

fn write_beginning(findings: &Findings, interface: &str, out: &Path) -> anyhow::Result<()> {
    if findings.boards.is_empty() {
        bail!("{}: not written, since no skin board was heard", out.display());
    }
    let text = words::beginning(findings, interface);
    config::examine_text(out, &text).context("what was heard makes no configuration")?;
    output::write_text(out, &text)
}
