//! How long a value takes from the bus into a client's hands.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use anyhow::Context;
use taxel_store::models_json;

use super::client::{self, Crowd, Delay};
use super::process::{Home, Scene};
use super::wire_floor;
use crate::document::{Aim, Axis, Cell, Figure, Level, Line, Look, Point, Section, Table, row};
use crate::numbers::{quantile, three_digits as figure};
use crate::options::Options;
use crate::rig::fits;

/// Streams settle before a window begins.
const WARM_UP: Duration = Duration::from_millis(300);

/// A case and the aims that stand for it.
struct Case {
    crowd: Crowd,
    p99_aim_us: Option<f64>,
    cpu_aim_percent: Option<f64>,
}

const fn case(subscribers: usize, rate_hz: Option<f64>, p99_us: Option<f64>, cpu_percent: Option<f64>) -> Case {
    Case { crowd: Crowd { subscribers, rate_hz }, p99_aim_us: p99_us, cpu_aim_percent: cpu_percent }
}

const CASES: [Case; 5] = [
    case(1, None, None, None),
    case(10, None, Some(300.0), None),
    case(100, None, None, None),
    case(100, Some(100.0), Some(2_000.0), Some(15.0)),
    case(1, Some(1_000.0), Some(150.0), None),
];

/// Messages over loopback TCP alone and the time between them, before each round: as a fast controller reads, and as the
/// skin sends.
const FLOORS: [(usize, Duration); 2] = [(800, Duration::from_millis(1)), (40, Duration::from_millis(50))];

/// Start to first force with a stored model set, from the first complete scan.
const START_AIM_MS: f64 = 200.0;

/// What was seen of a case.
#[derive(Default)]
struct Seen {
    delays: Vec<Delay>,
    window: Duration,
    /// Processor time of the daemon.
    cpu: Duration,
}

/// Delays in us.
struct Delays {
    /// From the stamp of the newest frame to the first message made of the value: it was published before that.
    published: Vec<f64>,
    /// From the making of a message into the client's hands.
    on_the_way: Vec<f64>,
    /// What the case's aim is for: all the way for values as they come, else `on_the_way`.
    whole: Vec<f64>,
}

/// Measures the daemon as a process, with 1, 10 and 100 subscribers.
///
/// # Errors
/// If the daemon cannot be started, does not get as far as a force, or ends.
pub fn latency(options: &Options) -> anyhow::Result<Section> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(measure(options))
}

async fn measure(options: &Options) -> anyhow::Result<Section> {
    let (rounds, window) = if options.quick { (1, Duration::from_millis(1500)) } else { (3, Duration::from_secs(8)) };
    let models = models_json::to_json(&*fits::calibrate(options.seed)?)?;
    let home = Home::new(options, Scene::Full)?;
    let mut daemon = home.start()?;
    let channel = client::connect(&mut daemon).await?;
    client::give_models(&channel, models, "").await?;
    let asked_to_force = client::first_force(&channel).await.with_context(|| daemon.complaints())?;
    let mut seen: Vec<Seen> = CASES.iter().map(|_| Seen::default()).collect();
    let mut floors = FLOORS.map(|_| Vec::new());
    for _ in 0..rounds {
        for (floor, (messages, period)) in floors.iter_mut().zip(FLOORS) {
            floor.extend(wire_floor::one_way_us(messages, period)?);
        }
        for (case, seen) in CASES.iter().zip(&mut seen) {
            let (before, begun) = (daemon.used()?.processor, Instant::now());
            seen.delays.extend(client::watch(daemon.address, case.crowd, WARM_UP, window).await?);
            seen.window += begun.elapsed();
            seen.cpu += daemon.used()?.processor.saturating_sub(before);
        }
    }
    drop(daemon);
    let mut daemon = home.start()?;
    let channel = client::connect(&mut daemon).await?;
    let start = client::first_force(&channel).await.with_context(|| daemon.complaints())?;
    Ok(section(&seen, &floors, [asked_to_force, start]))
}

impl Seen {
    fn delays(&self, crowd: Crowd) -> Delays {
        let mut first: BTreeMap<u64, f64> = BTreeMap::new();
        for delay in &self.delays {
            let least = first.entry(delay.sequence).or_insert(f64::INFINITY);
            *least = least.min(delay.to_send_us);
        }
        let on_the_way = || self.delays.iter().map(|delay| delay.on_the_way_us);
        let whole = match crowd.rate_hz {
            None => self.delays.iter().map(|delay| delay.to_send_us + delay.on_the_way_us).collect(),
            Some(_) => on_the_way().collect(),
        };
        // A held value's age says nothing of when it was published.
        let published = if crowd.rate_hz.is_none() { first.into_values().collect() } else { Vec::new() };
        Delays { published, on_the_way: on_the_way().collect(), whole }
    }

