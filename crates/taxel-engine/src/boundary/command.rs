//! Commands and their answers. Reads need no command: they are served from snapshots.

use std::sync::Arc;
use taxel_skin::Kilopascal;

pub use crate::request::{ErrorReason, Rejection, RequestId};

use crate::calibration::branch::Branch;
use crate::calibration::view::SessionView;
use crate::known_set::KnownSet;
use crate::loads::load::{KnownLoad, Load};
use crate::model_set::ModelSet;
use crate::zero::view::TareView;

/// Something that changes the engine's state.
#[derive(Clone, Debug)]
pub enum Command {
    /// Take the zero of a patch.
    Tare {
        /// The patch; empty for the only one.
        patch: String,
        /// An operator who confirms that nothing touches the skin; kept with the tare.
        confirmed_by: Option<String>,
    },
    /// Configure the boards of a patch again; its zero is lost.
    BringUp {
        /// The patch; empty for the only one.
        patch: String,
        /// An operator who confirms that nothing touches the skin: whatever is felt, and whatever was found of the boards.
        confirmed_by: Option<String>,
    },
    /// A program begins to hand over the scans of a patch; the zero of what came before it is lost. Or it hands over the readings
    /// of its gauge alone.
    BeginPush {
        /// The patch; empty for the only one.
        patch: String,
    },
    /// Begin a calibration: tare, then the first ramp.
    StartSession {
        /// The patch; empty for the only one.
        patch: String,
        /// Where the rise of a ramp ends by itself; the plan's target if absent.
        target: Option<Kilopascal>,
        /// Which branches of the pressure it gathers; the plan's if absent.
        branches: Option<Branch>,
        /// As in [`Command::Tare`].
        confirmed_by: Option<String>,
        /// Modules to do without: board address and module number. Their taxels get no model.
        leave_out: Vec<(u8, u8)>,
    },
    /// Begin a further ramp after venting, also of an interrupted session.
    StartRamp {
        /// Number of the session.
        session: u64,
    },
    /// Take the plateau at which the bag is held, where no gauge says its pressure.
    Plateau {
        /// Number of the session.
        session: u64,
        /// What the dial shows.
        kpa: Kilopascal,
    },
    /// End the rise of a ramp over both branches, else the ramp, and fit.
    FinishRamp {
        /// Number of the session.
        session: u64,
    },
    /// Stop a session; its samples are kept.
    AbortSession {
        /// Number of the session.
        session: u64,
        /// Why; absent: an operator wants it.
        reason: Option<String>,
    },
    /// Lay a session aside: its model set cannot be activated any more.
    DiscardSession {
        /// Number of the session.
        session: u64,
    },
    /// Use a model set from now on.
    Activate {
        /// The patch; empty for the only one.
        patch: String,
        /// The model set's id.
        model_set: String,
        /// If given, refuse unless this one is active now (empty: none is).
        expected: Option<String>,
    },
    /// Read the force under a known load that lies on the skin now.
    RecordLoad {
        /// The patch; empty for the only one.
        patch: String,
        /// What lies there.
        load: KnownLoad,
    },
    /// Delete a session with all its samples. The model set that came of it stays.
    DeleteSession {
        /// Number of the session.
        session: u64,
    },
    /// Delete a model set.
    DeleteModelSet {
        /// The model set's id.
        model_set: String,
    },
    /// Take in a model set made elsewhere.
    Import {
        /// The set; its patch must be one of this daemon's.
        model_set: Arc<ModelSet>,
        /// An operator insists that the set is right, whatever is odd about it.
        insist: bool,
    },
    /// Keep the model set that a fit of stored samples gave, without using it.
    KeepRefit {
        /// The set; it is for one of this daemon's patches.
        model_set: Arc<ModelSet>,
        /// The sessions whose samples were fitted.
        sessions: Vec<u64>,
    },
    /// Keep the model set that known loads made of another one, without using it.
    KeepRecalibration {
        /// The set; it is for one of this daemon's patches.
        model_set: Arc<ModelSet>,
    },
}

/// A command's answer.
pub type Reply = Result<Done, Rejection>;

/// What a command did.
#[derive(Clone, Debug)]
pub enum Done {
    /// The zero was taken.
    Tared(TareView),
    /// Boards are being configured; see the health.
    BringUpStarted,
    /// Scans may be handed over.
    PushBegun,
    /// The session after the command.
    Session(Arc<SessionView>),
    /// The model set is active.
    Activated {
        /// The set that is active now.
        model_set: String,
        /// The set that was active before.
        previous: Option<String>,
    },
    /// The known load was read.
    LoadRecorded(Arc<Load>),
    /// What was to be deleted is gone from the disk.
    Deleted,
    /// The model set that was imported, or made of stored samples or known loads, is on disk, now or since before.
    Kept {
        /// The set.
        model_set: KnownSet,
        /// Whether it was there already: the same samples or loads were used in the same way before.
        known: bool,
    },
}
