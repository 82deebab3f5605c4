//! At how many places of a skin loads were laid.

/// The place of each load, counted from 0, by the taxels that felt it, ascending.
///
/// Two loads lie at one place if they share more than half of the taxels of the smaller one. One of which no taxel is known
/// makes no place more.
pub fn places<'a>(loads: impl IntoIterator<Item = &'a [u16]>) -> Vec<usize> {
    let mut first: Vec<&[u16]> = Vec::new();
    let place = |felt: &'a [u16]| {
        let known = first.iter().position(|known| felt.is_empty() || same(known, felt));
        known.unwrap_or_else(|| {
            first.extend((!felt.is_empty()).then_some(felt));
            first.len().saturating_sub(1)
        })
    };
    loads.into_iter().map(place).collect()
}

fn same(a: &[u16], b: &[u16]) -> bool {
    let shared = a.iter().filter(|taxel| b.binary_search(taxel).is_ok()).count();
    2 * shared > a.len().min(b.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn disc(centre: u16) -> Vec<u16> {
        (centre - 5..centre + 5).collect()
    }

    fn of(loads: &[Vec<u16>]) -> Vec<usize> {
        places(loads.iter().map(Vec::as_slice))
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
    fn a_load_whose_place_is_not_known_makes_no_place_more() {
        assert_eq!(of(&[vec![], disc(20), vec![], disc(60), vec![]]), [0, 0, 0, 1, 0]);
    }
}