    fn cpu_percent(&self) -> f64 {
        100.0 * self.cpu.as_secs_f64() / self.window.as_secs_f64()
    }
}

fn name(crowd: Crowd) -> String {
    let Crowd { subscribers, rate_hz } = crowd;
    let plural = if subscribers == 1 { "" } else { "s" };
    let when = rate_hz.map_or_else(|| "each value as it comes".to_owned(), |hz| format!("{hz} Hz"));
    format!("{subscribers} subscriber{plural}, {when}")
}

fn section(seen: &[Seen], floors: &[Vec<f64>; 2], [activated, restarted]: [Duration; 2]) -> Section {
    let delays: Vec<Delays> = CASES.iter().zip(seen).map(|(case, seen)| seen.delays(case.crowd)).collect();
    let aims = aims(seen, &delays, restarted);
    Section {
        id: "latency".to_owned(),
        title: "Latency: from the bus into a client's hands".to_owned(),
        text: text(&delays, floors, [activated, restarted], &aims),
        aims,
        figures: vec![picture(&delays)],
        tables: vec![path_table(seen, &delays, floors)],
    }
}

fn text(delays: &[Delays], floors: &[Vec<f64>; 2], [activated, restarted]: [Duration; 2], aims: &[Aim]) -> Vec<String> {
    let missed = aims.iter().filter(|aim| aim.met == Some(false)).count();
    let (published, on_the_way) = (&delays[1].published, &delays[1].on_the_way);
    vec![
        "A daemon runs as a process of its own on the simulated forearm of 230 taxels, which sends 20 scans a second, \
         with every output asked for. The clients share this process's one thread, and both share the machine's cores. \
         Clocks are CLOCK_MONOTONIC on both sides. \"Stamp\" is the receive time of the newest frame in a value; \
         \"published\" is bounded from above by the age that the first of all messages with that value carries; \"hand\" \
         is when the client has the decoded message. Values that are sent as they come are timed from the stamp; at a \
         fixed rate a held value is old by design, so that the time from the making of the message counts."
            .to_owned(),
        format!(
            "With 10 subscribers the median value is published {} us after its stamp and takes {} us from there into a \
             client's hands (p99: {} and {} us). On the way sleeping threads are woken one after the other: the engine's by the bus, \
             the service's by the engine, the client's by the service; the first figure has two of these wake-ups, the \
             second one. Loopback TCP alone, to a thread that sleeps in read, takes {} us, p99 {} us, at 1 kHz, and \
             {} us, p99 {} us, at the skin's rate, in the same run.",
            figure(quantile(published, 0.5)),
            figure(quantile(on_the_way, 0.5)),
            figure(quantile(published, 0.99)),
            figure(quantile(on_the_way, 0.99)),
            figure(quantile(&floors[0], 0.5)),
            figure(quantile(&floors[0], 0.99)),
            figure(quantile(&floors[1], 0.5)),
            figure(quantile(&floors[1], 0.99)),
        ),
        format!(
            "The first force came {} ms after the first complete scan that the client saw when models were activated on \
             a fresh store, and {} ms after the first complete scan when the daemon was started again on that store.",
            figure(activated.as_secs_f64() * 1e3),
            figure(restarted.as_secs_f64() * 1e3)
        ),
        format!(
            "Processor time is the daemon's without the simulated bus. A p99.9 of fewer than 1,000 messages is the largest of \
             them. {missed} of {} aims were missed: on a machine with two cores, which daemon, simulator and clients share, \
             most of a delay is the waking of threads.",
            aims.len()
        ),
    ]
}

fn three(values: &[f64]) -> [Cell; 3] {
    [0.5, 0.99, 0.999].map(|share| match quantile(values, share) {
        value if value.is_nan() => "-".into(),
        value => value.into(),
    })
}

fn path_table(seen: &[Seen], delays: &[Delays], floors: &[Vec<f64>; 2]) -> Table {
    let mut columns = vec!["case".to_owned(), "messages".to_owned()];
    for what in ["stamp to published", "message made to hand", "stamp to hand"] {
        columns.extend(["p50", "p99", "p99.9"].map(|quantile| format!("{what}, {quantile}, us")));
    }
    columns.push("daemon, % of a core".to_owned());
    let mut rows: Vec<Vec<Cell>> = Vec::new();
    for ((case, seen), delays) in CASES.iter().zip(seen).zip(delays) {
        let mut row = row![name(case.crowd), seen.delays.len() as f64];
        let whole: &[f64] = if case.crowd.rate_hz.is_none() { &delays.whole } else { &[] };
        row.extend([delays.published.as_slice(), &delays.on_the_way, whole].into_iter().flat_map(three));
        row.push(seen.cpu_percent().into());
        rows.push(row);
    }
    for (floor, (_, period)) in floors.iter().zip(FLOORS) {
        let name = format!("loopback TCP alone, {} Hz", 1.0 / period.as_secs_f64());
        let mut row = row![name, floor.len() as f64];
        row.extend([&[][..], floor, &[]].into_iter().flat_map(three));
        row.push("-".into());
        rows.push(row);
    }
    let caption = "The way of a value, in us. A dash stands where the case has no such time.";
    Table::new("latency-cases", caption, columns, rows)
}

