//! What a gauge prints on a serial device or over TCP, and what a template reads of it.

use std::time::Duration;

use anyhow::anyhow;
use taxel_rig::{Lines, Template, numbers_of};
use taxel_skin::printable;
use taxel_wire::signal::PressureUnit;
use tokio::time::{Instant, timeout_at};

use crate::rig::{At, unescaped};

/// Rates that gauges and micro boards have, the likeliest first.
const TRIED: [u32; 5] = [115_200, 9_600, 19_200, 57_600, 38_400];
/// Lines that are shown.
const SHOWN: usize = 5;
/// What air presses with, kPa: a gauge of a vented bag that reads so is absolute.
const AIR_KPA: std::ops::RangeInclusive<f64> = 80.0..=110.0;
/// A reading further below 0 than an offset is one of vacuum, kPa.
const VACUUM_KPA: f64 = 1.0;
/// From one question to the next.
const ASK_EVERY: Duration = Duration::from_millis(200);

/// A gauge to listen to.
#[derive(Debug, clap::Args)]
pub struct Gauge {
    /// A gauge that prints text in place of a bus: a serial device, or tcp:HOST:PORT. Without a rate, as in /dev/ttyACM0@9600, the
    /// usual ones are tried.
    #[arg(long, value_name = "PATH", conflicts_with_all = ["log", "interface", "out", "yarp"])]
    pub serial: Option<String>,
    /// What a line looks like, as in "P={kPa}".
    #[arg(long, value_name = "TEMPLATE", requires = "serial")]
    template: Option<String>,
    /// A question that it answers with a line, as in "P\r\n"; without it is only listened.
    #[arg(long, value_name = "TEXT", requires = "serial", value_parser = |text: &str| Ok::<_, String>(unescaped(text)))]
    poll: Option<String>,
}

/// Listens there so long at each rate; a text for people.
///
/// # Errors
/// A template or a rate that makes no sense, or a device that cannot be opened.
pub async fn text(gauge: &Gauge, at: &str, over: Duration) -> anyhow::Result<String> {
    let places = match At::new(at).map_err(|why| anyhow!("--serial {at}: {why}"))? {
        At::Serial(path, _) if !at.contains('@') => TRIED.map(|baud| At::Serial(path.clone(), baud)).to_vec(),
        one => vec![one],
    };
    let template = |text| Template::new(text).map_err(|why| anyhow!("--template {text}: {why}"));
    let template = gauge.template.as_deref().map(template).transpose()?;
    let mut tried = Vec::new();
    for at in places {
        let heard = listen(&at, gauge, over).await?;
        let is_text = |line: &&String| line.chars().all(|c| c.is_ascii_graphic() || c.is_ascii_whitespace());
        if heard.lines.iter().filter(is_text).count() * 2 > heard.lines.len() {
            let mut lines = vec![format!("{at}: {:.1} lines/s", heard.lines.len() as f64 / heard.seconds)];
            lines.extend(heard.lines.iter().rev().take(SHOWN).rev().map(|line| format!("  {}", printable(line))));
            lines.extend(proposals(gauge, &at.to_string(), &heard, template.as_ref()));
            return Ok(lines.join("\n"));
        }
        tried.push(format!("{at}: {} bytes, no lines of text", heard.bytes));
    }
    tried.push("is the gauge on, and does it print by itself? If it has to be asked: --poll \"P\\r\\n\"".to_owned());
    Ok(tried.join("\n"))
}

struct Heard {
    lines: Vec<String>,
    bytes: usize,
    seconds: f64,
}

