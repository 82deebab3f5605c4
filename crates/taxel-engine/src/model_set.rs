//! A model set: what a session produced for a patch, with all it depends on.

use taxel_model::TaxelModel;

use crate::rest::TaxelBaseline;

/// Models of all taxels of a patch, immutable once made.
#[derive(Clone, Debug)]
pub struct ModelSet {
    /// `m-` and the first 16 hexadecimal digits of the content's hash; made by the store's codec.
    pub id: String,
    /// The patch it is for.
    pub patch: String,
    /// When it was made, nanoseconds since 1970.
    pub created_wall_ns: i64,
    /// Number of the session it came from; `None` if it was fitted from a file or imported.
    pub session: Option<u64>,
    /// `order 5, pressure-binned` and the like: how it was fitted.
    pub method: String,
    /// Board settings that the counts depend on, in words: one line a board.
    pub board_settings: Vec<String>,
    /// Count and noise at rest that the models refer to, one per taxel.
    pub baseline: Vec<TaxelBaseline>,
    /// Highest pressure that was calibrated, in kPa.
    pub pressure_max_kpa: f64,
    /// Relative standard uncertainty of the gauge's gain, shared by all taxels.
    pub gauge_gain_rel: f64,
    /// Standard uncertainty of the gauge's offset in kPa, shared by all taxels.
    pub gauge_offset_kpa: f64,
    /// One model per taxel of the patch, in its order.
    pub taxels: Vec<TaxelModel>,
}
