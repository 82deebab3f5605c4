//! `taxeld bring-up`: configures the boards of a patch anew.

use taxel_proto::v1::TareRequest;

use super::connect::Server;
use super::failure::Outcome;

/// Configures the boards of a patch anew, which then take their own zero. Nothing may touch the skin; while a force is felt the
/// daemon refuses.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld bring-up\n  taxeld bring-up --confirmed-by Ada   # you confirm that nothing touches the skin"
)]
pub struct BringUpArgs {
    #[command(flatten)]
    server: Server,
    /// Your name, as the one who confirms that nothing touches the skin: boards that stream are then not checked for a load first.
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
pub async fn bring_up(args: BringUpArgs) -> Outcome {
    let daemon = args.server.connect().await?;
    let request = TareRequest { patch: daemon.patch(), confirmed_by: args.confirmed_by };
    daemon.skin().bring_up(request).await?;
    if args.json {
        say!("{{}}");
        return Ok(());
    }
    say!(
        "the bring-up has begun: `taxeld health` says how the boards are; then `taxeld tare`, if no zero is taken by itself"
    );
    Ok(())
}
