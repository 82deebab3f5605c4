//! A look at boards and gauge before a session, so that what would spoil it is known before the pump runs.

use std::time::Duration;
use taxel_skin::Time;

use crate::intake::receive::Intake;

/// A gauge that has read the very same in so many readings and for so long may stand still.
const STANDS_READINGS: usize = 20;
const STANDS: Duration = Duration::from_secs(1);

/// What an operator should see to, a line each: modules that are silent, boards that send at another period or warn of
/// themselves, a gauge that is silent or stands still. `left_out` are modules that nobody waits for.
#[must_use]
pub fn look(intake: &Intake, now: Time, gauge_timeout: Duration, left_out: &[u16]) -> Vec<String> {
    let mut lines = Vec::new();
    let waited_for = |module: usize| !left_out.iter().any(|out| usize::from(*out) == module);
    if intake.scan().silent.iter().enumerate().any(|(module, silent)| *silent && waited_for(module)) {
        lines.push(intake.silence(now));
    }
    for board in intake.board_health(now) {
        lines.extend(board.warnings.iter().map(|warning| format!("board {}: {warning}", board.address)));
    }
    lines.extend(look_at_gauge(intake, now, gauge_timeout));
    lines
}

fn look_at_gauge(intake: &Intake, now: Time, timeout: Duration) -> Option<String> {
    let gauge = intake.gauge();
    let Some((time, kpa)) = gauge.newest() else {
        return Some("no pressure has been heard: is the gauge on?".to_owned());
    };
    let silence = now.since(time);
    if silence > timeout {
        return Some(format!("the gauge has been silent for {:.1} s", silence.as_secs_f64()));
    }
    let (readings, span) = gauge.run();
    (readings >= STANDS_READINGS && span >= STANDS).then(|| {
        let seconds = span.as_secs_f64();
        format!("the gauge has read exactly {:.3} kPa for {seconds:.1} s: see that it moves when the pump runs", kpa.0)
    })
}
