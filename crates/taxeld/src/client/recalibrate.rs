//! `taxeld recalibrate`: known loads correct the gain of the active model set, without the bag.

use taxel_proto::v1::{RecalibrateRequest, Recalibration, RecalibrationPoint};

use super::connect::Asked;
use super::failure::{Failure, Outcome};
use super::table;

/// Says by what factor the skin reads too little or too much, from known loads at five places or more; with --accept keeps
/// the corrected model set. It is not in use before `taxeld models use`.
///
/// The loads are those of `taxeld load` with the active models. Exit code 3 if the loads contradict each other: the one that
/// does is named.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  taxeld recalibrate\n  taxeld recalibrate --leave-out 7 --accept")]
pub struct RecalibrateArgs {
    #[command(flatten)]
    asked: Asked,
    /// Numbers of loads not to take, of all that were read with the active models.
    #[arg(long, value_name = "LOAD,...", value_delimiter = ',')]
    leave_out: Vec<u64>,
    /// Relative standard deviation of what a sound skin reads from place to place, 0.01 to 0.2 [default: 0.03].
    /// The smaller, the smaller a wrong load is found.
    #[arg(long, value_name = "SHARE")]
    place_uncertainty: Option<f64>,
    /// Keep the corrected model set. It is not used by that.
    #[arg(long)]
    accept: bool,
}

/// Runs it.
///
/// # Errors
/// The loads contradict each other or are too few, or no daemon.
pub async fn recalibrate(args: RecalibrateArgs) -> Outcome {
    let daemon = args.asked.daemon().await?;
    let request = RecalibrateRequest {
        patch: daemon.patch.clone(),
        loads: Vec::new(), // all
        leave_out: args.leave_out,
        place_uncertainty: args.place_uncertainty,
        dry_run: true,
        model_set: String::new(),
    };
    let proposal = daemon.validation().recalibrate(request.clone()).await?.into_inner();
    args.asked.show("Recalibration", &proposal, print)?;
    if let Some(why) = proposal.refused_because.first() {
        return Err(Failure::refused(why.clone()));
    }
    if !args.accept {
        return Ok(());
    }
    let request = RecalibrateRequest { dry_run: false, model_set: proposal.model_set, ..request };
    let answer = daemon.validation().recalibrate(request).await?.into_inner();
    args.asked.show("Recalibration", &answer, |Recalibration { model_set: id, source, .. }| {
        say!("kept as {id}, not in use. Use it: taxeld models use {id}; the way back: taxeld models use {source}");
    })
}

fn print(proposal: &Recalibration) {
    let row = |point: &RecalibrationPoint| {
        let off = |read: f64| format!("{:+.1}", 100.0 * (read / point.known_n - 1.0));
        let mark = if point.load == proposal.contradicts { "contradicts the others" } else { "" };
        vec![
            point.load.to_string(),
            format!("{:.2}", point.known_n),
            format!("{:.2}", point.read_n),
            off(point.read_n),
            off(point.corrected_n),
            format!("{:+.1}", point.deviation),
            mark.to_owned(),
        ]
    };
    let header = ["load", "laid on N", "read N", "error %", "then %", "deviation", ""];
    table::print(&header, proposal.points.iter().map(row));
    let Recalibration { gain, gain_sigma, source, points, .. } = proposal;
    let new = format!("a load at a new place is then known to {:.1} % (k = 1)", 100.0 * proposal.relative_sigma);
    say!("gain {gain:.4} +- {gain_sigma:.4} from {} loads on {source}; {new}", points.len());
    if !proposal.needed {
        say!("that is no more than the loads can tell: there is nothing to correct");
    }
}
