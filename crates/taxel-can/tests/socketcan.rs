//! A real interface, as far as a virtual one is real: run by tests/vcan/run-can-tests inside the lab.

mod lab;

use std::io::Write;
use std::time::{Duration, Instant};

use lab::adapter::Adapter;
use lab::{Heard, Vcan, run};
use taxel_can::{
    BusError, BusEvent, ClockReading, DownReason, ErrorCounters, FrameSource, LINK_POLL, NotSent, SendError,
};
use taxel_wire::{CanId, Frame};

const SKIN: CanId = CanId::Standard(0x301);
const NO_INTERFACE: BusEvent = BusEvent::Down { reason: DownReason::NoInterface };
const INTERFACE_DOWN: BusEvent = BusEvent::Down { reason: DownReason::InterfaceDown };

fn numbered(number: u32) -> Frame {
    Frame::of(SKIN, number.to_be_bytes())
}

#[tokio::test]
async fn frames_of_another_process_come_with_the_kernel_s_receive_time() {
    let Some(vcan) = Vcan::up("vc_time") else { return };
    let mut bus = vcan.open(None, false);
    let before = ClockReading::now().time;
    vcan.cansend("301#0102030405060708");
    let sent = ClockReading::now().time;
    let heard = Heard::frames(&mut bus, 1).await;
    assert_eq!(heard.frames[0].frame, Frame::of(SKIN, [1, 2, 3, 4, 5, 6, 7, 8]));
    let time = heard.frames[0].time;
    assert!(before <= time && time <= sent, "{before} <= {time} <= {sent}: not the time of reading");
    assert!(
        matches!(heard.events[0], BusEvent::BufferGranted { bytes, wanted } if bytes >= wanted),
        "{:?}",
        heard.events
    );
    assert_eq!(heard.events[1..], [BusEvent::Up]);
}

#[tokio::test]
async fn a_log_that_canplayer_plays_arrives_whole_and_in_order() {
    let Some(vcan) = Vcan::up("vc_play") else { return };
    let mut file = tempfile::NamedTempFile::new().unwrap();
    let mut sent = Vec::new();
    for i in 0..2_000_u32 {
        let id = if i % 3 == 0 { CanId::Extended(0x0012_3400 + i) } else { SKIN };
        let frame = Frame::data(id, &i.to_be_bytes()[..(i % 5) as usize]).unwrap();
        let data: String = frame.bytes().iter().map(|byte| format!("{byte:02X}")).collect();
        writeln!(file, "(0.{:06}) can0 {id}#{data}", i * 100).unwrap();
        sent.push(frame);
    }
    let path = file.path().to_str().unwrap().to_owned();
    let mut bus = vcan.open(None, false);
    let wire = format!("{}=can0", vcan.name);
    let player = tokio::task::spawn_blocking(move || run("canplayer", &["-I", &path, &wire]));
    let heard = Heard::frames(&mut bus, 2_000).await;
    player.await.unwrap();
    assert_eq!(heard.plain_frames(), sent);
    assert!(heard.frames.is_sorted_by_key(|timed| timed.time));
    assert_eq!(heard.dropped(), 0);
}

#[tokio::test]
async fn only_the_wanted_identifiers_wake_the_owner() {
    let Some(vcan) = Vcan::up("vc_filter") else { return };
    let mut bus = vcan.open(Some(&[SKIN, CanId::Extended(0x18AA_A302)]), false);
    // The first and the last two are wanted; between them their look-alikes.
    let sent = ["301#01", "301#R", "00000301#02", "302#03", "18AAA302#R", "18AAA303#04", "18AAA302#05", "301#06"];
    sent.iter().for_each(|frame| vcan.cansend(frame));
    let heard = Heard::frames(&mut bus, 3).await;
    let wanted = [Frame::of(SKIN, [1]), Frame::of(CanId::Extended(0x18AA_A302), [5]), Frame::of(SKIN, [6])];
    assert_eq!(heard.plain_frames(), wanted);
}

