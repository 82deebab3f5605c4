//! `[service]`: how much of the service there is.

use std::net::SocketAddr;

use serde::Deserialize;
use taxel_rpc::Limits;

use super::fault::Fault;

/// More connections or streams than any machine serves.
const COUNT_MAX: usize = 100_000;

/// `[service]`
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ServiceSection {
    /// Where gRPC is served; loopback only. Absent, 127.0.0.1:50051, unless there is a `[[listen]]`.
    pub listen: Option<SocketAddr>,
    /// Most streams at a time; absent, [`ServiceSection::streams`] says how many.
    pub subscribers_max: Option<usize>,
    /// Of one peer: an account on the Unix socket, a certificate, or an address; absent, [`ServiceSection::streams_of_one`]
    /// says how many.
    pub subscribers_per_peer_max: Option<usize>,
    /// Most connections at a time.
    pub connections_max: usize,
}

impl Default for ServiceSection {
    fn default() -> Self {
        Self { listen: None, subscribers_max: None, subscribers_per_peer_max: None, connections_max: 128 }
    }
}

impl ServiceSection {
    /// Most streams at a time.
    pub fn streams(&self) -> usize {
        self.subscribers_max.unwrap_or(128)
    }

    /// Most streams of one peer at a time.
    pub fn streams_of_one(&self) -> usize {
        let limits = Limits::default();
        let some = of_one(self.streams(), limits.streams_reserved, limits.streams_per_peer);
        self.subscribers_per_peer_max.unwrap_or(some)
    }

    /// Most connections of one peer at a time.
    pub fn connections_of_one(&self) -> usize {
        let limits = Limits::default();
        of_one(self.connections_max, 0, limits.connections_per_peer)
    }

    /// What is wrong with the section, if anything is.
    pub fn problem(&self) -> Option<Fault> {
        let counts = [
            ("service.subscribers_max", self.streams()),
            ("service.subscribers_per_peer_max", self.streams_of_one()),
            ("service.connections_max", self.connections_max),
        ];
        let (key, count) = counts.into_iter().find(|(_, count)| !(1..=COUNT_MAX).contains(count))?;
        Some(Fault::of(key, format!("{key} = {count}: expected 1 to {COUNT_MAX}")))
    }
}

/// Of so many places in all, of which some are kept for operators: however few there are, one peer does not take all the others.
fn of_one(all: usize, reserved: usize, most: usize) -> usize {
    most.min((all - reserved.min(all / 2)).saturating_mul(9) / 10).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_there_are_few_places_one_peer_does_not_take_them_all() {
        let read = |text: &str| toml::from_str::<ServiceSection>(text).unwrap();
        let of_one = |text: &str| (read(text).streams_of_one(), read(text).connections_of_one());
        assert_eq!(of_one(""), (100, 96));
        assert_eq!(of_one("subscribers_max = 2\nconnections_max = 20"), (1, 18));
        assert_eq!(of_one("subscribers_max = 2\nsubscribers_per_peer_max = 2").0, 2, "as it says");
    }

    #[test]
    fn a_count_of_nothing_or_beyond_any_machine_is_refused() {
        let read = |text: &str| toml::from_str::<ServiceSection>(text).unwrap();
        assert_eq!((read("").streams(), read("").problem()), (128, None));
        assert_eq!((read("subscribers_max = 1000").streams(), read("subscribers_max = 1000").problem()), (1000, None));
        assert!(
            read("subscribers_max = 9223372036854775807").problem().unwrap().words().contains("expected 1 to 100000")
        );
        for key in ["subscribers_max", "subscribers_per_peer_max", "connections_max"] {
            let fault = read(&format!("{key} = 0")).problem().unwrap();
            let expected = format!("service.{key} = 0: expected 1 to 100000");
            assert_eq!((fault.key(), fault.words()), (format!("service.{key}").as_str(), expected.as_str()));
        }
    }
}
