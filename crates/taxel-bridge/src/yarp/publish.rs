//! When what goes out on which port.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, SystemTime};

use anyhow::Context;
use taxel_client::{Force, Forces};
use taxel_proto::Timestamp;
use taxel_yarp::{NameServer, OutPort, Value};
use tokio::time::sleep;

use super::messages::{Layout, contact, force, pressures};
use super::parts::Part;
use crate::config::{PatchSection, YarpSection};
use crate::daemon::{Daemon, Taxels};
use crate::ticks;

/// The port of contacts, unless it takes skinManager's name.
pub const EVENTS: &str = "/taxeld/skin_events:o";
/// Contacts go out as often as skinManager sends them.
const EVENTS_EVERY: Duration = Duration::from_millis(20);
/// Pressures go out so often: a skin of iCub has no more new ones.
pub const PRESSURES_HZ: f64 = 20.0;
/// That there is no force is said so often.
const NO_FORCE_EVERY: Duration = Duration::from_millis(100);
/// Between two attempts to open a port.
const AGAIN_AFTER: Duration = Duration::from_secs(1);

/// The ports of this bridge.
#[derive(Clone)]
pub struct Ports {
    server: NameServer,
    /// The names that were taken, to be given back at the end. Another program's are not touched.
    taken: Arc<Mutex<Vec<String>>>,
}

impl Ports {
    /// Those of the name server that is configured, or that YARP's own files name.
    ///
    /// # Errors
    /// Where neither names one.
    pub fn of(section: &YarpSection) -> anyhow::Result<Self> {
        let server = NameServer::of(section.server.as_deref()).context("yarp")?;
        Ok(Self { server, taken: Arc::default() })
    }

    /// Opens a port as soon as the name server is there and the name is free.
    async fn open(&self, name: &str) -> OutPort {
        let mut told = String::new();
        loop {
            let why = match OutPort::open(&self.server, name).await {
                Ok(port) => {
                    self.taken.lock().unwrap_or_else(PoisonError::into_inner).push(name.to_owned());
                    return port;
                }
                Err(error) => error.to_string(),
            };
            if told != why {
                tracing::warn!(port = name, "not opened: {why}");
                told = why;
            }
            sleep(AGAIN_AFTER).await;
        }
    }

    /// Takes the names back, for as long as a name server takes to answer.
    pub async fn give_back(&self) {
        let names = std::mem::take(&mut *self.taken.lock().unwrap_or_else(PoisonError::into_inner));
        for name in names {
            if let Err(error) = self.server.unregister(&name).await {
                tracing::warn!(port = name, "its name was not taken back: {error}");
                return;
            }
        }
    }
}

/// Seconds since 1970 of the newest frame of a sample, or now where there is none.
fn seconds(time: Option<Timestamp>) -> f64 {
    let time = time.unwrap_or_else(|| SystemTime::now().into());
    time.seconds as f64 + f64::from(time.nanos) * 1e-9
}

/// Sends each force as it comes, and ten times a second that there is none.
pub async fn forces(ports: Ports, name: String, mut forces: Forces) -> anyhow::Result<()> {
    let mut port = ports.open(&name).await;
    let mut tick = ticks(NO_FORCE_EVERY);
    loop {
        let came = tokio::select! {
            () = forces.changed() => true,
            _ = tick.tick() => false,
        };
        let newest = forces.force();
        match &newest {
            Ok(force_now) if came => port.send(seconds(force_now.sample.time), &force(&newest)),
            Ok(_) => {}
            Err(_) => port.send(seconds(None), &force(&newest)),
        }
    }
}

/// Sends the pressures of all rows as they come; when a stream has ended, that there are none.
pub async fn taxels(ports: Ports, name: String, mut taxels: Taxels) -> anyhow::Result<()> {
    let mut port = ports.open(&name).await;
    let mut rows = 0;
    loop {
        if let Some((skin, sample, waited)) = taxels.next().await {
            let layout = Layout::new(skin);
            rows = layout.rows;
            let kpa = pressures(&sample, &layout, waited).into_iter().map(Value::Float);
            port.send(seconds(sample.time), &kpa.collect::<Vec<_>>());
        } else {
            port.send(seconds(None), &vec![Value::Float(f64::NAN); rows]);
        }
    }
}

/// A patch whose contacts go out.
pub struct Followed {
    patch: String,
    part: Part,
    forces: Forces,
    /// Asked for anew after a time without a force: a daemon that comes back may have another configuration.
    layout: Option<Layout>,
}

impl Followed {
    /// Follows a patch.
    pub fn new(section: &PatchSection, daemon: &Daemon) -> Option<Self> {
        let patch = section.name.clone();
        Some(Self { forces: daemon.forces(&patch, None), patch, part: section.part()?, layout: None })
    }
}

/// Sends the contacts of all patches whose force holds.
pub async fn events(ports: Ports, name: String, daemon: Daemon, mut patches: Vec<Followed>) -> anyhow::Result<()> {
    let mut port = ports.open(&name).await;
    let mut tick = ticks(EVENTS_EVERY);
    let mut stamp = 0.0_f64;
    loop {
        tick.tick().await;
        let mut contacts = Vec::new();
        for patch in &mut patches {
            let Ok(Force { sample, .. }) = patch.forces.force() else {
                patch.layout = None;
                continue;
            };
            if patch.layout.is_none() {
                patch.layout = daemon.layout(&patch.patch).await.ok().map(|skin| Layout::new(&skin));
            }
            let Some(layout) = &patch.layout else { continue };
            stamp = stamp.max(seconds(sample.time));
            contacts.extend(sample.contacts.iter().map(|one| contact(patch.part, one, layout)));
        }
        port.send(stamp, &contacts);
    }
}
