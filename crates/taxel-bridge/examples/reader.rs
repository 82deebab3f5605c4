//! A reader of one topic that counts: how many samples came, how many are missing, and how long they took.
//!
//! `cargo run --release -p taxel-bridge --example reader -- ENDPOINT KEY SECONDS`
//!
//! The key is that of the topic in Zenoh. Sequence number and time of sending are those of the attachment, as `rmw_zenoh`
//! lays it out; the clock is the machine's wall clock, so that sender and reader have to be on one machine.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::Context;
use taxel_bridge::config::ZenohSection;
use taxel_bridge::link::{self, tried};

/// Sequence number and time of sending, in ns since 1970.
fn sent(attachment: &[u8]) -> Option<(i64, i64)> {
    let word = |at: usize| Some(i64::from_le_bytes(attachment.get(at..at + 8)?.try_into().ok()?));
    Some((word(0)?, word(8)?))
}

fn now_ns() -> i64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as i64)
}

#[tokio::main]
async fn main() -> anyhow::Result<()> {
    let arguments: Vec<_> = std::env::args().collect();
    let [_, endpoint, key, seconds] = &arguments[..] else { anyhow::bail!("expected ENDPOINT KEY SECONDS") };
    let until = Instant::now() + Duration::from_secs_f64(seconds.parse().context("SECONDS")?);
    let session = link::open(&ZenohSection { router: Some(endpoint.clone()), config: None }).await?;
    let topic = tried("the topic", session.declare_subscriber(key).await)?;
    let (mut numbers, mut took_ns, mut came) = (Vec::new(), Vec::new(), Vec::new());
    while let Ok(sample) =
        tokio::time::timeout(until.saturating_duration_since(Instant::now()), topic.recv_async()).await
    {
        let sample = tried("a sample", sample)?;
        let attachment = sample.attachment().context("a sample without an attachment")?.to_bytes();
        let ((number, sent_ns), came_ns) = (sent(&attachment).context("a short attachment")?, now_ns());
        numbers.push(number);
        took_ns.push(came_ns - sent_ns);
        came.push(came_ns);
    }
    let missing: Vec<i64> = numbers.windows(2).flat_map(|two| two[0] + 1..two[1]).collect();
    let pauses: Vec<i64> = came.windows(2).map(|two| two[1] - two[0]).collect();
    let (first, last) = came.first().zip(came.last()).context("no sample came")?;
    let rate_hz = pauses.len() as f64 * 1e9 / (last - first) as f64;
    println!("Rust: {} samples, {rate_hz:.1} Hz, {} missing {:?}", numbers.len(), missing.len(), head(&missing));
    println!("  bridge's sending to here: {}; between two arrivals {}", quantiles(took_ns), quantiles(pauses));
    Ok(())
}

/// The first twenty.
fn head(numbers: &[i64]) -> &[i64] {
    &numbers[..numbers.len().min(20)]
}

/// p50, p99 and the largest, of ns in ms.
fn quantiles(mut values_ns: Vec<i64>) -> String {
    values_ns.sort_unstable();
    let at = |share: f64| values_ns[(share * (values_ns.len() - 1) as f64) as usize] as f64 * 1e-6;
    format!("p50 {:.3} ms, p99 {:.3} ms, largest {:.1} ms", at(0.5), at(0.99), at(1.0))
}
