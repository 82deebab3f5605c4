//! What the service manager is told: when the daemon serves, that it lives, when it reloads and when it stops.
//! Without a service manager nothing is told to nobody.

use std::convert::Infallible;
use std::future::pending;
use std::time::Duration;

use sd_notify::NotifyState;
use taxel_rpc::Handle;

fn tell(states: &[NotifyState<'_>]) {
    if let Err(error) = sd_notify::notify(states) {
        tracing::debug!(%error, "the service manager was not told");
    }
}

/// Tells that the daemon serves, and from then on that it lives: as long as the engine has its turns, and the service's
/// thread, on which this runs. An engine that stands still is killed by the service manager and started again.
pub async fn keep(handle: Handle) -> Infallible {
    keep_telling(handle, sd_notify::watchdog_enabled(), tell).await
}

async fn keep_telling(
    handle: Handle,
    watchdog: Option<Duration>,
    mut tell: impl FnMut(&[NotifyState<'_>]),
) -> Infallible {
    let patches = handle.patches();
    let status = format!("serving {patches} patch{}", if patches == 1 { "" } else { "es" });
    // The address is bound and the engine runs: a client that connects now is served.
    handle.first_turn().await;
    tell(&[NotifyState::Ready, NotifyState::Status(&status)]);
    let Some(limit) = watchdog else { return pending().await };
    loop {
        if handle.stalled_for().is_none() && !handle.is_over() {
            tell(&[NotifyState::Watchdog]);
        }
        tokio::time::sleep(limit / 3).await; // one sign may come late
    }
}

/// Tells that the configuration is being read again; [`reloaded`] must follow.
pub fn reloading() {
    match NotifyState::monotonic_usec_now() {
        Ok(now) => tell(&[NotifyState::Reloading, now]),
        Err(error) => tracing::debug!(%error, "no time for the service manager"),
    }
}

/// Tells that the daemon serves with what was reloaded.
pub fn reloaded() {
    tell(&[NotifyState::Ready]);
}

/// Tells that the daemon stops.
pub fn stopping() {
    tell(&[NotifyState::Stopping]);
}

#[cfg(all(test, feature = "sim"))]
mod tests {
    use std::path::Path;
    use std::sync::atomic::{AtomicI64, Ordering};
    use std::sync::{Arc, Mutex};

    use taxel_rpc::handle::channel;
    use taxel_skin::Time;
    use tokio_util::sync::CancellationToken;

    use super::*;
    use crate::config;

    #[tokio::test(start_paused = true)]
    async fn the_watchdog_is_fed_only_while_the_engine_has_its_turns() {
        let path = Path::new("demo_config.toml");
        let plan = Arc::new(config::examine_text(path, include_str!("demo_config.toml")).unwrap().1.plan);
        let now_ms = Arc::new(AtomicI64::new(1_000));
        let reads = Arc::clone(&now_ms);
        let clock = Arc::new(move || Time::from_nanos(reads.load(Ordering::Relaxed) * 1_000_000));
        let (handle, publisher, _requests) = channel(plan, clock, CancellationToken::new());
        let told = Arc::new(Mutex::new(Vec::new()));
        let hears = Arc::clone(&told);
        let tell = move |states: &[NotifyState<'_>]| {
            hears.lock().unwrap().extend(states.iter().map(|state| format!("{state:?}")));
        };
        let limit = Duration::from_secs(3);
        let keeping = tokio::spawn(keep_telling(handle, Some(limit), tell));
        let after = async |wait: Duration| {
            tokio::time::sleep(wait).await;
            std::mem::take(&mut *told.lock().unwrap())
        };
        let (short, fed) = (Duration::from_millis(50), "Watchdog".to_owned());
        assert!(after(short).await.is_empty(), "the engine has not had its first turn");
        publisher.beat();
        let first = after(short).await;
        assert!(first[0] == "Ready" && first.contains(&fed), "{first:?}");
        assert_eq!(after(limit / 3).await, ["Watchdog"]);
        now_ms.fetch_add(150, Ordering::Relaxed); // the engine has had no turn for longer than it may
        assert!(after(limit).await.is_empty());
        publisher.beat();
        assert_eq!(after(limit / 3).await, ["Watchdog"]);
        keeping.abort();
    }
}
