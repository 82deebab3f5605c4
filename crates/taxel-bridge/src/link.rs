//! The way to a router of Zenoh.

use anyhow::{Context, anyhow};
use zenoh::Session;

use crate::config::ZenohSection;

/// Where the router of `rmw_zenoh` listens.
const ROUTER: &str = "tcp/localhost:7447";

/// Zenoh's configuration of a client of one router, which is waited for. It sends no multicast and listens to nobody.
///
/// # Errors
/// If the file cannot be used, or the endpoint is none.
pub fn configuration(section: &ZenohSection) -> anyhow::Result<zenoh::Config> {
    let mut config = match &section.config {
        Some(path) => {
            zenoh::Config::from_file(path).map_err(|error| anyhow!("zenoh.config {}: {error}", path.display()))?
        }
        None => zenoh::Config::default(),
    };
    let mut set = |key: &str, value: &str| {
        config.insert_json5(key, value).map_err(|error| anyhow!("zenoh: {key} = {value}: {error}"))
    };
    set("mode", "\"client\"")?;
    set("scouting/multicast/enabled", "false")?;
    set("connect/timeout_ms", "-1")?;
    if let Some(router) = section.router.as_deref().or(section.config.is_none().then_some(ROUTER)) {
        set("connect/endpoints", &serde_json::json!([router]).to_string())?;
    }
    Ok(config)
}

/// Opens a session. Zenoh waits for a router that cannot be reached, and finds one again that goes away later.
///
/// # Errors
/// If the configuration cannot be used.
pub async fn open(section: &ZenohSection) -> anyhow::Result<Session> {
    tracing::info!("waits for the router");
    let session = tried("the router", zenoh::open(configuration(section)?).await)?;
    tracing::info!("the router is there");
    Ok(session)
}

/// Zenoh's errors as everybody else's.
///
/// # Errors
/// The given one, with what was tried.
pub fn tried<T>(what: &str, result: zenoh::Result<T>) -> anyhow::Result<T> {
    result.map_err(|error| anyhow!("{error}")).with_context(|| what.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_router_goes_before_what_the_file_says_and_a_bad_endpoint_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("zenoh.json5");
        std::fs::write(&file, "{ mode: 'peer', connect: { endpoints: ['tcp/fleet:7447'] } }").unwrap();
        let config = Some(file);
        let endpoints = |section: &ZenohSection| configuration(section).unwrap().get_json("connect/endpoints").unwrap();
        let mode = |section: &ZenohSection| configuration(section).unwrap().get_json("mode").unwrap();
        assert!(endpoints(&ZenohSection::default()).contains("tcp/localhost:7447"));
        let of_file = ZenohSection { router: None, config };
        assert!(endpoints(&of_file).contains("tcp/fleet:7447"));
        assert_eq!(mode(&of_file), "\"client\"");
        let both = ZenohSection { router: Some("tcp/other:7447".into()), ..of_file };
        assert!(endpoints(&both).contains("tcp/other:7447"));
        let bad = ZenohSection { router: Some("nowhere".into()), config: None };
        let error = format!("{:#}", configuration(&bad).unwrap_err());
        assert!(error.contains("nowhere"), "{error}");
        let none = ZenohSection { router: None, config: Some(folder.path().join("none.json5")) };
        assert!(format!("{:#}", configuration(&none).unwrap_err()).contains("none.json5"));
    }
}
