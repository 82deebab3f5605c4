//! The message of each call of the service, as it comes from a client.

use prost::Message;
use taxel_proto::v1;

use crate::requests::Requests;

/// Requests, one after the other.
pub fn run(data: &[u8]) {
    for (call, message) in Requests::new(data) {
        if let Some((_, check)) = CHECKS.iter().find(|(name, _)| *name == call) {
            check(message);
        }
    }
}

/// The calls whose messages are read: all that there are.
pub fn calls() -> impl Iterator<Item = &'static str> {
    CHECKS.iter().map(|(call, _)| *call)
}

/// What is read can be written, is read again as the same, and has no more in it than came.
fn check<M: Message + Default>(bytes: &[u8]) {
    let Ok(message) = M::decode(bytes) else { return };
    let written = message.encode_to_vec();
    // A list of one number takes a byte more in the form in which it is written.
    assert!(written.len() <= 2 * bytes.len(), "{} bytes of {}", written.len(), bytes.len());
    let again = M::decode(&*written).expect("what was written is read");
    // Equal bytes are equal messages, also where a number is NaN.
    assert_eq!(again.encode_to_vec(), written);
}

/// A call's name, and how its message is checked.
type Check = (&'static str, fn(&[u8]));

const CHECKS: &[Check] = &[
    ("ActivateModelSet", check::<v1::ActivateModelSetRequest>),
    ("AdvanceSession", check::<v1::AdvanceSessionRequest>),
    ("BringUp", check::<v1::BringUpRequest>),
    ("DeleteModelSet", check::<v1::DeleteModelSetRequest>),
    ("DeleteSession", check::<v1::SessionRequest>),
    ("ExportModelSet", check::<v1::ExportModelSetRequest>),
    ("ExportSamples", check::<v1::SessionRequest>),
    ("GetForce", check::<v1::PatchRequest>),
    ("GetHealth", check::<()>),
    ("GetModelSet", check::<v1::GetModelSetRequest>),
    ("GetSession", check::<v1::SessionRequest>),
    ("GetSkin", check::<v1::PatchRequest>),
    ("GetValidation", check::<v1::PatchRequest>),
    ("ImportModelSet", check::<v1::ImportModelSetRequest>),
    ("ListAudit", check::<v1::ListAuditRequest>),
    ("ListModelSets", check::<v1::ListRequest>),
    ("ListSessions", check::<v1::ListRequest>),
    ("PushScans", check::<v1::PushScansRequest>),
    ("Recalibrate", check::<v1::RecalibrateRequest>),
    ("RecordLoad", check::<v1::RecordLoadRequest>),
    ("RefitSessions", check::<v1::RefitSessionsRequest>),
    ("StartSession", check::<v1::StartSessionRequest>),
    ("StreamForce", check::<v1::StreamRequest>),
    ("StreamTaxels", check::<v1::StreamRequest>),
    ("Tare", check::<v1::TareRequest>),
    ("WatchEvents", check::<v1::WatchEventsRequest>),
    ("WatchSession", check::<v1::SessionRequest>),
];
