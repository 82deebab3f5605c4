//! Kernel filters: exactly the wanted identifiers, so that no other frame wakes the process.

use taxel_wire::CanId;

/// Most filters that one socket takes (`CAN_RAW_FILTER_MAX`).
const FILTERS_MAX: usize = 512;
const EXTENDED: u32 = 0x8000_0000;
const REMOTE: u32 = 0x4000_0000;
const STANDARD_BITS: u32 = 0x7FF;
const EXTENDED_BITS: u32 = 0x1FFF_FFFF;

/// A frame passes if `frame id & mask == id & mask`, flags included.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Filter {
    pub id: u32,
    pub mask: u32,
}

/// What the socket is to let through.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Wanted {
    /// Every frame.
    All,
    /// These identifiers, data frames only.
    Only(Filters),
}

/// A list of identifiers as filters of the kernel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Filters {
    /// At most [`FILTERS_MAX`].
    pub kernel: Vec<Filter>,
    /// Sorted; only where the kernel cannot be exact, so that the rest is left out here.
    recheck: Option<Vec<CanId>>,
}

impl Wanted {
    pub fn new(ids: Option<&[CanId]>) -> Self {
        ids.map_or(Self::All, |ids| Self::Only(Filters::new(ids)))
    }

    /// Whether the process wants a data frame that the kernel let through.
    pub fn passes(&self, id: CanId) -> bool {
        match self {
            Self::Only(Filters { recheck: Some(ids), .. }) => ids.binary_search(&id).is_ok(),
            _ => true,
        }
    }
}

impl Filters {
    /// Exact filters, one an identifier: the kernel finds those by table, so blocks that share a mask, which it has
    /// to walk, only come in where the list is longer than a socket takes. If even the blocks are too many, the
    /// kernel lets all data frames through and the rest is sorted out here.
    fn new(ids: &[CanId]) -> Self {
        let mut ids = ids.to_vec();
        ids.sort_unstable();
        ids.dedup();
        let mut kernel: Vec<Filter> = ids.iter().map(|&id| exact(id)).collect();
        if kernel.len() > FILTERS_MAX {
            kernel = merged(kernel);
        }
        if kernel.len() <= FILTERS_MAX {
            return Self { kernel, recheck: None };
        }
        let flags = EXTENDED | REMOTE;
        let kernel = vec![Filter { id: 0, mask: flags }, Filter { id: EXTENDED, mask: flags }];
        Self { kernel, recheck: Some(ids) }
    }
}

fn exact(id: CanId) -> Filter {
    match id {
        CanId::Standard(id) => Filter { id: u32::from(id) & STANDARD_BITS, mask: STANDARD_BITS | EXTENDED | REMOTE },
        CanId::Extended(id) => Filter { id: id & EXTENDED_BITS | EXTENDED, mask: EXTENDED_BITS | EXTENDED | REMOTE },
    }
}

/// Joins neighbouring aligned blocks of equal size until none is left to join: the same identifiers, fewer filters.
fn merged(mut filters: Vec<Filter>) -> Vec<Filter> {
    filters.sort_unstable();
    for bit in 0..29 {
        let mut joined: Vec<Filter> = Vec::with_capacity(filters.len());
        for filter in filters {
            match joined.last_mut() {
                // The sort puts the two halves of a block of 2^(bit + 1) next to each other.
                Some(last)
                    if last.mask == filter.mask && last.mask >> bit & 1 == 1 && last.id ^ filter.id == 1 << bit =>
                {
                    last.mask &= !(1 << bit);
                }
                _ => joined.push(filter),
            }
        }
        filters = joined;
    }
    filters
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn accepts(filters: &[Filter], raw: u32) -> bool {
        filters.iter().any(|filter| raw & filter.mask == filter.id & filter.mask)
    }

    #[test]
    fn look_alikes_of_a_wanted_identifier_are_not_let_through() {
        let Wanted::Only(filters) = Wanted::new(Some(&[CanId::Standard(0x301)])) else { panic!() };
        assert!(accepts(&filters.kernel, 0x301));
        for raw in [0x301 | REMOTE, 0x301 | EXTENDED, 0x18AA_A301 | EXTENDED, 0x300, 0x303] {
            assert!(!accepts(&filters.kernel, raw), "{raw:X}");
        }
    }

    #[test]
    fn a_long_list_of_neighbours_stays_exact_by_blocks() {
        let ids: Vec<CanId> = (0x100..0x500).map(CanId::Standard).collect();
        let filters = Filters::new(&ids);
        assert_eq!(filters.kernel.len(), 3, "256 + 512 + 256: {:X?}", filters.kernel);
        assert_eq!(filters.recheck, None);
        for raw in 0..0x800 {
            assert_eq!(accepts(&filters.kernel, raw), (0x100..0x500).contains(&raw), "{raw:X}");
        }
    }

    #[test]
    fn what_no_512_filters_can_say_is_sorted_out_here() {
        // No two of these differ in one bit only, so none can share a mask.
        let even = |id: &u16| id.count_ones().is_multiple_of(2);
        let ids: Vec<CanId> = (0..0x800).filter(even).map(CanId::Standard).collect();
        let wanted = Wanted::new(Some(&ids));
        let Wanted::Only(filters) = &wanted else { panic!() };
        assert!(filters.kernel.len() <= FILTERS_MAX);
        assert!((0..0x800).all(|id| wanted.passes(CanId::Standard(id)) == even(&id)));
        assert!(!wanted.passes(CanId::Extended(0x11)));
    }

    #[test]
    fn an_empty_list_lets_nothing_through() {
        let Wanted::Only(filters) = Wanted::new(Some(&[])) else { panic!() };
        assert!(filters.kernel.is_empty());
    }

    proptest! {
        /// Merging may change the filters, never what they let through.
        #[test]
        fn merging_is_exact(ids in prop::collection::vec(0_u32..64, 0..64), probe in 0_u32..80, flags in 0_u32..4) {
            let wanted: Vec<CanId> = ids.iter().map(|&id| CanId::Extended(id)).collect();
            let raw = probe | flags << 30;
            let expected = flags == 2 && ids.contains(&probe);
            let distinct: BTreeSet<Filter> = wanted.iter().map(|&id| exact(id)).collect();
            let filters = merged(distinct.into_iter().collect());
            prop_assert_eq!(accepts(&filters, raw), expected);
        }
    }
}