fn aims(seen: &[Seen], delays: &[Delays], restarted: Duration) -> Vec<Aim> {
    let mut aims = Vec::new();
    for ((case, seen), delays) in CASES.iter().zip(seen).zip(delays) {
        let from = if case.crowd.rate_hz.is_none() { "the bus" } else { "the daemon" };
        let name = name(case.crowd);
        if let Some(aim) = case.p99_aim_us {
            let what = format!("{name}: from {from} into a controller's hands, 99 % of the forces, us");
            aims.push(Aim::at_most(&what, quantile(&delays.whole, 0.99), aim));
        }
        if let Some(aim) = case.cpu_aim_percent {
            let what = format!("{name}: daemon, % of a core");
            aims.push(Aim::at_most(&what, seen.cpu_percent(), aim));
        }
    }
    let what = "start on a stored calibration: from the first complete scan to the first force, ms";
    aims.push(Aim::at_most(what, restarted.as_secs_f64() * 1e3, START_AIM_MS));
    aims
}

/// Quantiles against the number of subscribers, for values as they come.
fn picture(delays: &[Delays]) -> Figure {
    let cases = || CASES.iter().zip(delays).filter(|(case, _)| case.crowd.rate_hz.is_none());
    let line = |what: &str, share: f64, ours: bool, of: fn(&Delays) -> &Vec<f64>| Line {
        name: format!("{what}, p{}", share * 100.0),
        ours,
        look: Look::Signs,
        points: cases()
            .map(|(case, delays)| Point {
                x: case.crowd.subscribers as f64,
                y: quantile(of(delays), share),
                ..Point::default()
            })
            .collect(),
    };
    Figure {
        id: "latency-path".to_owned(),
        title: "From the bus into a client's hands".to_owned(),
        caption: "From the newest frame's stamp to the published value and into the client's hands, each value as it \
                  comes, against the number of subscribers."
            .to_owned(),
        x: Axis::log("subscribers"),
        y: Axis::log("us"),
        lines: vec![
            line("to published", 0.5, false, |delays| &delays.published),
            line("to published", 0.99, false, |delays| &delays.published),
            line("to hand", 0.5, true, |delays| &delays.whole),
            line("to hand", 0.99, true, |delays| &delays.whole),
            line("to hand", 0.999, true, |delays| &delays.whole),
        ],
        bands: vec![Level::new(300.0, "aim for p99 to hand with 10 subscribers")],
        levels: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn delay(sequence: u64, to_send_us: f64, on_the_way_us: f64) -> Delay {
        Delay { sequence, to_send_us, on_the_way_us }
    }

    const CPU: Duration = Duration::from_millis(20);

    #[test]
    fn a_value_is_published_before_its_first_message_is_made() {
        let delays = vec![delay(1, 50.0, 10.0), delay(1, 40.0, 30.0), delay(2, 60.0, 5.0)];
        let seen = Seen { delays, window: Duration::from_secs(1), cpu: CPU };
        let arrival = seen.delays(Crowd { subscribers: 2, rate_hz: None });
        assert_eq!(arrival.published, [40.0, 60.0]);
        assert_eq!(arrival.whole, [60.0, 70.0, 65.0]);
        let held = seen.delays(Crowd { subscribers: 2, rate_hz: Some(100.0) });
        assert!(held.published.is_empty(), "the age of a held value is no delay");
        assert_eq!(held.whole, [10.0, 30.0, 5.0]);
        assert!((seen.cpu_percent() - 2.0).abs() < 1e-9);
    }

    #[test]
    fn every_aim_is_judged_and_a_miss_is_counted_in_the_text() {
        let seen: Vec<Seen> = CASES
            .iter()
            .map(|_| Seen { delays: vec![delay(1, 200.0, 160.0)], window: Duration::from_secs(1), cpu: CPU })
            .collect();
        let section =
            section(&seen, &[vec![20.0, 30.0], vec![80.0]], [Duration::from_secs(1), Duration::from_millis(150)]);
        let verdicts: Vec<bool> = section.aims.iter().filter_map(|aim| aim.met).collect();
        assert_eq!(verdicts, [false, true, true, false, true]);
        assert!(section.text[3].contains("2 of 5 aims were missed"), "{}", section.text[3]);
        let width = section.tables[0].columns.len();
        assert!(section.tables[0].rows.iter().all(|row| row.len() == width));
    }
}