async fn listen(at: &At, gauge: &Gauge, over: Duration) -> anyhow::Result<Heard> {
    let mut link = at.open().await.map_err(anyhow::Error::msg)?;
    let poll = gauge.poll.as_ref();
    let mut lines = if poll.is_some() { Lines::from_the_first() } else { Lines::default() };
    let (begun, mut buffer) = (Instant::now(), [0; 1024]);
    let end = begun + over;
    let mut heard = Heard { lines: Vec::new(), bytes: 0, seconds: over.as_secs_f64() };
    while Instant::now() < end {
        if let Some(poll) = poll {
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

/// The lines of a configuration: by the template that was given, or for each number of the last line.
fn proposals(gauge: &Gauge, at: &str, heard: &Heard, given: Option<&Template>) -> Vec<String> {
    if let Some(template) = given {
        let unread = heard.lines.iter().rev().find_map(|line| template.read(line).err());
        let unread = unread.map(|why| format!("  not read: {}", printable(&why)));
        return std::iter::once(proposal(gauge, at, heard, template)).chain(unread).collect();
    }
    let numbers = heard.lines.last().map(|line| numbers_of(line)).unwrap_or_default();
    if numbers.is_empty() {
        return vec![format!("no number is in the last line; a template has one of {}", PressureUnit::NAMES)];
    }
    let templates = numbers.iter().filter_map(|number| {
        // Without a unit in the line the pressure of the air says which it is.
        let is_air = |unit: &&&str| {
            PressureUnit::named(unit).is_some_and(|unit| AIR_KPA.contains(&unit.to_kilopascal(number.value)))
        };
        let unit = ["kPa", "hPa", "Pa"].iter().find(is_air).filter(|_| number.unit.is_none()).unwrap_or(&"kPa");
        Template::new(&number.template.replace("{kPa}", &format!("{{{unit}}}"))).ok()
    });
    let lines = templates.map(|template| proposal(gauge, at, heard, &template));
    std::iter::once("for its [[patch]], one of (another unit may stand in the braces):".to_owned())
        .chain(lines)
        .collect()
}

/// A line of a configuration, and what it reads.
fn proposal(gauge: &Gauge, at: &str, heard: &Heard, template: &Template) -> String {
    let unit = template.unit().unwrap_or_default();
    let read = heard.lines.iter().filter_map(|line| template.read(line).ok().flatten());
    let read: Vec<f64> = read.map(|value| unit.to_kilopascal(value)).collect();
    let (least, most) = read.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), kpa| (a.min(*kpa), b.max(*kpa)));
    let (reference, words) = match read.last() {
        None => ("", "reads none of them"),
        Some(_) if AIR_KPA.contains(&least) && AIR_KPA.contains(&most) => {
            (", reference = \"absolute\"", "the air's own pressure, if the bag is vented now")
        }
        Some(_) if least < -VACUUM_KPA && most < VACUUM_KPA => (", reference = \"ambient\"", "below 0 in vacuum"),
        Some(_) => ("", "taken as above 0 in vacuum; if it is below 0 there, add reference = \"ambient\""),
    };
    let poll = gauge.poll.as_ref().map_or_else(String::new, |poll| format!(", poll = {poll:?}"));
    let (text, count) = (template.text(), heard.lines.len());
    let range = if read.is_empty() {
        String::new()
    } else {
        format!("{least:.3} to {most:.3} kPa in {} of {count} lines: ", read.len())
    };
    printable(&format!("  gauge = {{ line = {at:?}, template = {text:?}{poll}{reference} }} # {range}{words}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_proposal_says_what_its_numbers_refer_to() {
        let gauge = Gauge { serial: None, template: None, poll: Some("P\r".to_owned()) };
        for (line, proposed) in [
            ("p -3.21 kPa", "template = \"p {kPa} kPa\", poll = \"P\\r\", reference = \"ambient\" } # -3.210"),
            (
                "p 0.02",
                "template = \"p {kPa}\", poll = \"P\\r\" } # 0.020 to 0.020 kPa in 2 of 2 lines: taken as above 0",
            ),
            ("1013.2", "template = \"{hPa}\", poll = \"P\\r\", reference = \"absolute\" } # 101.320"),
            ("99870 Pa", "template = \"{Pa} Pa\", poll = \"P\\r\", reference = \"absolute\" } # 99.870"),
        ] {
            let heard = Heard { lines: vec![line.to_owned(); 2], bytes: 9, seconds: 1.0 };
            let said = proposals(&gauge, "/dev/ttyACM0@9600", &heard, None);
            let expected = format!("gauge = {{ line = \"/dev/ttyACM0@9600\", {proposed}");
            assert!(said[1].contains(&expected), "{said:?}");
            let pasted = said[1].parse::<toml::Table>().unwrap();
            assert!(pasted["gauge"]["template"].is_str());
        }
    }
}
