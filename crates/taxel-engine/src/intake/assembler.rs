//! Live counts of one patch: whole modules come in, scans come out, silence is noticed.

use std::time::Duration;
use taxel_skin::{CountRange, Patch, Time};
use taxel_wire::icub::{ModuleScan, Pairer};

use crate::counts::Counts;

/// A head and its tail are a few frames apart; half the board's period keeps them from pairing across scans.
const PAIRING_SHARE: u32 = 2;

/// One module's live state.
#[derive(Debug)]
pub struct ModuleState {
    /// Head and tail to whole modules.
    pub pairer: Pairer,
    /// When it was last received whole.
    pub last: Option<Time>,
    /// Whether it has been silent for too long, or was never heard.
    pub stale: bool,
    /// Whole modules received.
    pub scans: u64,
    /// Whether it is part of the scan being assembled.
    fresh: bool,
    /// Whether a scan waits for it: it was heard lately, or listening began lately.
    expected: bool,
}

/// Counts of all taxels and how fresh they are.
#[derive(Debug)]
pub struct ScanAssembler {
    modules: Vec<ModuleState>,
    counts: Vec<u16>,
    range: CountRange,
    /// Thermal pads of each module as last received.
    pads: Vec<[u8; 2]>,
    fresh: usize,
    expected: usize,
    newest: Time,
    begun: Option<Time>,
    /// No module of the scan being assembled was received before this time.
    earliest_fresh: Option<Time>,
    /// Modules of one scan should lie within this.
    span_max: Duration,
    /// Whether the scans were cut anew; they are not again until one is overrun.
    realigned: bool,
}

/// A scan that has just ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ScanEnd {
    /// Whether every module of the patch was fresh.
    pub whole: bool,
    /// Mean time of the modules.
    pub time: Time,
}

impl ScanAssembler {
    /// Nothing received yet: every module is stale.
    pub fn new(patch: &Patch, period: Duration) -> Self {
        let module = |_: &_| ModuleState {
            pairer: Pairer::new(period / PAIRING_SHARE),
            last: None,
            stale: true,
            scans: 0,
            fresh: false,
            expected: true,
        };
        Self {
            modules: patch.modules().iter().map(module).collect(),
            counts: vec![0; patch.taxels().len()],
            range: patch.counts(),
            pads: vec![[0; 2]; patch.modules().len()],
            fresh: 0,
            expected: patch.modules().len(),
            newest: Time::default(),
            begun: None,
            earliest_fresh: None,
            span_max: period / 2,
            realigned: false,
        }
    }

    /// The pairer of a module, for its halves.
    pub fn pairer(&mut self, module: usize) -> &mut Pairer {
        &mut self.modules[module].pairer
    }

    /// Takes a whole module. Returns the scan that it completes: all expected modules have come, or one came twice, so
    /// that the scan before it is over.
    pub fn on_module(&mut self, patch: &Patch, index: usize, scan: &ModuleScan) -> Option<ScanEnd> {
        let site = &patch.modules()[index];
        let first = site.first_taxel as usize;
        for (count, &slot) in self.counts[first..].iter_mut().zip(site.kind.taxel_slots()) {
            *count = scan.values[slot as usize].into();
        }
        for (pad, &slot) in self.pads[index].iter_mut().zip(site.kind.thermal_slots()) {
            *pad = scan.values[slot as usize];
        }
        self.note_module(index, scan.time)
    }

    /// As [`ScanAssembler::on_module`], for a module of a sensor that is described by its signals: `raw` are its counts.
    pub fn on_cells(&mut self, patch: &Patch, index: usize, time: Time, raw: &[u16]) -> Option<ScanEnd> {
        let site = &patch.modules()[index];
        let (first, taxels) = (usize::from(site.first_taxel), site.kind.taxel_slots().len());
        for (count, &raw) in self.counts[first..].iter_mut().zip(raw).take(taxels) {
            *count = raw.min(self.range.top());
        }
        self.note_module(index, time)
    }

    /// The counts of a module are in.
    fn note_module(&mut self, index: usize, time: Time) -> Option<ScanEnd> {
        let overrun = self.modules[index].fresh.then(|| self.end_scan());
        let module = &mut self.modules[index];
        self.expected += usize::from(!std::mem::replace(&mut module.expected, true));
        module.stale = false;
        module.last = Some(time);
        module.scans += 1;
        module.fresh = true;
        self.fresh += 1;
        self.newest = self.newest.max(time);
        self.earliest_fresh = Some(self.earliest_fresh.map_or(time, |earliest| earliest.min(time)));
        self.begun.get_or_insert(time);
        self.realigned &= overrun.is_none();
        if self.fresh < self.expected || self.realign() {
            return overrun;
        }
        // With every other module in, this one completes the scan; it wins over the overrun that it caused.
        Some(self.end_scan())
    }

    /// Listening may begin in the middle of the boards' bursts, and then every scan would be put together from two.
    /// So a scan that is too long loses its early part once, and goes on with the next burst. Boards that are spread
    /// over the whole period stay long, which is why it is done once only.
    fn realign(&mut self) -> bool {
        let early = self.newest - self.span_max;
        if self.realigned || self.earliest_fresh.is_none_or(|earliest| earliest >= early) {
            return false;
        }
        self.earliest_fresh = None;
        let before = self.fresh;
        for module in self.modules.iter_mut().filter(|m| m.fresh) {
            match module.last {
                Some(last) if last < early => {
                    module.fresh = false;
                    self.fresh -= 1;
                }
                last => self.earliest_fresh = self.earliest_fresh.min(last).or(last),
            }
        }
        self.realigned = self.fresh < before;
        self.realigned
    }

