//! One scan as everybody in the engine sees it: what intake made of the frames.

use taxel_skin::Time;

use crate::counts::Counts;

/// One value from every module that was heard, and what of it is valid.
#[derive(Clone, Copy, Debug)]
pub struct Scan<'a> {
    /// Mean receive time of its modules.
    pub time: Time,
    /// Whether every module of the patch is in it.
    pub whole: bool,
    /// One raw count per taxel, as last received.
    pub counts: Counts<'a>,
    /// Two thermal pads per module, as last received; a module without pads has zeros.
    pub pads: &'a [[u8; 2]],
    /// One per module: it has been silent for too long.
    pub silent: &'a [bool],
    /// One per taxel: its module is heard and it has no fault.
    pub sound: &'a [bool],
    /// One more each time `sound` or `silent` changed.
    pub soundness: u64,
    /// One per module: by how many counts its taxels have jumped together lately, there and back within a scan or two;
    /// nearly always 0. Empty where nobody looked.
    pub jumps: &'a [f32],
}

impl Scan<'_> {
    /// The counts of all taxels in units, `None` for those that are not valid.
    pub fn sound_counts(&self) -> impl Iterator<Item = Option<f64>> {
        self.counts.iter_units().zip(self.sound).map(|(count, &sound)| sound.then_some(count))
    }

    /// The counts of those that are not valid, as last received, `None` for the others.
    pub fn faulty_counts(&self) -> impl Iterator<Item = Option<f64>> {
        self.counts.iter_units().zip(self.sound).map(|(count, &sound)| (!sound).then_some(count))
    }
}
