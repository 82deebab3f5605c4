//! Kernel filters: exactly the wanted identifiers, so that no other frame wakes the process.

use taxel_wire::CanId;

/// Most filters that one socket takes (`CAN_RAW_FILTER_MAX`).
const FILTERS_MAX: usize = 512;
const EXTENDED: u32 = 0x8000_0000;
const REMOTE: u32 = 0x4000_0000;
const STANDARD_BITS: u32 = 0x7FF;
const EXTENDED_BITS: u32 = 0x1FFF_FFFF;

/// Identifier and mask: a frame passes if `frame id & mask == id & mask`, flags included.
pub(crate) type Filter = (u32, u32);

/// Data frames of these identifiers. More than a socket takes are those of eleven full skin boards: then all data frames
/// come, since most of them are wanted.
pub(crate) fn filters(ids: &[CanId]) -> Vec<Filter> {
    let flags = EXTENDED | REMOTE;
    if ids.len() > FILTERS_MAX {
        return vec![(0, flags), (EXTENDED, flags)];
    }
    let exact = |id: &CanId| match *id {
        CanId::Standard(id) => (u32::from(id) & STANDARD_BITS, STANDARD_BITS | flags),
        CanId::Extended(id) => (id & EXTENDED_BITS | EXTENDED, EXTENDED_BITS | flags),
    };
    ids.iter().map(exact).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn accepts(filters: &[Filter], raw: u32) -> bool {
        filters.iter().any(|(id, mask)| raw & mask == id & mask)
    }

    #[test]
    fn look_alikes_of_a_wanted_identifier_are_not_let_through() {
        let only = filters(&[CanId::Standard(0x301)]);
        assert!(accepts(&only, 0x301));
        for raw in [0x301 | REMOTE, 0x301 | EXTENDED, 0x18AA_A301 | EXTENDED, 0x300, 0x303] {
            assert!(!accepts(&only, raw), "{raw:X}");
        }
        assert!(filters(&[]).is_empty(), "an empty list lets nothing through");
    }

    #[test]
    fn of_more_than_a_socket_takes_all_data_frames_come() {
        let ids: Vec<CanId> = (0..=FILTERS_MAX as u16).map(CanId::Standard).collect();
        let all = filters(&ids);
        assert!(accepts(&all, 0x7FF) && accepts(&all, 0x18AA_A301 | EXTENDED) && !accepts(&all, 0x301 | REMOTE));
    }
}
