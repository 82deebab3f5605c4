//! Gauges on real pseudo terminals and connections.

use std::io::{Read, Write};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use nix::fcntl::OFlag;
use nix::pty::{PtyMaster, grantpt, posix_openpt, ptsname_r, unlockpt};
use taxel_can::FrameSource;
use taxel_rig::Template;
use taxel_rig::modbus::{Framing, Number, Register, Request};
use taxel_wire::signal::{PressureMeaning, PressureUnit};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpListener;
use tokio::time::timeout;

use super::*;

type LineBus = RemoteBus<Gauge>;

/// The end of a pseudo terminal that is the gauge's, and where the other one is.
fn terminal() -> (PtyMaster, PathBuf) {
    let master = posix_openpt(OFlag::O_RDWR | OFlag::O_NOCTTY).unwrap();
    grantpt(&master).unwrap();
    unlockpt(&master).unwrap();
    let path = ptsname_r(&master).unwrap().into();
    (master, path)
}

fn bus(at: &str, poll: &str) -> LineBus {
    let template = Template::new("P={kPa}").unwrap();
    let at = At::new(at).unwrap();
    of(at, Speech::Text { poll: poll.to_owned(), template })
}

fn of(at: At, speech: Speech) -> LineBus {
    line_bus(Line { at, speech })
}

fn serial(path: &Path) -> LineBus {
    bus(path.to_str().unwrap(), "")
}

/// What the bus says next: pressures and events.
async fn next(bus: &mut LineBus) -> (Vec<f64>, Vec<BusEvent>) {
    let mut batch = Batch::default();
    bus.next(&mut batch).await.unwrap();
    let signal = reading::signal(0, PressureUnit::Kilopascal, PressureMeaning::Differential);
    (batch.frames.iter().map(|timed| signal.decode(&timed.frame).unwrap().0).collect(), batch.events)
}

/// Why the bus is down, by its next event.
async fn down(bus: &mut LineBus) -> String {
    loop {
        for event in next(bus).await.1 {
            if let BusEvent::SourceDown { why } = event {
                return why;
            }
        }
    }
}

// Time goes on as it does where bytes are waited for: a kernel that takes its while for them would be outrun by a clock that jumps.

/// Opens the terminal from the other end, so that what is written is kept for it.
async fn opened(bus: &mut LineBus) {
    let mut batch = Batch::default();
    while bus.remote.open.is_none() {
        assert!(timeout(Duration::from_millis(1), bus.next(&mut batch)).await.is_err());
    }
}

#[tokio::test]
async fn a_gauge_on_a_serial_line_is_read_from_its_first_whole_line_on() {
    let (mut gauge, path) = terminal();
    let mut bus = serial(&path);
    opened(&mut bus).await;
    gauge.write_all(b"=9.5\r\nP=12.5\r\n").unwrap();
    assert_eq!(next(&mut bus).await, (vec![12.5], vec![BusEvent::Up]));
    gauge.write_all(b"P=13.25\nP=14\n").unwrap();
    assert_eq!(next(&mut bus).await, (vec![14.0], vec![]), "what comes at once is one reading, the newest");
}

#[tokio::test]
async fn a_gauge_that_is_unplugged_and_plugged_in_is_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let device = folder.path().join("gauge");
    let (mut gauge, path) = terminal();
    symlink(&path, &device).unwrap();
    let mut bus = serial(&device);
    opened(&mut bus).await;
    gauge.write_all(b"\nP=1\n").unwrap();
    assert_eq!(next(&mut bus).await.0, [1.0]);
    drop(gauge);
    std::fs::remove_file(&device).unwrap();
    assert!(down(&mut bus).await.starts_with(&device.display().to_string()));
    assert!(down(&mut bus).await.contains("No such file"), "told once, and again where the reason is another one");
    let (mut gauge, path) = terminal();
    symlink(&path, &device).unwrap();
    let printing = Arc::new(AtomicBool::new(true));
    let prints = Arc::clone(&printing);
    let gauge = std::thread::spawn(move || {
        while prints.load(Ordering::Relaxed) && gauge.write_all(b"P=3\n").is_ok() {
            std::thread::sleep(Duration::from_millis(10)); // a gauge that prints a hundred times a second
        }
    });
    let read = loop {
        let (read, _) = next(&mut bus).await;
        if !read.is_empty() {
            break read;
        }
    };
    assert_eq!(read, [3.0]);
    printing.store(false, Ordering::Relaxed);
    gauge.join().unwrap();
}

