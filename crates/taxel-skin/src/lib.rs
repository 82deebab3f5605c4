//! The words of robot skin as types: units, time, identifiers, layout, geometry.
//!
//! Nothing here does I/O or reads a clock. Every other crate speaks in these types.

pub mod area;
mod count_range;
mod drawing;
#[cfg(feature = "flat")]
mod flat;
mod geometry;
mod ids;
mod layout;
mod module_list;
mod positions;
pub mod text;
mod time;
mod units;
mod words;

pub use count_range::CountRange;
pub use drawing::Drawing;
#[cfg(feature = "flat")]
pub use flat::flat;
pub use geometry::{Geometry, NormalsVerdict};
pub use ids::{BoardAddress, BusIndex, IdError, Module, TaxelIndex};
pub use layout::{Board, LayoutError, ModuleKind, ModuleSite, Patch, TaxelSite, VALUES_PER_BOARD, VALUES_PER_MODULE};
pub use module_list::{KindWord, parse_modules, written_modules};
pub use positions::{GeometryError, PositionFile, TaxelPose};
pub use time::Time;
pub use units::{Kilopascal, Newton, SquareMillimetre};
pub use words::{columns, counted, printable, unprintable};
