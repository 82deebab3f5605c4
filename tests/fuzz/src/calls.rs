//! Calls of the service as a client makes them: through all its layers, without a socket.

mod house;

use std::time::Duration;

use http_body_util::{BodyExt, Full};
use taxel_engine::command::Command;
use taxel_proto::refusal::reason_of;
use taxel_rpc::SharedServices;
use tonic::body::Body;
use tonic::codegen::{Bytes, Service, http};
use tonic::transport::server::TcpConnectInfo;
use tonic::{Code, Status};

use crate::requests::Requests;
use house::{House, Method};

/// Longest that a call may take; none does anything that takes time.
const ANSWER_MAX: Duration = Duration::from_secs(10);

/// So often a stream is given its turn to say something.
const TURNS: u32 = 20;

/// Longest text of a refusal, in bytes: it has to fit into headers.
const TEXT_BYTES_MAX: usize = 1_500;

/// Longest command as text, in bytes: names and a note of a client are kept.
const COMMAND_BYTES_MAX: usize = 4_000;

thread_local! {
    static HOUSE: House = House::build();
}

/// Calls, one after the other. Each is answered, or refused with words and a reason; what reaches the engine is bounded.
pub fn run(data: &[u8]) {
    HOUSE.with(|house| {
        for (name, message) in Requests::new(data) {
            let Some(method) = house.methods.get(name) else { continue };
            let call = call(house.services.clone(), method, message);
            let called = house.runtime.block_on(async { tokio::time::timeout(ANSWER_MAX, call).await });
            let answer = called.unwrap_or_else(|_| panic!("{name} was not answered"));
            let commands = house.commands.try_iter().collect::<Vec<_>>();
            assert!(commands.len() <= 1, "{name}: {commands:?}");
            commands.iter().for_each(check_command);
            if let Err(status) = answer {
                check_refusal(name, &status);
            }
        }
    });
}

/// The end of a call; of a stream that goes on, its beginning.
async fn call(mut services: SharedServices, method: &Method, message: &[u8]) -> Result<(), Status> {
    let request = http::Request::post(format!("http://localhost/{}", method.path))
        .header("content-type", "application/grpc")
        .header("te", "trailers")
        .extension(TcpConnectInfo { local_addr: None, remote_addr: Some(([127, 0, 0, 1], 1).into()) })
        .body(Body::new(Full::new(framed(method, message))))
        .expect("a request");
    let ready = |cx: &mut std::task::Context<'_>| Service::<http::Request<Body>>::poll_ready(&mut services, cx);
    std::future::poll_fn(ready).await.unwrap_or_else(|never| match never {});
    let response = services.call(request).await.unwrap_or_else(|never| match never {});
    assert_eq!(response.status(), 200);
    ended(response.headers())?;
    let mut body = response.into_body();
    if method.answers_stream {
        let mut turns = 0;
        return tokio::select! {
            biased;
            frame = body.frame() => frame.map_or(Ok(()), checked),
            () = async { while turns < TURNS { turns += 1; tokio::task::yield_now().await } } => Ok(()),
        };
    }
    while let Some(frame) = body.frame().await {
        checked(frame)?;
    }
    Ok(())
}

/// The message as it travels; of a stream of requests each begins with a byte of its length.
fn framed(method: &Method, mut message: &[u8]) -> Bytes {
    let mut bytes = Vec::new();
    let mut frame = |message: &[u8]| {
        bytes.push(0);
        bytes.extend((message.len() as u32).to_be_bytes());
        bytes.extend(message);
    };
    if !method.asks_stream {
        frame(message);
    }
    while let Some((length, rest)) = message.split_first().filter(|_| method.asks_stream) {
        let (one, rest) = rest.split_at(usize::from(*length).min(rest.len()));
        frame(one);
        message = rest;
    }
    bytes.into()
}

fn checked(frame: Result<http_body::Frame<Bytes>, Status>) -> Result<(), Status> {
    match frame?.into_data() {
        Ok(data) => {
            check_messages(&data);
            Ok(())
        }
        Err(frame) => frame.trailers_ref().map_or(Ok(()), ended),
    }
}

/// Whole messages, as many as were ready together, none of them compressed.
fn check_messages(mut data: &[u8]) {
    while !data.is_empty() {
        let (&[compressed, ref length @ ..], rest) = data.split_first_chunk::<5>().expect("a message has a head");
        assert_eq!(compressed, 0);
        let length = u32::from_be_bytes(*length) as usize;
        data = rest.get(length..).unwrap_or_else(|| panic!("{length} bytes were said, and {} came", rest.len()));
    }
}

fn ended(headers: &http::HeaderMap) -> Result<(), Status> {
    Status::from_header_map(headers).filter(|status| status.code() != Code::Ok).map_or(Ok(()), Err)
}

/// Words, and a reason for programs; the fault is never that of the daemon.
fn check_refusal(name: &str, status: &Status) {
    let reason = reason_of(status).unwrap_or_default();
    let shown = format!("{name}: {:?}, {reason}: {}", status.code(), status.message());
    assert!(!status.message().is_empty() && status.message().len() <= TEXT_BYTES_MAX, "{shown}");
    assert!(
        !matches!(reason.as_str(), "" | "ERROR_REASON_UNSPECIFIED" | "PROGRAM_FAULT" | "DAEMON_UNAVAILABLE"),
        "{shown}"
    );
    assert!(status.code() != Code::Unknown, "{shown}");
}

/// What a client writes is short, and names what there is, before the engine sees it.
fn check_command(command: &Command) {
    match command {
        Command::Import { .. } | Command::KeepRefit { .. } | Command::KeepRecalibration { .. } => return,
        Command::Tare { patch, .. }
        | Command::BringUp { patch, .. }
        | Command::StartSession { patch, .. }
        | Command::BeginPush { patch }
        | Command::Activate { patch, .. }
        | Command::RecordLoad { patch, .. } => house::is_patch(patch),
        _ => {}
    }
    let shown = format!("{command:?}");
    assert!(shown.len() <= COMMAND_BYTES_MAX, "{shown}");
}
