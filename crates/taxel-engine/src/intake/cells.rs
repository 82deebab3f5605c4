//! Devices that are described by their signals: from their frames to whole modules.
//!
//! A device is a group of taxels that has its power and its zero in common, as a skin board has. Its taxels lie in one
//! frame or in several, of one identifier or more, multiplexed or not. A module is complete when all frames that hold its
//! taxels have come *of one and the same scan*. What belongs to one scan is shown by
//!
//! - **time**: frames that are less than half a period apart, as a board's head and tail;
//! - a **frame** that begins each scan: what came before it is of another one;
//! - a **counter** in each frame: frames of different numbers are of different scans.
//!
//! As with head and tail, half a module is never made whole with a frame that may be of another scan: it is counted as an
//! orphan, and the module waits for its next scan.

use std::ops::Range;
use std::time::Duration;
use taxel_skin::{Patch, Time};
use taxel_wire::array::{FrameSpec, TooShort};
use taxel_wire::bits::{BitField, FrameMatch};
use taxel_wire::{CanId, Frame, TimedFrame};

/// Frames of one scan that only their times tell lie within this share of the period.
const WINDOW_SHARE: f64 = 0.5;

/// Where a scan of a device begins.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ScanBegin {
    /// Frames close in time are of one scan.
    Time,
    /// With this frame.
    Frame(FrameMatch),
    /// With each new number at this place of every frame of the device.
    Counter(BitField),
}

/// A number that a device tells of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceSignal {
    /// Its frames.
    pub frames: FrameMatch,
    /// Its place.
    pub field: BitField,
}

/// Who sends a device its commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sender {
    /// The patch that has them.
    Patch,
    /// Nobody here. If there are any, somebody else sends these.
    Elsewhere,
}

/// What is known of a device.
#[derive(Clone, Debug)]
pub struct DevicePlan {
    /// Its taxels, numbered within the device from 0 on. One that is in several frames has the newest number.
    pub frames: Vec<FrameSpec>,
    /// What belongs to one scan.
    pub scans: ScanBegin,
    /// A number that is the given one while all is well.
    pub status: Option<(DeviceSignal, i128)>,
    /// Frames to send so that it streams, and how long after the beginning of the bring-up.
    pub commands: Vec<(Duration, Frame)>,
    /// Who sends them.
    pub sender: Sender,
}

impl DevicePlan {
    /// A device whose scans come whole and in no frames.
    pub const fn without_frames() -> Self {
        Self {
            frames: Vec::new(),
            scans: ScanBegin::Time,
            status: None,
            commands: Vec::new(),
            sender: Sender::Elsewhere,
        }
    }

    /// Whether the daemon sends it anything.
    pub fn is_configured(&self) -> bool {
        !self.commands.is_empty() && self.sender != Sender::Elsewhere
    }

    /// The identifiers of all its frames, some of them more than once.
    pub fn ids(&self) -> impl Iterator<Item = CanId> + '_ {
        let begin = match &self.scans {
            ScanBegin::Frame(frames) => Some(frames.id),
            ScanBegin::Time | ScanBegin::Counter(_) => None,
        };
        let status = self.status.iter().map(|(signal, _)| signal.frames.id);
        self.frames.iter().map(|spec| spec.frames.id).chain(begin).chain(status)
    }
}

/// What a frame of a device brought.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Brought {
    /// Modules of the patch that it completes.
    pub modules: Vec<usize>,
    /// It says how the device is.
    pub status: bool,
}

/// A device, live.
#[derive(Debug)]
pub struct Device {
    plan: DevicePlan,
    window: Duration,
    modules: Vec<ModuleParts>,
    /// Raw counts of its taxels as last received.
    counts: Vec<u16>,
    /// When each of its frames came in this scan.
    came: Vec<Option<Time>>,
    counter: Option<i128>,
    /// Whether the frame that begins a scan has come.
    begun: bool,
    well: bool,
    orphans: u64,
}

/// One module of a device.
#[derive(Debug)]
struct ModuleParts {
    /// Its position in the patch.
    index: usize,
    /// Its taxels within the device.
    taxels: Range<usize>,
    /// The frames that hold them.
    frames: Vec<usize>,
    /// It is complete in this scan.
    complete: bool,
}

