//! At how many places of a skin loads were laid.

/// The places of loads, each as the taxels that felt it, ascending, on a patch of so many taxels.
///
/// Two loads lie at one place if they share more than half of the taxels of the smaller one. A load that at least half of
/// the patch felt is a place of its own: it says something of the whole skin wherever it lies. One of which it is not
/// known which taxels felt it (of an earlier version) lies where the other such loads lie.
#[must_use]
pub fn places<'a>(loads: impl IntoIterator<Item = &'a [u16]>, patch_taxels: usize) -> usize {
    let mut found: Vec<&[u16]> = Vec::new();
    for felt in loads {
        let everywhere = 2 * felt.len() >= patch_taxels.max(1);
        if everywhere || !found.iter().any(|known| same(known, felt)) {
            found.push(felt);
        }
    }
    found.len()
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

    fn count(loads: &[Vec<u16>]) -> usize {
        places(loads.iter().map(Vec::as_slice), 100)
    }

    #[test]
    fn loads_that_share_most_of_their_taxels_lie_at_one_place() {
        assert_eq!(count(&[]), 0);
        assert_eq!(count(&[disc(20), disc(20), disc(22)]), 1);
        assert_eq!(count(&[disc(20), disc(26), disc(60)]), 3);
        // A fingertip within the place of a mass.
        assert_eq!(count(&[disc(20), vec![19, 20, 21]]), 1);
    }

    #[test]
    fn a_load_on_half_of_the_patch_is_a_place_of_its_own_and_an_unknown_one_is_none_beside_its_like() {
        let half: Vec<u16> = (0..50).collect();
        assert_eq!(count(&[half.clone(), half.clone(), half]), 3);
        assert_eq!(count(&[vec![], vec![], vec![]]), 1);
        assert_eq!(count(&[vec![], disc(20), disc(60)]), 3);
    }

    proptest! {
        /// More loads never make fewer places, and there are never more places than loads.
        #[test]
        fn places_grow_with_loads(centres in proptest::collection::vec(5_u16..95, 0..12)) {
            let loads: Vec<_> = centres.iter().map(|centre| disc(*centre)).collect();
            let counts: Vec<_> = (0..=loads.len()).map(|n| count(&loads[..n])).collect();
            prop_assert!(counts.windows(2).all(|pair| pair[0] <= pair[1] && pair[1] <= pair[0] + 1), "{counts:?}");
        }
    }
}
