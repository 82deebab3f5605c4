//! Peers that mean no good, or do not know better: each costs little, is ended, and harms nobody else.

use tokio::io::AsyncWriteExt;
use tokio::net::TcpSocket;

use crate::fixture::*;
use crate::server::read_to_end;

/// Preface and empty settings.
const BEGIN: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0";

/// So short that a watch of ten looks takes no time, on the slowest machine.
const SHORT: Duration = Duration::from_millis(5);

#[tokio::test]
async fn a_peer_without_a_preface_is_closed() {
    let daemon = start_with(&[FOREARM], Limits { check_every: SHORT, preface_checks: 4, ..patient() }).await;
    let mut silent = TcpStream::connect(daemon.address).await.unwrap();
    let mut half = TcpStream::connect(daemon.address).await.unwrap();
    half.write_all(&BEGIN[..20]).await.unwrap();
    read_to_end(&mut silent).await;
    read_to_end(&mut half).await;
}

/// It answers pings and reads its socket, so that neither TCP nor the keepalive sees anything.
#[tokio::test]
async fn a_reader_that_gives_no_window_is_ended_and_its_place_is_free() {
    let limits =
        Limits { check_every: SHORT, preface_checks: 1_000, streams: 1, keepalive_interval: SHORT, ..patient() };
    let daemon = start_with(&[FOREARM], limits).await;
    daemon.engine().patch(0, snapshot(1, Time::default()));
    let mute = daemon.endpoint().initial_stream_window_size(0).connect().await.unwrap();
    let _untaken = stream(mute.clone(), None).await.unwrap();
    while stream(daemon.connect().await, None).await.is_err() {}
    while get_force(mute.clone()).await.is_ok() {} // its connection is gone, and it may come again
}

/// A reader of all taxels that reads nothing.
pub async fn mute(daemon: &Daemon) -> TcpStream {
    let socket = TcpSocket::new_v4().unwrap();
    socket.set_recv_buffer_size(4096).unwrap();
    let mut mute = socket.connect(daemon.address).await.unwrap();
    // Windows of 2 GiB, and `/taxel.v1.SkinService/StreamTaxels` for an empty message.
    let path = b"/taxel.v1.SkinService/StreamTaxels";
    let headers = [&[0x83, 0x86, 0x04, path.len() as u8][..], path].concat();
    let wide = [frame(4, 0, 0, &[0, 4, 0x7f, 0xff, 0xff, 0xff]), frame(8, 0, 0, &[0x7f, 0, 0, 0])].concat();
    let call = [frame(1, 4, 1, &headers), frame(0, 1, 1, &[0; 5])].concat();
    mute.write_all(&[BEGIN, &wide, &call].concat()).await.unwrap();
    mute
}

/// The socket is full, so that not even a ping goes out.
#[tokio::test]
async fn a_reader_that_reads_nothing_at_all_is_ended_and_its_place_is_free() {
    let limits = Limits { check_every: SHORT, preface_checks: 1_000, streams: 1, ..patient() };
    let daemon = start_with(&[FOREARM], limits).await;
    let _mute = mute(&daemon).await;
    let mut refused = false;
    for sequence in 1.. {
        daemon.engine().patch(0, snapshot(sequence, Time::default()));
        match stream(daemon.connect().await, None).await {
            Err(_) => refused = true,
            Ok(_) if refused => break,
            Ok(_) => {} // it has not subscribed yet
        }
    }
}

/// The connections answer pings and make no call: they are let live until somebody else needs their places.
#[tokio::test]
async fn idle_connections_make_room_for_new_programs_and_not_for_those_with_a_stream() {
    let limits = Limits { connections: 12, connections_per_peer: 8, ..patient() };
    let (daemon, _folder, unix) = on_two_doors(limits);
    daemon.engine().patch(0, snapshot(1, Time::default()));
    let mut reader = stream(daemon.connect().await, None).await.unwrap();
    reader.message().await.unwrap().unwrap();
    let mut idle = Vec::new();
    for _ in 0..7 {
        let channel = daemon.connect().await;
        get_force(channel.clone()).await.unwrap();
        idle.push(channel);
    }
    // All places of loopback are taken: each new program gets the place of one that is idle.
    for _ in 0..20 {
        get_force(daemon.connect().await).await.unwrap();
    }
    daemon.engine().patch(0, snapshot(2, Time::default()));
    assert_eq!(reader.message().await.unwrap().unwrap().sequence, 2, "a stream is not idle");
    // Another peer has its own places.
    get_force(unix.connect().await.unwrap()).await.unwrap();
}

