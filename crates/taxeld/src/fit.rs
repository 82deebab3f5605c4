//! `taxeld fit`: models from a recording, or from any table of counts and pressures.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::{Context, bail};
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::calibration::fit::{Branch, FitRecipe, PlaysChoice, Scans, Workers, legs};
use taxel_engine::calibration::method;
use taxel_engine::model_set::{Maker, ModelSet};
use taxel_model::{
    Estimator, FitOptions, Flag, MAX_ORDER, MIN_BINNED_SAMPLES, Order, Plays, Rails, Samples, Shape, Status, TaxelModel,
};
use taxel_store::models_json;

mod session;
mod summary;

use crate::files;
use crate::output;
use crate::recording::{Column, Recording};
use crate::say;
use crate::soundness::{Wanted, check};
use crate::threads::Threads;

pub use summary::print_summary;
pub use summary::spread;

/// A bar is shown for what takes longer.
const BAR_AFTER: Duration = Duration::from_secs(1);

/// Taxels of a module, unless it is told.
const MODULE_SIZE: u16 = 10;

/// A clock of the gauge's own is looked for within so many seconds, unless it is told.
const MAX_CLOCK_S: f64 = 8.0;

/// Steps of that bar.
const BAR_STEPS: u64 = 1_000;

/// Fits models to DATA.csv and writes MODELS.json.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld fit ramp.csv.gz --out models.json\n  taxeld fit ramp.csv --order auto --branch rising --out models.json\n  zstdcat ramp.csv.zst | taxeld fit - --patch palm --out - > models.json"
)]
pub struct FitArgs {
    /// Recording: `t_s,pressure_kpa,c0,c1,...`, one row a scan, plain or .gz; `-` is the standard input.
    ///
    /// 280 rows and more of integers within 0..=255 in two columns or more are a recording of a skin: faulty stretches
    /// are left out, and the hysteresis is compensated where that wins; one cell in a hundred may be something else and
    /// is left out. An export of a session is fitted as the session itself is. Anything else is fitted as it stands, decimals as written: the least-squares polynomial of each column,
    /// monotone or not, is written down also where it is no usable model of a taxel.
    data: PathBuf,
    /// Where the models go; `-` is the standard output.
    #[arg(long, value_name = "MODELS.json")]
    out: PathBuf,
    /// Order of the polynomial, 1 to 10, or `auto`: per taxel by leave-one-out error [default: 5, and 3 for the curve
    /// that plays bend].
    #[arg(long, value_parser = parse_order)]
    order: Option<Order>,
    /// The paper's method and nothing else: its equation over all samples of rising pressure, every fault and outlier
    /// included, the curve as it comes out, monotone or not. Only --min-swing excludes a taxel.
    #[arg(long, conflicts_with_all = ["estimator", "branch", "plays", "smooth", "max_lag", "bin_width"])]
    paper: bool,
    /// Least-squares problem. Without it: pressure-binned for recordings and other columns of 280 integers and more,
    /// per-sample for other tables.
    #[arg(long)]
    estimator: Option<EstimatorArg>,
    /// Solve in double-double throughout, for audits and reference values.
    #[arg(long)]
    exact: bool,
    /// Width of a pressure bin in kPa [default: about 140 bins].
    #[arg(long, value_name = "KPA", value_parser = parse_positive)]
    bin_width: Option<f64>,
    /// Which part of a recording is fitted [default: both, and of a session what it gathered].
    #[arg(long, value_enum)]
    branch: Option<BranchArg>,
    /// Compensation of hysteresis: `auto` is on if there is enough of it and it wins on a branch that no fit saw [default: auto,
    /// and off for a session, whose curves are those of its rise].
    #[arg(long, value_enum)]
    plays: Option<PlaysArg>,
    /// Seconds over which counts are averaged, here and when the models are applied; 0 is not at all.
    #[arg(long, value_name = "S", default_value_t = 0.5, value_parser = parse_seconds)]
    smooth: f64,
    /// Neighbouring columns that form a module (a triangle) [default: 10].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    module_size: Option<u16>,
    /// Look for one constant lag of at most so many seconds between gauge and counts, and take it out.
    #[arg(long, value_name = "S", value_parser = parse_seconds)]
    max_lag: Option<f64>,
    /// Look for a clock of the gauge's own, late by at most so many seconds and fast or slow by up to 2 %, and use it
    /// where it wins on a stretch that it was not found on; 0 is not at all [default: 8].
    #[arg(long, value_name = "S", value_parser = parse_seconds)]
    max_clock: Option<f64>,
    /// What the gauge reads in the first two seconds is its own error where nothing moves then: take it off, up to 10 kPa.
    #[arg(long)]
    gauge_zero: bool,
    /// Exclude taxels that move by less than so many counts, as the paper does; 0 is off.
    #[arg(long, value_name = "COUNTS", default_value_t = 0.0, value_parser = parse_seconds)]
    min_swing: f64,
    /// Name of the patch that the models are for [default: that of the session, else the name of the file].
    #[arg(long)]
    patch: Option<String>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum EstimatorArg {
    PerSample,
    PressureBinned,
}

/// Which part of a recording is fitted.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum BranchArg {
    /// Rising and falling pressure.
    Both,
    /// Rising pressure alone.
    Rising,
}

