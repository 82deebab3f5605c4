//! `taxel-lab fit`: models from a recording, from an exported session, or from any table of counts and pressures.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use anyhow::{Context, ensure};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use taxel_engine::calibration::fit::{Branch, FitRecipe, RECORDING_SCANS_MIN, Workers, fit as fit_skin};
use taxel_engine::model_set::ModelSet;
use taxel_model::{FitOptions, MAX_ORDER};
use taxel_store::models_json;

mod summary;

use crate::recording::Recording;
use crate::session;
use crate::soundness::{Purpose, check};

/// Fits models to DATA.csv and writes MODELS.json.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxel-lab fit ramp.csv.gz --out models.json\n  taxel-lab fit ramp.csv --order 3 --branch rising --out models.json\n  taxeld sessions export 3 | taxel-lab fit - --out models.json"
)]
pub struct FitArgs {
    /// Recording: `t_s,pressure_kpa,c0,c1,...`, one row a scan, plain or .gz; `-` is the standard input.
    ///
    /// 280 rows and more of integers within 0..=255 in two columns or more are a recording of a skin: faulty stretches
    /// are left out, and the hysteresis is compensated where that wins. An export of a session is fitted as the session
    /// itself is. Anything else (counts of more bits or reals, plateaus, typed pressures) is fitted without a search for faults.
    data: PathBuf,
    /// Where the models go; `-` is the standard output.
    #[arg(long, value_name = "MODELS.json")]
    out: PathBuf,
    /// Order of the polynomial whose coefficients each model tells, 1 to 10 [default: 5]. Counts are read by it with --paper
    /// alone.
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=i64::from(MAX_ORDER)))]
    order: Option<u8>,
    /// The paper's method and nothing else: its equation over all samples of rising pressure, every fault and outlier
    /// included, the curve as it comes out, monotone or not. Only --min-swing excludes a taxel.
    #[arg(long, conflicts_with_all = ["branch", "plays", "smooth"])]
    paper: bool,
    /// Which part of a recording is fitted [default: both, and of a session what it gathered].
    #[arg(long, value_parser = one_of(["both", "rising"], [Branch::Both, Branch::Rising]))]
    branch: Option<Branch>,
    /// Compensation of hysteresis: `auto` is on if there is enough of it and it wins on a branch that no fit saw [default: auto].
    #[arg(long, value_parser = one_of(["auto", "off"], [true, false]))]
    plays: Option<bool>,
    /// Seconds over which counts are averaged, here and when the models are applied; 0 is not at all.
    #[arg(long, value_name = "S", default_value_t = 0.5, value_parser = parse_number)]
    smooth: f64,
    /// Neighbouring columns that form a module (a triangle) [default: 10].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    module_size: Option<u16>,
    /// Exclude taxels that move by less than this many counts, as the paper does; 0 is off.
    #[arg(long, value_name = "COUNTS", default_value_t = 0.0, value_parser = parse_number)]
    min_swing: f64,
    /// Name of the patch that the models are for [default: that of the session, else the name of the file].
    #[arg(long)]
    patch: Option<String>,
}

/// A parser of words that stand for values.
fn one_of<T: Copy + Send + Sync + 'static, const N: usize>(
    words: [&'static str; N],
    values: [T; N],
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(words).try_map(move |chosen| {
        let at = words.iter().position(|word| *word == chosen).ok_or("no such value")?;
        Ok::<T, &str>(values[at])
    })
}

/// A finite number of 0 or more.
pub(crate) fn parse_number(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| value.is_finite() && *value >= 0.0);
    value.ok_or_else(|| "expected a finite number of 0 or more".to_owned())
}

/// Runs `taxel-lab fit`.
///
/// # Errors
/// A file that cannot be read or written, or has no pressure; or not one usable taxel.
pub fn fit(args: &FitArgs) -> anyhow::Result<()> {
    taxel_files::announce(&[&args.out], &[&args.data])?;
    let mut recording = Recording::read(&args.data)?;
    let began = Instant::now();
    let (mut set, notes) = args.models(&mut recording).with_context(|| args.data.display().to_string())?;
    let patch = args.patch.clone().or_else(|| session::patch(&recording));
    set.patch = patch.unwrap_or_else(|| stem(&args.data));
    let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    set.created_wall_ns = i64::try_from(since_1970.as_nanos()).unwrap_or(i64::MAX);
    set.id = models_json::content_id(&set);
    let took = began.elapsed().as_secs_f64();
    say!("{}: {} scans fitted in {took:.2} s", args.data.display(), recording.scans());
    notes.iter().for_each(|note| say!("  {note}"));
    summary::print(&set);
    let taxels = set.taxels.len();
    ensure!(
        set.taxels.iter().any(|model| model.is_usable()),
        "not one of {taxels} taxels got a usable model: nothing is written"
    );
    let text = models_json::to_json(&set).context("the models cannot be written")?;
    taxel_files::write_text(&args.out, &text)?;
    say!("written to {}", args.out.display());
    Ok(())
}

impl FitArgs {
    /// The models, and what there is to say of the recording.
    fn models(&self, recording: &mut Recording) -> anyhow::Result<(ModelSet, Vec<String>)> {
        let is_session = session::is_session(recording);
        let notes = if is_session { Vec::new() } else { check(recording, Purpose::Fit)? };
        let is_skin = !is_session && recording.as_scans().is_recording();
        ensure!(
            self.module_size.is_none() || is_skin,
            "--module-size needs a recording of a skin, {RECORDING_SCANS_MIN} rows and more of 8-bit counts in two columns and \
             more; this is an export of a session or another recording: leave --module-size out"
        );
        let set = if is_session {
            session::fit(recording, self.recipe(), self.branch)?
        } else {
            fit_skin(&recording.as_scans(), &self.recipe(), &AllCores)?
        };
        Ok((set, notes))
    }

    fn recipe(&self) -> FitRecipe {
        FitRecipe {
            options: self.options(),
            branch: self.branch.unwrap_or(Branch::Both),
            plays: self.plays.unwrap_or(true),
            module_size: usize::from(self.module_size.unwrap_or(10)),
            smooth_s: self.smooth,
            ..FitRecipe::default()
        }
    }

    fn options(&self) -> FitOptions {
        let default = FitOptions::default();
        let order = self.order.unwrap_or(default.order);
        FitOptions { order, paper: self.paper, min_swing_counts: self.min_swing, ..default }
    }
}

/// The name of a file up to its first dot.
fn stem(path: &Path) -> String {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let stem = name.split('.').next().unwrap_or_default();
    if matches!(stem, "" | "-") { "recording".to_owned() } else { stem.to_owned() }
}

/// Threads on all cores.
struct AllCores;

impl Workers for AllCores {
    fn each(&self, jobs: usize, job: &(dyn Fn(usize) + Sync)) {
        let next = AtomicUsize::new(0);
        let take = || Some(next.fetch_add(1, Ordering::Relaxed)).filter(|number| *number < jobs);
        let cores = thread::available_parallelism().map_or(1, usize::from);
        thread::scope(|scope| {
            for _ in 0..cores.min(jobs) {
                scope.spawn(|| std::iter::from_fn(take).for_each(job));
            }
        });
    }
}
