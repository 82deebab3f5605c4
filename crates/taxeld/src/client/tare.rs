//! `taxeld tare`: takes the zero of the untouched skin.

use taxel_proto::v1::TareRequest;

use super::connect::Server;
use super::failure::Outcome;
use super::json;

/// Takes the zero. Nothing may touch the skin; the daemon refuses unless the counts show an unloaded skin.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld tare\n  taxeld tare --confirmed-by Ada   # you confirm that nothing touches the skin"
)]
pub struct TareArgs {
    #[command(flatten)]
    server: Server,
    /// Your name, as the one who confirms that nothing touches the skin: the zero is then taken without proof in the counts.
    #[arg(long, value_name = "NAME", default_value = "")]
    confirmed_by: String,
    /// Print the answer as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs it.
///
/// # Errors
/// Refused with the daemon's reason, or no daemon.
pub async fn tare(args: TareArgs) -> Outcome {
    let daemon = args.server.connect().await?;
    let request = TareRequest { patch: daemon.patch(), confirmed_by: args.confirmed_by };
    let status = daemon.skin().tare(request).await?.into_inner();
    if args.json {
        return json::print("TareStatus", &status);
    }
    say!("{}: zero {} taken: {}", status.patch, status.epoch, status.reason);
    let (baseline, noise) = (status.baseline_median_counts, status.noise_median_counts);
    say!("  baseline {baseline:.1} counts, noise {noise:.2} counts (medians)");
    Ok(())
}
