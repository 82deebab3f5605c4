//! Threads: those of the daemon by their names, and the cores of this machine for what is done once over a whole file, which the
//! daemon itself leaves to the robot.

use std::sync::LazyLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use anyhow::Context;
use taxel_engine::calibration::fit::Workers;

/// Threads on all cores.
pub struct Threads;

impl Workers for Threads {
    fn each(&self, jobs: usize, job: &(dyn Fn(usize) + Sync)) {
        each(jobs, job);
    }
}

/// Starts a thread of this name.
///
/// # Errors
/// The name, and the system's answer, if there is no thread to be had.
pub fn start(name: &str, run: impl FnOnce() + Send + 'static) -> anyhow::Result<()> {
    let started = thread::Builder::new().name(name.to_owned()).spawn(run);
    started.map(drop).with_context(|| format!("starting the thread `{name}`"))
}

/// How many threads run at once. The system is asked once, which takes it some file reads.
pub fn count() -> usize {
    static COUNT: LazyLock<usize> = LazyLock::new(|| thread::available_parallelism().map_or(1, usize::from));
    *COUNT
}

/// Does `job` for each number below `jobs`, each once, on all cores. Where no thread can be had this one does it all.
pub fn each(jobs: usize, job: &(dyn Fn(usize) + Sync)) {
    let next = AtomicUsize::new(0);
    let work = || {
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number >= jobs {
                return;
            }
            job(number);
        }
    };
    thread::scope(|scope| {
        (1..count().min(jobs)).for_each(|_| _ = thread::Builder::new().spawn_scoped(scope, work));
        work();
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_job_is_done_once() {
        for jobs in [0, 1, 2, 1_000] {
            let done: Vec<AtomicUsize> = (0..jobs).map(|_| AtomicUsize::new(0)).collect();
            each(jobs, &|number| _ = done[number].fetch_add(1, Ordering::Relaxed));
            assert!(done.iter().all(|times| times.load(Ordering::Relaxed) == 1), "{done:?}");
        }
    }
}
