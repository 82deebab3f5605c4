//! Scans that a program hands over whole, of a skin that is on no bus.

use taxel_skin::{Kilopascal, Time};

/// One scan of a patch that has [`PushPlan`](crate::plan::PushPlan), whose counts are within its range.
#[derive(Clone, Debug, PartialEq)]
pub struct PushedScan {
    /// Position of the patch in the plan.
    pub patch: usize,
    /// When this machine received it, at the earliest: the age of its force is counted from here.
    pub time: Time,
    /// When it was taken. It may have waited for that since `time`, where nobody has said when it came; how fast scans come is
    /// judged by this.
    pub taken: Time,
    /// One raw count per taxel.
    pub counts: Vec<u16>,
    /// The pressure in the bag at the same time, where the plan says that it comes with the scans; a finite number.
    pub pressure: Option<Kilopascal>,
}
