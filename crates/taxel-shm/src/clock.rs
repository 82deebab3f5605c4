//! The clock that writer and readers share.

use nix::time::{ClockId, clock_gettime};

/// `CLOCK_BOOTTIME` in nanoseconds: one clock for all processes of a machine, which never steps and goes on while the
/// machine is suspended.
#[must_use]
pub fn now_ns() -> i64 {
    // It cannot fail on Linux. If it did, the origin would make every stamp one of the future, which is refused.
    clock_gettime(ClockId::CLOCK_BOOTTIME)
        .map_or(0, |at| at.tv_sec().saturating_mul(1_000_000_000).saturating_add(at.tv_nsec()))
}
