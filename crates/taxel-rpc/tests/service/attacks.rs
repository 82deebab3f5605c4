//! Peers that mean no good, or do not know better: each costs little and harms nobody else.

use std::time::{Duration, Instant};
use taxel_proto::v1;
use taxel_proto::v1::force_service_client::ForceServiceClient;
use taxel_rpc::{Limits, Rate};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::fixture::{Daemon, FOREARM, patient, start, start_with};
use crate::server::read_to_end;

async fn still_serves(daemon: &Daemon) {
    ForceServiceClient::new(daemon.connect().await).get_force(v1::GetForceRequest::default()).await.unwrap();
}

#[tokio::test]
async fn a_peer_without_a_preface_is_closed() {
    let daemon = start_with(&[FOREARM], Limits { preface: Duration::from_millis(20), ..patient() }).await;
    let mut silent = TcpStream::connect(daemon.address).await.unwrap();
    let mut half = TcpStream::connect(daemon.address).await.unwrap();
    half.write_all(b"PRI * HTTP/2.0\r\n").await.unwrap();
    read_to_end(&mut silent).await;
    read_to_end(&mut half).await;
    // On a machine that is busy elsewhere an honest peer can miss 20 ms, too; then it tries again.
    for _ in 0..100 {
        let Ok(channel) = daemon.endpoint().connect().await else { continue };
        if ForceServiceClient::new(channel).get_force(v1::GetForceRequest::default()).await.is_ok() {
            return;
        }
    }
    panic!("an honest peer was closed 100 times");
}

#[tokio::test]
async fn connections_beyond_the_limit_are_closed_on_arrival_and_others_go_on() {
    let daemon = start_with(&[FOREARM], Limits { connections: 1, ..patient() }).await;
    let mut client = ForceServiceClient::new(daemon.connect().await);
    client.get_force(v1::GetForceRequest::default()).await.unwrap();
    let mut second = TcpStream::connect(daemon.address).await.unwrap();
    assert_eq!(read_to_end(&mut second).await, 0);
    client.get_force(v1::GetForceRequest::default()).await.unwrap();
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
    still_serves(&daemon).await;
}

/// Frames after a correct preface and empty settings.
async fn flood(daemon: &Daemon, frames: impl Iterator<Item = Vec<u8>>) -> (usize, bool) {
    let mut peer = TcpStream::connect(daemon.address).await.unwrap();
    peer.write_all(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0").await.unwrap();
    let mut sent = 0;
    for frame in frames {
        if peer.write_all(&frame).await.is_err() {
            return (sent, true);
        }
        sent += 1;
    }
    let _ = peer.shutdown().await;
    read_to_end(&mut peer).await;
    (sent, false)
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
async fn endless_headers_close_the_connection() {
    let daemon = start().await;
    let first = std::iter::once(frame(1, 0, 1, &[0x82])); // HEADERS without END_HEADERS
    let more = (0..100_000).map(|_| frame(9, 0, 1, &[0x82; 64])); // CONTINUATION
    let (sent, closed) = flood(&daemon, first.chain(more)).await;
    assert!(closed, "{sent} frames were taken");
    still_serves(&daemon).await;
}

#[tokio::test]
async fn rapid_resets_close_the_connection() {
    let daemon = start().await;
    // HEADERS with END_STREAM and END_HEADERS: method POST, scheme http, path /; then RST_STREAM with CANCEL.
    let calls = (0..200_000_u32).flat_map(|n| {
        let stream = 2 * n + 1;
        [frame(1, 5, stream, &[0x83, 0x86, 0x84]), frame(3, 0, stream, &[0, 0, 0, 8])]
    });
    let (sent, closed) = flood(&daemon, calls).await;
    assert!(closed, "{sent} frames were taken");
    still_serves(&daemon).await;
}

/// Nothing of what is answered is read, so that it waits in the daemon's memory.
#[tokio::test]
async fn requests_that_are_none_close_the_connection() {
    let daemon = start().await;
    // HEADERS with END_STREAM and END_HEADERS that hold `te: gzip` alone.
    let none = b"\0\x02te\x04gzip";
    let (sent, closed) = flood(&daemon, (0..1_000_000_u32).map(|n| frame(1, 5, 2 * n + 1, none))).await;
    assert!(closed, "{sent} frames were taken");
    still_serves(&daemon).await;
}

/// Reads frames until one of this kind has come.
async fn until(peer: &mut TcpStream, kind: u8) {
    loop {
        let mut head = [0; 9];
        peer.read_exact(&mut head).await.unwrap();
        let length = u32::from_be_bytes([0, head[0], head[1], head[2]]);
        peer.read_exact(&mut vec![0; length as usize]).await.unwrap();
        if head[3] == kind && (kind != PING || head[4] == 1) {
            return;
        }
    }
}

const PING: u8 = 6;
const RST_STREAM: u8 = 3;

/// The daemon skips them for a second, and no call is brought on by them. A ping is answered when what came before it was read.
#[tokio::test]
async fn frames_of_a_call_that_was_refused_are_read_no_faster_than_other_frames_of_no_call() {
    let frames_of_no_call = Rate { burst: 1, every: Duration::from_millis(10) };
    let daemon = start_with(&[FOREARM], Limits { frames_of_no_call, ..patient() }).await;
    let trailers = frame(1, 5, 1, &[]); // HEADERS with END_STREAM and END_HEADERS
    for after_the_end in [trailers, frame(0, 1, 1, &[]), frame(0, 1, 1, &[0])] {
        let mut peer = TcpStream::connect(daemon.address).await.unwrap();
        peer.write_all(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0").await.unwrap();
        // A request that does not end, for a method that is not there.
        peer.write_all(&frame(1, 4, 1, &[0x83, 0x86, 0x84])).await.unwrap();
        until(&mut peer, RST_STREAM).await;
        let begun = Instant::now();
        let ping = || frame(PING, 0, 0, &[0; 8]);
        peer.write_all(&[after_the_end.repeat(50), ping()].concat()).await.unwrap();
        until(&mut peer, PING).await;
        peer.write_all(&ping()).await.unwrap();
        until(&mut peer, PING).await;
        let took = begun.elapsed().as_secs_f64();
        assert!(took >= 0.4, "50 frames that begin with {:?} took {took} s, each 10 ms", &after_the_end[..5]);
    }
    still_serves(&daemon).await;
}
