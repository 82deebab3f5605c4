//! How much of a bus the frames of its patches take.

use taxel_engine::plan::{PatchPlan, Plan};
use taxel_skin::BusIndex;

use super::file::{BusSection, BusSource, Config};
use super::problem::{Faults, Said};

/// Bits of a classic frame with eight bytes, unstuffed and with the gap that follows, at 1 Mbit/s in seconds.
const FRAME_S: f64 = 111e-6;

/// The same of a frame without any: no frame of described signals takes less.
const EMPTY_FRAME_S: f64 = 47e-6;

/// From this share on frames wait for each other, and those of one scan come in two.
const CROWDED_FROM: f64 = 0.8;

/// Frames a second that a patch reads from its buses, and the share of one of 1 Mbit/s that they take with eight bytes each.
pub fn of_patch(plan: &PatchPlan) -> (f64, f64) {
    let frames = match plan.devices.iter().map(|device| device.frames.len()).sum::<usize>() {
        0 => 2 * plan.patch.modules().len(),
        described => described,
    };
    let frames_per_s = frames as f64 / plan.period.as_secs_f64();
    (frames_per_s, frames_per_s * FRAME_S)
}

/// Notes the buses that cannot carry what their patches send at least, and tells of those that are nearly full.
pub fn judge(config: &Config, plan: &Plan, faults: &mut Faults, said: &mut Said) {
    let least_s = |patch: &PatchPlan| if patch.devices.is_empty() { FRAME_S } else { EMPTY_FRAME_S };
    let of_can = |(_, section): &(usize, &BusSection)| section.source != BusSource::Yarp;
    for (bus, section) in config.bus.iter().enumerate().filter(of_can) {
        let on_bus = |patch: &&PatchPlan| patch.pushed.is_none() && patch.patch.is_on(BusIndex(bus as u8));
        let share: f64 = plan.patches.iter().filter(on_bus).map(|patch| of_patch(patch).0 * least_s(patch)).sum();
        let told = format!("bus `{}`: the scans of its patches take {:.0} % of 1 Mbit/s", section.name, 100.0 * share);
        if share > 1.0 {
            let patch = plan.patches.iter().find(on_bus);
            let key = patch.map_or_else(String::new, |patch| config.patch_key(patch.patch.name()) + ".period_ms");
            faults.note(&key, format!("{told}: raise period_ms, or put boards on another bus"));
        } else if share >= CROWDED_FROM {
            said.remarks.push(format!("{told}: frames will be late; a greater period_ms leaves room"));
        }
    }
}
