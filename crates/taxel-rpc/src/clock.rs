//! The clocks of the service. It reads none of its own, so that tests and replays hand in time as they like.

use std::sync::Arc;
use taxel_skin::Time;

/// A clock that never steps.
pub type Clock = Arc<dyn Fn() -> Time + Send + Sync>;

/// What time it is, for two questions.
#[derive(Clone)]
pub struct Clocks {
    /// The run's clock, the same that stamps the frames: how old is a value? A replay's runs at the speed of the replay.
    pub run: Clock,
    /// The clock of the process: for how long has the engine not run? Live it is the same clock.
    pub process: Clock,
}
