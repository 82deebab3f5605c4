//! From the arrival of a frame to its reader: through shared memory and through the service, side by side in one run.
//!
//! `cargo run --release -p taxel-client --example latency -- target/release/taxeld [SECONDS]`
//!
//! It starts `taxeld demo` with both doors open, and reads both: shared memory by looking at it without a pause, as a control
//! loop on a core of its own does, and again once every millisecond; the service by its stream. Frames of the simulated
//! boards are stamped when they are handed over, as a kernel does it. What is counted is the time from the newest frame in
//! a sample to the moment at which a reader has the sample in its hands, on the machine's one clock.

use std::error::Error;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use taxel_client::{Address, Options, follow};
use taxel_shm::{Page, now_ns};

/// A demo that ends with this programme.
struct Demo(Child);

impl Drop for Demo {
    fn drop(&mut self) {
        let _ = self.0.kill(); // it may have ended
        let _ = self.0.wait();
    }
}

/// What one way of reading saw.
#[derive(Default)]
struct Seen {
    /// From the newest frame in a sample to the reader, ns.
    from_frame: Vec<i64>,
    /// From the moment at which the page was written, ns.
    from_page: Vec<i64>,
}

impl Seen {
    fn print(&mut self, name: &str) {
        for (what, times) in [("frame to reader", &mut self.from_frame), ("page to reader", &mut self.from_page)] {
            times.sort_unstable();
            let Some(last) = times.len().checked_sub(1) else { continue };
            let at = |share: f64| times[(share * last as f64) as usize] as f64 * 1e-3;
            println!(
                "{name:32} {what:16} p50 {:7.1} us  p99 {:7.1} us  p99.9 {:7.1} us  {} samples",
                at(0.5),
                at(0.99),
                at(0.999),
                times.len()
            );
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let taxeld = arguments.next().ok_or("usage: latency TAXELD [SECONDS]")?;
    let span = Duration::from_secs_f64(arguments.next().map_or(Ok(20.0), |text| text.parse())?);
    let folder = format!("/dev/shm/taxel-latency-{}", std::process::id());
    let mut command = Command::new(taxeld);
    command.args(["demo", "--listen", "127.0.0.1:0", "--shared-memory", &folder]).stdout(Stdio::piped());
    let mut demo = Demo(command.stderr(Stdio::null()).spawn()?);
    let mut lines = BufReader::new(demo.0.stdout.take().ok_or("no output")?).lines().map_while(Result::ok);
    let live = lines.find_map(|line| Some(line.strip_prefix("The skin is now")?.rsplit_once(" on ")?.1.to_owned()));
    let address = live.ok_or("the demo did not start")?;
    std::thread::spawn(move || lines.for_each(drop)); // its text goes on and must not block it
    let address = Address::parse(address.trim_end_matches('.'))?;
    std::thread::sleep(Duration::from_secs(5)); // its first zero
    let path = Path::new(&folder).join("left_forearm");
    for (name, pause) in [("shared memory, without a pause", None), ("shared memory, every millisecond", Some(1))] {
        let beside = std::thread::spawn({
            let address = address.clone();
            move || service(address, span)
        });
        shared_memory(&path, span, pause.map(Duration::from_millis))?.print(name);
        beside.join().map_err(|_| "the stream")??.print("the service's stream, beside it");
    }
    service(address, span)?.print("the service's stream, alone");
    drop(demo);
    let _ = std::fs::remove_dir_all(folder);
    Ok(())
}

/// Reads the page for so long, with these pauses.
fn shared_memory(path: &Path, span: Duration, pause: Option<Duration>) -> Result<Seen, Box<dyn Error>> {
    let page = Page::open(path)?;
    let (begun, mut seen, mut last) = (Instant::now(), Seen::default(), 0);
    while begun.elapsed() < span {
        if let Ok(force) = page.force(None)
            && force.sample.sequence != last
        {
            let now_ns = now_ns();
            // The first sample may have been there for any time.
            if last != 0 {
                seen.from_frame.extend(force.sample.monotonic_ns.map(|frame_ns| now_ns - frame_ns));
                seen.from_page.push(now_ns - force.sample.written_ns);
            }
            last = force.sample.sequence;
        }
        match pause {
            Some(pause) => std::thread::sleep(pause),
            None => std::hint::spin_loop(),
        }
    }
    Ok(seen)
}

/// Reads each sample of the stream for so long. Runs without a runtime around it.
fn service(address: Address, span: Duration) -> Result<Seen, String> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(|e| e.to_string())?;
    Ok(runtime.block_on(async {
        let mut forces = follow(Options::new(address));
        let (begun, mut seen, mut last) = (Instant::now(), Seen::default(), 0);
        while begun.elapsed() < span {
            forces.changed().await;
            if let Ok(force) = forces.force()
                && force.sample.sequence != last
            {
                let now_ns = now_ns();
                if last != 0 {
                    seen.from_frame.extend(force.sample.monotonic_ns.map(|frame_ns| now_ns - frame_ns));
                }
                last = force.sample.sequence;
            }
        }
        seen
    }))
}
