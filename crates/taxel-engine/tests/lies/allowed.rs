//! Lies that are known and argued: the counts of one moment look the same with the truth and without it.
//!
//! An entry allows the lies whose name begins with its cause, as the table prints it. They are counted as lies in every
//! table and their share is bounded, so that more of them than there were is a failure, too.

/// A cause, and why nothing in the frames shows the lie when it is told.
const ALLOWED: &[(&str, &str)] = &[
    (
        "boards configured under a load",
        "A board takes its own zero when it starts or is configured, and sends counts as if nothing lay on it. A load \
         whose edges are within what taxels move from day to day leaves no trace. The daemon looks before it \
         configures and refuses while it feels a force; a board that starts by itself, or an operator who insists, \
         does not ask.",
    ),
    (
        "zero taken under a load",
        "Rest is proven against the models' zero of another day. A load that moves the counts by less than days do \
         passes for rest; the floor says how much that can be for most skins, not for each.",
    ),
    (
        "silent re-tare of a board",
        "A new zero shows by its residues on taxels that nothing touches. A board with some twenty taxels, nearly all \
         of them under the load, and residues of half a count has too few such taxels.",
    ),
    (
        "board hangs below 1 s, new zero",
        "As a silent re-tare: a hang that is shorter than a silence leaves nothing but the new zero.",
    ),
    (
        "module flickers",
        "The first scans of a module that begins to jump towards load look like a touch. Each is judged by its own \
         changes within two scans to a second.",
    ),
    (
        "taxel stuck",
        "The first scans of a taxel that hangs at another count look like a touch of this taxel; it is excluded when it \
         has stood still for two seconds.",
    ),
    (
        "taxel frozen",
        "A taxel that stands still at its rest does not feel what comes; within two seconds it is excluded. A contact \
         that is smaller than the taxel and lies on it alone then touches nothing that can feel it.",
    ),
    ("taxel flickers on its rail", "As a flickering module, for one taxel."),
    (
        "foreign node",
        "The first scan that another node sends with a board's identifiers comes in its time; the next one is too many, \
         and the module is faulty from then on.",
    ),
    ("old scans again", "As a foreign node."),
    (
        "no fault",
        "A load that rolls from board to board in less than a period is read where it came from and where it went.",
    ),
    ("engine stalled", "As no fault: the scans of the boards that are read together are up to a period apart."),
    ("frames held back, then all at once", "As an engine that stalled."),
];

/// A truth that is so little beyond three standard uncertainties, in newton, is there by chance: of normal errors one in
/// 370 is further out.
const CHANCE_N: f64 = 0.05;

/// Whether a lie by so much is on the list.
pub fn is_allowed(name: &str, excess_n: f64) -> bool {
    excess_n < CHANCE_N || ALLOWED.iter().any(|(cause, _)| name.starts_with(cause))
}
