//! The tables. Every row but a session's newest view, the tally and the index of model sets is written once and never touched again, but that a
//! session or a model set can be deleted: then a row in another table says so. Triggers hold that, also against other
//! programmes.

/// `taxl`: marks the file as ours in its header.
pub(crate) const APPLICATION_ID: i64 = 0x7461_786C;

/// The version that this programme writes. A file with a higher one is refused, one with a lower one is brought up.
pub(crate) const VERSION: i64 = STEPS.len() as i64;

/// What makes each version from the one before, the first from an empty file. A step that was shipped never changes.
///
/// `checksum` columns hold the first bytes of a SHA-256 over the row's content: SQLite itself notices a flipped bit
/// only in its own structure. Numbers that may be NaN are blobs of little-endian f64, because SQLite stores NaN as NULL.
/// Counts of a sample: see `rows::counts_to_blob`.
pub(crate) const STEPS: [&str; 8] =
    [SESSIONS_AND_MODELS, KNOWN_LOADS, DELETIONS, AUDIT, SET_INDEX, ZERO_DOUBTS, GAUGE_ZEROS, HIDDEN];

/// `ramps.baseline` may have the gauge's zero behind it, see `rows::ramp_to_blob`: an earlier program must not take that for
/// damage.
const GAUGE_ZEROS: &str = "";

/// By how many counts each taxel lay from rest when the boards of the patch took their zeros, and what it read then, both as
/// little-endian f32; NULL if nothing is known.
const HIDDEN: &str = "
ALTER TABLE zero_doubts ADD COLUMN hidden BLOB;
ALTER TABLE zero_doubts ADD COLUMN reads BLOB;
";

const SESSIONS_AND_MODELS: &str = "
CREATE TABLE sessions (
    number   INTEGER PRIMARY KEY,
    view     TEXT NOT NULL,
    checksum BLOB NOT NULL
) STRICT;

CREATE TABLE ramps (
    session  INTEGER NOT NULL REFERENCES sessions (number),
    ramp     INTEGER NOT NULL,
    baseline BLOB NOT NULL,
    checksum BLOB NOT NULL,
    PRIMARY KEY (session, ramp)
) STRICT, WITHOUT ROWID;

CREATE TABLE samples (
    session      INTEGER NOT NULL REFERENCES sessions (number),
    idx          INTEGER NOT NULL,
    ramp         INTEGER NOT NULL,
    time_ns      INTEGER NOT NULL,
    pressure_kpa REAL NOT NULL,
    counts       BLOB NOT NULL,
    checksum     BLOB NOT NULL,
    PRIMARY KEY (session, idx)
) STRICT, WITHOUT ROWID;

-- `id` is not unique: a set whose row is damaged can be imported again.
CREATE TABLE model_sets (
    seq    INTEGER PRIMARY KEY,
    id     TEXT NOT NULL,
    sha256 BLOB NOT NULL,
    json   BLOB NOT NULL
) STRICT;

-- The active set of a patch is its newest activation: pointer and history are one and cannot disagree.
CREATE TABLE activations (
    seq       INTEGER PRIMARY KEY,
    patch     TEXT NOT NULL,
    model_set TEXT NOT NULL,
    wall_ns   INTEGER NOT NULL,
    checksum  BLOB NOT NULL
) STRICT;

CREATE TABLE tares (
    seq             INTEGER PRIMARY KEY,
    patch           TEXT NOT NULL,
    epoch           INTEGER NOT NULL,
    valid           INTEGER NOT NULL,
    wall_ns         INTEGER NOT NULL,
    reason          TEXT NOT NULL,
    baseline_median REAL,
    noise_median    REAL,
    baseline        BLOB NOT NULL
) STRICT;

-- How many rows a stream of the others ever got, so that missing ones are noticed.
CREATE TABLE tally (
    stream   TEXT PRIMARY KEY,
    rows     INTEGER NOT NULL,
    checksum BLOB NOT NULL
) STRICT, WITHOUT ROWID;