#[tokio::test]
async fn a_connection_is_refused_only_when_all_others_have_calls_under_way() {
    let daemon = start_with(&[FOREARM], Limits { connections: 2, ..patient() }).await;
    daemon.engine().patch(0, snapshot(1, Time::default()));
    let mut readers = Vec::new();
    for _ in 0..2 {
        readers.push(stream(daemon.connect().await, None).await.unwrap());
    }
    let mut third = TcpStream::connect(daemon.address).await.unwrap();
    assert_eq!(read_to_end(&mut third).await, 0);
    for reader in &mut readers {
        reader.message().await.unwrap().unwrap();
    }
    readers.pop();
    while daemon.endpoint().connect().await.is_err() {}
}

#[tokio::test]
async fn a_thousand_idle_sockets_keep_no_client_out() {
    let daemon = start().await;
    let client = daemon.connect().await;
    let mut idle = Vec::new();
    for _ in 0..900 {
        idle.push(TcpStream::connect(daemon.address).await.unwrap());
    }
    for _ in 0..20 {
        get_force(daemon.connect().await).await.unwrap();
    }
    // The oldest were closed for the newer ones, and not a client that is known.
    read_to_end(&mut idle[0]).await;
    get_force(client).await.unwrap();
}

#[tokio::test]
async fn garbage_is_answered_by_closing() {
    let daemon = start().await;
    for garbage in [&b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"[..], &[0xFF; 4096], &[0x16, 3, 1, 2, 0, 1, 0, 1, 0xFC, 3, 3]]
    {
        let mut peer = TcpStream::connect(daemon.address).await.unwrap();
        let _ = peer.write_all(garbage).await;
        read_to_end(&mut peer).await; // its own end stays open
    }
    get_force(daemon.connect().await).await.unwrap();
}

/// HTTP/2 frame: length, type, flags, stream, payload (RFC 9113 section 4.1).
fn frame(kind: u8, flags: u8, stream: u32, payload: &[u8]) -> Vec<u8> {
    let mut bytes = (payload.len() as u32).to_be_bytes()[1..].to_vec();
    bytes.extend([kind, flags]);
    bytes.extend(stream.to_be_bytes());
    bytes.extend(payload);
    bytes
}

#[tokio::test]
async fn endless_headers_rapid_resets_and_requests_that_are_none_close_the_connection() {
    // HEADERS without END_HEADERS, and CONTINUATION.
    let endless = std::iter::once(frame(1, 0, 1, &[0x82])).chain((0..100_000).map(|_| frame(9, 0, 1, &[0x82; 64])));
    // HEADERS with END_STREAM and END_HEADERS: method POST, scheme http, path /; then RST_STREAM with CANCEL.
    let reset = |n: u32| [frame(1, 5, 2 * n + 1, &[0x83, 0x86, 0x84]), frame(3, 0, 2 * n + 1, &[0, 0, 0, 8])];
    // HEADERS with END_STREAM and END_HEADERS that hold `te: gzip` alone.
    let none = |n: u32| frame(1, 5, 2 * n + 1, b"\0\x02te\x04gzip");
    let daemon = start().await;
    flood(&daemon, "endless headers", endless).await;
    flood(&daemon, "rapid resets", (0..200_000).flat_map(reset)).await;
    flood(&daemon, "requests that are none", (0..1_000_000).map(none)).await;
}

/// Sends frames after a correct preface and empty settings until the connection is closed; what is answered waits in the daemon.
async fn flood(daemon: &Daemon, what: &str, mut frames: impl Iterator<Item = Vec<u8>>) {
    let mut peer = TcpStream::connect(daemon.address).await.unwrap();
    peer.write_all(BEGIN).await.unwrap();
    let closed = loop {
        let Some(frame) = frames.next() else { break false };
        if peer.write_all(&frame).await.is_err() {
            break true;
        }
    };
    assert!(closed, "{what}: all frames were taken");
    get_force(daemon.connect().await).await.unwrap();
}
