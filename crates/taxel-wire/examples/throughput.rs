//! How fast a candump log becomes messages, on one core and without reading from disk:
//! `cargo run --release -p taxel-wire --example throughput -- LOG`

use std::error::Error;
use std::time::{Duration, Instant};
use taxel_wire::candump::parse_line_bytes;
use taxel_wire::icub;

/// Long enough for a steady figure.
const AT_LEAST: Duration = Duration::from_secs(1);

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("expected the path of a candump log, unpacked")?;
    let log = std::fs::read(&path).map_err(|error| format!("{path}: {error}"))?;
    let lines: Vec<&[u8]> = log.split_inclusive(|&byte| byte == b'\n').collect();

    report("parse", lines.len(), || lines.iter().filter(|line| parse_line_bytes(line).is_ok()).count());
    report("parse and decode", lines.len(), || {
        let frames = lines.iter().filter_map(|line| parse_line_bytes(line).ok());
        frames.filter(|line| icub::decode(&line.frame).is_ok()).count()
    });
    Ok(())
}

fn report(what: &str, lines: usize, pass: impl Fn() -> usize) {
    let start = Instant::now();
    let mut passes = 0;
    let mut accepted = 0;
    while start.elapsed() < AT_LEAST {
        accepted = pass();
        passes += 1;
    }
    let per_second = (passes * lines) as f64 / start.elapsed().as_secs_f64();
    println!("{what}: {accepted} of {lines} lines accepted, {:.2} million lines/s", per_second * 1e-6);
}
