//! From the arrival of a frame to its reader: through shared memory and through the service, in one run.
//!
//! `cargo run --release -p taxel-client --example latency -- target/release/taxeld [SECONDS]`
//!
//! It starts `taxeld demo` with both doors open, and reads both: shared memory by looking at it without a pause, as a control
//! loop on a core of its own does; the service by its stream. Frames of the simulated
//! boards are stamped when they are handed over, as a kernel does it. What is counted is the time from the newest frame in
//! a sample to the moment at which a reader has the sample in its hands, on the machine's one clock.

use std::error::Error;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use taxel_client::{Address, Options, follow};
use taxel_shm::{Page, now_ns};

/// What one way of reading saw: the times from the newest frame in a sample to the reader.
#[derive(Default)]
struct Seen {
    last: u64,
    times_ns: Vec<i64>,
}

impl Seen {
    /// Takes a sample if it is new. The first one may have been there for any time.
    fn take(&mut self, sequence: u64, frame_ns: Option<i64>) {
        if sequence != self.last && self.last != 0 {
            self.times_ns.extend(frame_ns.map(|frame_ns| now_ns() - frame_ns));
        }
        self.last = sequence;
    }
}

fn print(name: &str, mut times_ns: Vec<i64>) {
    times_ns.sort_unstable();
    let Some(last) = times_ns.len().checked_sub(1) else { return };
    let at = |share: f64| times_ns[(share * last as f64) as usize] as f64 * 1e-3;
    let [p50, p99, most] = [0.5, 0.99, 0.999].map(at);
    println!("{name:32} p50 {p50:7.1} us  p99 {p99:7.1} us  p99.9 {most:7.1} us  {} samples", times_ns.len());
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let taxeld = arguments.next().ok_or("usage: latency TAXELD [SECONDS]")?;
    let span = Duration::from_secs_f64(arguments.next().map_or(Ok(20.0), |text| text.parse())?);
    let folder = format!("/dev/shm/taxel-latency-{}", std::process::id());
    let mut command = Command::new(taxeld);
    command.args(["demo", "--listen", "127.0.0.1:0", "--shared-memory", &folder]).stdout(Stdio::piped());
    let mut demo = command.stderr(Stdio::null()).spawn()?;
    let mut lines = BufReader::new(demo.stdout.take().ok_or("no output")?).lines().map_while(Result::ok);
    let live = lines.find_map(|line| Some(line.strip_prefix("The skin is now")?.rsplit_once(" on ")?.1.to_owned()));
    let address = live.ok_or("the demo did not start")?;
    std::thread::spawn(move || lines.for_each(drop)); // its text goes on and must not block it
    let address = Address::parse(address.trim_end_matches('.'))?;
    std::thread::sleep(Duration::from_secs(5)); // its first zero
    let path = Path::new(&folder).join("left_forearm");
    print("shared memory", shared_memory(&path, span)?);
    print("the service's stream", service(address, span)?);
    demo.kill()?;
    demo.wait()?;
    let _ = std::fs::remove_dir_all(folder);
    Ok(())
}

/// Reads the page without a pause for so long.
fn shared_memory(path: &Path, span: Duration) -> Result<Vec<i64>, Box<dyn Error>> {
    let page = Page::open(path)?;
    let (begun, mut seen) = (Instant::now(), Seen::default());
    while begun.elapsed() < span {
        if let Ok(force) = page.force(None) {
            seen.take(force.sample.sequence, force.sample.monotonic_ns);
        }
        std::hint::spin_loop();
    }
    Ok(seen.times_ns)
}

/// Reads each sample of the stream for so long. Runs without a runtime around it.
fn service(address: Address, span: Duration) -> std::io::Result<Vec<i64>> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    Ok(runtime.block_on(async {
        let mut forces = follow(Options::new(address));
        let (begun, mut seen) = (Instant::now(), Seen::default());
        while begun.elapsed() < span {
            forces.changed().await;
            if let Ok(force) = forces.force() {
                seen.take(force.sample.sequence, force.sample.monotonic_ns);
            }
        }
        seen.times_ns
    }))
}
