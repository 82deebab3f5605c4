//! Messages as JSON: the canonical form of protobuf, as grpcurl prints it, with every field that has a default.

use std::sync::LazyLock;

use anyhow::Context;
use prost::Message;
use prost_reflect::{DescriptorPool, DynamicMessage, SerializeOptions};

use super::failure::Outcome;

static POOL: LazyLock<DescriptorPool> =
    LazyLock::new(|| DescriptorPool::decode(taxel_proto::DESCRIPTORS).unwrap_or_default());

/// The JSON of a message of package `taxel.v1` in one line.
fn text(name: &str, message: &impl Message) -> anyhow::Result<String> {
    let descriptor =
        POOL.get_message_by_name(&format!("taxel.v1.{name}")).with_context(|| format!("no message {name}"))?;
    let dynamic = DynamicMessage::decode(descriptor, message.encode_to_vec().as_slice())?;
    let mut out = Vec::new();
    let mut serializer = serde_json::Serializer::new(&mut out);
    dynamic.serialize_with_options(&mut serializer, &SerializeOptions::new().skip_default_fields(false))?;
    Ok(String::from_utf8(out)?)
}

/// Prints the JSON of a message as a line.
///
/// # Errors
/// If the package has no message of this name.
pub fn print(name: &str, message: &impl Message) -> Outcome {
    say!("{}", text(name, message)?);
    Ok(())
}
