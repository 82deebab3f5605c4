//! What the figures were measured on and with: without it a time means nothing.

use std::time::SystemTime;

use prost_types::Timestamp;
use serde::Serialize;

use crate::options::Options;

/// Machine, versions and the report's own options.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Machine {
    /// Model of the processor, as the kernel names it.
    pub cpu: String,
    /// Processors that this process may use.
    pub cores: usize,
    /// System and kernel.
    pub kernel: String,
    /// Version of this programme.
    pub taxeld: String,
    /// Optimised or not, and for which processor features.
    pub build: String,
    /// When, UTC.
    pub date_utc: String,
    /// Of all simulated data.
    pub seed: u64,
    /// Whether sizes and repetitions were reduced.
    pub quick: bool,
    /// Which of the optional recordings and regression sets were there.
    pub data: String,
}

impl Machine {
    /// This machine, now.
    #[must_use]
    pub fn here(options: &Options) -> Self {
        Self {
            cpu: cpu_model().unwrap_or_else(|| std::env::consts::ARCH.to_owned()),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            kernel: kernel(),
            taxeld: env!("CARGO_PKG_VERSION").to_owned(),
            build: build(),
            date_utc: now_utc(),
            seed: options.seed,
            quick: options.quick,
            data: data(options),
        }
    }

    /// Names and values for people.
    pub(crate) fn rows(&self) -> Vec<(&'static str, String)> {
        let mode = if self.quick { "quick: fewer repetitions and smaller sizes" } else { "full" };
        vec![
            ("processor", format!("{}, {} in use", self.cpu, self.cores)),
            ("kernel", self.kernel.clone()),
            ("taxeld", format!("{}, {}", self.taxeld, self.build)),
            ("date, UTC", self.date_utc.clone()),
            ("report", format!("{mode}; seed {}", self.seed)),
            ("data", self.data.clone()),
        ]
    }
}

/// To the minute.
fn now_utc() -> String {
    let now = Timestamp::from(SystemTime::now()).to_string();
    now.split_at_checked("2026-01-01T00:00".len()).map_or_else(String::new, |(minute, _)| minute.replace('T', " "))
}

fn cpu_model() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name") || line.starts_with("Model"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

fn kernel() -> String {
    let release = std::fs::read_to_string("/proc/sys/kernel/osrelease").unwrap_or_default();
    format!("{} {}", std::env::consts::OS, release.trim())
}

fn build() -> String {
    let features = [
        ("sse4.2", cfg!(target_feature = "sse4.2")),
        ("avx2", cfg!(target_feature = "avx2")),
        ("fma", cfg!(target_feature = "fma")),
        ("avx512f", cfg!(target_feature = "avx512f")),
        ("neon", cfg!(target_feature = "neon")),
    ];
    let on: Vec<&str> = features.into_iter().filter(|(_, on)| *on).map(|(name, _)| name).collect();
    let on = if on.is_empty() { "no processor features beyond the baseline".to_owned() } else { on.join(" ") };
    let profile = if cfg!(debug_assertions) { "NOT OPTIMISED, its times mean nothing" } else { "optimised" };
    format!("{profile}, {}, {on}", std::env::consts::ARCH)
}

fn data(options: &Options) -> String {
    let Some(folder) = &options.data else {
        return "no folder with recordings and regression sets".to_owned();
    };
    let there = |name: &str| if folder.join(name).is_dir() { "present" } else { "absent" };
    format!("recordings of the insole {}, regression sets (strd) {}", there("insole"), there("strd"))
}
