//! A robot controller that reads the force of the skin: the newest sample, only if it is good and fresh.
//!
//! `cargo run --release -p taxel-proto --example controller -- [http://127.0.0.1:50051 [PATCH]]`
//!
//! Policy:
//! 1. A reader of its own takes samples off the stream at once and keeps the newest, so that the control loop never
//!    waits and never works through a queue of old ones.
//! 2. Only OK and DEGRADED are forces. STALE, TARE_INVALID and UNCALIBRATED carry none: the loop does without.
//! 3. The age is the sample's age when it was sent plus the time that passed here since it came. Samples that waited on
//!    the way came later than the others, and the daemon's `monotonic_ns` shows that.
//! 4. A stream that ends is opened again; until then the force grows old and is refused.

use std::fmt;
use std::time::{Duration, Instant};

use taxel_proto::v1::force_service_client::ForceServiceClient;
use taxel_proto::v1::{ForceSample, ForceState, StreamForceRequest};
use tokio::sync::watch;
use tonic::transport::Endpoint;

/// Samples per second that the daemon is asked for.
const RATE_HZ: f64 = 200.0;
/// The control loop's own period.
const LOOP: Duration = Duration::from_millis(10);
/// An older force is none: two periods of the boards, and a little.
const AGE_MAX: Duration = Duration::from_millis(120);
/// Small HTTP/2 windows: what is not read yet waits at the daemon, which replaces it by newer samples.
const WINDOW_BYTES: u32 = 4 * 1024;

/// A sample and when it came.
#[derive(Clone)]
struct Received {
    sample: ForceSample,
    at: Instant,
    /// How much longer than the quickest sample so far it was on its way.
    delayed: Duration,
}

/// Why there is no force to act on.
enum NoForce {
    NothingYet,
    State(ForceState, Vec<String>),
    TooOld(Duration),
}

impl fmt::Display for NoForce {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NothingYet => write!(f, "no sample yet"),
            Self::State(state, reasons) => write!(f, "{}: {}", state.as_str_name(), reasons.join("; ")),
            Self::TooOld(age) => {
                write!(f, "{:.0} ms old, more than {} ms", age.as_secs_f64() * 1e3, AGE_MAX.as_millis())
            }
        }
    }
}

/// The force in newton and its age, or why there is none.
fn usable(newest: Option<&Received>) -> Result<(f64, Duration), NoForce> {
    let received = newest.ok_or(NoForce::NothingYet)?;
    let sample = &received.sample;
    let good = matches!(sample.state(), ForceState::Ok | ForceState::Degraded);
    let (Some(newton), Some(age_s), true) = (sample.total_n, sample.age_s, good) else {
        return Err(NoForce::State(sample.state(), sample.reasons.clone()));
    };
    // An age that is no time at all is as bad as an old one.
    let sent_with = Duration::try_from_secs_f64(age_s).unwrap_or(Duration::MAX);
    let age = sent_with.saturating_add(received.delayed).saturating_add(received.at.elapsed());
    if age > AGE_MAX { Err(NoForce::TooOld(age)) } else { Ok((newton, age)) }
}

/// Reads the stream for ever and keeps the newest sample.
async fn read(endpoint: Endpoint, patch: String, newest: watch::Sender<Option<Received>>) {
    loop {
        if let Err(error) = read_once(&endpoint, &patch, &newest).await {
            eprintln!("stream: {error}");
        }
        tokio::time::sleep(Duration::from_millis(500)).await;
    }
}

async fn read_once(
    endpoint: &Endpoint,
    patch: &str,
    newest: &watch::Sender<Option<Received>>,
) -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    let mut client = ForceServiceClient::new(endpoint.connect().await?);
    let request = StreamForceRequest { patch: patch.to_owned(), rate_hz: Some(RATE_HZ) };
    let mut stream = client.stream_force(request).await?.into_inner();
    let begun = Instant::now();
    // The daemon's clock against ours, as the quickest sample shows it; NaN until there is one.
    let mut offset_s = f64::NAN;
    while let Some(sample) = stream.message().await? {
        let at = Instant::now();
        let sent_s = sample.monotonic_ns.zip(sample.age_s).map(|(ns, age_s)| ns as f64 * 1e-9 + age_s);
        let on_the_way_s = sent_s.map_or(f64::NAN, |sent_s| (at - begun).as_secs_f64() - sent_s);
        offset_s = offset_s.min(on_the_way_s); // `min` takes the number where the other is NaN
        let delayed = Duration::try_from_secs_f64(on_the_way_s - offset_s).unwrap_or_default();
        newest.send_replace(Some(Received { sample, at, delayed }));
    }
    Ok(())
}

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let address = arguments.next().unwrap_or_else(|| "http://127.0.0.1:50051".to_owned());
    let endpoint = Endpoint::from_shared(address)?
        .initial_stream_window_size(WINDOW_BYTES)
        .connect_timeout(Duration::from_secs(2))
        .http2_keep_alive_interval(Duration::from_secs(5))
        .keep_alive_while_idle(true);
    let (sender, newest) = watch::channel(None);
    let patch = arguments.next().unwrap_or_default();
    tokio::spawn(read(endpoint, patch, sender));
    let mut tick = tokio::time::interval(LOOP);
    tick.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    for cycle in 0_u64.. {
        tick.tick().await;
        let force = usable(newest.borrow().as_ref());
        // Here the controller acts. This one shows what it has, twice a second.
        if cycle.is_multiple_of(50) {
            match force {
                Ok((newton, age)) => println!("{newton:6.2} N, {:3.0} ms old", age.as_secs_f64() * 1e3),
                Err(why) => println!("no force: {why}"),
            }
        }
    }
    Ok(())
}
