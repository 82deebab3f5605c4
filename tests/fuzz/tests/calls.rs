//! The list of messages that are fuzzed against the service's own description.

#![allow(clippy::unwrap_used, clippy::panic)]

use prost::Message as _;
use prost_types::FileDescriptorSet;

#[test]
fn the_message_of_every_call_is_read() {
    let files = FileDescriptorSet::decode(taxel_proto::DESCRIPTORS).unwrap().file;
    let services = files.iter().flat_map(|file| &file.service);
    let mut expected: Vec<&str> = services.flat_map(|service| &service.method).map(|method| method.name()).collect();
    expected.sort_unstable();
    assert_eq!(taxel_fuzz::messages::calls().collect::<Vec<_>>(), expected);
}
