//! `taxeld watch`: the force, with its uncertainty, age, state and reasons.

use std::time::Duration;

use taxel_client::{Moment, Received, Samples};
use taxel_proto::judge::{Force, NoForce, word};
use taxel_proto::v1::{ForceState, PatchRequest};
use taxel_skin::counted;

use super::connect::{Asked, Daemon};
use super::failure::{Failure, Outcome};
use super::json;
use super::table::Tone;
use crate::values::seconds;

/// How often a silent stream is looked for.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// Shows the force as it comes, a line a sample, and a line more when the stream falls silent.
///
/// Exit code 0 if the last force shown was good, 3 if there was none to act on, 1 if the stream was lost.
#[derive(Debug, clap::Args)]
#[command(
    group = clap::ArgGroup::new("end").args(["once", "count"]),
    after_help = "Examples:\n  taxeld watch\n  taxeld watch --once --quiet               # just the newtons, for scripts\n  taxeld watch --json --rate 100 | jq .totalN"
)]
pub struct WatchArgs {
    #[command(flatten)]
    asked: Asked,
    /// Samples per second, 1 to 1000 [default: 2 for people, each new sample with --json].
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Wait for one good force, print it and end; --within limits the wait.
    #[arg(long)]
    once: bool,
    /// With --once: how long to wait for a good force.
    #[arg(long, value_name = "S", default_value_t = 2.0, value_parser = |text: &str| seconds(text, 0.0, 1e6), requires = "once")]
    within: f64,
    /// With --once or --count: print only the number, and only if it is valid.
    #[arg(long, requires = "end", conflicts_with = "json")]
    quiet: bool,
    /// What the uncertainty of the newest force is made of, greatest first.
    #[arg(long, conflicts_with_all = ["rate", "json", "quiet", "once", "count"])]
    budget: bool,
    /// End after this many samples.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    count: Option<u64>,
}

impl WatchArgs {
    fn rate_hz(&self) -> Option<f64> {
        self.rate.or((!self.asked.json && !self.once).then_some(2.0))
    }
}

/// Runs it until the stream ends, enough has come, or Ctrl-C.
///
/// # Errors
/// No good force, a lost stream, or no daemon.
pub async fn watch(args: WatchArgs) -> Outcome {
    let daemon = args.asked.daemon().await?;
    if args.budget {
        return budget(&daemon).await;
    }
    let mut samples = Samples::open(daemon.force(), daemon.patch.clone(), args.rate_hz()).await?;
    let for_people = !args.asked.json && !args.once && !args.quiet;
    // At a rate of its own, a sample is older than it may be long before the next one is due.
    let silent_after = LOOK_EVERY + Duration::from_secs_f64(1.0 / args.rate_hz().unwrap_or(f64::INFINITY));
    let mut came = tokio::time::Instant::now();
    let (mut newest, mut seen): (Option<Judged>, u64) = (None, 0);
    let mut look = tokio::time::interval(LOOK_EVERY);
    look.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    let within = if args.once { Duration::from_secs_f64(args.within) } else { Duration::MAX };
    let give_up = tokio::time::sleep(within);
    tokio::pin!(give_up);
    let shown = loop {
        tokio::select! {
            interrupted = tokio::signal::ctrl_c() => { interrupted?; break None; }
            received = samples.next() => {
                let ended = || anyhow::anyhow!("the daemon ended the stream");
                let judged = Judged::new(received?.ok_or_else(ended)?, Moment::now());
                (seen, came) = (seen + 1, tokio::time::Instant::now());
                let good = judged.force.is_ok();
                if good || !args.once {
                    show(&args, &judged)?;
                }
                if taxel_files::say::reader_has_gone() {
                    return Ok(()); // as in `taxeld watch | head`
                }
                if (args.once && good) || args.count.is_some_and(|count| seen >= count) {
                    break Some(judged); // as it was shown, however long that took
                }
                newest = Some(judged);
            }
            _ = look.tick(), if for_people && came.elapsed() > silent_after => {
                let was_good = newest.as_ref().filter(|last| last.force.is_ok());
                let now = was_good.map(|last| last.again(Moment::now()));
                if let Some(silent) = now.filter(|now| now.force.is_err()) {
                    show(&args, &silent)?;
                    newest = Some(silent);
                }
            }
            () = &mut give_up => break None,
        }
    };
    verdict(shown.or_else(|| newest.map(|newest| newest.again(Moment::now()))))
}

/// The newest force, and each term of its uncertainty.
async fn budget(daemon: &Daemon) -> Outcome {
    let request = PatchRequest { patch: daemon.patch.clone() };
    let mut sample = daemon.force().get_force(request).await?.into_inner();
    sample.budget.sort_by(|a, b| b.sigma_n.total_cmp(&a.sigma_n));
    let (terms, undetected_n) = (std::mem::take(&mut sample.budget), sample.undetected_n);
    let judged = Judged::new(Received::now(sample), Moment::now());
    if let Ok(force) = &judged.force {
        say!("{}", describe(&judged));
        say!(
            "standard uncertainty by cause (the low end is {:.2} N less twice the root of their summed squares):",
            force.total_n
        );
        for term in &terms {
            say!("  {:.2} N  {}", term.sigma_n, term.term);
        }
        if let Some(undetected_n) = undetected_n {
            say!(
                "undetected force: up to {undetected_n:.2} N could press without any taxel showing it. It moves the high end up; \
                 uncertainties add as squares, so the parts do not simply add up. A tare of the unloaded skin makes it smaller."
            );
        }
    }
    verdict(Some(judged))
}

