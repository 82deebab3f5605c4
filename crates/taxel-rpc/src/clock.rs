//! The clock of the service. It reads none of its own, so that tests hand in time as they like.

use std::sync::Arc;
use taxel_skin::Time;

/// The run's clock, the same that stamps the frames. It never steps.
pub type Clock = Arc<dyn Fn() -> Time + Send + Sync>;
