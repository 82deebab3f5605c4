//! Lies that are known and argued: the counts of one moment look the same with the truth and without it.
//!
//! An entry allows the lies whose name begins with its cause, as the table prints it. They are counted as lies in every
//! table and their share is bounded, so that more of them than there were is a failure, too.

/// What the name of a lie ends with that is none if each module is read at some moment within what a sample may be of.
pub const MODULES_APART: &str = "; modules apart";
/// The same within what a module may be of that is not heard any more and not silent yet.
pub const HEARD_LATE: &str = "; heard late";

/// A daemon found that a board's zero holds a load, and stopped before that was on disk.
pub const FORGOTTEN: &str = "; found and not written down";

/// What the name of a lie ends with that is told of a skin without positions, some of whose taxels cannot be read.
pub const UNPLACED: &str = "; without positions";

/// How a name begins and what it has, and why nothing in the frames shows the lie when it is told.
const ALLOWED: &[(&str, &str, &str)] = &[
    (
        "",
        MODULES_APART,
        "The boards do not convert at the same moment, nor do they send at the same one: what rolls from module to module \
         in less than a period is read where it came from and where it went, or nowhere, and so are two loads of which \
         one lands while the other leaves.",
    ),
    (
        "frames lost",
        HEARD_LATE,
        "A module of which a frame is missing is read as it was until another comes or it is silent, after 150 ms: a touch \
         meanwhile cannot be in it.",
    ),
    ("frames swapped", HEARD_LATE, "As lost frames: head and tail of two scans make none."),
    (
        "frames duplicated",
        HEARD_LATE,
        "As lost frames: a scan too many makes a module faulty, and the next is missing.",
    ),
    ("module silent", HEARD_LATE, "As lost frames."),
    ("module unplugged", HEARD_LATE, "As lost frames."),
    ("board silent", HEARD_LATE, "As lost frames."),
    ("board at another period", HEARD_LATE, "As lost frames: a board may send seldom, and is silent after 150 ms."),
    ("engine stalled", HEARD_LATE, "As lost frames: what waits for the engine is older by as much."),
    ("frames held back, then all at once", HEARD_LATE, "As an engine that stalled."),
    (
        "no fault",
        UNPLACED,
        "Where positions are not known, nobody knows which taxels lie beside one that cannot be read. A total is a lower bound \
         where few taxels of its module are touched; a fingertip on it may touch none of these, and some of another module.",
    ),
    (
        "",
        FORGOTTEN,
        "A board keeps its zero while the daemon is away, and what was found of it is on disk within a fraction of a \
         second. A disk that takes nothing, or a crash within that time, loses it, and the next run sees a skin at rest.",
    ),
    (
        "boards configured under a load",
        "",
        "A board takes its own zero when it starts or is configured, and sends counts as if nothing lay on it. A load \
         whose edges are within what taxels move from day to day leaves no trace. The daemon looks before it \
         configures and refuses while it feels a force; a board that starts by itself, or an operator who insists, \
         does not ask.",
    ),
    (
        "zero taken under a load",
        "",
        "Rest is proven against the models' zero of another day. A load that moves the counts by less than days do \
         passes for rest; the floor says how much that can be for most skins, not for each.",
    ),
    (
        "zero taken while a load changed",
        " by a little",
        "As a zero under a load, where the load changes by less than the noise of the watch, which grows with the root of the \
         taxels: 0.5 N on 50 of them, 1.07 N on the forearm.",
    ),
    (
        "models gathered under a load",
        "",
        "A ramp's zero is proven as any other is, and what it hides is in every model that is fitted to it.",
    ),
    (
        "silent re-tare of a board",
        "",
        "A new zero shows by its residues on taxels that nothing touches. A board with some twenty taxels, nearly all \
         of them under the load, and residues of half a count has too few such taxels.",
    ),
    (
        "lost acknowledgements",
        "",
        "As a silent re-tare: five of them lose the zero, but what lay on the board when it took its own is not known. A load \
         too light to be seen to vanish with it, or one that goes and gives its place to another as heavy, passes for rest \
         when the next zero is taken.",
    ),
    (
        "board hangs below 1 s, new zero",
        "",
        "As a silent re-tare: a hang that is shorter than a silence leaves nothing but the new zero.",
    ),
    ("power cycle of a board", "", "A board that starts takes its zero then, as one that is configured."),
    (
        "module flickers",
        "",
        "The first scans of a module that begins to jump towards load look like a touch. Each is judged by its own \
         changes within two scans to a second.",
    ),
    (
        "taxel stuck",
        "",
        "The first scans of a taxel that hangs at another count look like a touch of this taxel; it is excluded when it \
         has stood still for two seconds.",
    ),
    (
        "taxel frozen",
        "",
        "A taxel that stands still at its rest does not feel what comes; within two seconds it is excluded. A contact \
         that is smaller than the taxel and lies on it alone then touches nothing that can feel it.",
    ),
    ("taxel flickers on its rail", "", "As a flickering module, for one taxel."),
    (
        "taxel noisy",
        " by a little",
        "As a flickering module, for single taxels: the first scans with the noise look like touches.",
    ),
    (
        "foreign node",
        "",
        "The first scan that another node sends with a board's identifiers comes in its time; the next one is too many, \
         and the module is faulty from then on.",
    ),
    ("old scans again", "", "As a foreign node."),
];

/// A truth that is so little beyond three standard uncertainties, in newton, is there by chance: of normal errors one in
/// 370 is further out.
pub const CHANCE_N: f64 = 0.05;

/// Whether a lie by so much is on the list.
pub fn is_allowed(name: &str, excess_n: f64) -> bool {
    excess_n < CHANCE_N || ALLOWED.iter().any(|(cause, has, _)| name.starts_with(cause) && name.contains(has))
}
