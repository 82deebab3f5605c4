//! Scans that a program pushes: what reaches the engine, and what ends the stream.

use taxel_proto::v1::ingest_service_client::IngestServiceClient;
use taxel_rpc::push_line::{PushEvent, SCANS_WAITING_MAX};
use taxel_rpc::{Role, Tokens};
use tokio_stream::wrappers::ReceiverStream;
use tonic::Request;

use crate::fixture::*;

fn begin(patch: &str) -> v1::PushScansRequest {
    v1::PushScansRequest { patch: patch.to_owned(), ..Default::default() }
}

fn scan(count: u32) -> v1::PushScansRequest {
    v1::PushScansRequest { counts: vec![count; TAXELS], pressure_kpa: Some(12.5), ..Default::default() }
}

/// A program that pushes.
struct Client {
    scans: mpsc::Sender<v1::PushScansRequest>,
    answers: Streaming<v1::PushScansResponse>,
}

impl Client {
    /// Begins a stream, which the engine lets it do.
    async fn begin(daemon: &mut Daemon) -> Self {
        Self::begin_as(daemon, GLOVE, None).await
    }

    /// The same, with this token if there is one.
    async fn begin_as(daemon: &mut Daemon, of: &str, token: Option<&str>) -> Self {
        let (scans, messages) = mpsc::channel(64);
        scans.send(begin(of)).await.unwrap();
        let mut request = Request::new(ReceiverStream::new(messages));
        if let Some(token) = token {
            request.metadata_mut().insert("authorization", format!("Bearer {token}").parse().unwrap());
        }
        let mut client = IngestServiceClient::new(daemon.connect().await);
        let answer = daemon.answer(Ok(Done::PushBegun), |command| {
            assert!(matches!(&command, Command::BeginPush { patch } if patch == of), "{command:?}");
        });
        let (answers, ()) = tokio::join!(client.push_scans(request), answer);
        let mut answers = answers.unwrap().into_inner();
        let first = answers.message().await.unwrap().unwrap();
        assert_eq!((first.taken, first.refused), (0, 0));
        Self { scans, answers }
    }

    async fn push(&self, scan: v1::PushScansRequest) {
        self.scans.send(scan).await.unwrap();
    }

    /// How the stream ends.
    async fn end(mut self) -> Status {
        loop {
            match self.answers.message().await {
                Ok(Some(_)) => {}
                Ok(None) => return Status::ok(""),
                Err(status) => return status,
            }
        }
    }
}

/// Why a stream is refused that begins so.
async fn refused(daemon: &Daemon, patch: &str) -> Status {
    let (scans, messages) = mpsc::channel(1);
    scans.send(begin(patch)).await.unwrap();
    let mut client = IngestServiceClient::new(daemon.connect().await);
    client.push_scans(ReceiverStream::new(messages)).await.unwrap_err()
}

async fn glove(limits: Limits) -> Daemon {
    start_with(&[GLOVE, FOREARM], limits).await
}

#[tokio::test]
async fn pushed_scans_reach_the_engine_with_the_time_of_their_receipt() {
    let mut daemon = glove(patient()).await;
    daemon.set_clock(Time::from_seconds(3.0));
    let client = Client::begin(&mut daemon).await;
    client.push(scan(4095)).await;
    let pushed = daemon.pushed.recv().await.unwrap();
    let PushEvent::Scan(scan) = pushed.event else { panic!("{pushed:?}") };
    assert_eq!((scan.patch, scan.time, scan.pressure), (0, Time::from_seconds(3.0), Some(Kilopascal(12.5))));
    assert_eq!(scan.counts, vec![4095; TAXELS]);
    let Client { scans, mut answers } = client;
    drop(scans);
    let last = answers.message().await.unwrap().unwrap();
    assert_eq!((last.taken, last.refused), (1, 0));
    let ended = daemon.pushed.recv().await.unwrap();
    assert!(matches!(&ended.event, PushEvent::Ended(why) if why.contains("has ended the stream")), "{ended:?}");
}

