//! One column of a recording.

use std::borrow::Cow;

/// A column of decimals: the nearest doubles, and what they leave over of the text.
#[derive(Clone, Debug, Default)]
pub struct Column {
    /// Nearest double.
    pub hi: Vec<f64>,
    /// Rest; `None` while every value was a double.
    pub lo: Option<Vec<f64>>,
}

impl Column {
    /// The column with only the rows of which `keep` says so; all of it without one.
    pub fn only(&self, keep: Option<&[bool]>) -> Cow<'_, Self> {
        let Some(keep) = keep else { return Cow::Borrowed(self) };
        let kept = |all: &[f64]| all.iter().zip(keep).filter(|(_, keep)| **keep).map(|(value, _)| *value).collect();
        Cow::Owned(Self { hi: kept(&self.hi), lo: self.lo.as_deref().map(kept) })
    }

    /// One more value.
    pub fn push(&mut self, hi: f64, lo: f64) {
        if lo != 0.0 && self.lo.is_none() {
            self.lo = Some(vec![0.0; self.hi.len()]);
        }
        self.hi.push(hi);
        if let Some(rest) = &mut self.lo {
            rest.push(lo);
        }
    }

    /// The values of another column behind its own.
    pub fn append(&mut self, other: &Self) {
        if self.lo.is_some() || other.lo.is_some() {
            let rest = self.lo.get_or_insert_with(|| vec![0.0; self.hi.len()]);
            match &other.lo {
                Some(other) => rest.extend(other),
                None => rest.resize(rest.len() + other.hi.len(), 0.0),
            }
        }
        self.hi.extend(&other.hi);
    }
}
