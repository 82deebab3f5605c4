//! Whether a request comes from where it may: a browser lends its reach to every page that it shows, so a page from
//! elsewhere must get nothing, whatever name it gives to this address.

use axum::http::header::{HOST, HeaderName, ORIGIN};
use axum::http::{HeaderMap, Uri};
use std::net::IpAddr;
use taxel_proto::refusal::Refusal;
use taxel_proto::v1::ErrorReason;
use tonic::{Code, Status};

/// Where a browser says that a request comes from, seen from the site that it goes to.
const SEC_FETCH_SITE: HeaderName = HeaderName::from_static("sec-fetch-site");

/// Refuses a request for a name that is not this machine's: "DNS rebinding" gives a name of its own to our address.
/// `names` are those of a proxy before the page.
pub(crate) fn check_host(uri: &Uri, headers: &HeaderMap, names: &[String]) -> Result<(), Status> {
    let host = host(headers)?;
    let asked = [Some(host), uri.authority().map(|authority| authority.as_str())];
    for authority in asked.into_iter().flatten() {
        if !is_ours(authority, names) {
            let short: String = authority.chars().take(100).collect();
            return Err(refused(format!(
                "`{short}` is no name of this page: it answers to localhost, to loopback addresses, and to page.hosts of the configuration"
            )));
        }
    }
    Ok(())
}

/// Refuses a request that a page from elsewhere made. Who is no browser says nothing of all this and passes.
pub(crate) fn check_origin(headers: &HeaderMap) -> Result<(), Status> {
    let foreign = |from: &str| {
        let short: String = from.chars().take(100).collect();
        refused(format!("a page of `{short}` may not call this service"))
    };
    if let Some(origin) = headers.get(ORIGIN) {
        let origin = origin.to_str().unwrap_or("?");
        let own = origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://"));
        if own != Some(host(headers)?) || headers.get_all(ORIGIN).iter().count() != 1 {
            return Err(foreign(origin));
        }
    }
    match headers.get(&SEC_FETCH_SITE).map(|site| site.as_bytes()) {
        None | Some(b"same-origin" | b"none") => Ok(()),
        Some(site) => Err(foreign(&String::from_utf8_lossy(site))),
    }
}

fn refused(text: String) -> Status {
    Refusal::new(Code::PermissionDenied, ErrorReason::RoleTooLow, text).into()
}

/// The one `Host` of a request.
fn host(headers: &HeaderMap) -> Result<&str, Status> {
    let mut all = headers.get_all(HOST).iter();
    match (all.next().and_then(|host| host.to_str().ok()), all.next()) {
        (Some(host), None) => Ok(host),
        _ => Err(Refusal::unreadable("expected one Host header").into()),
    }
}

fn is_ours(authority: &str, names: &[String]) -> bool {
    let name = match authority.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|b| b.is_ascii_digit()) => name,
        _ => authority,
    };
    let bare = name.strip_prefix('[').and_then(|inner| inner.strip_suffix(']')).unwrap_or(name);
    let loopback = bare.parse::<IpAddr>().is_ok_and(|address| address.is_loopback());
    loopback || name.eq_ignore_ascii_case("localhost") || names.iter().any(|known| name.eq_ignore_ascii_case(known))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(HeaderName, &str)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (name.clone(), value.parse().unwrap())).collect()
    }

    fn host_is_ours(host: &str) -> bool {
        check_host(&Uri::from_static("/"), &headers(&[(HOST, host)]), &["robot.lab".to_owned()]).is_ok()
    }

    #[test]
    fn this_machine_answers_to_its_own_names_alone() {
        for host in
            ["localhost", "LOCALHOST:8080", "127.0.0.1:9", "127.8.8.8", "[::1]:8080", "robot.lab", "Robot.Lab:80"]
        {
            assert!(host_is_ours(host), "{host}");
        }
        for host in [
            "",
            "evil.example",
            "localhost.evil.example",
            "127.0.0.1.evil.example:80",
            "10.0.0.1",
            "[::2]",
            "robot.lab.evil",
            "evil:80:localhost",
            "localhost:x",
            "user@localhost",
            "0.0.0.0",
            "2130706433",
        ] {
            assert!(!host_is_ours(host), "{host}");
        }
    }

    #[test]
    fn a_page_from_elsewhere_gets_nothing_and_curl_needs_to_say_nothing() {
        let host = (HOST, "localhost:8080");
        let origin = |origin| check_origin(&headers(&[host.clone(), (ORIGIN, origin)])).is_ok();
        assert!(check_origin(&headers(std::slice::from_ref(&host))).is_ok());
        assert!(origin("http://localhost:8080") && origin("https://localhost:8080"));
        for other in [
            "null",
            "http://localhost",
            "http://localhost:8081",
            "http://evil.example",
            "file://",
            "http://localhost:8080.evil",
        ] {
            assert!(!origin(other), "{other}");
        }
        for (site, ours) in
            [("same-origin", true), ("none", true), ("same-site", false), ("cross-site", false), ("?", false)]
        {
            assert_eq!(check_origin(&headers(&[host.clone(), (SEC_FETCH_SITE, site)])).is_ok(), ours, "{site}");
        }
    }
}