/// Compensation of hysteresis.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum PlaysArg {
    /// Where it wins on a branch that no fit saw.
    Auto,
    /// Wherever a taxel carries it.
    On,
    /// Nowhere.
    Off,
}

/// `auto`, or an order that is fitted.
pub fn parse_order(text: &str) -> Result<Order, String> {
    if text == "auto" {
        return Ok(Order::Auto);
    }
    let order = text.parse::<u8>().ok().filter(|order| (1..=MAX_ORDER).contains(order));
    order.map(Order::Fixed).ok_or_else(|| format!("expected 1 to {MAX_ORDER} or `auto`"))
}

/// A finite number of 0 or more.
pub fn parse_seconds(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| value.is_finite() && *value >= 0.0);
    value.ok_or_else(|| "expected a finite number of 0 or more".to_owned())
}

/// A finite number above 0.
pub fn parse_positive(text: &str) -> Result<f64, String> {
    parse_seconds(text).ok().filter(|v| *v > 0.0).ok_or_else(|| "expected a finite number above 0".to_owned())
}

/// Runs `taxeld fit`.
///
/// # Errors
/// A file that cannot be read or written, or has no pressure; or not one usable taxel.
pub fn fit(args: &FitArgs) -> anyhow::Result<()> {
    if files::is_standard(&args.out) {
        say::step_aside();
    }
    let mut recording = Recording::read(&args.data)?;
    recording.report_refused(&args.data);
    let named = || args.data.display().to_string();
    let of_session = session::is_session(&recording);
    let notes = if of_session { Vec::new() } else { check(&mut recording, Wanted::FIT).with_context(named)? };
    let began = Instant::now();
    let scans = scans_of(&recording);
    let mut set = if of_session {
        args.refuse_for_session().with_context(named)?;
        session::fit(&recording, args.session_recipe(), args.branch()).with_context(named)?
    } else if scans.is_recording() {
        taxel_engine::calibration::fit::fit(&scans, &args.recipe(), &Bar::new(began)).with_context(named)?
    } else {
        args.fit_table(&recording).with_context(named)?
    };
    let took = began.elapsed();
    let patch = args.patch.clone().or_else(|| session::patch(&recording));
    set.patch = patch.unwrap_or_else(|| stem(&args.data));
    let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    set.created_wall_ns = i64::try_from(since_1970.as_nanos()).unwrap_or(i64::MAX);
    set.id = models_json::content_id(&set);
    say!("{}: {} scans fitted in {:.2} s", args.data.display(), recording.scans(), took.as_secs_f64());
    notes.iter().for_each(|note| say!("  {note}"));
    print_summary(&set);
    if set.taxels.iter().all(|model| !model.is_usable()) {
        // Of a regression set the polynomial is what was asked for.
        if of_session || scans.is_recording() || !set.taxels.iter().any(has_polynomial) {
            bail!("not one of {} taxels got a usable model: nothing is written", set.taxels.len());
        }
        say!("  no column is a usable model of a taxel: what is written are the polynomials alone");
    }
    let text = models_json::to_json(&set).context("the models cannot be written")?;
    output::write_text(&args.out, &text)?;
    say!("written to {}", args.out.display());
    Ok(())
}

impl FitArgs {
    /// As the daemon fits a session, but for what is asked for.
    fn session_recipe(&self) -> FitRecipe {
        FitRecipe { curve: Branch::Rising, plays: self.plays().unwrap_or(PlaysChoice::Off), ..self.recipe() }
    }

