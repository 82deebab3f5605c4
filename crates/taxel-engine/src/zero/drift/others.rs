//! What all modules but one have in common.

/// Values of modules, sorted, so that the median without any one of them is found at once.
pub(super) struct Others {
    sorted: Vec<(usize, f64)>,
}

impl Others {
    /// Module and value, each module once; values are numbers.
    pub(super) fn new(mut values: Vec<(usize, f64)>) -> Self {
        values.sort_by(|a, b| a.1.total_cmp(&b.1));
        Self { sorted: values }
    }

    /// The median of all; `None` where there are fewer than `least`.
    pub(super) fn median(&self, least: usize) -> Option<f64> {
        self.median_without(usize::MAX, least)
    }

    /// The median without `module`; `None` where fewer than `least` remain.
    pub(super) fn median_without(&self, module: usize, least: usize) -> Option<f64> {
        let own = self.sorted.iter().position(|&(other, _)| other == module);
        let n = self.sorted.len() - usize::from(own.is_some());
        if n < least.max(1) {
            return None;
        }
        let at = |rank: usize| self.sorted[rank + usize::from(own.is_some_and(|own| own <= rank))].1;
        Some(0.5 * (at((n - 1) / 2) + at(n / 2)))
    }
}