#[tokio::test]
async fn a_flap_too_short_to_be_seen_is_told_all_the_same() {
    let Some(vcan) = Vcan::up("vc_blink") else { return };
    let mut bus = vcan.open(None, false);
    Heard::event(&mut bus, BusEvent::Up).await;
    vcan.set("down");
    vcan.set("up");
    assert_eq!(Heard::event(&mut bus, BusEvent::Up).await.events, [INTERFACE_DOWN, BusEvent::Up]);
}

#[tokio::test]
async fn an_interface_that_is_deleted_and_made_again_is_found_and_nothing_leaks() {
    let Some(vcan) = Vcan::named("vc_again") else { return };
    let mut bus = vcan.open(None, true);
    let heard = Heard::event(&mut bus, NO_INTERFACE).await;
    assert_eq!(heard.events, [NO_INTERFACE], "not there yet");
    let refused = bus.send(&numbered(0)).await;
    assert!(matches!(refused, Err(SendError { why: NotSent::Down(DownReason::NoInterface), .. })), "{refused:?}");
    let mut files = Vec::new();
    for round in 0..10 {
        vcan.create();
        let heard = Heard::event(&mut bus, BusEvent::Up).await;
        assert!(heard.events.iter().any(|event| matches!(event, BusEvent::BufferGranted { .. })));
        vcan.cansend(&format!("301#{round:08X}"));
        assert_eq!(Heard::frames(&mut bus, 1).await.plain_frames(), [numbered(round)]);
        files.push(std::fs::read_dir("/proc/self/fd").unwrap().count());
        vcan.delete();
        let heard = Heard::event(&mut bus, NO_INTERFACE).await;
        assert!(heard.frames.is_empty());
    }
    assert_eq!(files.first(), files.last(), "open files: {files:?}");
}

/// The interface goes down and up 50 times, or as often as TAXELD_FLAPS says: `TAXELD_FLAPS=1000 LAB_TIMEOUT=900
/// tests/vcan/run-can-tests flaps`.
#[tokio::test]
async fn flaps_of_the_interface_are_each_told_lose_nothing_after_them_and_leak_nothing() {
    let Some(vcan) = Vcan::up("vc_flaps") else { return };
    let flaps = std::env::var("TAXELD_FLAPS").map_or(50, |flaps| flaps.parse().unwrap());
    let mut bus = vcan.open(None, true);
    Heard::event(&mut bus, BusEvent::Up).await;
    let mut files = Vec::new();
    for round in 0..flaps {
        vcan.set("down");
        let heard = Heard::event(&mut bus, INTERFACE_DOWN).await;
        assert_eq!(heard.events, [INTERFACE_DOWN], "told once");
        let refused = bus.send(&numbered(round)).await;
        assert!(matches!(refused, Err(SendError { why: NotSent::Down(DownReason::InterfaceDown), .. })), "{refused:?}");
        vcan.set("up");
        // At once: the frame must not wait for the next look at the link, and the state comes before it.
        vcan.cansend(&format!("301#{round:08X}"));
        let heard = Heard::frames(&mut bus, 1).await;
        assert_eq!((heard.events, heard.frames[0].frame), (vec![BusEvent::Up], numbered(round)), "flap {round}");
        bus.send(&numbered(7)).await.unwrap();
        Heard::frames(&mut bus, 1).await;
        files.push(std::fs::read_dir("/proc/self/fd").unwrap().count());
    }
    assert!(files.iter().all(|open| *open == files[0]), "open files: {files:?}");
    println!("{flaps} flaps, {} open files at each", files[0]);
}

/// Whatever can still be opened is, and held until this is dropped.
fn all_descriptors() -> Vec<std::fs::File> {
    std::iter::from_fn(|| std::fs::File::open("/dev/null").ok()).collect()
}

#[tokio::test]
async fn without_a_descriptor_left_a_bus_goes_on_and_its_end_is_told_all_the_same() {
    let Some(vcan) = Vcan::up("vc_scarce") else { return };
    let mut bus = vcan.open(None, true);
    Heard::event(&mut bus, BusEvent::Up).await;
    let held = all_descriptors();
    let (mut heard, begun) = (Heard::default(), Instant::now());
    // For as long as some looks at the link take.
    while begun.elapsed() < 5 * LINK_POLL {
        let sent = numbered(heard.frames.len() as u32);
        bus.send(&sent).await.unwrap();
        heard.until(&mut bus, |heard| heard.frames.last().is_some_and(|last| last.frame == sent)).await;
    }
    assert_eq!(heard.events, []);
    drop(held);
    vcan.delete();
    Heard::event(&mut bus, NO_INTERFACE).await;
}

