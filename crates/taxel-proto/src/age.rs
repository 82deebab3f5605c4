//! How old a sample may become.

use std::time::Duration;

use crate::v1::{ForceSample, TaxelSample};

impl ForceSample {
    /// The oldest that this sample may become and still be a force: what its daemon says, or the reader's own limit if
    /// that is stricter. Nothing where the daemon says none: a force of unknown worth is none.
    #[must_use]
    pub fn max_age(&self, own: Option<Duration>) -> Duration {
        own.map_or(limit(self.max_age_s), |own| own.min(limit(self.max_age_s)))
    }
}

impl TaxelSample {
    /// The oldest that a taxel's reading may become and still be one; nothing where the daemon says none.
    #[must_use]
    pub fn max_age(&self) -> Duration {
        limit(self.max_age_s)
    }
}

fn limit(max_age_s: f64) -> Duration {
    Duration::try_from_secs_f64(max_age_s).unwrap_or(Duration::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_is_the_daemons_or_a_stricter_one_of_the_reader() {
        let ms = Duration::from_millis;
        let sample = |max_age_s| ForceSample { max_age_s, ..ForceSample::default() };
        assert_eq!(sample(0.627).max_age(None), ms(627));
        assert_eq!(sample(0.627).max_age(Some(ms(120))), ms(120));
        assert_eq!(sample(0.15).max_age(Some(ms(1_000))), ms(150));
        for none in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(sample(none).max_age(None), Duration::ZERO, "{none}");
        }
    }
}
