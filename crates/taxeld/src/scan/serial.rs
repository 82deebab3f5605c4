//! What a gauge prints on a serial device or over TCP, and what a template reads of it.

use std::time::Duration;

use anyhow::ensure;
use taxel_rig::{Lines, Template, numbers_of};
use taxel_skin::printable;
use taxel_wire::signal::PressureUnit;
use tokio::time::{Instant, timeout_at};

use crate::rig::{At, BAUD_RATES, BAUD_USUAL};

/// Rates that gauges and micro boards have, the likeliest first.
const TRIED: [u32; 5] = [115_200, 9_600, 19_200, 57_600, 38_400];
/// Lines that are shown.
const SHOWN: usize = 5;
/// From one question to the next.
const ASK_EVERY: Duration = Duration::from_millis(200);

/// What to listen to.
pub struct Asked<'a> {
    /// Where.
    pub at: At,
    /// The rate; the usual ones where it is not known.
    pub baud: Option<u32>,
    /// What a line looks like.
    pub template: Option<&'a str>,
    /// What to ask it.
    pub poll: Option<&'a str>,
    /// How long, at one rate.
    pub over: Duration,
}

/// Listens; a text for people.
///
/// # Errors
/// A template or a rate that makes no sense, or a device that cannot be opened.
pub async fn text(asked: &Asked<'_>) -> anyhow::Result<String> {
    let template =
        asked.template.map(|text| Template::new(text).map_err(|why| anyhow::anyhow!("--template {text}: {why}")));
    let template = template.transpose()?;
    let rates = match asked.baud {
        Some(baud) => vec![baud],
        None if asked.at.is_serial() => TRIED.to_vec(),
        None => vec![BAUD_USUAL],
    };
    ensure!(rates.iter().all(|rate| BAUD_RATES.contains(rate)), "--baud: expected one of {BAUD_RATES:?}");
    let mut tried = Vec::new();
    for baud in rates {
        let rate = if asked.at.is_serial() { format!("@{baud}") } else { String::new() };
        let heard = listen(&asked.at.at_rate(baud), asked).await?;
        let is_text = |line: &&String| line.chars().all(|c| c.is_ascii_graphic() || c.is_ascii_whitespace());
        if heard.lines.iter().filter(is_text).count() * 2 > heard.lines.len() {
            let mut lines =
                vec![format!("{}{rate}: {:.1} lines/s", asked.at, heard.lines.len() as f64 / heard.seconds)];
            lines.extend(heard.lines.iter().rev().take(SHOWN).rev().map(|line| format!("  {}", printable(line))));
            lines.extend(template.as_ref().map_or_else(|| proposals(&heard), |template| readings(template, &heard)));
            return Ok(lines.join("\n"));
        }
        tried.push(format!("{}{rate}: {} bytes, no lines of text", asked.at, heard.bytes));
    }
    tried.push("is the gauge on, and does it print by itself? If it has to be asked: --poll \"P\\r\\n\"".to_owned());
    Ok(tried.join("\n"))
}

struct Heard {
    lines: Vec<String>,
    bytes: usize,
    seconds: f64,
}

async fn listen(at: &At, asked: &Asked<'_>) -> anyhow::Result<Heard> {
    let mut link = at.open().await.map_err(anyhow::Error::msg)?;
    // On a command line an escape is two characters.
    let poll = asked.poll.map(|text| text.replace("\\r", "\r").replace("\\n", "\n"));
    let mut lines = if poll.is_some() { Lines::from_the_first() } else { Lines::default() };
    let (begun, mut buffer) = (Instant::now(), [0; 1024]);
    let end = begun + asked.over;
    let mut heard = Heard { lines: Vec::new(), bytes: 0, seconds: asked.over.as_secs_f64() };
    while Instant::now() < end {
        if let Some(poll) = &poll {
            link.write(poll.as_bytes()).await?;
        }
        let until = if poll.is_some() { end.min(Instant::now() + ASK_EVERY) } else { end };
        while let Ok(count) = timeout_at(until, link.read(&mut buffer)).await {
            let count = count?;
            heard.bytes += count;
            heard.lines.extend(lines.take(&buffer[..count]));
        }
    }
    Ok(heard)
}

/// What a template reads of the lines.
fn readings(template: &Template, heard: &Heard) -> Vec<String> {
    let unit = template.unit().unwrap_or_default();
    let read = heard.lines.iter().filter_map(|line| template.read(line).ok().flatten());
    let read: Vec<f64> = read.map(|value| unit.to_kilopascal(value)).collect();
    let (least, most) = read.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), kpa| (a.min(*kpa), b.max(*kpa)));
    let mut lines = vec![format!("the template reads {} of {} lines", read.len(), heard.lines.len())];
    if let Some(last) = read.last() {
        lines.push(format!("  {least:.3} to {most:.3} kPa, last {last:.3} kPa{}", reference(least, most)));
    }
    let unread = heard.lines.iter().rev().find_map(|line| template.read(line).err());
    lines.extend(unread.map(|why| format!("  not read: {why}")));
    lines
}

/// What such readings refer to.
fn reference(least: f64, most: f64) -> &'static str {
    match (least, most) {
        (least, most) if least > 50.0 && most < 110.0 => ": as air has, so add reference = \"absolute\"",
        (least, most) if least < -5.0 && most < 5.0 => ": below 0 in vacuum, so add reference = \"ambient\"",
        _ => "",
    }
}

/// A template for each number of the last line.
fn proposals(heard: &Heard) -> Vec<String> {
    let numbers = heard.lines.last().map(|line| numbers_of(line)).unwrap_or_default();
    let mut lines = vec!["templates for its numbers, in kPa; other units stand in the braces as well:".to_owned()];
    lines.extend(numbers.iter().map(|(value, template)| format!("  {value}: --template '{}'", printable(template))));
    if numbers.is_empty() {
        lines = vec![format!("no number is in the last line; a template has one of {}", PressureUnit::NAMES)];
    }
    lines
}
