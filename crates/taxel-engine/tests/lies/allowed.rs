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

/// What the name of a lie ends with that is no larger than what lies about taxels without a model.
pub const ON_UNREAD: &str = "; on what is not read";

/// How often lies of a root may be told, and by how much they may be wrong.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    pub samples_per_million: f64,
    pub stories_per_thousand: f64,
    pub worst_n: f64,
}

const fn budget(samples_per_million: f64, stories_per_thousand: f64, worst_n: f64) -> Budget {
    Budget { samples_per_million, stories_per_thousand, worst_n }
}

/// A truth that is so little beyond three standard uncertainties, in newton, is there by chance: of normal errors one in
/// 370 is further out.
pub const CHANCE_N: f64 = 0.05;

/// How a name begins and what it has, its budget, and why nothing in the frames shows the lie when it is told. The budgets
/// are twice what 5,500 minutes came to, and some samples of a few stories for those that did not come.
pub const ALLOWED: &[(&str, &str, Budget, &str)] = &[
    (
        "by chance",
        "",
        budget(300.0, 15.0, CHANCE_N),
        "Of normal errors one in 370 is further out than three standard uncertainties.",
    ),
    (
        "",
        MODULES_APART,
        budget(5.0, 4.0, 5.0),
        "The boards do not convert at the same moment, nor do they send at the same one: what rolls from module to module \
         in less than a period is read where it came from and where it went, or nowhere, and so are two loads of which \
         one lands while the other leaves.",
    ),
    (
        "",
        HEARD_LATE,
        budget(20.0, 12.0, 30.0),
        "A module of which frames are missing is read as it was until others come or it is silent, after 150 ms: a touch \
         meanwhile cannot be in it. Head and tail of two scans make none; a scan too many makes a module faulty, and the \
         next is missing; what waits for the engine or the adapter is older by as much.",
    ),
    (
        "no fault",
        UNPLACED,
        budget(20.0, 3.0, 5.0),
        "Where positions are not known, nobody knows which taxels lie beside one that cannot be read. A total is a lower bound \
         where few taxels of its module are touched; a fingertip on it may touch none of these, and some of another module.",
    ),
    (
        "",
        ON_UNREAD,
        budget(1000.0, 25.0, 5.0),
        "A fingertip on a taxel without a model: those beside it read its flank alone, and a wide light load reads the same. With \
         two patches three loads in ten are fingertips, and one taxel in eight has no model.",
    ),
    (
        "",
        FORGOTTEN,
        budget(50.0, 2.0, 12.0),
        "A board keeps its zero while the daemon is away, and what was found of it is on disk within a fraction of a \
         second. A disk that takes nothing, or a crash within that time, loses it, and the next run sees a skin at rest.",
    ),
    (
        "boards configured under a load",
        "",
        budget(400.0, 6.0, 6.0),
        "A board takes its own zero when it starts or is configured, and sends counts as if nothing lay on it. A load \
         whose edges are within what taxels move from day to day leaves no trace. The daemon looks before it \
         configures and refuses while it feels a force; a board that starts by itself, or an operator who insists, \
         does not ask.",
    ),
    (
        "zero taken under a load",
        "",
        budget(100.0, 3.0, 3.0),
        "Rest is proven against the models' zero of another day. A load that moves the counts by less than days do \
         passes for rest; the floor says how much that can be for most skins, not for each.",
    ),
    (
        "zero taken while a load changed",
        " by a little",
        budget(50.0, 3.0, 1.1),
        "As a zero under a load, where the load changes by less than the noise of the watch, which grows with the root of the \
         taxels: 0.5 N on 50 of them, 1.07 N on the forearm.",
    ),
    (
        "models gathered under a load",
        "",
        budget(100.0, 3.0, 3.0),
        "A ramp's zero is proven as any other is, and what it hides is in every model that is fitted to it.",
    ),
    (
        "silent re-tare of a board",
        "",
        budget(50.0, 6.0, 5.5),
        "A new zero shows by its residues on taxels that nothing touches. A board with some twenty taxels, nearly all \
         of them under the load, and residues of half a count has too few such taxels.",
    ),
    (
        "lost acknowledgements",
        "",
        budget(50.0, 4.0, 4.0),
        "As a silent re-tare: five of them lose the zero, but what lay on the board when it took its own is not known. A load \
         too light to be seen to vanish with it, or one that goes and gives its place to another as heavy, passes for rest \
         when the next zero is taken.",
    ),
    (
        "board hangs below 1 s, new zero",
        "",
        budget(150.0, 4.0, 4.0),
        "As a silent re-tare: a hang that is shorter than a silence leaves nothing but the new zero.",
    ),
    (
        "power cycle of a board",
        "",
        budget(200.0, 4.0, 5.0),
        "A board that starts takes its zero then, as one that is configured.",
    ),
    (
        "module flickers",
        "",
        budget(40.0, 30.0, 12.0),
        "The first scans of a module that begins to jump towards load look like a touch. Each is judged by its own \
         changes within two scans to a second.",
    ),
    (
        "taxel stuck",
        "",
        budget(10.0, 4.0, 2.0),
        "The first scans of a taxel that hangs at another count look like a touch of this taxel; it is excluded when it \
         has stood still for two seconds.",
    ),
    (
        "taxel frozen",
        "",
        budget(30.0, 4.0, 2.0),
        "A taxel that stands still at its rest does not feel what comes; within two seconds it is excluded. A contact \
         that is smaller than the taxel and lies on it alone then touches nothing that can feel it.",
    ),
    ("taxel flickers on its rail", "", budget(10.0, 4.0, 2.0), "As a flickering module, for one taxel."),
    (
        "taxel noisy",
        " by a little",
        budget(10.0, 4.0, 0.5),
        "As a flickering module, for single taxels: the first scans with the noise look like touches.",
    ),
    (
        "foreign node",
        "",
        budget(5.0, 8.0, 25.0),
        "The first scan that another node sends with a board's identifiers comes in its time; the next one is too many, \
         and the module is faulty from then on.",
    ),
    ("old scans again", "", budget(5.0, 4.0, 20.0), "As a foreign node."),
];

/// The place on the list of a lie by so much. What is there by chance has the first, whatever its name.
pub fn root_of(name: &str, excess_n: f64) -> Option<usize> {
    if excess_n < CHANCE_N {
        return Some(0);
    }
    (1..ALLOWED.len()).find(|&root| name.starts_with(ALLOWED[root].0) && name.contains(ALLOWED[root].1))
}

/// Whether a lie by so much is on the list.
pub fn is_allowed(name: &str, excess_n: f64) -> bool {
    root_of(name, excess_n).is_some()
}
