//! The service `taxel.v1` as Rust types, clients and servers, generated from `proto/` at build time.
//!
//! What every message, field and call means is written in the `.proto` files; the same text is the documentation of
//! the items here.

mod code_name;
pub mod judge;
pub mod refusal;

pub use code_name::code_name;

/// Package `taxel.v1`.
#[allow(missing_docs, rustdoc::all, clippy::all, clippy::too_many_lines)] // generated, and documented in the .proto files
pub mod v1 {
    tonic::include_proto!("taxel.v1");
}

impl v1::Skin {
    /// Positions in m and outward normals of the taxels that have them.
    #[must_use]
    pub fn poses(&self) -> [Vec<[f64; 3]>; 2] {
        let known = |of: fn(&v1::TaxelLayout) -> Option<v1::Vector3>| {
            self.taxels.iter().filter_map(of).map(|v1::Vector3 { x, y, z }| [x, y, z]).collect()
        };
        [known(|taxel| taxel.position_m), known(|taxel| taxel.normal)]
    }
}

/// The compiled `.proto` files with their comments, a serialised `google.protobuf.FileDescriptorSet`.
pub const DESCRIPTORS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/taxel_descriptors.bin"));

pub use prost_types::Timestamp;
