//! At how many places of a skin loads were laid.

use crate::loads::load::Load;

/// Loads at fewer places tell nothing of how much the skin differs from place to place.
pub const PLACES_MIN: usize = 3;

/// Where loads were laid.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LaidAt {
    /// The place of each load, counted from 0.
    pub place: Vec<usize>,
    /// How many places they are known to have lain at.
    pub known: usize,
    /// Of how many loads it is not known where they lay. They may lie at one of the others, and make no place more.
    pub unplaced: usize,
}

impl LaidAt {
    /// Of these loads.
    pub fn of(loads: &[&Load]) -> Self {
        let felt: Vec<&[u16]> = loads.iter().map(|load| load.read.taxels.as_slice()).collect();
        let unplaced = felt.iter().filter(|taxels| taxels.is_empty()).count();
        let place = places(&felt);
        let known = place.iter().max().map_or(0, |last| last + 1) - usize::from(unplaced > 0);
        Self { place, known, unplaced }
    }

    /// Why they say nothing of the whole skin, in words.
    pub fn too_few(&self) -> Option<String> {
        let (loads, known, unplaced) = (self.place.len(), self.known, self.unplaced);
        let old = if unplaced > 0 {
            format!(" (of {unplaced} it is not known where they lay: lay them again)")
        } else {
            String::new()
        };
        (known < PLACES_MIN).then(|| {
            format!(
                "the {loads} loads lie at {known} of at least {PLACES_MIN} places{old}, and another place may differ: lay \
                 loads where other taxels feel them"
            )
        })
    }
}

/// The place of each load, counted from 0, by the taxels that felt it, ascending.
///
/// Two loads lie at one place if they share more than half of the taxels of the smaller one. Those of which it is not known
/// which taxels felt them lie at one place together.
fn places(loads: &[&[u16]]) -> Vec<usize> {
    let mut first: Vec<&[u16]> = Vec::new();
    let mut found = Vec::with_capacity(loads.len());
    for &felt in loads {
        let known = first.iter().position(|known| same(known, felt));
        found.push(known.unwrap_or(first.len()));
        if known.is_none() {
            first.push(felt);
        }
    }
    found
}

fn same(a: &[u16], b: &[u16]) -> bool {
    let shared = a.iter().filter(|taxel| b.binary_search(taxel).is_ok()).count();
    2 * shared > a.len().min(b.len()) || (a.is_empty() && b.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn disc(centre: u16) -> Vec<u16> {
        (centre - 5..centre + 5).collect()
    }

    fn of(loads: &[Vec<u16>]) -> Vec<usize> {
        places(&loads.iter().map(Vec::as_slice).collect::<Vec<_>>())
    }

    #[test]
    fn loads_that_share_most_of_their_taxels_lie_at_one_place() {
        assert_eq!(of(&[]), [0; 0]);
        assert_eq!(of(&[disc(20), disc(60), disc(22), disc(26)]), [0, 1, 0, 2]);
        // A fingertip within the place of a mass, and masses that the whole patch feels.
        assert_eq!(of(&[disc(20), vec![19, 20, 21]]), [0, 0]);
        assert_eq!(of(&[disc(20), disc(20), disc(20)]), [0, 0, 0]);
    }

    #[test]
    fn loads_whose_place_is_not_known_are_one_place() {
        assert_eq!(of(&[vec![], disc(20), vec![], vec![]]), [0, 1, 0, 0]);
    }
}