#[tokio::test]
async fn an_interface_that_is_replaced_between_two_looks_is_found() {
    let Some(vcan) = Vcan::up("vc_swap") else { return };
    let mut bus = vcan.open(None, false);
    Heard::event(&mut bus, BusEvent::Up).await;
    vcan.delete();
    vcan.create();
    Heard::event(&mut bus, NO_INTERFACE).await;
    Heard::event(&mut bus, BusEvent::Up).await;
    vcan.cansend("301#00000001");
    assert_eq!(Heard::frames(&mut bus, 1).await.plain_frames(), [numbered(1)]);
}

#[tokio::test]
async fn a_stall_loses_frames_only_beyond_the_buffer_and_counts_each() {
    let Some(vcan) = Vcan::up("vc_stall") else { return };
    let mut bus = vcan.open(Some(&[SKIN]), false);
    let mut sender = vcan.open(Some(&[]), true);
    // 1 s of a full bus is what the buffer holds at the measured size of a frame, half of it is promised.
    const HELD: u32 = 4_504;
    const SENT: u32 = 15_000;
    for i in 0..HELD {
        sender.send(&numbered(i)).await.unwrap();
    }
    let mut heard = Heard::frames(&mut bus, HELD as usize).await;
    assert_eq!(heard.dropped(), 0, "half a second of a full bus");
    for i in HELD..SENT {
        sender.send(&numbered(i)).await.unwrap();
    }
    // The bus is silent now: the loss at its end is told all the same.
    heard.until(&mut bus, |heard| heard.frames.len() as u64 + heard.dropped() >= u64::from(SENT)).await;
    // One more frame carries the kernel's own count, which must change nothing.
    sender.send(&numbered(SENT)).await.unwrap();
    heard.until(&mut bus, |heard| heard.frames.last().is_some_and(|last| last.frame == numbered(SENT))).await;
    assert!(heard.dropped() > 0);
    assert_eq!(heard.frames.len() as u64 + heard.dropped(), u64::from(SENT) + 1);
    assert!(heard.frames.is_sorted_by_key(|timed| timed.time));
}

#[tokio::test]
async fn an_error_frame_is_an_event_and_marked_as_written_by_a_process() {
    let Some(vcan) = Vcan::up("vc_error") else { return };
    // Also with an empty list of identifiers: errors pass in any case.
    let mut bus = vcan.open(Some(&[]), false);
    vcan.cansend("20000040#0000000000000000");
    let heard = Heard::event(&mut bus, BusEvent::Error { error: BusError::BusOff, local: true }).await;
    assert!(heard.frames.is_empty() && heard.errors.is_empty(), "nobody records what is none of the controller's");
}

/// What a controller says of itself, which no process of this machine wrote.
fn controller(error: BusError) -> BusEvent {
    BusEvent::Error { error, local: false }
}

#[tokio::test]
async fn a_controller_that_leaves_the_bus_is_told_and_heard_again_once_it_is_set_up_again() {
    let Some(mut adapter) = Adapter::plugged("vc_slcan") else { return };
    let mut bus = adapter.open();
    Heard::event(&mut bus, BusEvent::Up).await;
    for round in 0..2 {
        adapter.says("sw096090");
        let few = Some(ErrorCounters { transmit: 90, receive: 96 });
        Heard::event(&mut bus, controller(BusError::Warning(few))).await;
        adapter.says("sp128130");
        let many = Some(ErrorCounters { transmit: 130, receive: 128 });
        Heard::event(&mut bus, controller(BusError::Passive(many))).await;
        adapter.says("e1s");
        Heard::event(&mut bus, controller(BusError::Protocol { violations: 0x04 })).await;
        adapter.says(&format!("t3014{round:08X}"));
        assert_eq!(Heard::frames(&mut bus, 1).await.plain_frames(), [numbered(round)], "errors alone end nothing");
        adapter.says("sb256000");
        let no_carrier = BusEvent::Down { reason: DownReason::NoCarrier };
        let heard = Heard::event(&mut bus, no_carrier).await;
        assert!(heard.events.contains(&controller(BusError::BusOff)), "before the link's own word: {:?}", heard.events);
        assert_eq!(heard.errors.last().map(|timed| timed.frame.id), Some(CanId::Extended(0x40)), "for a recording");
        adapter.set("down");
        Heard::event(&mut bus, INTERFACE_DOWN).await;
        adapter.set("up");
        Heard::event(&mut bus, BusEvent::Up).await;
        adapter.says("tZZZ4not a frame");
        adapter.says(&format!("t3014{round:08X}"));
        assert_eq!(Heard::frames(&mut bus, 1).await.plain_frames(), [numbered(round)]);
    }
}