    fn end_scan(&mut self) -> ScanEnd {
        let (mut sum, mut count) = (0_i128, 0);
        for module in &mut self.modules {
            if module.fresh {
                sum += i128::from(module.last.unwrap_or_default().as_nanos());
                count += 1;
            }
            module.fresh = false;
        }
        self.fresh = 0;
        self.earliest_fresh = None;
        let mean = (sum / count.max(1)) as i64;
        ScanEnd { whole: count as usize == self.modules.len(), time: Time::from_nanos(mean) }
    }

    /// Marks modules that have been silent for longer than `limit`; returns the positions of those that fell silent now.
    pub fn mark_stale(&mut self, now: Time, limit: Duration) -> Vec<usize> {
        let mut silent = Vec::new();
        if self.first_silence(limit).is_none_or(|silence| now < silence) {
            return silent; // nearly always
        }
        for (index, module) in self.modules.iter_mut().enumerate() {
            let since = module.last.or(self.begun);
            if module.expected && since.is_some_and(|since| now.since(since) > limit) {
                module.stale = true;
                module.expected = false;
                self.expected -= 1;
                self.fresh -= usize::from(std::mem::take(&mut module.fresh));
                silent.push(index);
            }
            module.pairer.expire(now);
        }
        silent
    }

    /// When the first module falls silent, if none is heard before; `None` if none is listened for.
    pub fn first_silence(&self, limit: Duration) -> Option<Time> {
        let expected = self.modules.iter().filter(|module| module.expected);
        let last = expected.filter_map(|module| module.last.or(self.begun)).min()?;
        Some(last + limit + Duration::from_nanos(1))
    }

    /// Two thermal pads per module as last received.
    pub fn pads(&self) -> &[[u8; 2]] {
        &self.pads
    }

    /// One raw count per taxel as last received.
    pub fn counts(&self) -> Counts<'_> {
        Counts::new(&self.counts, self.range)
    }

    /// All modules, in the patch's order.
    pub fn modules(&self) -> &[ModuleState] {
        &self.modules
    }

    /// Receive time of the newest frame; `None` before the first.
    pub fn newest(&self) -> Option<Time> {
        self.begun.map(|_| self.newest)
    }

    /// Whether every module but those that are `left_out` was received within `limit` of the newest one.
    pub fn is_whole_without(&self, limit: Duration, left_out: impl Fn(usize) -> bool) -> bool {
        let fresh = |m: &ModuleState| !m.stale && m.last.is_some_and(|last| self.newest.since(last) <= limit);
        self.modules.iter().enumerate().all(|(index, module)| left_out(index) || fresh(module))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_skin::ModuleKind;
    use taxel_wire::icub::StatusWord;

    fn patch(modules: usize) -> Patch {
        crate::tests::patch(&vec![ModuleKind::Triangle; modules])
    }

    fn scan(ms: i64, value: u8) -> ModuleScan {
        ModuleScan { time: Time::from_nanos(ms * 1_000_000), values: [value; 12], status: StatusWord(0) }
    }

    const PERIOD: Duration = Duration::from_millis(50);

    #[test]
    fn a_scan_ends_when_every_module_has_come() {
        let (patch, mut live) = (patch(3), ScanAssembler::new(&patch(3), PERIOD));
        assert_eq!(live.on_module(&patch, 1, &scan(1, 1)), None); // listening began within the burst
        assert_eq!(live.on_module(&patch, 2, &scan(2, 1)), None);
        assert_eq!(live.on_module(&patch, 0, &scan(50, 2)), None, "no scan from two bursts");
        assert_eq!(live.on_module(&patch, 1, &scan(51, 2)), None);
        let end = live.on_module(&patch, 2, &scan(52, 2)).unwrap();
        assert!(end.whole);
        assert_eq!(end.time, Time::from_nanos(51_000_000));
        assert!(live.is_whole_without(PERIOD, |_| false));
    }

    #[test]
    fn boards_spread_over_the_period_still_give_scans() {
        let (patch, mut live) = (patch(4), ScanAssembler::new(&patch(4), PERIOD));
        let ends = (0..40_i64).filter(|i| live.on_module(&patch, (i % 4) as usize, &scan(i * 12, 1)).is_some()).count();
        assert_eq!(ends, 9, "one is spent on the attempt to cut them better");
    }

    #[test]
    fn a_silent_module_neither_blocks_the_scan_nor_counts_as_whole() {
        let (patch, mut live) = (patch(2), ScanAssembler::new(&patch(2), PERIOD));
        live.on_module(&patch, 0, &scan(0, 1));
        live.on_module(&patch, 1, &scan(1, 1));
        assert_eq!(live.on_module(&patch, 0, &scan(50, 2)), None);
        let overrun = live.on_module(&patch, 0, &scan(100, 3)).unwrap();
        assert!(!overrun.whole, "module 1 missed this scan");
        let now = Time::from_nanos(200_000_000);
        assert_eq!(live.mark_stale(now, 3 * PERIOD), vec![1]);
        assert!(!live.on_module(&patch, 0, &scan(205, 4)).unwrap().whole);
        assert_eq!(live.counts().raw(0), Some(4));
        assert_eq!(live.counts().raw(10), Some(1), "the stale count is kept, with its age");
    }
}
