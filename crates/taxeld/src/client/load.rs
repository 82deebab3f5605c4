//! `taxeld load`: a known mass lies on the skin; how far the force is off.

use taxel_proto::v1::record_load_request::Load as Known;
use taxel_proto::v1::{Load, PatchRequest, RecordLoadRequest, Validation};

use super::connect::Asked;
use super::failure::Outcome;
use super::table;

/// Compares the force with a mass that lies on the skin now, and keeps both. Without a mass: what was compared so far.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld load 0.5 --by Ada --note 'brass, over module 9'\n  taxeld load --newton 4.9\n  taxeld load"
)]
pub struct LoadArgs {
    #[command(flatten)]
    asked: Asked,
    /// The mass in kg.
    #[arg(value_name = "KG")]
    mass: Option<f64>,
    /// The force in N that it presses with, instead of a mass.
    #[arg(long, value_name = "N", conflicts_with = "mass")]
    newton: Option<f64>,
    /// Standard uncertainty of the load as a share of it, 0 to 0.5 [default: 0.01].
    #[arg(long, value_name = "SHARE")]
    uncertainty: Option<f64>,
    /// Who laid it on.
    #[arg(long, value_name = "NAME", default_value = "")]
    by: String,
    /// Anything worth keeping.
    #[arg(long, value_name = "TEXT", default_value = "")]
    note: String,
    /// Number of an earlier load that was noted wrong.
    #[arg(long, value_name = "LOAD", default_value_t = 0)]
    replaces: u64,
}

/// Runs it.
///
/// # Errors
/// Refused with the daemon's reason, or no daemon.
pub async fn load(args: LoadArgs) -> Outcome {
    let daemon = args.asked.daemon().await?;
    let known = args.mass.map(Known::MassKg).or(args.newton.map(Known::ForceN));
    if known.is_none() {
        let request = PatchRequest { patch: daemon.patch.clone() };
        let validation = daemon.validation().get_validation(request).await?.into_inner();
        return args.asked.show("Validation", &validation, print_all);
    }
    let request = RecordLoadRequest {
        patch: daemon.patch.clone(),
        load: known,
        relative_uncertainty: args.uncertainty,
        note: args.note,
        by: args.by,
        replaces: args.replaces,
    };
    let load = daemon.validation().record_load(request).await?.into_inner();
    args.asked.show("Load", &load, print_one)
}

fn print_one(load: &Load) {
    let (number, true_n, error, within) = (load.load, load.force_n, load.error_percent, within(load));
    let read = format!("{:.2} N read (standard uncertainty {:.2} N)", load.read_n, load.read_sigma_n);
    say!("load {number}: {true_n:.2} N lies there, {read}: {error:+.1} %, {within}");
    load.reasons.iter().for_each(|reason| say!("  {reason}"));
}

fn within(load: &Load) -> &'static str {
    if load.within_two_sigma { "within two standard uncertainties" } else { "beyond two standard uncertainties" }
}

fn print_all(validation: &Validation) {
    let row = |load: &Load| {
        let reasons = [load.outdated_because.as_str(), load.left_out_because.as_str(), within(load)];
        let state = reasons.into_iter().find(|reason| !reason.is_empty()).unwrap_or_default().to_owned();
        vec![
            load.load.to_string(),
            table::moment(load.time.as_ref()),
            format!("{:.2}", load.force_n),
            format!("{:.2}", load.read_n),
            format!("{:+.1}", load.error_percent),
            load.by.clone(),
            state,
        ]
    };
    table::print(&["load", "time", "laid on N", "read N", "error %", "by", ""], validation.loads.iter().map(row));
    if let Some(error) = validation.mean_absolute_error_percent {
        say!("mean absolute error: {error:.1} %");
    }
}
