//! Requests that mean no good: each is refused, costs little and harms nobody else.

use crate::fixture::*;

/// Nothing that is waited for takes longer, on the slowest machine.
const PATIENCE: Duration = Duration::from_secs(60);

const GET_FORCE: &str = "/taxel.v1.ForceService/GetForce";
const STREAM: &str = "/taxel.v1.ForceService/StreamForce";
const IMPORT: &str = "/taxel.v1.ModelService/ImportModelSet";

async fn still_serves(daemon: &Daemon) {
    assert_eq!(daemon.post(GET_FORCE, "{}").await.status, 200);
}

#[tokio::test]
async fn bad_json_is_refused_with_what_was_expected() {
    let daemon = start().await;
    let deep = "[".repeat(60_000);
    for body in
        ["{", "[]", "null", "1", "{\"patch\": 1}", "{\"speed\": 1}", "{}{}", "\u{0}", &deep, "{\"patch\": \"\\ud800\"}"]
    {
        let answer = daemon.post(GET_FORCE, body).await;
        assert_eq!(answer.status, 400, "{}: {answer:?}", &body[..body.len().min(40)]);
        assert!(answer.body.contains("taxel.v1.PatchRequest"), "{answer:?}");
    }
    still_serves(&daemon).await;
}

#[tokio::test]
async fn a_huge_body_is_refused() {
    let daemon = start().await;
    let huge = "x".repeat(100_000);
    assert_eq!(daemon.post(GET_FORCE, &huge).await.status, 413);
    let told = "Content-Type: application/json\r\n";
    let chunked = format!("POST {GET_FORCE} HTTP/1.1\r\nHost: localhost\r\n{told}Transfer-Encoding: chunked\r\n\r\n");
    let chunked = format!("{chunked}{}", "1000\r\n".to_owned() + &"x".repeat(0x1000) + "\r\n");
    let endless = chunked + &("1000\r\n".to_owned() + &"x".repeat(0x1000) + "\r\n").repeat(100);
    assert_eq!(daemon.raw(endless.as_bytes()).await.status, 413);
    still_serves(&daemon).await;
}

#[tokio::test]
async fn a_model_set_may_be_large() {
    let daemon = start().await;
    let body = format!("{{\"json\": \"{}\"}}", "x".repeat(3_000_000));
    let answer = daemon.post(IMPORT, &body).await;
    assert!(answer.status == 400 && answer.body.contains("3000000 bytes"), "{answer:?}");
}

#[tokio::test]
async fn a_name_that_is_not_ours_gets_nothing() {
    let daemon = start().await;
    for path in ["/", GET_FORCE, STREAM] {
        let request = format!("GET {path} HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n");
        let answer = daemon.raw(request.as_bytes()).await;
        assert_eq!(answer.status, 403, "{path}: {answer:?}");
    }
    for head in ["", "Host: localhost\r\nHost: evil.example\r\n"] {
        let answer = daemon.raw(format!("GET / HTTP/1.1\r\nConnection: close\r\n{head}\r\n").as_bytes()).await;
        assert_eq!(answer.status, 400, "{head}: {answer:?}");
    }
    let proxied = daemon.raw(b"GET / HTTP/1.1\r\nHost: robot.lab\r\nConnection: close\r\n\r\n").await;
    assert_eq!(proxied.status, 200);
}