CREATE TRIGGER sessions_stay BEFORE DELETE ON sessions
    BEGIN SELECT RAISE(ABORT, 'sessions are never deleted'); END;
CREATE TRIGGER ramps_stay BEFORE DELETE ON ramps
    BEGIN SELECT RAISE(ABORT, 'ramps are append-only'); END;
CREATE TRIGGER ramps_keep BEFORE UPDATE ON ramps
    BEGIN SELECT RAISE(ABORT, 'ramps are append-only'); END;
CREATE TRIGGER samples_stay BEFORE DELETE ON samples
    BEGIN SELECT RAISE(ABORT, 'samples are append-only'); END;
CREATE TRIGGER samples_keep BEFORE UPDATE ON samples
    BEGIN SELECT RAISE(ABORT, 'samples are append-only'); END;
CREATE TRIGGER model_sets_stay BEFORE DELETE ON model_sets
    BEGIN SELECT RAISE(ABORT, 'model_sets are append-only'); END;
CREATE TRIGGER model_sets_keep BEFORE UPDATE ON model_sets
    BEGIN SELECT RAISE(ABORT, 'model_sets are append-only'); END;
CREATE TRIGGER activations_stay BEFORE DELETE ON activations
    BEGIN SELECT RAISE(ABORT, 'activations are append-only'); END;
CREATE TRIGGER activations_keep BEFORE UPDATE ON activations
    BEGIN SELECT RAISE(ABORT, 'activations are append-only'); END;
CREATE TRIGGER tares_stay BEFORE DELETE ON tares
    BEGIN SELECT RAISE(ABORT, 'tares are append-only'); END;
CREATE TRIGGER tares_keep BEFORE UPDATE ON tares
    BEGIN SELECT RAISE(ABORT, 'tares are append-only'); END;
";

const KNOWN_LOADS: &str = "
CREATE TABLE loads (
    number   INTEGER PRIMARY KEY,
    load     TEXT NOT NULL,
    checksum BLOB NOT NULL
) STRICT;

CREATE TRIGGER loads_stay BEFORE DELETE ON loads
    BEGIN SELECT RAISE(ABORT, 'loads are append-only'); END;
CREATE TRIGGER loads_keep BEFORE UPDATE ON loads
    BEGIN SELECT RAISE(ABORT, 'loads are append-only'); END;
";

/// A row here is written before the rows that it stands for may go, in the same transaction.
const DELETIONS: &str = "
CREATE TABLE deleted_sessions (
    number   INTEGER PRIMARY KEY,
    wall_ns  INTEGER NOT NULL,
    checksum BLOB NOT NULL
) STRICT;

-- `seq` is that of the row in model_sets. Activations up to the one given do not bring the set back if it is imported
-- again.
CREATE TABLE deleted_model_sets (
    seq        INTEGER PRIMARY KEY,
    id         TEXT NOT NULL,
    activation INTEGER NOT NULL,
    wall_ns    INTEGER NOT NULL,
    checksum   BLOB NOT NULL
) STRICT;

CREATE TRIGGER deleted_sessions_stay BEFORE DELETE ON deleted_sessions
    BEGIN SELECT RAISE(ABORT, 'deleted_sessions are append-only'); END;
CREATE TRIGGER deleted_sessions_keep BEFORE UPDATE ON deleted_sessions
    BEGIN SELECT RAISE(ABORT, 'deleted_sessions are append-only'); END;
CREATE TRIGGER deleted_model_sets_stay BEFORE DELETE ON deleted_model_sets
    BEGIN SELECT RAISE(ABORT, 'deleted_model_sets are append-only'); END;
CREATE TRIGGER deleted_model_sets_keep BEFORE UPDATE ON deleted_model_sets
    BEGIN SELECT RAISE(ABORT, 'deleted_model_sets are append-only'); END;

