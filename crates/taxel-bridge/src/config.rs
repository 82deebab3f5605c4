//! `taxel-bridge.toml`: read, and refused with the place and what was expected.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use serde::Deserialize;

use crate::ros::name_of;
use crate::yarp::parts::{self, Part};

/// The whole file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// The robot's name, one word.
    pub robot: String,
    /// The daemon.
    #[serde(default)]
    pub daemon: DaemonSection,
    /// The way to the router.
    #[serde(default)]
    pub zenoh: ZenohSection,
    /// ROS 2 topics; left out, there are none.
    pub ros: Option<RosSection>,
    /// The robot in a fleet; left out, it is in none.
    pub fleet: Option<FleetSection>,
    /// YARP ports; left out, there are none.
    pub yarp: Option<YarpSection>,
    /// What is bridged, one section a patch.
    #[serde(rename = "patch")]
    pub patches: Vec<PatchSection>,
}

/// `[daemon]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DaemonSection {
    /// `unix:PATH`, `http://HOST:PORT` or `https://HOST:PORT`; left out, the local socket or loopback.
    pub server: Option<String>,
    /// File whose first line is the token to show.
    pub token_file: Option<PathBuf>,
    /// Folder of `ca.pem`, `client.pem` and `client.key`, for https.
    pub tls: Option<PathBuf>,
    /// The name in the daemon's certificate, if it is not the host's in `server`.
    pub tls_name: Option<String>,
}

/// `[zenoh]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ZenohSection {
    /// The router's endpoint, for example `tcp/localhost:7447`, which is the default.
    pub router: Option<String>,
    /// A configuration file of Zenoh (JSON5), for TLS and whatever else; `router` goes before its endpoints.
    pub config: Option<PathBuf>,
}

/// What carries ROS 2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Middleware {
    /// `rmw_fastrtps_cpp`, the default of ROS, or `rmw_cyclonedds_cpp`.
    #[default]
    Dds,
    /// `rmw_zenoh_cpp`.
    Zenoh,
}

/// `[ros]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RosSection {
    /// How the nodes speak that are to hear it.
    pub middleware: Middleware,
    /// `ROS_DOMAIN_ID`.
    pub domain: u16,
    /// Before all names; `/` for none, `/skin` if left out.
    pub namespace: Option<String>,
    /// Whether the service `tare` is offered to everybody on the router.
    pub tare: bool,
}

/// `[fleet]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FleetSection {
    /// The fleet's router, if it is another one than the robot's own.
    pub zenoh: Option<ZenohSection>,
    /// Force samples per second of each patch, 1 to 1000; 10 if left out.
    pub rate_hz: Option<f64>,
}

/// `[yarp]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct YarpSection {
    /// The name server, `ADDRESS:PORT`; left out, the one of YARP's own files.
    pub server: Option<String>,
    /// The name of the port of contacts; `/taxeld/skin_events:o` if left out.
    pub skin_events: Option<String>,
}

/// `[[patch]]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PatchSection {
    /// Its name at the daemon.
    pub name: String,
    /// The frame of its coordinates in tf; its name if left out.
    pub frame: Option<String>,
    /// Forces per second, 1 to 1000; left out, each new one as it comes.
    pub rate_hz: Option<f64>,
    /// Clouds of taxels per second, 1 to 1000; left out, there are none.
    pub taxels_hz: Option<f64>,
    /// Body part, link and skin part in the events of YARP, where its name is none of iCub's.
    pub part: Option<Part>,
}

impl PatchSection {
    /// The frame of its coordinates.
    pub fn frame(&self) -> &str {
        self.frame.as_deref().unwrap_or(&self.name)
    }

    /// Its numbers in the events.
    pub fn part(&self) -> Option<Part> {
        self.part.or_else(|| parts::named(&self.name))
    }
}

impl Config {
    /// Reads a file.
    ///
    /// # Errors
    /// Where it is not as expected.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let text = taxel_files::read_utf8(path).with_context(|| format!("reading {}", path.display()))?;
        Self::parse(&text).with_context(|| path.display().to_string())
    }

    /// Reads a text.
    ///
    /// # Errors
    /// Where it is not as expected.
    pub fn parse(text: &str) -> anyhow::Result<Self> {
        let config: Self = toml::from_str(text)?;
        config.check()?;
        Ok(config)
    }

    fn check(&self) -> anyhow::Result<()> {
        ensure!(is_robot(&self.robot), "robot = {:?}: expected 1 to 64 letters, digits, `_`, `-` or `.`", self.robot);
        ensure!(
            self.ros.is_some() || self.fleet.is_some() || self.yarp.is_some(),
            "neither [ros] nor [fleet] nor [yarp]: there is nothing to do"
        );
        self.ros.iter().try_for_each(RosSection::check)?;
        check_rate("fleet.rate_hz", self.fleet.as_ref().and_then(|fleet| fleet.rate_hz))?;
        if let Some(YarpSection { skin_events, .. }) = &self.yarp {
            let is_port = |name: &String| name.starts_with('/') && !name.contains(char::is_whitespace);
            let fits = skin_events.as_ref().is_none_or(is_port);
            ensure!(fits, "yarp.skin_events = {skin_events:?}: expected a name as in /taxeld/skin_events:o");
            if let Some(PatchSection { name, .. }) = self.patches.iter().find(|patch| patch.part().is_none()) {
                bail!("patch {name:?}: none of iCub's parts: write part = [3, 4, 2] (body part, link, skin part)");
            }
        }
        ensure!(!self.patches.is_empty(), "no [[patch]]: there is nothing to do");
        self.patches.iter().try_for_each(PatchSection::check)
    }
}