    fn plays(&self) -> Option<PlaysChoice> {
        self.plays.map(|plays| match plays {
            PlaysArg::Auto => PlaysChoice::Auto,
            PlaysArg::On => PlaysChoice::On,
            PlaysArg::Off => PlaysChoice::Off,
        })
    }

    fn recipe(&self) -> FitRecipe {
        FitRecipe {
            options: self.options(if self.paper { Estimator::Paper } else { Estimator::PressureBinned }),
            branch: self.branch().unwrap_or(Branch::Both),
            plays: self.plays().unwrap_or_default(),
            plays_order: self.order.unwrap_or(Plays::DEFAULT_ORDER),
            module_size: usize::from(self.module_size.unwrap_or(MODULE_SIZE)),
            smooth_s: self.smooth,
            max_lag_s: self.max_lag.unwrap_or(0.0),
            max_clock_s: self.max_clock.unwrap_or(MAX_CLOCK_S),
            gauge_zero: self.gauge_zero,
            ..FitRecipe::default()
        }
    }

    fn options(&self, estimator: Estimator) -> FitOptions {
        let mut options = FitOptions {
            order: self.order.unwrap_or_default(),
            estimator: self.estimator.map_or(estimator, |chosen| match chosen {
                EstimatorArg::PerSample => Estimator::PerSample,
                EstimatorArg::PressureBinned => Estimator::PressureBinned,
            }),
            exact: self.exact,
            bin_width_kpa: self.bin_width,
            ..FitOptions::default()
        };
        options.exclusion.min_swing_counts = self.min_swing;
        options
    }

    fn branch(&self) -> Option<Branch> {
        self.branch.map(|branch| match branch {
            BranchArg::Both => Branch::Both,
            BranchArg::Rising => Branch::Rising,
        })
    }

    /// Refuses what a session leaves no choice in.
    fn refuse_for_session(&self) -> anyhow::Result<()> {
        let asked = [
            (self.module_size.is_some(), "--module-size", "the file says which taxels are a module"),
            (self.gauge_zero, "--gauge-zero", "what the gauge read at rest is in the file and is taken off"),
            (self.max_lag.is_some(), "--max-lag", "one clock pairs its counts and pressures"),
            (self.max_clock.is_some(), "--max-clock", "one clock pairs its counts and pressures"),
        ];
        match asked.iter().find(|(asked, ..)| *asked) {
            Some((_, option, why)) => bail!("{option} is not for an export of a session: {why}"),
            None => Ok(()),
        }
    }

    /// Refuses what only a recording of a skin has.
    fn refuse_for_table(&self) -> anyhow::Result<()> {
        let asked = [
            (matches!(self.plays, Some(PlaysArg::On)), "--plays on"),
            (self.gauge_zero, "--gauge-zero"),
            (self.max_lag.is_some_and(|lag| lag > 0.0), "--max-lag"),
        ];
        match asked.iter().find(|(asked, _)| *asked) {
            Some((_, option)) => bail!(
                "{option} needs a recording of a skin, {MIN_BINNED_SAMPLES} rows and more of 8-bit counts in two columns and \
                 more; this is fitted column by column as a table"
            ),
            None => Ok(()),
        }
    }

