//! Raw counts of a patch, with the range that they are of. What is judged in counts is judged in the units of [`CountRange`].

use std::ops::Range;
use std::sync::Arc;
use taxel_skin::CountRange;

/// The counts of taxels, borrowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts<'a> {
    raw: &'a [u16],
    range: CountRange,
}

impl<'a> Counts<'a> {
    /// Raw counts of a range, one per taxel.
    #[must_use]
    pub const fn new(raw: &'a [u16], range: CountRange) -> Self {
        Self { raw, range }
    }

    /// The raw counts.
    #[must_use]
    pub const fn all(self) -> &'a [u16] {
        self.raw
    }

    /// What they are of.
    #[must_use]
    pub const fn range(self) -> CountRange {
        self.range
    }

    /// How many there are.
    #[must_use]
    pub const fn len(self) -> usize {
        self.raw.len()
    }

    /// Whether there is none.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.raw.is_empty()
    }

    /// The raw count of a taxel.
    #[must_use]
    pub fn raw(self, taxel: usize) -> Option<u16> {
        self.raw.get(taxel).copied()
    }

    /// The count of a taxel in units.
    #[must_use]
    pub fn units(self, taxel: usize) -> Option<f64> {
        self.raw(taxel).map(|raw| self.range.units(raw))
    }

    /// Those of a range of taxels; none where it goes beyond the last.
    #[must_use]
    pub fn slice(self, taxels: Range<usize>) -> Self {
        Self { raw: self.raw.get(taxels).unwrap_or_default(), ..self }
    }

    /// All of them in units.
    pub fn iter_units(self) -> impl ExactSizeIterator<Item = f64> + 'a {
        let per_unit = self.range.per_unit();
        self.raw.iter().map(move |&raw| f64::from(raw) / per_unit)
    }
}

/// Counts of eight bits.
impl<'a, T: AsRef<[u16]> + ?Sized> From<&'a T> for Counts<'a> {
    fn from(raw: &'a T) -> Self {
        Self::new(raw.as_ref(), CountRange::BYTE)
    }
}

/// The counts of one scan, shared by all who keep it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SharedCounts {
    raw: Arc<[u16]>,
    range: CountRange,
}

impl SharedCounts {
    /// What is in it.
    #[must_use]
    pub fn counts(&self) -> Counts<'_> {
        Counts::new(&self.raw, self.range)
    }
}

impl From<Counts<'_>> for SharedCounts {
    fn from(Counts { raw, range }: Counts<'_>) -> Self {
        Self { raw: raw.into(), range }
    }
}

/// Counts of eight bits.
impl<T: AsRef<[u16]>> From<T> for SharedCounts {
    fn from(raw: T) -> Self {
        Counts::from(&raw).into()
    }
}
