//! The audit log: what a command takes along for it, and how it is read.

use taxel_engine::audit::{Answered, Asked};
use taxel_proto::v1::audit_service_client::AuditServiceClient;

use crate::fixture::*;

/// What the next command takes along, which nobody answers.
async fn asked(daemon: &mut Daemon) -> Box<Asked> {
    daemon.requests.recv().await.unwrap().asked.unwrap()
}

#[tokio::test]
async fn a_command_takes_along_who_asked_from_where_and_for_what() {
    let mut daemon = start().await;
    let channel = daemon.connect().await;
    let tare = v1::TareRequest { confirmed_by: " Ann ".to_owned(), ..Default::default() };
    let mut skin = SkinServiceClient::new(channel.clone());
    let (_, tare) = tokio::join!(skin.tare(tare), asked(&mut daemon));
    let load = v1::RecordLoadRequest {
        load: Some(v1::record_load_request::Load::MassKg(0.5)),
        by: "Bob".to_owned(),
        replaces: 4,
        note: "left".to_owned(),
        relative_uncertainty: Some(0.02),
        patch: String::new(),
    };
    let mut validation = ValidationServiceClient::new(channel);
    let (_, load) = tokio::join!(validation.record_load(load), asked(&mut daemon));
    let all = [tare, load];
    let shown: Vec<_> = all.iter().map(|a| (a.method.as_str(), a.what.as_str(), a.claimed.as_str())).collect();
    let expected = [
        ("Tare", "TareRequest { patch: \"\", confirmed_by: \" Ann \" }", "Ann"),
        (
            "RecordLoad",
            "RecordLoadRequest { patch: \"\", relative_uncertainty: Some(0.02), note: \"left\", by: \"Bob\", replaces: 4, \
             load: Some(MassKg(0.5)) }",
            "Bob",
        ),
    ];
    assert_eq!(shown, expected);
    for asked in &all {
        assert_eq!(
            (asked.transport.as_str(), asked.role.as_str(), asked.patch.as_str()),
            ("loopback", "admin", FOREARM)
        );
        assert!(asked.place.starts_with("127.0.0.1:"), "{asked:?}");
    }
}

#[tokio::test]
async fn names_that_are_too_long_or_hold_control_characters_are_refused() {
    let daemon = start().await;
    let channel = daemon.connect().await;
    for (name, expected) in [
        ("x".repeat(257), "confirmed_by: 257 bytes, at most 256 are kept"),
        ("Ann\u{1b}[2J".to_owned(), "confirmed_by: has the unprintable character U+001B, expected a name"),
        ("Ann\nBob".to_owned(), "confirmed_by: has the unprintable character U+000A, expected a name"),
        ("Ann\u{85}".to_owned(), "confirmed_by: has the unprintable character U+0085, expected a name"),
        ("Ann\u{202e}".to_owned(), "confirmed_by: has the unprintable character U+202E, expected a name"),
        ("\u{3164}".to_owned(), "confirmed_by: has the unprintable character U+3164, expected a name"),
        ("  ".to_owned(), "confirmed_by: `  ` has no letter and no digit, expected a name"),
        ("\u{301}".to_owned(), "confirmed_by: `\u{301}` has no letter and no digit, expected a name"),
    ] {
        let request = v1::TareRequest { confirmed_by: name, ..Default::default() };
        let status = SkinServiceClient::new(channel.clone()).tare(request).await.unwrap_err();
        assert_eq!((status.code(), status.message()), (Code::InvalidArgument, expected));
    }
    let load = Some(v1::record_load_request::Load::MassKg(0.5));
    let request = v1::RecordLoadRequest { load, by: "\u{7f}".to_owned(), ..Default::default() };
    let status = ValidationServiceClient::new(channel).record_load(request).await.unwrap_err();
    assert!(status.message().starts_with("by: has the unprintable character U+007F"), "{status:?}");
}

/// A log of 25 entries, of which the 7th was never answered.
fn log() -> Store {
    let audit = |(before, most): (u64, u32), told: Told<Vec<AuditEntry>>| {
        let entry = |number: u64| AuditEntry {
            number,
            asked: Some(Asked {
                who: format!("who {number}"),
                patch: if number.is_multiple_of(10) { "palm" } else { "" }.to_owned(),
                wall_ns: 1,
                ..Asked::default()
            }),
            answered: (number != 7).then(|| Answered { result: "done".to_owned(), wall_ns: 2, ..Answered::default() }),
            damage: String::new(),
        };
        told(Ok((1..=25).rev().filter(|number| *number < before).take(most as usize).map(entry).collect()));
    };
    Store { audit: Some(Box::new(audit)), ..Store::default() }
}

#[tokio::test]
async fn the_log_is_read_in_pages_and_each_entry_comes_once() {
    let daemon = start_backed(log(), patient()).await;
    let mut client = AuditServiceClient::new(daemon.connect().await);
    let (mut seen, mut before): (Vec<v1::AuditEntry>, _) = (Vec::new(), 0);
    for entries in [10, 10, 5] {
        let request = v1::ListRequest { most: 10, before, ..Default::default() };
        seen.extend(client.list_audit(request).await.unwrap().into_inner().entries);
        before = seen.last().unwrap().entry;
        assert_eq!(seen.len() % 10, entries % 10);
    }
    assert_eq!(seen.iter().map(|entry| entry.entry).collect::<Vec<_>>(), (1..=25).rev().collect::<Vec<_>>());
    let unanswered = seen.iter().find(|entry| entry.entry == 7).unwrap();
    assert_eq!((unanswered.result.as_str(), unanswered.answered), ("", None));
    let of_palm = v1::ListRequest { patch: "palm".to_owned(), most: 3, ..Default::default() };
    let of_palm = client.list_audit(of_palm).await.unwrap().into_inner().entries;
    assert_eq!(of_palm.iter().map(|entry| entry.entry).collect::<Vec<_>>(), [20, 10], "however far apart they are");
    let request = v1::ListRequest { most: 1_001, ..Default::default() };
    assert_eq!(client.list_audit(request).await.unwrap_err().code(), Code::InvalidArgument);
}
