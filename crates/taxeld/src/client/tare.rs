//! `taxeld tare`: takes the zero of the untouched skin. `taxeld bring-up`: configures its boards anew.

use taxel_proto::v1::TareRequest;

use super::connect::Asked;
use super::failure::Outcome;

/// Of which patch, and whether somebody confirms that it is unloaded.
#[derive(Debug, clap::Args)]
pub struct UnloadedArgs {
    #[command(flatten)]
    asked: Asked,
    /// Your name, as the one who confirms that nothing touches the skin: the counts need not show it.
    #[arg(long, value_name = "NAME", default_value = "")]
    confirmed_by: String,
}

/// Takes the zero.
///
/// # Errors
/// Refused with the daemon's reason, or no daemon.
pub async fn tare(args: UnloadedArgs) -> Outcome {
    let daemon = args.asked.daemon().await?;
    let request = TareRequest { patch: daemon.patch.clone(), confirmed_by: args.confirmed_by };
    let status = daemon.skin().tare(request).await?.into_inner();
    args.asked.show("TareStatus", &status, |status| {
        say!("{}: zero {} taken: {}", status.patch, status.epoch, status.reason);
        let (baseline, noise) = (status.baseline_median_counts, status.noise_median_counts);
        say!("  unloaded count {baseline:.1}, noise {noise:.2} counts (medians)");
    })
}

/// Configures the boards.
///
/// # Errors
/// Refused with the daemon's reason, or no daemon.
pub async fn bring_up(args: UnloadedArgs) -> Outcome {
    let daemon = args.asked.daemon().await?;
    let request = TareRequest { patch: daemon.patch.clone(), confirmed_by: args.confirmed_by };
    daemon.skin().bring_up(request).await?;
    match args.asked.json {
        true => say!("{{}}"),
        false => say!(
            "the bring-up has begun: `taxeld health` says how the boards are; then `taxeld tare`, if no zero is taken by itself"
        ),
    }
    Ok(())
}
