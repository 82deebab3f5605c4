//! Where a bus's task gives what it received, on its way to the engine.

#[cfg(feature = "record")]
use taxel_can::ClockReading;
use taxel_engine::BusNotice;
use taxel_wire::TimedFrame;

#[cfg(feature = "record")]
use crate::sleep::SleepWatch;

/// The taps of all buses; of those that are not recorded there is none.
#[derive(Default)]
pub struct Taps(#[cfg(feature = "record")] Vec<Option<taxel_mcap::FrameTap>>);

impl Taps {
    /// A tap for each bus.
    #[cfg(feature = "record")]
    pub fn new(taps: Vec<Option<taxel_mcap::FrameTap>>) -> Self {
        Self(taps)
    }

    /// Each bus's own beside its tap.
    pub fn beside<T>(self, buses: Vec<T>) -> Vec<Option<(T, Tap)>> {
        #[cfg(feature = "record")]
        let mut taps = self.0.into_iter().map(|tap| Tap(tap.map(|tap| (tap, SleepWatch::of_machine()))));
        #[cfg(not(feature = "record"))]
        let mut taps = std::iter::empty();
        buses.into_iter().map(|bus| Some((bus, taps.next().unwrap_or_default()))).collect()
    }
}

/// The tap of one bus.
#[derive(Default)]
pub struct Tap(#[cfg(feature = "record")] Option<(taxel_mcap::FrameTap, SleepWatch)>);

impl Tap {
    /// Copies what a bus gave, and what its controller told. Never waits.
    #[cfg_attr(not(feature = "record"), allow(unused_variables, clippy::unused_self))]
    pub fn look(&mut self, frames: &[TimedFrame], errors: &[TimedFrame], notices: &[BusNotice]) {
        #[cfg(feature = "record")]
        if let Some((tap, sleep)) = &mut self.0 {
            for notice in notices {
                if let BusNotice::Dropped(frames) = notice {
                    tap.kernel_lost(*frames);
                }
            }
            if let Some(slept) = sleep.look() {
                tap.slept(slept);
            }
            if !frames.is_empty() || !errors.is_empty() {
                tap.take(frames, errors, ClockReading::now().wall_offset_ns());
            }
        }
    }
}
