//! `[page]`: the operator's page, and the service as JSON; `[metrics]` for Prometheus.

use serde::Deserialize;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;

use super::fault::Fault;

/// Longest name of a host, in bytes.
const NAME_BYTES_MAX: usize = 253;

/// `[page]`; without it there is no page.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PageSection {
    /// Where it is served; loopback only.
    pub listen: SocketAddr,
    /// Names beside localhost by which it may be asked for: those of a proxy before it.
    pub hosts: Vec<String>,
    /// What is bound to that address already, by the demo: no file says so.
    #[serde(skip)]
    pub bound: Option<Arc<TcpListener>>,
}

impl Default for PageSection {
    fn default() -> Self {
        Self { listen: SocketAddr::from(([127, 0, 0, 1], 8_080)), hosts: Vec::new(), bound: None }
    }
}

/// `[metrics]`; without it there are none.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MetricsSection {
    /// Where they are served, at `/metrics`; loopback only. Absent: on the page's address.
    pub listen: Option<SocketAddr>,
}

/// What is wrong with the sections, if anything is.
pub fn problem(page: Option<&PageSection>, metrics: Option<&MetricsSection>) -> Option<Fault> {
    if metrics.is_some_and(|metrics| metrics.listen.is_none()) && page.is_none() {
        return Some(Fault::of("metrics", "[metrics]: without a [page] beside which to serve them, listen is needed"));
    }
    if let (Some(page), Some(listen)) = (page, metrics.and_then(|metrics| metrics.listen))
        && page.listen == listen
        && listen.port() != 0
    {
        let words = format!("metrics.listen = {listen} is page.listen: leave it out to serve both there");
        return Some(Fault::of("metrics.listen", words));
    }
    let foreign = listens(page, metrics).find(|(_, listen)| !listen.ip().is_loopback()).map(|(key, listen)| {
        let words = format!(
            "{key} = {listen}: only loopback addresses are served, nothing there is secured; from elsewhere come through \
             ssh -L or a proxy with TLS"
        );
        Fault::of(key, words)
    });
    foreign.or_else(|| strange_host(page?))
}

/// The addresses of page and metrics, each with its key.
pub fn listens(
    page: Option<&PageSection>,
    metrics: Option<&MetricsSection>,
) -> impl Iterator<Item = (&'static str, SocketAddr)> {
    let page = page.map(|page| ("page.listen", page.listen));
    let metrics = metrics.and_then(|metrics| Some(("metrics.listen", metrics.listen?)));
    page.into_iter().chain(metrics)
}

fn strange_host(section: &PageSection) -> Option<Fault> {
    let is_name = |host: &&String| {
        let known = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_');
        !host.is_empty() && host.len() <= NAME_BYTES_MAX && host.chars().all(known)
    };
    let strange = section.hosts.iter().find(|host| !is_name(host))?;
    let words = format!("page.hosts: {strange:?}: expected a name without scheme or port, as in \"robot.lab\"");
    Some(Fault::of("page.hosts", words))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_loopback_addresses_and_plain_names_are_taken() {
        let of = |listen: &str, host: &str| PageSection {
            listen: listen.parse().unwrap(),
            hosts: vec![host.to_owned()],
            bound: None,
        };
        for (listen, host) in [("127.0.0.1:8080", "robot.lab"), ("[::1]:1", "a"), ("127.9.9.9:0", "x-1.y_2")] {
            assert_eq!(problem(Some(&of(listen, host)), None), None);
        }
        for (listen, host) in [
            ("0.0.0.0:8080", "a"),
            ("10.0.0.1:1", "a"),
            ("[::]:1", "a"),
            ("127.0.0.1:1", ""),
            ("127.0.0.1:1", "robot:80"),
            ("127.0.0.1:1", "*"),
            ("127.0.0.1:1", "a b"),
        ] {
            assert!(problem(Some(&of(listen, host)), None).is_some(), "{listen} {host}");
        }
    }

    #[test]
    fn metrics_are_served_beside_the_page_or_on_a_loopback_address_of_their_own() {
        let page = PageSection::default();
        let at = |listen: Option<&str>| MetricsSection { listen: listen.map(|at| at.parse().unwrap()) };
        assert_eq!(problem(Some(&page), Some(&at(None))), None);
        assert_eq!(problem(None, Some(&at(Some("127.0.0.1:9464")))), None);
        assert!(problem(None, Some(&at(None))).is_some());
        assert!(problem(None, Some(&at(Some("0.0.0.0:9464")))).is_some());
        assert!(problem(Some(&page), Some(&at(Some("127.0.0.1:8080")))).is_some());
    }
}