#[tokio::test]
async fn the_readings_of_a_gauge_are_pushed_without_scans() {
    let mut daemon = start_with(&[ARM], patient()).await;
    daemon.set_clock(Time::from_seconds(3.0));
    let client = Client::begin_as(&mut daemon, ARM, None).await;
    client.push(v1::PushScansRequest { pressure_kpa: Some(12.5), ..Default::default() }).await;
    let pushed = daemon.pushed.recv().await.unwrap();
    let PushEvent::Reading(timed) = pushed.event else { panic!("{pushed:?}") };
    assert_eq!((pushed.bus, timed.time), (BusIndex(1), Time::from_seconds(3.0)));
    assert_eq!(pushed_gauge().decode(&timed.frame), Ok(Kilopascal(12.5)));
    client.push(scan(7)).await;
    let status = client.end().await;
    let says = "counts: come with reading 2, but the scans of patch `left_arm` come over its bus";
    assert!(status.code() == Code::InvalidArgument && status.message().contains(says), "{status:?}");
    let client = Client::begin_as(&mut daemon, ARM, None).await;
    client.push(v1::PushScansRequest::default()).await;
    let status = client.end().await;
    assert!(status.message().contains("pressure_kpa: is missing in reading 1"), "{status:?}");
}

/// A program that begins a stream waits for the disk, which has to have that first.
#[tokio::test]
async fn scans_that_wait_for_the_answer_are_as_old_as_the_first_message() {
    let mut daemon = glove(patient()).await;
    daemon.set_clock(Time::from_seconds(3.0));
    let (scans, messages) = mpsc::channel(1);
    scans.send(v1::PushScansRequest { patch: GLOVE.to_owned(), ..scan(7) }).await.unwrap();
    let mut client = IngestServiceClient::new(daemon.connect().await);
    let begun = tokio::spawn(async move { client.push_scans(ReceiverStream::new(messages)).await });
    let request = daemon.requests.recv().await.unwrap();
    daemon.set_clock(Time::from_seconds(5.0));
    request.reply.send(Ok(Done::PushBegun)).unwrap();
    let pushed = daemon.pushed.recv().await.unwrap();
    let PushEvent::Scan(scan) = pushed.event else { panic!("{pushed:?}") };
    assert_eq!((scan.time, scan.taken), (Time::from_seconds(3.0), Time::from_seconds(5.0)));
    begun.await.unwrap().unwrap();
}

#[tokio::test]
async fn what_is_no_scan_ends_the_stream_with_scan_taxel_and_value_and_is_not_used() {
    let mut wrong_taxel = scan(7);
    wrong_taxel.counts[13] = 4096;
    let mut wide = scan(7);
    wide.counts[0] = u32::MAX;
    let short = v1::PushScansRequest { counts: vec![7; TAXELS - 1], ..Default::default() };
    let pressure = |kpa| v1::PushScansRequest { pressure_kpa: Some(kpa), ..scan(7) };
    for (message, says) in [
        (wrong_taxel, "counts: taxel 13 of scan 2 is 4096, expected 0 to 4095"),
        (wide, "counts: taxel 0 of scan 2 is 4294967295, expected 0 to 4095"),
        (short, "counts: scan 2 has 19 counts, expected 20, one per taxel"),
        (begin(""), "counts: scan 2 has 0 counts, expected 20, one per taxel"),
        (pressure(f64::NAN), "pressure_kpa: NaN in scan 2, expected -200 to 2000"),
        (pressure(1e9), "pressure_kpa: 1000000000 in scan 2, expected -200 to 2000"),
        (
            v1::PushScansRequest { patch: FOREARM.to_owned(), ..scan(7) },
            "patch: this stream pushes the scans of `glove` and cannot change to another",
        ),
    ] {
        let mut daemon = glove(patient()).await;
        let client = Client::begin(&mut daemon).await;
        client.push(scan(7)).await;
        client.push(message).await;
        let status = client.end().await;
        assert_eq!((status.code(), status.message()), (Code::InvalidArgument, says));
        assert!(matches!(daemon.pushed.recv().await.unwrap().event, PushEvent::Scan(_)));
        let ended = daemon.pushed.recv().await.unwrap();
        assert!(matches!(&ended.event, PushEvent::Ended(why) if why.contains(says)), "{ended:?}");
    }
}

#[tokio::test]
async fn a_second_pusher_is_told_who_pushes_and_may_begin_when_that_one_has_ended() {
    let mut daemon = glove(patient()).await;
    let first = Client::begin(&mut daemon).await;
    let refused = refused(&daemon, GLOVE).await;
    assert_eq!(refused.code(), Code::AlreadyExists, "{refused:?}");
    assert!(refused.message().contains("127.0.0.1") && refused.message().contains(GLOVE), "{refused:?}");
    let Client { scans, mut answers } = first;
    drop(scans);
    while answers.message().await.unwrap().is_some() {}
    Client::begin(&mut daemon).await;
}

