//! The engine's part of the stability suite, see [`taxel_model::stability`]: the gates of a calibration session, and what
//! has a memory in time.

mod gates;
mod time_steps;

use taxel_model::stability::Group;

/// The cases.
pub const GROUPS: [Group; 2] = [("gates", gates::cases), ("time_steps", time_steps::cases)];

#[cfg(test)]
mod tests {
    use super::GROUPS;
    use taxel_model::stability::failures;

    #[test]
    fn sessions_keep_what_a_broken_ramp_brings_out_of_the_fit() {
        assert_eq!(failures(&GROUPS[0]), [""; 0]);
    }

    #[test]
    fn steps_of_any_length_in_time_are_followed_alike() {
        assert_eq!(failures(&GROUPS[1]), [""; 0]);
    }
}