impl Device {
    /// The device at `board` of a patch; nothing received yet.
    pub fn new(patch: &Patch, board: usize, plan: DevicePlan, period: Duration) -> Self {
        let mut first = 0;
        let sites = patch.modules().iter().enumerate().filter(|(_, site)| usize::from(site.board) == board);
        let modules = sites.map(|(index, site)| {
            let taxels = first..first + site.kind.taxel_slots().len();
            first = taxels.end;
            let holds = |spec: &FrameSpec| spec.counts.iter().any(|(taxel, _)| taxels.contains(&usize::from(*taxel)));
            let frames = (0..plan.frames.len()).filter(|&frame| holds(&plan.frames[frame])).collect();
            ModuleParts { index, taxels, frames, complete: false }
        });
        let modules: Vec<ModuleParts> = modules.collect();
        let share = if plan.scans == ScanBegin::Time { WINDOW_SHARE } else { 1.0 };
        Self {
            counts: vec![0; first],
            came: vec![None; plan.frames.len()],
            window: period.mul_f64(share),
            modules,
            counter: None,
            begun: false,
            well: true,
            orphans: 0,
            plan,
        }
    }

    /// Takes a frame. `None` if the device has no such frame.
    ///
    /// # Errors
    /// [`TooShort`] if it ends before one of its numbers does; nothing of it is used.
    pub fn on_frame(&mut self, frame: &TimedFrame) -> Result<Option<Brought>, TooShort> {
        let mut brought = None;
        let number = |signal: &DeviceSignal| {
            let meant = signal.frames.is(&frame.frame);
            meant.then(|| signal.field.read(frame.frame.bytes())).flatten()
        };
        if let Some((number, (_, good))) = self.plan.status.as_ref().and_then(|s| Some((number(&s.0)?, s))) {
            self.well = number == *good;
            brought.get_or_insert_with(Brought::default).status = true;
        }
        if matches!(&self.plan.scans, ScanBegin::Frame(begin) if begin.is(&frame.frame)) {
            self.begin_scan();
            self.begun = true;
            brought.get_or_insert_with(Brought::default);
        }
        for part in 0..self.plan.frames.len() {
            if self.plan.frames[part].frames.is(&frame.frame) {
                let brought = brought.get_or_insert_with(Brought::default);
                self.on_part(part, frame, &mut brought.modules)?;
            }
        }
        Ok(brought)
    }

    /// One of the frames that hold taxels.
    fn on_part(&mut self, part: usize, frame: &TimedFrame, complete: &mut Vec<usize>) -> Result<(), TooShort> {
        let counter = match &self.plan.scans {
            ScanBegin::Counter(field) => field.read(frame.frame.bytes()),
            ScanBegin::Time | ScanBegin::Frame(_) => None,
        };
        // A frame that is too short must change nothing.
        let counts = &mut self.counts;
        let (found, needed) = (frame.frame.bytes().len(), self.plan.frames[part].bytes_needed());
        if found < needed {
            return Err(TooShort { id: frame.frame.id, found, needed });
        }
        // Whatever sends a frame once more does not make another scan of it.
        let counts_scans = matches!(self.plan.scans, ScanBegin::Counter(_));
        if counts_scans && counter == self.counter && self.came[part].is_some() {
            self.orphans += 1;
            return Ok(());
        }
        let apart = |came: &Time| frame.time < *came || frame.time.since(*came) >= self.window;
        let other = self.came[part].is_some() || self.came.iter().flatten().any(apart) || counter != self.counter;
        self.plan.frames[part].read(&frame.frame, |taxel, count| {
            if let Some(place) = counts.get_mut(usize::from(taxel)) {
                *place = count;
            }
        })?;
        if other {
            self.begin_scan();
            self.begun = false; // of a scan whose first frame was lost
        }
        self.counter = counter;
        if matches!(self.plan.scans, ScanBegin::Frame(_)) && !self.begun {
            self.orphans += 1;
            return Ok(());
        }
        self.came[part] = Some(frame.time);
        for module in self.modules.iter_mut().filter(|module| !module.complete && module.frames.contains(&part)) {
            if module.frames.iter().all(|&frame| self.came[frame].is_some()) {
                module.complete = true;
                complete.push(module.index);
            }
        }
        Ok(())
    }

    /// What came so far is of an earlier scan.
    fn begin_scan(&mut self) {
        let open = |part: &usize| self.modules.iter().any(|m| !m.complete && m.frames.contains(part));
        let orphans = (0..self.came.len()).filter(|&part| self.came[part].is_some()).filter(open).count();
        self.orphans += orphans as u64;
        self.came.fill(None);
        self.modules.iter_mut().for_each(|module| module.complete = false);
    }

    /// The raw counts of a module of the patch as last received; empty if it is none of this device's.
    pub fn counts(&self, module: usize) -> &[u16] {
        let found = self.modules.iter().find(|parts| parts.index == module);
        found.and_then(|parts| self.counts.get(parts.taxels.clone())).unwrap_or_default()
    }

    /// Whether its status is the good one, as far as it said.
    pub const fn is_well(&self) -> bool {
        self.well
    }

    /// Frames that found no whole module.
    pub const fn orphans(&self) -> u64 {
        self.orphans
    }
}

#[cfg(test)]
mod tests;
