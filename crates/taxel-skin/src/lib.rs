//! The words of robot skin as types: units, time, identifiers, layout, geometry.
//!
//! Nothing here does I/O or reads a clock. Every other crate speaks in these types.

pub mod area;
mod geometry;
mod ids;
mod layout;
mod polygon;
mod time;
mod units;

pub use geometry::{Geometry, GeometryError, NormalsVerdict, TaxelPose};
pub use ids::{BoardAddress, BusIndex, IdError, Module, TaxelIndex};
pub use layout::{Board, LayoutError, ModuleKind, ModuleSite, Patch, TaxelSite, VALUES_PER_MODULE};
pub use time::Time;
pub use units::{Kilopascal, Newton, SquareMillimetre};