#[tokio::test]
async fn scans_that_the_engine_does_not_take_are_refused_and_counted() {
    let mut daemon = glove(patient()).await;
    let client = Client::begin(&mut daemon).await;
    let many = SCANS_WAITING_MAX as u64 + 5;
    for _ in 0..many {
        client.push(scan(7)).await;
    }
    let Client { scans, mut answers } = client;
    drop(scans);
    let mut last = v1::PushScansResponse::default();
    while let Some(answer) = answers.message().await.unwrap() {
        last = answer;
    }
    assert_eq!((last.taken, last.refused), (SCANS_WAITING_MAX as u64, 5));
    let told: u64 = std::iter::from_fn(|| daemon.pushed.try_recv().ok()).map(|pushed| pushed.refused).sum();
    assert_eq!(told, 5, "the engine learns of each");
}

#[tokio::test]
async fn a_pusher_that_pauses_for_too_long_makes_room_for_another() {
    let mut daemon = glove(Limits { push_pause: Duration::from_millis(300), ..patient() }).await;
    let client = Client::begin(&mut daemon).await;
    let scans = client.scans.clone();
    let status = client.end().await;
    assert_eq!((status.code(), status.message()), (Code::DeadlineExceeded, "no scan was pushed for 0.3 s"));
    drop(scans);
    Client::begin(&mut daemon).await;
}

#[tokio::test]
async fn nobody_pushes_the_scans_of_boards_or_of_a_patch_that_is_not_there() {
    let daemon = glove(patient()).await;
    for (patch, code) in [(FOREARM, Code::FailedPrecondition), ("elbow", Code::NotFound), ("", Code::InvalidArgument)] {
        let refused = refused(&daemon, patch).await;
        assert_eq!(refused.code(), code, "{refused:?}");
    }
}

#[tokio::test]
async fn a_shutdown_ends_the_stream_of_a_pusher() {
    let mut daemon = glove(patient()).await;
    let client = Client::begin(&mut daemon).await;
    let scans = client.scans.clone();
    daemon.shutdown.cancel();
    assert_eq!(client.end().await.code(), Code::Unavailable);
    drop(scans);
}

/// The holder of the token `abc` in this role (its hash is of FIPS 180-2 appendix B.1), and nobody else.
fn holder(role: Role) -> Rules {
    let hash = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
    Rules { tokens: Tokens::parse(&format!("{role} glove {hash}")).unwrap(), ..Rules::default() }
}

fn ruled(rules: Rules) -> (Daemon, Access) {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let (address, access) = (listener.local_addr().unwrap(), Access::new(rules));
    // A stream that is not judged anew ends all the same, and otherwise.
    let limits = Limits { push_pause: Limits::default().push_pause, ..patient() };
    let daemon = serve_on(vec![Listener::Tcp(listener)], access.clone(), (&[GLOVE, FOREARM], limits), address);
    (daemon, access)
}

#[tokio::test]
async fn a_pusher_that_may_push_no_more_is_ended_and_no_later_scan_of_it_enters() {
    let nobody = Rules::default();
    let of_others = Rules { loopback: Some(Role::Admin), ..Rules::default() };
    for (token, before, after, code) in [
        (None, Rules::open(), nobody, Code::Unauthenticated),
        (Some("abc"), holder(Role::Operator), of_others, Code::Unauthenticated),
        (Some("abc"), holder(Role::Operator), holder(Role::Observer), Code::PermissionDenied),
    ] {
        for pushes_on in [true, false] {
            let (mut daemon, access) = ruled(before.clone());
            let client = Client::begin_as(&mut daemon, GLOVE, token).await;
            client.push(scan(7)).await;
            assert!(matches!(daemon.pushed.recv().await.unwrap().event, PushEvent::Scan(_)));
            access.update(|_| after.clone());
            let scans = client.scans.clone();
            if pushes_on {
                client.push(scan(8)).await;
            }
            let status = client.end().await;
            assert_eq!(status.code(), code, "{status:?}");
            let ended = daemon.pushed.recv().await.unwrap();
            assert!(matches!(&ended.event, PushEvent::Ended(why) if why.contains(status.message())), "{ended:?}");
            access.update(|_| Rules::open());
            Client::begin(&mut daemon).await;
            drop(scans); // the first client has not ended its request meanwhile
        }
    }
}
