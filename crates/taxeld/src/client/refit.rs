//! `taxeld sessions refit`: stored samples fitted once more.

use taxel_model::Order;
use taxel_proto::v1::{
    Branches, FitEstimator, FitOptions, FitPlays, GetModelSetRequest, PatchRequest, Refit, RefitSessionsRequest,
};

use super::connect::{Daemon, Server};
use super::failure::{Failure, Outcome};
use super::json;
use super::models::print_set;
use super::places::Places;
use crate::values::{parse_order, parse_positive, parse_seconds};

/// What it takes beside the sessions.
#[derive(Debug, clap::Args)]
pub struct RefitArgs {
    #[command(flatten)]
    server: Server,
    /// Print the answer as JSON.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    options: Options,
}

/// How to fit, where that differs from the configuration.
#[derive(Debug, clap::Args)]
struct Options {
    /// Order of the polynomial, 1 to 10, or `auto`: per taxel by leave-one-out error.
    #[arg(long, value_parser = parse_order)]
    order: Option<Order>,
    /// The paper's method and nothing else: its equation over all samples of rising pressure, the curve as it comes out.
    #[arg(long, conflicts_with_all = ["estimator", "branch", "plays", "smooth", "bin_width"])]
    paper: bool,
    /// Least-squares problem.
    #[arg(long)]
    estimator: Option<EstimatorArg>,
    /// Solve in double-double throughout, for audits and reference values.
    #[arg(long)]
    exact: bool,
    /// Width of a pressure bin in kPa.
    #[arg(long, value_name = "KPA", value_parser = parse_positive)]
    bin_width: Option<f64>,
    /// Which part is fitted [default: what the sessions gathered].
    #[arg(long, value_enum)]
    branch: Option<BranchArg>,
    /// Compensation of hysteresis, over both branches.
    #[arg(long, value_enum)]
    plays: Option<PlaysArg>,
    /// Seconds over which counts are averaged in use; 0 is not at all.
    #[arg(long, value_name = "S", value_parser = parse_seconds)]
    smooth: Option<f64>,
    /// Exclude taxels that move by less than so many counts, as the paper does; 0 is off.
    #[arg(long, value_name = "COUNTS", value_parser = parse_seconds)]
    min_swing: Option<f64>,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum EstimatorArg {
    PerSample,
    PressureBinned,
}

/// Which part is fitted.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum BranchArg {
    /// Rising and falling pressure.
    Both,
    /// Rising pressure alone.
    Rising,
}

/// Compensation of hysteresis.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum PlaysArg {
    /// Where it wins on a branch that no fit saw.
    Auto,
    /// Wherever a taxel carries it.
    On,
    /// Nowhere.
    Off,
}

impl Options {
    fn message(&self) -> FitOptions {
        let estimator = match (self.paper, self.estimator) {
            (true, _) => FitEstimator::Paper,
            (false, None) => FitEstimator::Unspecified,
            (false, Some(EstimatorArg::PerSample)) => FitEstimator::PerSample,
            (false, Some(EstimatorArg::PressureBinned)) => FitEstimator::PressureBinned,
        };
        let branches = match self.branch {
            None => Branches::Unspecified,
            Some(BranchArg::Rising) => Branches::Rising,
            Some(BranchArg::Both) => Branches::Both,
        };
        let plays = match self.plays {
            None => FitPlays::Unspecified,
            Some(PlaysArg::Auto) => FitPlays::Auto,
            Some(PlaysArg::On) => FitPlays::On,
            Some(PlaysArg::Off) => FitPlays::Off,
        };
        FitOptions {
            order: self.order.map(|order| match order {
                Order::Fixed(order) => u32::from(order),
                Order::Auto => 0,
            }),
            estimator: estimator.into(),
            exact: self.exact.then_some(true),
            bin_width_kpa: self.bin_width,
            branches: branches.into(),
            plays: plays.into(),
            smooth_s: self.smooth,
            min_swing_counts: self.min_swing,
        }
    }
}

/// Fits one session once more, or several together.
///
/// # Errors
/// Refused with the daemon's reason, or no daemon.
pub async fn refit(args: &RefitArgs, sessions: Vec<u64>) -> Outcome {
    let daemon = args.server.connect().await?;
    let request = RefitSessionsRequest { sessions, options: Some(args.options.message()) };
    let answer = daemon.calibration().refit_sessions(request).await?.into_inner();
    tell(args, &daemon, &answer).await
}

async fn tell(args: &RefitArgs, daemon: &Daemon, answer: &Refit) -> Outcome {
    if args.json {
        return json::print("Refit", answer);
    }
    let summary = answer.model_set.as_ref().ok_or_else(|| Failure::refused("the daemon did not say which set"))?;
    say!("{} scans fitted", answer.scans);
    let request =
        GetModelSetRequest { model_set: summary.model_set.clone(), patch: summary.patch.clone(), curves: Vec::new() };
    let set = daemon.models().get_model_set(request).await?.into_inner();
    let skin = daemon.skin().get_skin(PatchRequest { patch: summary.patch.clone() }).await?.into_inner();
    print_set(&set, &Places::of(&skin))?;
    let id = &summary.model_set;
    match (answer.known, summary.active) {
        (true, true) => say!("the same samples were fitted so before: this is the set in use"),
        (known, _) => {
            let before = if known { "the same samples were fitted so before: the set was there already; " } else { "" };
            say!(
                "{before}it is not in use. What changes: taxel-lab compare active {id}; use it: taxeld models use {id}"
            );
        }
    }
    Ok(())
}
