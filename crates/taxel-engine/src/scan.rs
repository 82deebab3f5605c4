//! One scan as everybody in the engine sees it: what intake made of the frames.

use taxel_skin::Time;

/// One value from every module that was heard, and what of it may be believed.
#[derive(Clone, Copy, Debug)]
pub struct Scan<'a> {
    /// Mean receive time of its modules.
    pub time: Time,
    /// Whether every module of the patch is in it.
    pub whole: bool,
    /// One raw count per taxel, as last received.
    pub counts: &'a [u8],
    /// Two thermal pads per module, as last received; a module without pads has zeros.
    pub pads: &'a [[u8; 2]],
    /// One per module: it has been silent for too long.
    pub silent: &'a [bool],
    /// One per taxel: its module is heard and it has no fault.
    pub sound: &'a [bool],
    /// One more each time `sound` or `silent` changed.
    pub soundness: u64,
}

impl Scan<'_> {
    /// The count of a taxel that may be believed.
    #[must_use]
    pub fn sound_count(&self, taxel: usize) -> Option<f64> {
        let count = self.counts.get(taxel)?;
        self.sound.get(taxel).filter(|sound| **sound).map(|_| f64::from(*count))
    }

    /// The counts of all taxels, `None` for those that may not be believed.
    pub fn sound_counts(&self) -> impl Iterator<Item = Option<f64>> {
        self.counts.iter().zip(self.sound).map(|(&count, &sound)| sound.then_some(f64::from(count)))
    }
}
