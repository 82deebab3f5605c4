//! What is reported of a patch's boards: which modules are silent, and the health of each board.

use std::ops::Range;
use std::time::Duration;
use taxel_skin::{Time, counted};

use super::Intake;
use crate::intake::cells::Device;
use crate::intake::gauge::GaugeHistory;
use crate::intake::health::BoardHealth;
use crate::intake::pace::Pace;

/// Smaller jumps are in the uncertainty, and nothing that anybody could mend: noise makes one now and then.
const JUMP_TOLD_COUNTS: f32 = 3.0;

/// A gauge that has read the very same in so many readings and for so long may stand still.
const STANDS_READINGS: usize = 20;
const STANDS: Duration = Duration::from_secs(1);

impl Intake {
    /// What an operator should see to before a session, so that what would spoil it is known before the pump runs, a line each:
    /// modules that are silent, boards that send at another period or warn of themselves, a gauge that is silent or stands still.
    /// `left_out` are modules that nobody waits for.
    pub fn look(&self, now: Time, gauge_timeout: Option<Duration>, left_out: &[u16]) -> Vec<String> {
        let mut lines = Vec::new();
        let waited_for = |module: usize| !left_out.iter().any(|out| usize::from(*out) == module);
        if self.scan().silent.iter().enumerate().any(|(module, silent)| *silent && waited_for(module)) {
            lines.push(self.silence(now));
        }
        for board in self.board_health(now) {
            lines.extend(board.warnings.iter().map(|warning| format!("board {}: {warning}", board.address)));
        }
        lines.extend(gauge_timeout.and_then(|timeout| look_at_gauge(&self.gauge, now, timeout)));
        lines
    }

    /// Which modules keep a scan from being whole, in words.
    pub fn silence(&self, now: Time) -> String {
        let modules = self.assembler.modules().iter().enumerate();
        let words = modules.filter(|(_, module)| module.stale).map(|(position, module)| {
            let since = module.last.map_or_else(
                || "never heard".to_owned(),
                |last| format!("silent for {:.1} s", now.since(last).as_secs_f64()),
            );
            format!("{} ({since})", self.plan.patch.module_name(position))
        });
        let silent: Vec<String> = words.collect();
        match silent.len() {
            0 => "too few whole scans came in time".to_owned(),
            n @ 1..=4 => format!("{}: {}", counted(n, "module is silent", "modules are silent"), silent.join(", ")),
            n => format!("{n} modules are silent: {} and {} more", silent[..3].join(", "), n - 3),
        }
    }

    /// One entry per board.
    pub fn board_health(&self, now: Time) -> Vec<BoardHealth> {
        (0..self.boards.len()).map(|board| self.health_of(board, now)).collect()
    }

    fn health_of(&self, position: usize, now: Time) -> BoardHealth {
        let (board, state) = (&self.plan.patch.boards()[position], &self.boards[position]);
        let range = self.regions.board_modules()[position].clone();
        let modules = &self.assembler.modules()[range.clone()];
        let names = range.clone().map(|m| (m, self.plan.patch.modules()[m].module.to_string()));
        let mut warnings = state.warnings();
        warnings.extend(self.pace_warnings(range.clone(), now));
        warnings.extend(self.jump_warnings(range));
        BoardHealth {
            patch: self.plan.patch.name().to_owned(),
            bus: board.bus.0,
            address: board.address.get(),
            bring_up: self.bring_up.in_words(names),
            modules: (modules.len() as u32, modules.iter().filter(|m| !m.stale).count() as u32),
            scans: modules.iter().map(|m| m.scans).sum(),
            orphans: modules.iter().map(|m| m.pairer.orphans().heads + m.pairer.orphans().tails).sum::<u64>()
                + self.devices.get(position).map_or(0, Device::orphans),
            status_errors: state.status_errors(),
            celsius: state.celsius(),
            firmware: state.firmware(),
            warnings,
        }
    }

    /// Which modules jump so far that somebody should look at them.
    fn jump_warnings(&self, modules: Range<usize>) -> impl Iterator<Item = String> {
        let jumping =
            modules.map(|module| (module, self.jumps[module])).filter(|(_, counts)| *counts >= JUMP_TOLD_COUNTS);
        jumping.map(|(module, counts)| {
            format!(
                "module {} jumps by {counts:.1} counts there and back, all its taxels at once, which is in the uncertainty: \
                 look at its plug and its supply",
                self.plan.patch.modules()[module].module
            )
        })
    }

    /// What is strange about how often the modules of a board send.
    fn pace_warnings(&self, modules: Range<usize>, now: Time) -> Vec<String> {
        let paces = &self.paces[modules];
        let mut warnings = Vec::new();
        if let Some(period) = paces.iter().find_map(Pace::unlike_configured) {
            let (is, was) = (period.as_millis(), self.plan.period.as_millis());
            warnings.push(format!("sends every {is} ms, the configuration says {was} ms"));
        }
        let excess: u64 = paces.iter().map(|pace| pace.excess().1).sum();
        if let Some(last) = paces.iter().filter_map(|pace| pace.excess().0).max() {
            warnings.push(format!(
                "{excess} scans arrived too fast and were ignored ({}). Does another node use its CAN ids, or was this \
                 computer overloaded?",
                last_seen(last, now)
            ));
        }
        warnings
    }
}

fn look_at_gauge(gauge: &GaugeHistory, now: Time, timeout: Duration) -> Option<String> {
    if let Some(why) = gauge.silence(now, timeout) {
        return Some(why);
    }
    let (_, kpa) = gauge.newest()?;
    let (readings, span) = gauge.run();
    (readings >= STANDS_READINGS && span >= STANDS).then(|| {
        let seconds = span.as_secs_f64();
        format!("the gauge has read exactly {:.3} kPa for {seconds:.1} s: see that it moves when the pump runs", kpa.0)
    })
}

/// When a thing that may be over happened last. In whole minutes: health is reported anew whenever a word of it changes.
fn last_seen(last: Time, now: Time) -> String {
    match now.since(last).as_secs() / 60 {
        0 => "last within a minute".to_owned(),
        minutes @ 1..120 => format!("last {minutes} min ago"),
        minutes => format!("last {} h ago", minutes / 60),
    }
}
