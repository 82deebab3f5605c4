//! The stability suite: stiff, extreme and broken cases, each with what must come out. One list of cases serves the
//! tests, which fail on any case that does not hold, and the report, which shows all of them.
//!
//! A case names the status and the flags that it expects, one figure with its limit, and what else must hold. Where
//! the case is a fit, any other method can be judged by the same figure on the same samples: [`case::Contest`]. The cases
//! of the engine's guarantees are `taxel_engine::stability`.

pub mod case;
mod fits;
mod plays;
mod ranges;
pub mod reference;
mod shape;
mod skins;
mod support;
pub mod taxels;
pub mod trial;

use case::Case;

/// A name and the cases of one part of the suite.
pub type Group = (&'static str, fn() -> Vec<Case>);

/// The suite in its order.
pub const GROUPS: [Group; 6] = [
    ("fits", fits::cases),
    ("support", support::cases),
    ("shape", shape::cases),
    ("skins", skins::cases),
    ("ranges", ranges::cases),
    ("plays", plays::cases),
];

/// Runs all cases of a group; what does not hold, in words.
#[must_use]
pub fn failures(group: &Group) -> Vec<String> {
    let cases = group.1();
    let named = |case: &Case| {
        let what = case.failures(&case.run()).into_iter();
        what.map(|what| format!("{} {}: {what}", case.number, case.name)).collect::<Vec<_>>()
    };
    cases.iter().flat_map(named).collect()
}
