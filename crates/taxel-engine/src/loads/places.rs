//! At how many places of a skin loads were laid.

/// The place of each load, counted from 0, by the taxels that felt it, ascending.
///
/// Two loads lie at one place if they share more than half of the taxels of the smaller one. Those of which it is not known
/// which taxels felt them (of an earlier version) lie at one place together.
#[must_use]
pub fn places(loads: &[&[u16]]) -> Vec<usize> {
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
    use proptest::prelude::*;

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

    proptest! {
        /// Places are numbered as they come, and a load that is there twice is at one place.
        #[test]
        fn places_are_numbered_as_they_come(centres in proptest::collection::vec(5_u16..95, 0..12)) {
            let loads: Vec<_> = centres.iter().map(|centre| disc(*centre)).collect();
            let found = of(&loads);
            let mut next = 0;
            for place in &found {
                prop_assert!(*place <= next, "{found:?}");
                next = next.max(place + 1);
            }
            let twice: Vec<_> = loads.iter().chain(&loads).cloned().collect();
            prop_assert_eq!(of(&twice), [found.as_slice(), found.as_slice()].concat());
        }
    }
}
