//! `taxeld rate`: how often new values really come, how old they are, and where they pause.

use std::time::Duration;

use serde_json::json;
use taxel_client::{Moment, Samples, Server};

use super::connect::Daemon;
use super::failure::{Failure, Outcome};
use crate::values::spread;

/// Counts new values for a while. A stream may be faster than its skin: iCub's gives 20 new values a second, 27 at most, and what
/// comes between is the last one again.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  taxeld rate\n  taxeld rate --seconds 60 --json | jq .newPerS")]
pub struct RateArgs {
    #[command(flatten)]
    server: Server,
    /// How long to count.
    #[arg(long, value_name = "S", default_value_t = 10.0, value_parser = crate::values::parse_seconds)]
    seconds: f64,
    /// Print the figures as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs it.
///
/// # Errors
/// No two values came, a lost stream, or no daemon.
pub async fn rate(args: RateArgs) -> Outcome {
    let daemon = Daemon::at(&args.server).await?;
    let mut samples = Samples::open(daemon.force(), daemon.patch(), None).await?;
    let end = tokio::time::sleep(Duration::from_secs_f64(args.seconds.min(1e6)));
    tokio::pin!(end);
    let (mut counted, mut patch, mut max_age_s) = (Counted::default(), String::new(), 0.0);
    loop {
        tokio::select! {
            interrupted = tokio::signal::ctrl_c() => { interrupted?; break; }
            received = samples.next() => {
                let received = received?.ok_or_else(|| anyhow::anyhow!("the daemon ended the stream"))?;
                let (sample, age) = (received.sample(), received.age(Moment::now()));
                patch.clone_from(&sample.patch);
                max_age_s = sample.max_age_s;
                counted.take(sample.monotonic_ns, age, sample.skipped);
            }
            () = &mut end => break,
        }
    }
    let Some(figures) = counted.figures() else {
        let why = format!("fewer than two new values came in {} s", args.seconds);
        return Err(Failure::refused(why).help("taxeld health"));
    };
    if args.json {
        say!("{}", figures.json(&patch, max_age_s));
    } else {
        say!("{}", figures.text(&patch, max_age_s));
    }
    Ok(())
}

/// Values as they came.
#[derive(Default)]
struct Counted {
    /// When the newest frame of each new value was received, by the daemon's clock, in ns.
    at_ns: Vec<i64>,
    /// How old each new value was when it came here, in s.
    ages_s: Vec<f64>,
    skipped: u64,
}

/// What is told of them; of intervals and ages least, median and greatest, in s.
#[derive(Debug, PartialEq)]
struct Figures {
    new: usize,
    per_s: f64,
    intervals_s: (f64, f64, f64),
    ages_s: (f64, f64, f64),
    skipped: u64,
}

impl Counted {
    /// A sample; one with the frames of the one before is no new value.
    fn take(&mut self, newest_ns: Option<i64>, age: Option<Duration>, skipped: u64) {
        // What was skipped before the first one is none of this reader's.
        self.skipped += if self.at_ns.is_empty() { 0 } else { skipped };
        let (Some(ns), Some(age)) = (newest_ns, age) else { return };
        if self.at_ns.last() != Some(&ns) {
            self.at_ns.push(ns);
            self.ages_s.push(age.as_secs_f64());
        }
    }

    fn figures(&self) -> Option<Figures> {
        let seconds = |pair: &[i64]| (pair[1] - pair[0]) as f64 * 1e-9;
        let intervals_s: Vec<f64> = self.at_ns.windows(2).map(seconds).collect();
        let all_s: f64 = intervals_s.iter().sum();
        Some(Figures {
            new: self.at_ns.len(),
            per_s: intervals_s.len() as f64 / all_s,
            intervals_s: spread(intervals_s)?,
            ages_s: spread(self.ages_s.clone())?,
            skipped: self.skipped,
        })
    }
}

impl Figures {
    fn text(&self, patch: &str, max_age_s: f64) -> String {
        let ms = |s: f64| format!("{:.0} ms", 1e3 * s);
        let ((_, interval, pause), (_, age, oldest)) = (self.intervals_s, self.ages_s);
        let skipped = if self.skipped > 0 {
            format!("\n  samples skipped, because this reader was too slow: {}", self.skipped)
        } else {
            String::new()
        };
        format!(
            "{patch}: {:.1} new values a second ({} counted)\n  every {} (median), longest pause {}\n  {} old on arrival \
             (median), at most {}; rejected if older than {}{skipped}",
            self.per_s,
            self.new,
            ms(interval),
            ms(pause),
            ms(age),
            ms(oldest),
            ms(max_age_s),
        )
    }

    fn json(&self, patch: &str, max_age_s: f64) -> String {
        let ((_, interval, pause), (_, age, oldest)) = (self.intervals_s, self.ages_s);
        json!({
            "patch": patch, "new": self.new, "newPerS": self.per_s, "intervalS": interval, "longestPauseS": pause,
            "ageS": age, "oldestS": oldest, "maxAgeS": max_age_s, "skipped": self.skipped,
        })
        .to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_new_frames_are_new_values_and_a_pause_is_seen() {
        let mut counted = Counted::default();
        assert_eq!(counted.figures(), None);
        let age = |ms| Some(Duration::from_millis(ms));
        counted.take(None, None, 0); // no frame has come yet
        for (ms, old) in [(0, 12), (50, 12), (50, 37), (100, 10), (350, 20)] {
            counted.take(Some(ms * 1_000_000), age(old), 1);
        }
        let figures = counted.figures().unwrap();
        assert_eq!(
            figures.text("palm", 0.12),
            "palm: 8.6 new values a second (4 counted)\n  every 50 ms (median), longest pause 250 ms\n  \
             12 ms old on arrival (median), at most 20 ms; rejected if older than 120 ms\n  \
             samples skipped, because this reader was too slow: 4"
        );
        let json: serde_json::Value = serde_json::from_str(&figures.json("palm", 0.12)).unwrap();
        assert_eq!((json["new"].as_u64(), json["longestPauseS"].as_f64()), (Some(4), Some(0.25)));
    }
}