fn show(args: &WatchArgs, judged: &Judged) -> Outcome {
    if args.asked.json {
        return json::print("ForceSample", &judged.received.told(judged.at));
    }
    if args.quiet {
        judged.newton().into_iter().for_each(|newton| say!("{newton}"));
    } else {
        say!("{}", describe(judged));
    }
    Ok(())
}

/// What the exit code tells.
fn verdict(newest: Option<Judged>) -> Outcome {
    let Some(judged) = newest else { return Err(Failure::refused("no force: no sample came")) };
    judged.force.map(|_| ()).map_err(|why| Failure::refused(format!("no force: {why}")))
}

/// A sample at one moment. Everything that is told of it is of that moment, so that the words, the figures and the exit code
/// agree on a slow machine, too.
#[derive(Clone)]
struct Judged {
    received: Received,
    at: Moment,
    /// Or why it is not to be acted on.
    force: Result<Force, NoForce>,
}

impl Judged {
    fn new(received: Received, at: Moment) -> Self {
        Self { force: received.force(at, None), at, received }
    }

    /// The same sample at a later moment.
    fn again(&self, at: Moment) -> Self {
        Self::new(self.received.clone(), at)
    }

    /// The newtons alone, of a good force: a bare number could not say that it is none.
    fn newton(&self) -> Option<f64> {
        self.force.as_ref().ok().map(|force| force.total_n)
    }
}

/// A force for people, in one line.
fn describe(judged: &Judged) -> String {
    let sample = judged.received.sample();
    let Force { total_n: newton, age } = match &judged.force {
        Ok(force) => force,
        Err(why) => return format!("{}: {}: {why}", sample.patch, Tone::Bad.paint("no force")),
    };
    let low_n = sample.low_n.unwrap_or_default();
    let interval =
        sample.high_n.map_or_else(|| format!("{low_n:.2} N or more"), |high| format!("{low_n:.2} to {high:.2} N"));
    let tone = if sample.state() == ForceState::Ok { Tone::Good } else { Tone::Warn };
    let simulated = if sample.simulated { ", simulated" } else { "" };
    let reasons = if sample.reasons.is_empty() { String::new() } else { format!(": {}", sample.reasons.join("; ")) };
    let (age_ms, active) = (1e3 * age.as_secs_f64(), counted(sample.active as usize, "taxel", "taxels"));
    let (patch, state) = (&sample.patch, tone.paint(word(sample.state())));
    format!("{patch}: {newton:.2} N ({interval}), {age_ms:.0} ms old, {active} active, {state}{simulated}{reasons}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_proto::v1::{ForceSample, ReasonCode};

    fn judged(state: ForceState, total_n: Option<f64>) -> Judged {
        let reasons = if state == ForceState::Ok { Vec::new() } else { vec!["a module is silent".to_owned()] };
        let sample = ForceSample {
            patch: "palm".to_owned(),
            state: state.into(),
            total_n,
            total_sigma_n: total_n.map(|_| 0.25),
            low_n: total_n.map(|total_n| total_n - 0.5),
            age_s: Some(0.02),
            max_age_s: 0.12,
            monotonic_ns: Some(1),
            sent: Some(std::time::SystemTime::now().into()),
            active: 18,
            reasons,
            ..ForceSample::default()
        };
        Judged::new(Received::now(sample), Moment::now())
    }

    #[test]
    fn a_force_that_waited_too_long_goes_on_as_none() {
        let told = |judged: &Judged| judged.received.told(judged.at);
        let fresh = judged(ForceState::Ok, Some(4.9));
        assert_eq!((told(&fresh).state(), told(&fresh).total_n), (ForceState::Ok, Some(4.9)));
        let told = told(&fresh.again(Moment::now() + Duration::from_secs(2)));
        assert_eq!((told.state(), told.total_n, told.total_sigma_n, told.active), (ForceState::Stale, None, None, 0));
        assert!(told.age_s.unwrap() >= 2.0 && told.reasons[0].ends_with(" ms old, more than 120 ms"), "{told:?}");
        assert_eq!(told.causes[0].code(), ReasonCode::FrameOld);
    }

    #[test]
    fn a_line_has_the_force_its_uncertainty_its_age_and_its_state_or_why_there_is_none() {
        let words = |judged: &Judged| anstream::adapter::strip_str(&describe(judged)).to_string();
        let line = words(&judged(ForceState::Degraded, Some(4.9)));
        assert!(line.starts_with("palm: 4.90 N (4.40 N or more), "), "{line}");
        assert!(line.ends_with(" ms old, 18 taxels active, DEGRADED: a module is silent"), "{line}");
        let line = words(&judged(ForceState::TareInvalid, None));
        assert_eq!(line, "palm: no force: TARE_INVALID: a module is silent");
    }

    #[test]
    fn a_bare_number_is_a_good_force() {
        let good = judged(ForceState::Degraded, Some(4.9));
        let too_old = good.again(Moment::now() + Duration::from_secs(1));
        let none = judged(ForceState::TareInvalid, Some(4.9));
        assert_eq!([&good, &too_old, &none].map(Judged::newton), [Some(4.9), None, None]);
    }

    #[test]
    fn a_force_that_was_shown_as_good_ends_well_however_long_that_took() {
        let shown = judged(ForceState::Degraded, Some(4.9));
        let later = shown.again(Moment::now() + Duration::from_secs(3600));
        assert!(verdict(Some(shown)).is_ok() && verdict(Some(later)).is_err() && verdict(None).is_err());
    }
}
