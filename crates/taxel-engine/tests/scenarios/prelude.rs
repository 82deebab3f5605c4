//! What nearly every scene names.

pub use std::sync::{Arc, OnceLock};
pub use std::time::Duration;

pub use taxel_engine::calibration::fit::Branch;
pub use taxel_engine::calibration::{SampleRefusal, SessionState, SessionView};
pub use taxel_engine::command::{Command, Done, ErrorReason, Rejection};
pub use taxel_engine::known_set::{KnownSet, SetSummary};
pub use taxel_engine::model_set::ModelSet;
pub use taxel_engine::plan::{PatchPlan, Plan};
pub use taxel_engine::record::Record;
pub use taxel_engine::snapshot::ForceState;
pub use taxel_engine::{BusNotice, Input, Restored};
pub use taxel_sim::{Config, DielectricConfig, Fault, Mass, PumpCommand, World};
pub use taxel_skin::{Board, ModuleKind, Patch, SquareMillimetre, TaxelIndex, Time};
pub use taxel_wire::{CanId, Frame, TimedFrame};

pub use crate::bench::{Bench, fresh, fresh_with, refused_as, session_of};
pub use crate::disk::{Disk, EPOCH_NS, configured};
pub use crate::host::Host;
pub use crate::rig::{BUS, board, module, patch_plan, plan, small_skin, small_world};
pub(crate) use crate::say;
pub use crate::sessions::{in_review, ramping};
pub use crate::shared::{Calibrated, forearm, ordinary, small};
