//! The clock that writer and readers share.

use nix::sys::time::TimeSpec;
use nix::time::{ClockId, clock_gettime};

/// `CLOCK_MONOTONIC` in nanoseconds: one clock for all processes of a machine, which never steps and stands still while
/// the machine sleeps.
#[must_use]
pub fn monotonic_ns() -> i64 {
    // It cannot fail on Linux. If it did, the origin would make every stamp one of the future, which is refused.
    clock_gettime(ClockId::CLOCK_MONOTONIC).map_or(0, nanos)
}

/// Nanoseconds for which the machine has slept since its start, or a little less, and [`monotonic_ns`], which is read later.
pub(crate) fn slept_and_monotonic_ns() -> (u64, i64) {
    let with_sleep_ns = clock_gettime(ClockId::CLOCK_BOOTTIME).map_or(0, nanos);
    let awake_ns = monotonic_ns();
    (u64::try_from(with_sleep_ns.saturating_sub(awake_ns)).unwrap_or(0), awake_ns)
}

const fn nanos(at: TimeSpec) -> i64 {
    at.tv_sec().saturating_mul(1_000_000_000).saturating_add(at.tv_nsec())
}
