//! How `taxeld calibrate` is asked.

use taxel_proto::v1::ModuleName;

use crate::client::connect::Server;

/// Guides through a calibration in the vacuum bag: zero, ramps, review, use of the new set.
///
/// A session that is under way is taken up again. Ctrl-C asks whether to abort it or to leave it to the daemon.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld calibrate\n  taxeld calibrate --both --ramps 2        # learns the hysteresis, too\n  taxeld calibrate --yes > calibration.log 2>&1   # asks nothing, uses the new set\n  taxeld calibrate --leave-out 12:3        # without module 3 of board 12\n  taxeld calibrate --patch left_forearm --with left_hand   # both in one bag, one ramp"
)]
pub struct CalibrateArgs {
    #[command(flatten)]
    pub server: Server,
    /// Another patch in the same bag, calibrated by the same ramps in a session of its own; may be given several times.
    #[arg(long, value_name = "PATCH", conflicts_with = "session")]
    pub with: Vec<String>,
    /// Ramps of the session; the bag is vented between them.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100))]
    pub ramps: u32,
    /// Gather the fall of the pressure after each rise, too.
    #[arg(long)]
    pub both: bool,
    /// Pressure at which the rise ends, in kPa [default: as the daemon is configured].
    #[arg(long, value_name = "KPA")]
    pub target: Option<f64>,
    /// Your name, as the one who confirms that nothing touches the skin: the zero is then taken without proof in the counts.
    #[arg(long, value_name = "NAME", default_value = "")]
    pub confirmed_by: String,
    /// A module to do without, because it is silent or broken; may be given several times.
    #[arg(long, value_name = "BOARD:MODULE", value_parser = parse_module)]
    pub leave_out: Vec<ModuleName>,
    /// Take up this session.
    #[arg(long, value_name = "SESSION", conflicts_with = "new", value_parser = clap::value_parser!(u64).range(1..))]
    pub session: Option<u64>,
    /// Begin a new session although an earlier one could be taken up.
    #[arg(long)]
    pub new: bool,
    /// Ask nothing: take up what was interrupted, use the new set.
    #[arg(long)]
    pub yes: bool,
    /// Print the session as lines of JSON, as it changes.
    #[arg(long)]
    pub json: bool,
}

fn parse_module(text: &str) -> Result<ModuleName, String> {
    let numbers = text.split_once(':').and_then(|(board, module)| Some((board.parse().ok()?, module.parse().ok()?)));
    let (board, module) = numbers.ok_or_else(|| "expected BOARD:MODULE, for example 12:3".to_owned())?;
    Ok(ModuleName { board, module })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_module_is_named_by_board_and_number() {
        assert_eq!(parse_module("12:3"), Ok(ModuleName { board: 12, module: 3 }));
        for text in ["", "12", "12:", ":3", "a:b", "12:3:4"] {
            assert!(parse_module(text).is_err(), "{text}");
        }
    }
}