DROP TRIGGER sessions_stay;
CREATE TRIGGER sessions_stay BEFORE DELETE ON sessions
    WHEN NOT EXISTS (SELECT 1 FROM deleted_sessions WHERE number = OLD.number)
    BEGIN SELECT RAISE(ABORT, 'sessions are append-only'); END;
CREATE TRIGGER sessions_end BEFORE INSERT ON sessions
    WHEN EXISTS (SELECT 1 FROM deleted_sessions WHERE number = NEW.number)
    BEGIN SELECT RAISE(ABORT, 'this session was deleted'); END;
DROP TRIGGER ramps_stay;
CREATE TRIGGER ramps_stay BEFORE DELETE ON ramps
    WHEN NOT EXISTS (SELECT 1 FROM deleted_sessions WHERE number = OLD.session)
    BEGIN SELECT RAISE(ABORT, 'ramps are append-only'); END;
DROP TRIGGER samples_stay;
CREATE TRIGGER samples_stay BEFORE DELETE ON samples
    WHEN NOT EXISTS (SELECT 1 FROM deleted_sessions WHERE number = OLD.session)
    BEGIN SELECT RAISE(ABORT, 'samples are append-only'); END;
DROP TRIGGER model_sets_stay;
CREATE TRIGGER model_sets_stay BEFORE DELETE ON model_sets
    WHEN NOT EXISTS (SELECT 1 FROM deleted_model_sets WHERE seq = OLD.seq)
    BEGIN SELECT RAISE(ABORT, 'model_sets are append-only'); END;
";

/// Who asked for what, and in the second table what came of it. A request without a result is one that the daemon did not
/// live to answer.
const AUDIT: &str = "
CREATE TABLE audit (
    seq      INTEGER PRIMARY KEY,
    entry    TEXT NOT NULL,
    checksum BLOB NOT NULL
) STRICT;

CREATE TABLE audit_results (
    seq      INTEGER PRIMARY KEY REFERENCES audit (seq),
    entry    TEXT NOT NULL,
    checksum BLOB NOT NULL
) STRICT;

CREATE TRIGGER audit_stay BEFORE DELETE ON audit
    BEGIN SELECT RAISE(ABORT, 'audit is append-only'); END;
CREATE TRIGGER audit_keep BEFORE UPDATE ON audit
    BEGIN SELECT RAISE(ABORT, 'audit is append-only'); END;
CREATE TRIGGER audit_results_stay BEFORE DELETE ON audit_results
    BEGIN SELECT RAISE(ABORT, 'audit_results are append-only'); END;
CREATE TRIGGER audit_results_keep BEFORE UPDATE ON audit_results
    BEGIN SELECT RAISE(ABORT, 'audit_results are append-only'); END;
";

/// What lists show of each row of model_sets, so that a start need not read the sets. It follows from these and is made again
/// where it is missing or damaged; its checksum has the set's hash in it.
const SET_INDEX: &str = "
CREATE TABLE set_index (
    seq      INTEGER PRIMARY KEY,
    entry    TEXT NOT NULL,
    checksum BLOB NOT NULL
) STRICT;
";

/// Why the counts of a patch cannot show that its skin is at rest, or nothing where they can again; the newest row of a patch
/// counts. Rows are numbered without a gap.
const ZERO_DOUBTS: &str = "
CREATE TABLE zero_doubts (
    seq      INTEGER PRIMARY KEY,
    patch    TEXT NOT NULL,
    why      TEXT NOT NULL,
    wall_ns  INTEGER NOT NULL,
    checksum BLOB NOT NULL
) STRICT;

CREATE TRIGGER zero_doubts_stay BEFORE DELETE ON zero_doubts
    BEGIN SELECT RAISE(ABORT, 'zero_doubts are append-only'); END;
CREATE TRIGGER zero_doubts_keep BEFORE UPDATE ON zero_doubts
    BEGIN SELECT RAISE(ABORT, 'zero_doubts are append-only'); END;
";
