//! What a reader needs to know of a message: its definition and all that this builds on, as MCAP wants it for protobuf.

use prost::Message;
use prost_types::{FileDescriptorProto, FileDescriptorSet};
use taxel_proto::DESCRIPTORS;

/// The package of every message of ours.
pub(crate) const PACKAGE: &str = "taxel.v1";

/// The schema of a message of `taxel.v1` (`"ForceSample"`): a serialised `FileDescriptorSet` of the file that defines it
/// and of all files that this one imports, without comments. `None` if there is no such message.
#[must_use]
pub fn schema_of(message: &str) -> Option<Vec<u8>> {
    let all = FileDescriptorSet::decode(DESCRIPTORS).ok()?;
    let defines = |file: &&FileDescriptorProto| {
        file.package() == PACKAGE && file.message_type.iter().any(|definition| definition.name() == message)
    };
    let mut file = Vec::new();
    with_imports(&all, all.file.iter().find(defines)?, &mut file);
    Some(FileDescriptorSet { file }.encode_to_vec())
}

/// Appends a file behind those that it imports, each once. Imports have no circles, or protoc would not take them.
fn with_imports(all: &FileDescriptorSet, file: &FileDescriptorProto, found: &mut Vec<FileDescriptorProto>) {
    for import in &file.dependency {
        if let Some(imported) = all.file.iter().find(|other| other.name() == import) {
            with_imports(all, imported, found);
        }
    }
    if !found.iter().any(|other| other.name() == file.name()) {
        found.push(FileDescriptorProto { source_code_info: None, ..file.clone() });
    }
}