impl RosSection {
    fn check(&self) -> anyhow::Result<()> {
        // More would need UDP ports that do not exist; ROS refuses them too.
        ensure!(self.domain <= 232, "ros.domain = {}: expected 0 to 232", self.domain);
        let namespace = self.namespace();
        let fits = namespace == "/" || namespace.starts_with('/') && ros2_client::Name::parse(namespace).is_ok();
        ensure!(fits, "ros.namespace = {namespace:?}: expected `/` or, for example, `/icub/skin`");
        Ok(())
    }

    /// The node's namespace.
    pub fn namespace(&self) -> &str {
        self.namespace.as_deref().unwrap_or("/skin")
    }

    /// The absolute name of what is called `name` here.
    pub fn absolute(&self, name: &str) -> String {
        format!("{}/{name}", self.namespace().trim_end_matches('/'))
    }

    /// The absolute name of what is called `name` of a patch.
    pub fn of_patch(&self, patch: &str, name: &str) -> String {
        self.absolute(&format!("{}/{name}", name_of(patch)))
    }
}

impl PatchSection {
    fn check(&self) -> anyhow::Result<()> {
        let name = &self.name;
        // A patch's name is a chunk of a key in the fleet.
        ensure!(is_robot(name), "patch {name:?}: expected 1 to 64 letters, digits, `_`, `-` or `.`");
        let frame = self.frame();
        ensure!(!frame.is_empty() && !frame.starts_with('/'), "patch {name:?}: frame {frame:?} is none of tf2's");
        check_rate(&format!("patch {name:?}: rate_hz"), self.rate_hz)?;
        check_rate(&format!("patch {name:?}: taxels_hz"), self.taxels_hz)
    }
}

fn check_rate(key: &str, rate_hz: Option<f64>) -> anyhow::Result<()> {
    match rate_hz {
        Some(hz) if !(1.0..=1000.0).contains(&hz) => bail!("{key} = {hz}: expected 1 to 1000"),
        _ => Ok(()),
    }
}

/// Whether a text can be one chunk of a key in the fleet.
pub fn is_robot(text: &str) -> bool {
    (1..=64).contains(&text.len()) && text.chars().all(|c| c.is_ascii_alphanumeric() || "_-.".contains(c))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEAST: &str = "robot = \"icub\"\n[ros]\n[[patch]]\nname = \"left_forearm\"\n";

    #[test]
    fn the_least_file_has_defaults_for_the_rest() {
        let config = Config::parse(LEAST).unwrap();
        let ros = config.ros.unwrap();
        assert_eq!((ros.domain, ros.middleware, ros.tare), (0, Middleware::Dds, false));
        assert_eq!(ros.absolute("tare"), "/skin/tare");
        assert_eq!(RosSection { namespace: Some("/".into()), ..ros }.absolute("tare"), "/tare");
        let patch = &config.patches[0];
        assert_eq!(patch.frame(), "left_forearm");
        assert!(config.fleet.is_none());
    }

    #[test]
    fn the_example_of_the_documentation_is_accepted() {
        let example = include_str!("../../../deploy/taxel-bridge.toml");
        let config = Config::parse(example).unwrap();
        assert!(config.ros.is_some() && config.fleet.is_some());
    }

    #[test]
    fn a_pipe_is_no_configuration_and_holds_nothing_up() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("bridge.toml");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        assert!(format!("{:#}", Config::read(&pipe).unwrap_err()).contains("no regular file"));
    }

    #[test]
    fn what_cannot_be_is_refused_with_its_place() {
        let cases = [
            (LEAST.replace("icub", "i/cub"), "robot"),
            (LEAST.replace("icub", ""), "robot"),
            (LEAST.replace("[ros]", ""), "nothing to do"),
            (LEAST.replace("[ros]", "[ros]\ndomain = 233"), "ros.domain"),
            (LEAST.replace("[ros]", "[ros]\nnamespace = \"skin\""), "ros.namespace"),
            (LEAST.replace("[ros]", "[ros]\nnamespace = \"/a//b\""), "ros.namespace"),
            (LEAST.replace("[ros]", "[ros]\nnamespace = \"/skin/\""), "ros.namespace"),
            (LEAST.replace("[ros]", "[ros]\nnamespace = \"/1a\""), "ros.namespace"),
            (LEAST.replace("[ros]", "[ros]\nnamespace = \"/\u{e9}\""), "ros.namespace"),
            (LEAST.replace("[ros]", "[ros]\ncolour = 1"), "colour"),
            (LEAST.replace("[ros]", "[fleet]\nrate_hz = 0.5"), "fleet.rate_hz"),
            ("robot = \"a\"\npatch = []\n[ros]\n".to_owned(), "[[patch]]"),
            (format!("{LEAST}rate_hz = 0.5"), "rate_hz"),
            (format!("{LEAST}rate_hz = nan"), "rate_hz"),
            (format!("{LEAST}taxels_hz = 2000.0"), "taxels_hz"),
            (format!("{LEAST}frame = \"/arm\""), "frame"),
            (LEAST.replace("left_forearm", "a*"), "patch"),
            (LEAST.replace("[ros]", "[yarp]").replace("left_forearm", "glove"), "none of iCub's parts"),
            (LEAST.replace("[ros]", "[yarp]\nskin_events = \"a b\""), "expected a name as in"),
        ];
        for (text, place) in cases {
            let error = format!("{:#}", Config::parse(&text).unwrap_err());
            assert!(error.contains(place), "{text}\n{error}");
        }
    }
}
