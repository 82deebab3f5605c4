//! What plays may have lived through where nobody has watched them.
//!
//! A play keeps the order of two histories: of two that see the same counts from now on, the one whose play stands
//! higher stays so, until both stand alike. So the histories in which the pressure only rose and only fell enclose all
//! others, now and for ever after, and they meet when the count has moved by twice the radius, or is at rest again.

use taxel_model::{PlayState, Plays, Sign};

/// Half the width of the loop, sum of w_k r_k, kPa: twice that is the most that a history can take from the curve.
pub(super) fn half_width_kpa(plays: &Plays) -> f64 {
    plays.weights_kpa.iter().zip(plays.radii_counts).map(|(weight, radius)| weight * radius).sum()
}

/// Where plays stand at `count` if the pressure only rose from rest since it was gone last: no history adds more.
pub(super) fn risen(plays: &Plays, count: f64) -> PlayState {
    let rest = match plays.sign {
        Sign::Rising => plays.range[0],
        Sign::Falling => plays.range[1],
    };
    through(plays, rest, count)
}

/// Where they stand if it fell there from far above, be it from beyond the calibrated range: no history adds less.
pub(super) fn fallen(plays: &Plays, count: f64) -> PlayState {
    let greatest = plays.radii_counts.iter().copied().fold(0.0, f64::max);
    through(plays, count + 2.0 * plays.sign.as_f64() * greatest, count)
}

/// From one count straight to another.
fn through(plays: &Plays, from: f64, to: f64) -> PlayState {
    let mut state = PlayState::default();
    plays.bend_kpa(&mut state, from);
    plays.bend_kpa(&mut state, to);
    state
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn plays(sign: Sign) -> Plays {
        Plays { range: [175.0, 225.0], sign, ..crate::force::tests::plays() }
    }

    proptest! {
        #[test]
        fn no_history_adds_more_than_the_one_that_rose_or_less_than_the_one_that_fell(
            past in proptest::collection::vec(150.0..250.0_f64, 0..20),
            path in proptest::collection::vec(150.0..250.0_f64, 1..20),
            rising: bool,
        ) {
            let plays = plays(if rising { Sign::Rising } else { Sign::Falling });
            let mut any = PlayState::default();
            for count in past {
                plays.bend_kpa(&mut any, count);
            }
            let (mut most, mut least) = (risen(&plays, path[0]), fallen(&plays, path[0]));
            let (mut low, mut high) = (path[0], path[0]);
            for count in path {
                (low, high) = (low.min(count), high.max(count));
                let [most, any, least] =
                    [&mut most, &mut any, &mut least].map(|state| plays.bend_kpa(state, count));
                prop_assert!(least <= any + 1e-9 && any <= most + 1e-9, "{least} {any} {most}");
                prop_assert!(most - least <= 2.0 * half_width_kpa(&plays) + 1e-9);
                let beyond_rest = if rising { low <= plays.range[0] } else { high >= plays.range[1] };
                if high - low >= 2.0 * plays.radii_counts[1] || beyond_rest {
                    prop_assert!((most - least).abs() < 1e-9, "they have met: {least} {most}");
                }
            }
        }
    }
}
