//! Raw counts of a patch: bytes of a skin of up to eight bits, words of a finer one.
//!
//! Most skins have eight bits, and the walks over all counts of a scan are the engine's hot path, so these stay bytes.
//! What is judged in counts is judged in the units of [`CountRange`], which for bytes are the counts themselves.

use std::ops::Range;
use std::sync::Arc;
use taxel_skin::CountRange;

/// The counts of taxels, borrowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counts<'a> {
    /// Of up to eight bits; a unit is one count.
    Bytes(&'a [u8]),
    /// Of another range.
    Words(&'a [u16], CountRange),
}

impl<'a> Counts<'a> {
    /// How many there are.
    #[must_use]
    pub const fn len(self) -> usize {
        match self {
            Self::Bytes(bytes) => bytes.len(),
            Self::Words(words, _) => words.len(),
        }
    }

    /// Whether there is none.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// The raw count of a taxel.
    #[must_use]
    pub fn raw(self, taxel: usize) -> Option<u16> {
        match self {
            Self::Bytes(bytes) => bytes.get(taxel).map(|&byte| u16::from(byte)),
            Self::Words(words, _) => words.get(taxel).copied(),
        }
    }

    /// The count of a taxel in units.
    #[must_use]
    pub fn units(self, taxel: usize) -> Option<f64> {
        match self {
            Self::Bytes(bytes) => bytes.get(taxel).map(|&byte| f64::from(byte)),
            Self::Words(words, range) => words.get(taxel).map(|&word| range.units(word)),
        }
    }

    /// Those of a range of taxels; none where it goes beyond the last.
    #[must_use]
    pub fn slice(self, taxels: Range<usize>) -> Counts<'a> {
        match self {
            Self::Bytes(bytes) => Self::Bytes(bytes.get(taxels).unwrap_or_default()),
            Self::Words(words, range) => Self::Words(words.get(taxels).unwrap_or_default(), range),
        }
    }

    /// Whether they may be counts of this range.
    #[must_use]
    pub fn fits(self, range: CountRange) -> bool {
        match self {
            Self::Bytes(_) => range.is_byte(),
            Self::Words(_, own) => own == range,
        }
    }

    /// All of them in units.
    pub fn iter_units(self) -> impl Iterator<Item = f64> + 'a {
        (0..self.len()).filter_map(move |taxel| self.units(taxel))
    }
}

impl<'a> From<&'a [u8]> for Counts<'a> {
    fn from(bytes: &'a [u8]) -> Self {
        Self::Bytes(bytes)
    }
}

impl<'a> From<&'a Vec<u8>> for Counts<'a> {
    fn from(bytes: &'a Vec<u8>) -> Self {
        Self::Bytes(bytes)
    }
}

impl<'a, const N: usize> From<&'a [u8; N]> for Counts<'a> {
    fn from(bytes: &'a [u8; N]) -> Self {
        Self::Bytes(bytes)
    }
}

/// The counts of taxels, owned, to be written to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CountBuffer {
    /// Of up to eight bits.
    Bytes(Vec<u8>),
    /// Of another range.
    Words(Vec<u16>, CountRange),
}

impl CountBuffer {
    /// So many zeros.
    #[must_use]
    pub fn new(taxels: usize, range: CountRange) -> Self {
        if range.is_byte() { Self::Bytes(vec![0; taxels]) } else { Self::Words(vec![0; taxels], range) }
    }

    /// What is in it.
    #[must_use]
    pub fn counts(&self) -> Counts<'_> {
        match self {
            Self::Bytes(bytes) => Counts::Bytes(bytes),
            Self::Words(words, range) => Counts::Words(words, *range),
        }
    }

    /// Writes raw counts from a taxel on; what goes beyond the last taxel or the range is cut.
    pub fn write(&mut self, first: usize, raw: &[u16]) {
        match self {
            Self::Bytes(bytes) => {
                let to = bytes.get_mut(first..).unwrap_or_default();
                to.iter_mut().zip(raw).for_each(|(to, &raw)| *to = raw.min(255) as u8);
            }
            Self::Words(words, range) => {
                let to = words.get_mut(first..).unwrap_or_default();
                to.iter_mut().zip(raw).for_each(|(to, &raw)| *to = raw.min(range.top()));
            }
        }
    }
}

/// The counts of one scan, shared by all who keep it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SharedCounts {
    /// Of up to eight bits.
    Bytes(Arc<[u8]>),
    /// Of another range.
    Words(Arc<[u16]>, CountRange),
}

impl SharedCounts {
    /// What is in it.
    #[must_use]
    pub fn counts(&self) -> Counts<'_> {
        match self {
            Self::Bytes(bytes) => Counts::Bytes(bytes),
            Self::Words(words, range) => Counts::Words(words, *range),
        }
    }
}

impl From<Counts<'_>> for SharedCounts {
    fn from(counts: Counts<'_>) -> Self {
        match counts {
            Counts::Bytes(bytes) => Self::Bytes(bytes.into()),
            Counts::Words(words, range) => Self::Words(words.into(), range),
        }
    }
}

impl From<Vec<u8>> for SharedCounts {
    fn from(bytes: Vec<u8>) -> Self {
        Self::Bytes(bytes.into())
    }
}

impl From<Arc<[u8]>> for SharedCounts {
    fn from(bytes: Arc<[u8]>) -> Self {
        Self::Bytes(bytes)
    }
}

impl From<&[u8]> for SharedCounts {
    fn from(bytes: &[u8]) -> Self {
        Self::Bytes(bytes.into())
    }
}

impl FromIterator<u8> for SharedCounts {
    fn from_iter<T: IntoIterator<Item = u8>>(counts: T) -> Self {
        Self::Bytes(counts.into_iter().collect())
    }
}
