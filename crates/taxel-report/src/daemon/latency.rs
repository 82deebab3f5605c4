//! How long a value takes from the bus into a client's hands.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use taxel_store::models_json;

use super::client::{self, Arrival, Crowd};
use super::process::{Home, Scene};
use super::wire_floor;
use crate::document::{Aim, Axis, Cell, Figure, Level, Line, Point, Section, Table, row};
use crate::numbers::{quantile, three_digits as figure};
use crate::options::Options;
use crate::rig::fits;

/// Streams settle before a window begins.
const WARM_UP: Duration = Duration::from_millis(300);

/// Subscribers that do the same, and the aims that stand for them.
#[derive(Clone, Copy)]
struct Case {
    subscribers: usize,
    /// Absent: each value as it comes.
    rate_hz: Option<f64>,
    p99_aim_us: Option<f64>,
    cpu_aim_percent: Option<f64>,
}

const fn case(subscribers: usize, rate_hz: Option<f64>, p99_us: Option<f64>, cpu_percent: Option<f64>) -> Case {
    Case { subscribers, rate_hz, p99_aim_us: p99_us, cpu_aim_percent: cpu_percent }
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

/// What was seen of a case, in us.
struct Seen {
    case: Case,
    /// From the stamp of the newest frame to the first message made of the value, by value: it was published before that.
    /// Of values as they come: a held value's age says nothing of when it was published.
    published: BTreeMap<u64, f64>,
    /// From the making of a message into the client's hands.
    on_the_way: Vec<f64>,
    /// From the stamp into the client's hands, of values as they come.
    to_hand: Vec<f64>,
    window: Duration,
    /// Processor time of the daemon.
    cpu: Duration,
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
    let home = Home::forearm(&options.taxeld, "", Scene::Full, options.seed)?;
    let (daemon, _, activated) = client::start(&home, Some(models)).await?;
    let mut all = CASES.map(Seen::new);
    let mut floors = FLOORS.map(|_| Vec::new());
    for _ in 0..rounds {
        for (floor, (messages, period)) in floors.iter_mut().zip(FLOORS) {
            floor.extend(wire_floor::one_way_us(messages, period)?);
        }
        for seen in &mut all {
            let (before, begun, crowd) = (daemon.used()?.processor, Instant::now(), seen.case.crowd(daemon.address()));
            client::watch(&crowd, WARM_UP, window, |arrival| seen.take(arrival)).await?;
            seen.window += begun.elapsed();
            seen.cpu += daemon.used()?.processor.saturating_sub(before);
        }
    }
    drop(daemon);
    let (_daemon, _, restarted) = client::start(&home, None).await?;
    Ok(section(&all, &floors, [activated, restarted]))
}

impl Case {
    fn crowd(self, address: String) -> Crowd {
        let Self { subscribers, rate_hz, .. } = self;
        let (patches, per_connection) = (vec![String::new()], client::STREAMS_PER_CONNECTION);
        Crowd { address, patches, subscribers, per_connection, rate_hz }
    }

    fn name(self) -> String {
        let plural = if self.subscribers == 1 { "" } else { "s" };
        let when = self.rate_hz.map_or_else(|| "each value as it comes".to_owned(), |hz| format!("{hz} Hz"));
        format!("{} subscriber{plural}, {when}", self.subscribers)
    }
}

impl Seen {
    fn new(case: Case) -> Self {
        let (published, window) = (BTreeMap::new(), Duration::ZERO);
        Self { case, published, on_the_way: Vec::new(), to_hand: Vec::new(), window, cpu: Duration::ZERO }
    }

    fn take(&mut self, Arrival { sequence, stamp_ns, made_ns, at_ns, .. }: Arrival) {
        let us = |from_ns, to_ns| (to_ns - from_ns) as f64 * 1e-3;
        self.on_the_way.push(us(made_ns, at_ns));
        if self.case.rate_hz.is_none() {
            self.to_hand.push(us(stamp_ns, at_ns));
            let first = self.published.entry(sequence).or_insert(f64::INFINITY);
            *first = first.min(us(stamp_ns, made_ns));
        }
    }

    fn published(&self) -> Vec<f64> {
        self.published.values().copied().collect()
    }

    /// What the case's aim is for: a held value is old by design.
    fn judged(&self) -> &[f64] {
        if self.case.rate_hz.is_none() { &self.to_hand } else { &self.on_the_way }
    }

    fn cpu_percent(&self) -> f64 {
        100.0 * self.cpu.as_secs_f64() / self.window.as_secs_f64()
    }
}

fn section(all: &[Seen], floors: &[Vec<f64>; 2], started: [Duration; 2]) -> Section {
    let aims = aims(all, started[1]);
    Section {
        text: text(&all[1], floors, started, &aims),
        aims,
        figures: vec![picture(all)],
        tables: vec![path_table(all, floors)],
        ..Section::default()
    }
}

/// `ten` are the ten subscribers that take each value as it comes; the first force after an activation and a restart.
fn text(ten: &Seen, floors: &[Vec<f64>; 2], [activated, restarted]: [Duration; 2], aims: &[Aim]) -> Vec<String> {
    let missed = aims.iter().filter(|aim| aim.met == Some(false)).count();
    let typical = |us: &[f64]| [0.5, 0.99].map(|share| figure(quantile(us, share)));
    let [published, published_99] = typical(&ten.published());
    let [on_the_way, on_the_way_99] = typical(&ten.on_the_way);
    let [[fast, fast_99], [slow, slow_99]] = [typical(&floors[0]), typical(&floors[1])];
    let [activated, restarted] = [activated, restarted].map(|took| figure(took.as_secs_f64() * 1e3));
    vec![
        "A daemon runs as a process of its own on the simulated forearm of 230 taxels, which sends 20 scans a second, \
         with every output asked for. The clients share this process's one thread, and both share the machine's cores. \
         Clocks are CLOCK_MONOTONIC on both sides. \"Stamp\" is the receive time of the newest frame in a value; \
         \"published\" is bounded from above by the age that the first of all messages with that value carries; \"hand\" \
         is when the client has the decoded message. Values that are sent as they come are timed from the stamp; at a \
         fixed rate a held value is old by design, so that the time from the making of the message counts."
            .to_owned(),
        format!(
            "With 10 subscribers the median value is published {published} us after its stamp and takes {on_the_way} us from \
             there into a client's hands (p99: {published_99} and {on_the_way_99} us). On the way sleeping threads are woken one after the other: the engine's by the bus, \
             the service's by the engine, the client's by the service; the first figure has two of these wake-ups, the \
             second one. Loopback TCP alone, to a thread that sleeps in read, takes {fast} us, p99 {fast_99} us, at 1 kHz, \
             and {slow} us, p99 {slow_99} us, at the skin's rate, in the same run."
        ),
        format!(
            "The first force came {activated} ms after the first complete scan that the client saw when models were activated \
             on a fresh store, and {restarted} ms after the first complete scan when the daemon was started again on that \
             store."
        ),
        format!(
            "Processor time is the daemon's without the simulated bus. A p99.9 of fewer than 1,000 messages is the largest of \
             them. {missed} of {} aims were missed: on a machine with two cores, which daemon, simulator and clients share, \
             most of a delay is the waking of threads.",
            aims.len()
        ),
    ]
}

fn path_table(all: &[Seen], floors: &[Vec<f64>; 2]) -> Table {
    let mut columns = vec!["case".to_owned(), "messages".to_owned()];
    for what in ["stamp to published", "message made to hand", "stamp to hand"] {
        columns.extend(["p50", "p99", "p99.9"].map(|quantile| format!("{what}, {quantile}, us")));
    }
    columns.push("daemon, % of a core".to_owned());
    let quantiles = |us: &[f64]| -> [Cell; 3] {
        [0.5, 0.99, 0.999].map(|share| if us.is_empty() { "-".into() } else { quantile(us, share).into() })
    };
    let cells = |name: String, [published, on_the_way, to_hand]: [&[f64]; 3], cpu: Cell| {
        let mut row = row![name, on_the_way.len() as f64];
        row.extend([published, on_the_way, to_hand].into_iter().flat_map(quantiles));
        row.push(cpu);
        row
    };
    let case = |seen: &Seen| {
        let published = seen.published();
        cells(seen.case.name(), [&published, &seen.on_the_way, &seen.to_hand], seen.cpu_percent().into())
    };
    let floor = |(us, (_, period)): (&Vec<f64>, (usize, Duration))| {
        let name = format!("loopback TCP alone, {} Hz", 1.0 / period.as_secs_f64());
        cells(name, [&[], us, &[]], "-".into())
    };
    let rows = all.iter().map(case).chain(floors.iter().zip(FLOORS).map(floor)).collect();
    let caption = "The way of a value, in us. A dash stands where the case has no such time.";
    Table::new("latency-cases", caption, columns, rows)
}

fn aims(all: &[Seen], restarted: Duration) -> Vec<Aim> {
    let mut aims = Vec::new();
    for seen in all {
        let from = if seen.case.rate_hz.is_none() { "the bus" } else { "the daemon" };
        let name = seen.case.name();
        if let Some(aim) = seen.case.p99_aim_us {
            let what = format!("{name}: from {from} into a controller's hands, 99 % of the forces, us");
            aims.push(Aim::at_most(&what, quantile(seen.judged(), 0.99), aim));
        }
        if let Some(aim) = seen.case.cpu_aim_percent {
            aims.push(Aim::at_most(&format!("{name}: daemon, % of a core"), seen.cpu_percent(), aim));
        }
    }
    let what = "start on a stored calibration: from the first complete scan to the first force, ms";
    aims.push(Aim::at_most(what, restarted.as_secs_f64() * 1e3, START_AIM_MS));
    aims
}

/// Quantiles against the number of subscribers, for values as they come.
fn picture(all: &[Seen]) -> Figure {
    let line = |what: &str, share: f64, ours: bool, of: fn(&Seen) -> Vec<f64>| {
        let point = |seen: &Seen| {
            let (x, y) = (seen.case.subscribers as f64, quantile(&of(seen), share));
            Point { x, y, ..Point::default() }
        };
        let points = all.iter().filter(|seen| seen.case.rate_hz.is_none()).map(point).collect();
        Line { name: format!("{what}, p{}", share * 100.0), ours, points, ..Line::default() }
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
            line("to published", 0.5, false, Seen::published),
            line("to published", 0.99, false, Seen::published),
            line("to hand", 0.5, true, |seen| seen.to_hand.clone()),
            line("to hand", 0.99, true, |seen| seen.to_hand.clone()),
            line("to hand", 0.999, true, |seen| seen.to_hand.clone()),
        ],
        bands: vec![Level::new(300.0, "aim for p99 to hand with 10 subscribers")],
        ..Figure::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(case: Case, arrivals: &[(u64, i64, i64)]) -> Seen {
        let mut seen = Seen { window: Duration::from_secs(1), cpu: Duration::from_millis(20), ..Seen::new(case) };
        for &(sequence, made_us, at_us) in arrivals {
            let (made_ns, at_ns) = (1_000 * made_us, 1_000 * at_us);
            seen.take(Arrival { sequence, is_new: true, is_force: true, stamp_ns: 0, made_ns, at_ns });
        }
        seen
    }

    #[test]
    fn a_value_is_published_before_its_first_message_is_made() {
        let arrivals = [(1, 50, 60), (1, 40, 70), (2, 60, 65)];
        let as_they_come = seen(case(2, None, None, None), &arrivals);
        assert_eq!(as_they_come.published(), [40.0, 60.0]);
        assert_eq!(as_they_come.judged(), [60.0, 70.0, 65.0]);
        let held = seen(case(2, Some(100.0), None, None), &arrivals);
        assert!(held.published().is_empty(), "the age of a held value is no delay");
        assert_eq!(held.judged(), [10.0, 30.0, 5.0]);
        assert!((held.cpu_percent() - 2.0).abs() < 1e-9);
    }

    #[test]
    fn every_aim_is_judged_and_a_miss_is_counted_in_the_text() {
        let all = CASES.map(|case| seen(case, &[(1, 200, 360)]));
        let started = [Duration::from_secs(1), Duration::from_millis(150)];
        let section = section(&all, &[vec![20.0, 30.0], vec![80.0]], started);
        let verdicts: Vec<bool> = section.aims.iter().filter_map(|aim| aim.met).collect();
        assert_eq!(verdicts, [false, true, true, false, true]);
        assert!(section.text[3].contains("2 of 5 aims were missed"), "{}", section.text[3]);
        let width = section.tables[0].columns.len();
        assert!(section.tables[0].rows.iter().all(|row| row.len() == width));
    }
}