#[tokio::test(start_paused = true)]
async fn a_gauge_that_stops_is_told() {
    let (_gauge, path) = terminal();
    let mut bus = serial(&path);
    let why = down(&mut bus).await;
    assert_eq!(why, format!("{}@115200: no line came for 3 s: is the gauge on, or does it need poll?", path.display()));
    assert_eq!(down(&mut self::bus("/dev/null", "")).await, "/dev/null@115200: it is no serial device");
}

#[tokio::test(start_paused = true)]
async fn only_one_program_reads_a_serial_line() {
    let (_gauge, path) = terminal();
    let mut first = serial(&path);
    opened(&mut first).await;
    assert!(down(&mut serial(&path)).await.ends_with("another program has it open"));
}

#[tokio::test]
async fn a_gauge_that_has_to_be_asked_is_and_its_echo_is_no_answer() {
    let (mut gauge, path) = terminal();
    let mut bus = bus(path.to_str().unwrap(), "P?\r\n");
    let answers = std::thread::spawn(move || {
        let mut asked = [0; 4];
        for kpa in 1..=3 {
            gauge.read_exact(&mut asked).unwrap();
            assert_eq!(&asked, b"P?\r\n");
            gauge.write_all(format!("P?\r\nP={kpa}\r\n").as_bytes()).unwrap();
        }
        gauge
    });
    let mut read = Vec::new();
    while read.len() < 3 {
        let (more, events) = next(&mut bus).await;
        assert!(events.iter().all(|event| *event == BusEvent::Up), "{events:?}");
        read.extend(more);
    }
    assert_eq!(read, [1.0, 2.0, 3.0]);
    drop(answers.join());
}

#[tokio::test(start_paused = true)]
async fn a_gauge_that_hangs_up_at_once_is_tried_with_growing_pauses() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let mut bus = bus(&format!("tcp:{}", listener.local_addr().unwrap()), "");
    let (mut tries, mut batch) = (0, Batch::default());
    let read = async { while bus.next(&mut batch).await.is_ok() {} };
    let serve = async {
        while tries < 1_000 && listener.accept().await.is_ok() {
            tries += 1
        }
    };
    tokio::select! {
        () = read => {}
        () = serve => {}
        () = tokio::time::sleep(Duration::from_secs(60)) => {}
    }
    assert!((5..=25).contains(&tries), "{tries} in a minute");
}

/// A register of slave 1 that counts the questions, over TCP and as RTU over a pseudo terminal.
#[tokio::test]
async fn a_register_is_asked_again_and_again() {
    let register = Request::Read(Register { slave: 1, input: true, address: 18, number: Number::I16, scale: 0.5 });
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let at = At::new(&format!("tcp:{}", listener.local_addr().unwrap())).unwrap();
    let mut bus = of(at, Speech::Modbus(register.clone(), Framing::Tcp));
    let serve = async {
        let (mut gauge, _) = listener.accept().await.unwrap();
        let mut question = [0; 12];
        for value in 1..=3 {
            gauge.read_exact(&mut question).await.unwrap();
            assert_eq!(question[2..], [0, 0, 0, 6, 1, 4, 0, 18, 0, 1]);
            gauge.write_all(&[question[0], question[1], 0, 0, 0, 5, 1, 4, 2, 0, value]).await.unwrap();
        }
        gauge
    };
    let read = async { [next(&mut bus).await.0, next(&mut bus).await.0, next(&mut bus).await.0].concat() };
    let (read, gauge) = tokio::join!(read, serve);
    assert_eq!(read, [0.5, 1.0, 1.5]);
    drop(gauge);
    assert!(down(&mut bus).await.contains("the line has ended"));

    let (mut gauge, path) = terminal();
    let mut bus = of(At::Serial(path, 115_200), Speech::Modbus(register, Framing::Rtu));
    let serve = std::thread::spawn(move || {
        let mut question = [0; 8];
        gauge.read_exact(&mut question).unwrap();
        gauge.write_all(&[1, 4, 2, 0, 7, 0xF8, 0xF2]).unwrap();
        gauge
    });
    let (read, events) = next(&mut bus).await;
    assert_eq!((read, events), (vec![3.5], vec![BusEvent::Up]));
    drop(serve.join());
}