#[tokio::test]
async fn an_adapter_that_is_unplugged_is_told_and_found_when_it_is_back() {
    let Some(mut adapter) = Adapter::plugged("vc_unplug") else { return };
    let mut bus = adapter.open();
    for round in 0..2 {
        Heard::event(&mut bus, BusEvent::Up).await;
        adapter.says(&format!("t3014{round:08X}"));
        assert_eq!(Heard::frames(&mut bus, 1).await.plain_frames(), [numbered(round)]);
        drop(adapter);
        Heard::event(&mut bus, NO_INTERFACE).await;
        let Some(again) = Adapter::plugged("vc_unplug") else { return };
        adapter = again;
    }
}

#[tokio::test]
async fn a_listening_bus_sends_nothing() {
    let Some(vcan) = Vcan::up("vc_listen") else { return };
    let mut bus = vcan.open(None, false);
    let refused = bus.send(&numbered(1)).await;
    assert!(matches!(refused, Err(SendError { why: NotSent::ListenOnly, id: SKIN })), "{refused:?}");
    vcan.cansend("301#00000002");
    assert_eq!(Heard::frames(&mut bus, 1).await.plain_frames(), [numbered(2)]);
}

#[tokio::test]
async fn a_full_transmit_queue_is_waited_for_and_then_given_up() {
    let Some(vcan) = Vcan::up("vc_queue") else { return };
    let mut bus = vcan.open(None, true);
    let shape = |verb: &str, rate: &str| {
        run("tc", &["qdisc", verb, "dev", &vcan.name, "root", "tbf", "rate", rate, "burst", "64", "limit", "256"]);
    };
    shape("add", "1mbit");
    for i in 0..300 {
        bus.send(&numbered(i)).await.unwrap();
    }
    assert_eq!(Heard::frames(&mut bus, 300).await.frames.len(), 300);
    shape("replace", "1kbit");
    let given_up = loop {
        if let Err(error) = bus.send(&numbered(0)).await {
            break error;
        }
    };
    // 1 + 2 + 4 + 8 + 16 + 32 ms.
    assert!(matches!(given_up.why, NotSent::QueueFull(waited) if waited >= Duration::from_millis(63)), "{given_up}");
}

#[tokio::test]
async fn a_step_of_the_wall_clock_moves_no_frame() {
    if std::env::var("TAXELD_LAB").as_deref() != Ok("uml") {
        return eprintln!("SKIPPED: the clock is stepped only in user-mode Linux, where it is nobody else's");
    }
    let Some(vcan) = Vcan::up("vc_clock") else { return };
    let mut bus = vcan.open(None, false);
    for (step, back) in [("2 hours", "2 hours ago"), ("2 hours ago", "2 hours")] {
        let before = ClockReading::now();
        vcan.cansend("301#00000001");
        run("date", &["-s", step]);
        let heard = Heard::frames(&mut bus, 1).await;
        let after = ClockReading::now();
        let stepped = (after.wall_offset_ns() - before.wall_offset_ns()).abs();
        assert!(stepped > 3_600_000_000_000, "the clock was stepped by {stepped} ns");
        let time = heard.frames[0].time;
        // The floor is the last time that nothing was there: at most as old as the opening or the frame before.
        assert!(
            time.seconds_since(before.time) > -5.0 && time <= after.time,
            "{time} in {} .. {}",
            before.time,
            after.time
        );
        run("date", &["-s", back]);
    }
}
