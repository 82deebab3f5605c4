//! Compiles `proto/` in pure Rust, so that no protoc is needed, and keeps the descriptors for reflection.

use prost::Message;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::{env, fs};

const FILES: [&str; 11] = [
    "taxel/v1/error.proto",
    "taxel/v1/request.proto",
    "taxel/v1/reason.proto",
    "taxel/v1/force.proto",
    "taxel/v1/skin.proto",
    "taxel/v1/calibration.proto",
    "taxel/v1/model.proto",
    "taxel/v1/validation.proto",
    "taxel/v1/audit.proto",
    "taxel/v1/ingest.proto",
    "taxel/v1/recording.proto",
];

fn main() -> Result<(), Box<dyn Error>> {
    // As cargo says now: a copy of the repository may share what this was built into.
    let here = env::var_os("CARGO_MANIFEST_DIR").ok_or("CARGO_MANIFEST_DIR is not set")?;
    let root = Path::new(&here).join("../../proto");
    for file in FILES {
        println!("cargo:rerun-if-changed={}", root.join(file).display());
    }
    let descriptors = protox::compile(FILES, [&root])?;
    let out = PathBuf::from(env::var_os("OUT_DIR").ok_or("OUT_DIR is not set")?);
    fs::write(out.join("taxel_descriptors.bin"), descriptors.encode_to_vec())?;
    tonic_prost_build::configure().btree_map(".").compile_fds(descriptors)?;
    Ok(())
}