    /// Fits each column as it stands, or the rows of rising pressure alone.
    fn fit_table(&self, recording: &Recording) -> anyhow::Result<ModelSet> {
        self.refuse_for_table()?;
        let Some(pressure) = &recording.pressure_kpa else {
            bail!("there is no column `pressure_kpa` to fit to");
        };
        let rises_alone = self.paper || matches!(self.branch, Some(BranchArg::Rising));
        let rising = rises_alone.then(|| legs::rising(&pressure.hi, &legs::legs(&pressure.hi)));
        let pressure = pressure.only(rising.as_deref());
        let fitted = |counts: &Column| {
            let counts = counts.only(rising.as_deref());
            // One column of counts over time, or counts of more than eight bits, are still taxels; a regression set is not.
            let count = |c: &f64| c.is_nan() || (*c >= 0.0 && c.fract() == 0.0);
            let taxel = counts.hi.len() as u64 >= MIN_BINNED_SAMPLES && counts.hi.iter().all(count);
            let options = self.options(match taxel {
                _ if self.paper => Estimator::Paper,
                true => Estimator::PressureBinned,
                false => Estimator::PerSample,
            });
            let samples = Samples {
                counts: &counts.hi,
                counts_low: counts.lo.as_deref(),
                pressure_kpa: &pressure.hi,
                pressure_low: pressure.lo.as_deref(),
                ramp: None,
            };
            if options.estimator == Estimator::PerSample {
                as_it_stands(&samples, options)
            } else {
                taxel_model::fit(&samples, &options)
            }
        };
        let taxels: Vec<_> = recording.counts.iter().map(fitted).collect();
        let highest = pressure.hi.iter().copied().filter(|p| p.is_finite()).fold(f64::NEG_INFINITY, f64::max);
        if !highest.is_finite() {
            bail!("the column `pressure_kpa` has no finite number");
        }
        let binned = taxels.iter().any(|model| model.estimator == Estimator::PressureBinned);
        let estimator = if binned { Estimator::PressureBinned } else { Estimator::PerSample };
        let method = method(&self.options(if self.paper { Estimator::Paper } else { estimator }));
        Ok(ModelSet {
            id: String::new(),
            patch: String::new(),
            created_wall_ns: 0,
            session: None,
            method: if rises_alone && !self.paper { format!("{method}, rising") } else { method },
            board_settings: Vec::new(),
            baseline: vec![TaxelBaseline { mean: f64::NAN, noise: f64::NAN }; taxels.len()],
            pressure_max_kpa: highest,
            gauge_gain_rel: 0.0,
            gauge_offset_kpa: 0.0,
            taxels,
            recorded: None,
            recalibrated: None,
            maker: Maker::this(false),
        })
    }
}

/// The least-squares polynomial of all samples: no value is the end of a converter, and no curve is bent. One of integers,
/// which may be counts, is no usable model where it would have had to be bent to be monotone.
fn as_it_stands(samples: &Samples<'_>, options: FitOptions) -> TaxelModel {
    let options = FitOptions { rails: Rails::None, ..options };
    let model = taxel_model::fit(samples, &options);
    let Some(rmse_ratio) = model.flags.iter().find_map(|flag| match flag {
        Flag::Repaired { rmse_ratio } => Some(*rmse_ratio),
        _ => None,
    }) else {
        return model;
    };
    let free = taxel_model::fit(samples, &FitOptions { shape: Shape::Report, ..options });
    TaxelModel { status: Status::NotMonotone { rmse_ratio }, ..free }
}

/// Whether it has more than a constant, usable or not.
fn has_polynomial(model: &TaxelModel) -> bool {
    model.curve.is_some() && model.order > 0
}

/// A recording as the engine takes it.
pub fn scans_of(recording: &Recording) -> Scans<'_> {
    Scans {
        time_s: &recording.time_s,
        pressure_kpa: recording.pressure_kpa.as_ref().map(|column| column.hi.as_slice()),
        counts: recording.counts.iter().map(|column| column.hi.as_slice()).collect(),
    }
}

/// The name of a file up to its first dot.
fn stem(path: &Path) -> String {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let stem = name.split('.').next().unwrap_or_default();
    if stem.is_empty() { "recording".to_owned() } else { stem.to_owned() }
}

/// A bar on a terminal, once the work takes long enough to want one.
struct Bar {
    began: Instant,
    bar: OnceLock<ProgressBar>,
    wanted: bool,
}

impl Bar {
    fn new(began: Instant) -> Self {
        Self { began, bar: OnceLock::new(), wanted: std::io::stderr().is_terminal() }
    }
}

impl Workers for Bar {
    fn each(&self, jobs: usize, job: &(dyn Fn(usize) + Sync)) {
        Threads.each(jobs, job);
    }

    fn progress(&self, share: f64) {
        if !self.wanted || self.began.elapsed() < BAR_AFTER {
            return;
        }
        let bar = self.bar.get_or_init(|| {
            let bar = ProgressBar::with_draw_target(Some(BAR_STEPS), ProgressDrawTarget::stderr());
            let style = ProgressStyle::with_template("fitting {bar:40} {percent} %");
            bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        });
        bar.set_position((share * BAR_STEPS as f64) as u64);
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        if let Some(bar) = self.bar.get() {
            bar.finish_and_clear();
        }
    }
}
