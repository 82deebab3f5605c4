//! `taxeld rate`: how often new values really come, how old they are, and where they pause.

use std::time::Duration;

use serde::Serialize;
use serde_json::json;
use taxel_client::{Moment, Samples};
use taxel_proto::v1::ForceSample;

use super::connect::Asked;
use super::failure::{Failure, Outcome};
use crate::values::{seconds, spread};

/// Counts new values for a while. A stream may be faster than its skin: iCub's gives 20 new values a second, 27 at most, and what
/// comes between is the last one again.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  taxeld rate\n  taxeld rate --seconds 60 --json | jq .newPerS")]
pub struct RateArgs {
    #[command(flatten)]
    asked: Asked,
    /// How long to count.
    #[arg(long, value_name = "S", default_value_t = 10.0, value_parser = |text: &str| seconds(text, 0.0, 1e6))]
    seconds: f64,
}

/// Runs it.
///
/// # Errors
/// No two values came, a lost stream, or no daemon.
pub async fn rate(args: RateArgs) -> Outcome {
    let daemon = args.asked.daemon().await?;
    let mut samples = Samples::open(daemon.force(), daemon.patch(), None).await?;
    let end = tokio::time::sleep(Duration::from_secs_f64(args.seconds));
    tokio::pin!(end);
    let mut counted = Counted::default();
    loop {
        tokio::select! {
            interrupted = tokio::signal::ctrl_c() => { interrupted?; break; }
            received = samples.next() => {
                let received = received?.ok_or_else(|| anyhow::anyhow!("the daemon ended the stream"))?;
                counted.take(received.sample(), received.age(Moment::now()));
            }
            () = &mut end => break,
        }
    }
    let Some(figures) = counted.figures() else {
        let why = format!("fewer than two new values came in {} s", args.seconds);
        return Err(Failure::refused(why).help("taxeld health"));
    };
    say!("{}", if args.asked.json { json!(figures).to_string() } else { figures.text() });
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
    /// Of the newest sample.
    patch: String,
    max_age_s: f64,
}

/// What is told of them; times in s.
#[derive(Debug, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
struct Figures {
    patch: String,
    new: usize,
    new_per_s: f64,
    /// The median from one new value to the next.
    interval_s: f64,
    longest_pause_s: f64,
    /// The median age of a new value when it came.
    age_s: f64,
    oldest_s: f64,
    max_age_s: f64,
    skipped: u64,
}

impl Counted {
    /// A sample of this age; one with the frames of the one before is no new value.
    fn take(&mut self, sample: &ForceSample, age: Option<Duration>) {
        self.patch.clone_from(&sample.patch);
        self.max_age_s = sample.max_age_s;
        // What was skipped before the first one is none of this reader's.
        self.skipped += if self.at_ns.is_empty() { 0 } else { sample.skipped };
        let (Some(ns), Some(age)) = (sample.monotonic_ns, age) else { return };
        if self.at_ns.last() != Some(&ns) {
            self.at_ns.push(ns);
            self.ages_s.push(age.as_secs_f64());
        }
    }

    fn figures(self) -> Option<Figures> {
        let Self { at_ns, ages_s, skipped, patch, max_age_s } = self;
        let intervals_s: Vec<f64> = at_ns.windows(2).map(|pair| (pair[1] - pair[0]) as f64 * 1e-9).collect();
        let new_per_s = intervals_s.len() as f64 / intervals_s.iter().sum::<f64>();
        let ((_, interval_s, longest_pause_s), (_, age_s, oldest_s)) = (spread(intervals_s)?, spread(ages_s)?);
        let new = at_ns.len();
        Some(Figures { patch, new, new_per_s, interval_s, longest_pause_s, age_s, oldest_s, max_age_s, skipped })
    }
}

impl Figures {
    fn text(&self) -> String {
        let Self { patch, new, new_per_s, skipped, .. } = self;
        let ms = |s: f64| format!("{:.0} ms", 1e3 * s);
        let skipped = if *skipped > 0 {
            format!("\n  samples skipped, because this reader was too slow: {skipped}")
        } else {
            String::new()
        };
        format!(
            "{patch}: {new_per_s:.1} new values a second ({new} counted)\n  every {} (median), longest pause {}\n  {} old on \
             arrival (median), at most {}; rejected if older than {}{skipped}",
            ms(self.interval_s),
            ms(self.longest_pause_s),
            ms(self.age_s),
            ms(self.oldest_s),
            ms(self.max_age_s),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_new_frames_are_new_values_and_a_pause_is_seen() {
        assert_eq!(Counted::default().figures(), None);
        let mut counted = Counted::default();
        let age = |ms| Some(Duration::from_millis(ms));
        let sample = ForceSample { patch: "palm".into(), max_age_s: 0.12, ..ForceSample::default() };
        counted.take(&sample, None); // no frame has come yet
        for (ms, old) in [(0, 12), (50, 12), (50, 37), (100, 10), (350, 20)] {
            counted.take(&ForceSample { monotonic_ns: Some(ms * 1_000_000), skipped: 1, ..sample.clone() }, age(old));
        }
        let figures = counted.figures().unwrap();
        assert_eq!(
            figures.text(),
            "palm: 8.6 new values a second (4 counted)\n  every 50 ms (median), longest pause 250 ms\n  \
             12 ms old on arrival (median), at most 20 ms; rejected if older than 120 ms\n  \
             samples skipped, because this reader was too slow: 4"
        );
        let json = json!(figures);
        assert_eq!((json["new"].as_u64(), json["longestPauseS"].as_f64()), (Some(4), Some(0.25)));
    }
}
