//! The zero follows the skin's temperature: slowly, within a bound, and never a hand.
//!
//! Capacitive skin drifts by up to about a count per kelvin. Other software takes the drift away with a high-pass,
//! which also takes a hand that lies still: within a minute a sustained contact has faded. Nothing here looks at a
//! taxel's own value to move its own zero. What moves the zero of a module is
//!
//! - what its own *thermal pads* say. No load reaches them. How many counts the taxels of this module move per count of
//!   its pads is learned while nothing touches it (`Coefficient`);
//! - the *common mode*: the median over the other untouched modules of the patch, each the median of its taxels. It is
//!   believed as far as the pads explain it, by a coefficient of the whole patch that is learned while they move
//!   (`Common`), and towards load by 1 N more. So neither a load that creeps in on one module nor one that creeps in on
//!   all of them is taken for drift, and a skin without pads is not followed.
//!
//! Together, for an untouched module: `drift = limited(common) + k (pads - common pads)`. A module that is touched, or
//! lies beside a touched one, is *held*: `drift = drift then + k (pads - pads then)`, and constant while `k` is not
//! known. A taxel counts as touched when its smoothed count is beyond its activation threshold, or has moved by half
//! of that threshold from where it rested before; a silent module counts as touched. A module is untouched again when
//! it has been so for `HOLD_OFF_S`. Without geometry every module lies beside every other.
//!
//! The drift moves by at most a configured rate and up to a configured bound from the proven zero. At the bound it
//! stays, and the force says so. A new zero begins at no drift, with nothing learned. While a session is open nothing
//! is followed.
//!
//! All of it is exponential smoothing that is exact in the time step, `1 - exp(-dt / tau)`. Time comes from scans; one
//! that is not later than the last is ignored; after a gap of more than `GAP_S` every average begins anew and every
//! module is held. Only live force follows drift: a table of counts (`taxel-lab apply`) has no pads, so nothing is
//! followed there.
//!
//! A scan costs some 20 ns a taxel. The live tables are made anew when a module has moved by a tenth of a count, at
//! most every five seconds; 230 taxels take 3.7 ms (`cargo run --release -p taxel-engine --example drift_time`). On the
//! simulated skin that warms up by 5 K in 20 minutes at boards that compensate half of its drift, a mass of 0.5 kg reads
//! 1 % too much (82 % if nothing is followed), the skin at rest 0.01 N (2.2 N), and a hand that lies still for half an
//! hour at 3 K loses 0.9 % (the scenarios of `drift.rs` print these).
//!
//! What it may have taken in of a load that lies on everything is told: [`DriftView::absorbed`], at most 1 N, is in the
//! detection floor of every force, and with the uncertainty of the coefficient in the drift's. Before, half a count was
//! taken in, 4 N on the forearm, and 1.25 counts per count of the pads beside, and nothing said so.
//!
//! What the pads say has come is uncertain until it is followed, while a session is open, too. Boards leave 1/4 to all of the
//! warmth. A coefficient outside of that, by more than a twentieth, may come of a load on everything that came as slowly, and is uncertain by more the
//! further it lies outside, up to all that boards may leave.
//!
//! What it cannot do: a load that comes and goes in step with the temperature from the zero on is what warmth does, as far
//! as both together stay within 0.2 and 1.05 counts per count of the pads. It knows a module's coefficient only while the pads have moved by
//! more than a count and a half since the zero, and holds all that it may have moved by for uncertain before; taxels of a
//! module differ from each other in their drift, and nothing is done about that; a thermal gradient that pads do not see is followed by half a count away from load and by 1 N towards it.

mod coefficient;
mod common;
#[cfg(test)]
mod edge_tests;
pub mod follow;
mod limits;
mod module;
#[cfg(test)]
mod module_tests;
mod others;
pub mod plan;
pub mod site;
mod smooth;
#[cfg(test)]
mod tests;
pub mod view;

pub use follow::Drift;
pub use plan::DriftPlan;
pub use site::{DriftSite, drift_sites};
pub use view::{DriftState, DriftView};
