//! Is this stretch of scans a skin at rest? Proof for the tare.
//!
//! A tare under load is the worst error a skin can make, and a moved zero the most frequent one. The test asks two
//! questions, module by module and not in the median over all:
//!
//! - *Was the skin still throughout?* The second half of the window is compared with the first, and the noise of each
//!   taxel with what it is known to be: a load that comes or goes within the window moves some taxels of a module by
//!   more than their noise explains. One that is spread over many modules may move each by less: all together tell
//!   (`window.rs`).
//! - *Is it where it was when nothing lay on it?* Between days the counts at rest move to both sides, on one recorded skin
//!   by -0.7 to +0.9 (once -2.3) in the median and from -3.5 to +4.2 (10th to 90th percentile); a load moves taxels to
//!   one side only. So `judge` refuses where the whole skin, one module more than the rest of it, or a few taxels of
//!   a module moved into the direction of load by more than a day does. Where a zero holds already, counts are compared
//!   with that too, by limits that know only of temperature and hysteresis.
//!
//! Simulated from those recordings, 155 taxels: 4 % of true rests refused; of uniform loads 15 % at 30 kPa, 55 % at 50,
//! 94 % at 60, 100 % from 100 kPa on; of loads on a tenth of the skin 75 % at 60 kPa, 100 % at 100 (these are figures of
//! the comparison with another day, by medians alone).
//!
//! A lighter load cannot be told from a day's drift at one instant. It shows when it goes: see `lighter`.

#[cfg(test)]
mod edge_tests;
#[cfg(test)]
mod insole_tests;
pub(crate) mod judge;
pub(crate) mod limits;
pub(crate) mod moves;
pub(crate) mod statistics;
#[cfg(test)]
pub(crate) mod tests;
pub(crate) mod verdict;
pub(crate) mod window;

pub use statistics::RestStatistics;