#[tokio::test]
async fn a_page_from_elsewhere_gets_nothing() {
    let daemon = start().await;
    daemon.engine.patch(0, snapshot(1));
    let own = format!("Origin: http://{}\r\n", daemon.address);
    let json = "Content-Type: application/json\r\n";
    assert_eq!(daemon.post_with(GET_FORCE, "{}", &format!("{own}{json}")).await.status, 200);
    for header in ["Origin: http://evil.example\r\n", "Sec-Fetch-Site: cross-site\r\n"] {
        let answer = daemon.post_with(GET_FORCE, "{}", &format!("{header}{json}")).await;
        assert_eq!(answer.status, 403, "{header}: {answer:?}");
        assert_eq!(daemon.get_with(STREAM, header).await.status, 403, "{header}");
    }
    // What a form of another site can send without asking.
    for kind in ["", "Content-Type: text/plain\r\n", "Content-Type: application/x-www-form-urlencoded\r\n"] {
        assert_eq!(daemon.post_with(GET_FORCE, "{}", kind).await.status, 415, "{kind}");
    }
    let ask = format!("OPTIONS {GET_FORCE} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    let answer = daemon.raw(ask.as_bytes()).await;
    assert!(answer.status == 405 && !answer.head.contains("access-control"), "{answer:?}");
}

#[tokio::test]
async fn paths_lead_nowhere_but_to_calls_and_the_pages_files() {
    let daemon = start().await;
    for path in [
        "/../Cargo.toml",
        "/..%2f..%2fetc/passwd",
        "//etc/passwd",
        "/main.js%00",
        "/taxel.v1.ForceService",
        "/taxel.v1.ForceService/NoSuch",
        "/taxel.v1.NoSuch/GetForce",
        "/grpc.reflection.v1.ServerReflection/ServerReflectionInfo",
    ] {
        for answer in [daemon.get(path).await, daemon.post(path, "{}").await] {
            assert_eq!(answer.status, 404, "{path}: {answer:?}");
        }
    }
    still_serves(&daemon).await;
}

#[tokio::test]
async fn who_sends_slowly_is_closed() {
    let short = Duration::from_millis(50);
    let daemon = start_with(Limits { head: short, body: short, ..patient() }).await;
    // A head that never ends, none at all, an idle connection after an answer.
    for begun in ["", "GET / HTTP/1.1\r\nHost: localhost\r\nX: ", "GET /icon.svg HTTP/1.1\r\nHost: localhost\r\n\r\n"] {
        let mut slow = daemon.connect().await;
        slow.write_all(begun.as_bytes()).await.unwrap();
        let mut all = Vec::new();
        slow.read_to_end(&mut all).await.unwrap(); // ends, so it was closed
    }
    let told = "Content-Type: application/json\r\n";
    let half = format!("POST {GET_FORCE} HTTP/1.1\r\nHost: localhost\r\n{told}Content-Length: 100\r\n\r\n{{");
    assert_eq!(daemon.raw(half.as_bytes()).await.status, 408);
}

#[tokio::test]
async fn five_hundred_idle_sockets_take_no_more_than_their_places_and_keep_nobody_out() {
    let daemon = start_with(patient_with(8)).await;
    let mut sockets = Vec::new();
    for _ in 0..500 {
        sockets.push(daemon.connect().await);
    }
    let mut closed = 0;
    for socket in &mut sockets[..492] {
        let mut byte = [0; 1];
        closed += usize::from(!matches!(socket.read(&mut byte).await, Ok(1)));
    }
    assert_eq!(closed, 492);
    still_serves(&daemon).await;
    assert_eq!(daemon.get("/metrics").await.status, 200);
    drop(sockets);
}

#[tokio::test]
async fn who_reads_nothing_of_a_stream_is_cut_off_and_its_place_is_free_again() {
    let limits = patient_with(1);
    let connections =
        taxel_rpc::Limits { check_every: Duration::from_millis(20), preface_checks: 1_000, ..limits.connections };
    let daemon = start_with(Limits { connections, ..limits }).await;
    daemon.engine.patch(0, snapshot(1));
    let events = daemon.stream("/taxel.v1.SkinService/StreamTaxels").await;
    let stalled = events.lines;
    let freed = async {
        for sequence in 2.. {
            daemon.engine.patch(0, snapshot(sequence));
            tokio::task::yield_now().await;
            if sequence % 100 == 0 && daemon.post(GET_FORCE, "{}").await.status == 200 {
                break;
            }
        }
    };
    tokio::time::timeout(PATIENCE, freed).await.expect("its place is never free");
    drop(stalled);
}
