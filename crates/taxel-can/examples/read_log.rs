//! How fast a candump log is read: `cargo run --release -p taxel-can --example read_log -- LOG`.

use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

use taxel_can::{LogReader, RecordedFrames as _};

fn main() -> Result<(), Box<dyn Error>> {
    let path = PathBuf::from(std::env::args_os().nth(1).ok_or("expected the path of a candump log, plain or .gz")?);
    let start = Instant::now();
    let mut log = LogReader::open(&path, None)?;
    let mut frames = Vec::with_capacity(1024);
    while log.next_batch(&mut frames, 1024)? {
        frames.clear();
    }
    let seconds = start.elapsed().as_secs_f64();
    let report = log.report();
    println!("{} frames in {seconds:.3} s: {:.2} M frames/s", report.frames, report.frames as f64 / seconds / 1e6);
    println!("{report:?}");
    Ok(())
}
