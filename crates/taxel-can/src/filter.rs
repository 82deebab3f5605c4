//! Kernel filters from identifiers, exact: frames that nobody needs never wake the process.

use socketcan::CanFilter;
use taxel_wire::CanId;
use thiserror::Error;

/// The kernel takes so many filters per socket (CAN_RAW_FILTER_MAX).
pub const FILTERS_MAX: usize = 512;

const EXTENDED: u32 = libc::CAN_EFF_FLAG;
const FLAGS: u32 = libc::CAN_EFF_FLAG | libc::CAN_RTR_FLAG;

/// More filters than the kernel takes.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("{0} kernel filters are needed, at most {FILTERS_MAX} are possible: split the bus or enable fewer modules")]
pub struct TooManyFilters(pub usize);

/// An identifier and the bits of it that count, as the kernel has them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Filter {
    pub id: u32,
    pub mask: u32,
}

impl Filter {
    #[cfg(test)]
    fn lets_through(self, raw: u32) -> bool {
        raw & self.mask == self.id & self.mask
    }
}

impl From<Filter> for CanFilter {
    fn from(filter: Filter) -> Self {
        Self::new(filter.id, filter.mask)
    }
}

/// Filters for exactly `ids`. Each also demands that the frame is no remote frame and has the identifier's own width;
/// a filter without those bits would let such look-alikes pass. Aligned runs of standard identifiers share a filter.
pub(crate) fn filters(ids: &[CanId]) -> Result<Vec<Filter>, TooManyFilters> {
    let mut standard: Vec<u32> = Vec::new();
    let mut list = Vec::new();
    for id in ids {
        match *id {
            CanId::Standard(id) => standard.push(u32::from(id)),
            CanId::Extended(id) => list.push(Filter { id: id | EXTENDED, mask: libc::CAN_EFF_MASK | FLAGS }),
        }
    }
    standard.sort_unstable();
    standard.dedup();
    let mut rest = standard.as_slice();
    while let Some(&first) = rest.first() {
        let run = aligned_run(first, rest);
        list.push(Filter { id: first, mask: (libc::CAN_SFF_MASK & !(run as u32 - 1)) | FLAGS });
        rest = &rest[run..];
    }
    if list.len() > FILTERS_MAX { Err(TooManyFilters(list.len())) } else { Ok(list) }
}

/// The longest power of two that `first` is a multiple of and that many consecutive identifiers follow from.
fn aligned_run(first: u32, ids: &[u32]) -> usize {
    let mut run = 1;
    loop {
        let longer = run * 2;
        let whole = ids.get(longer - 1) == Some(&(first + longer as u32 - 1));
        if !whole || first % longer as u32 != 0 {
            return run;
        }
        run = longer;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_full_board_is_one_filter() {
        let ids: Vec<CanId> = (0x4D0..0x4E0).map(CanId::Standard).collect();
        assert_eq!(filters(&ids).unwrap(), [Filter { id: 0x4D0, mask: 0x7F0 | FLAGS }]);
    }

    #[test]
    fn too_many_scattered_identifiers_are_refused() {
        let ids: Vec<CanId> = (0..600).map(|i| CanId::Standard(i * 3)).collect();
        assert_eq!(filters(&ids), Err(TooManyFilters(600)));
    }

    proptest! {
        #[test]
        fn exactly_the_wanted_frames_pass(
            ids in proptest::collection::btree_set(0_u16..0x800, 0..300),
            extended in proptest::option::of(0_u32..0x2000_0000),
        ) {
            let wanted: Vec<CanId> =
                ids.iter().map(|&id| CanId::Standard(id)).chain(extended.map(CanId::Extended)).collect();
            let list = filters(&wanted).unwrap();
            let passes = |raw: u32| list.iter().any(|f| f.lets_through(raw));
            for id in 0..0x800_u16 {
                let raw = u32::from(id);
                prop_assert_eq!(passes(raw), ids.contains(&id));
                prop_assert!(!passes(raw | libc::CAN_RTR_FLAG), "remote frame");
                prop_assert_eq!(passes(raw | EXTENDED), extended == Some(raw), "extended look-alike");
            }
            if let Some(id) = extended {
                prop_assert!(passes(id | EXTENDED));
            }
        }
    }
}
