//! What a host sees of the faults of boards, taxels, foreign nodes and its own adapter.

use crate::common::*;

const MS: fn(u64) -> Duration = Duration::from_millis;

/// Times of the heads of module 0 of a board, in seconds.
fn scan_times(frames: &[TimedFrame], address: u8) -> Vec<f64> {
    let of_board = |(time, message): (Time, Message)| match message {
        Message::Head { board, module, .. } if (board.get(), module.get()) == (address, 0) => Some(time.as_seconds()),
        _ => None,
    };
    messages(frames).into_iter().filter_map(of_board).collect()
}

/// All values that taxel `taxel` of board 13 sent; it must be one of the first seven of its module.
fn values_of(frames: &[TimedFrame], taxel: usize) -> Vec<u8> {
    let of_taxel = |(_, message): (Time, Message)| match message {
        Message::Head { board, module, values } if board.get() == 13 && usize::from(module.get()) == taxel / 10 => {
            Some(values[taxel % 10])
        }
        _ => None,
    };
    messages(frames).into_iter().filter_map(of_taxel).collect()
}

#[test]
fn another_period_lasts_until_it_is_mended() {
    let mut world = streaming(1);
    for (n, (period_ms, scans)) in [(10, 100), (100, 10)].into_iter().enumerate() {
        let begin = 3.0 * n as f64;
        let fault = Fault::OtherPeriod { board: board(12), period_ms };
        world.inject(fault).unwrap();
        advance(&mut world, begin + 0.2);
        let frames = advance(&mut world, begin + 1.2);
        assert!(scan_times(&frames, 12).len().abs_diff(scans) <= 1, "{period_ms} ms");
        assert!(scan_times(&frames, 13).len().abs_diff(20) <= 1);
        world.repair(fault).unwrap();
        advance(&mut world, begin + 2.0);
        assert!(scan_times(&advance(&mut world, begin + 3.0), 12).len().abs_diff(20) <= 1);
    }
}

#[test]
fn the_adapter_gives_old_scans_again_with_fresh_times() {
    let mut world = streaming(1);
    advance(&mut world, 1.0);
    world.pump(ramp(40.0, 40.0));
    let rising = advance(&mut world, 3.0);
    world.pump(PumpCommand::Vent);
    advance(&mut world, 4.0);
    world.inject(Fault::FramesReplayed { span: MS(3000), within: MS(100) }).unwrap();
    let burst = advance(&mut world, 4.1);
    assert!(scan_times(&burst, 13).len() > 55, "{} scans", scan_times(&burst, 13).len());
    let times: Vec<_> = burst.iter().map(|frame| frame.time).collect();
    assert!(times.is_sorted() && times[0] >= seconds(4.0));
    let mut again = values_of(&burst, 3).into_iter();
    assert!(values_of(&rising, 3).iter().all(|old| again.any(|value| value == *old)), "between them come live ones");
    advance(&mut world, 4.2);
    assert!(scan_times(&advance(&mut world, 5.2), 13).len().abs_diff(20) <= 1);
}

#[test]
fn a_slow_adapter_keeps_all_and_gives_it_late() {
    let mut world = streaming(1);
    let mut sound = world.clone();
    advance(&mut world, 1.0);
    world.inject(Fault::FramesHeld { span: MS(700), within: MS(50) }).unwrap();
    assert!(advance(&mut world, 1.69).is_empty());
    let late = advance(&mut world, 3.0);
    advance(&mut sound, 1.0);
    let wire = |frames: &[TimedFrame]| frames.iter().map(|frame| frame.frame).collect::<Vec<_>>();
    assert_eq!(wire(&late), wire(&advance(&mut sound, 3.0)), "nothing is lost and nothing overtakes");
    let burst = late.iter().filter(|frame| frame.time < seconds(1.76)).count();
    assert!(burst > 600, "{burst} frames in 60 ms");
}

#[test]
fn duplicated_and_swapped_frames_are_those_of_the_wire() {
    let mut sound = streaming(1);
    let clean = advance(&mut sound, 5.0);
    for fault in [Fault::FramesDuplicated { probability: 0.1 }, Fault::FramesSwapped { probability: 0.1 }] {
        let mut world = streaming(1);
        world.inject(fault).unwrap();
        let got = advance(&mut world, 5.0);
        assert!(got.is_sorted_by_key(|frame| frame.time));
        let more = got.len() as isize - clean.len() as isize;
        let changed = got.iter().zip(&clean).filter(|(a, b)| a.frame != b.frame).count();
        match fault {
            Fault::FramesDuplicated { .. } => assert!((400..700).contains(&more), "{more} more"),
            _ => assert!((-1..=0).contains(&more) && changed > 700, "{more} more, {changed} at another place"),
        }
    }
}

#[test]
fn loads_come_roll_and_go_and_the_truth_follows() {
    let mut world = streaming(1);
    advance(&mut world, 1.0);
    let mass = Mass::on_disc(0.5, TaxelIndex(100), 600.0);
    let load = world.place(mass, MS(1000)).unwrap();
    for (now, share) in [(1.5, 0.5), (2.5, 1.0)] {
        advance(&mut world, now);
        assert!((world.true_force().0 - share * mass.weight().0).abs() < 1e-9, "at {now} s");
    }
    world.roll(load, TaxelIndex(20), MS(1000)).unwrap();
    advance(&mut world, 4.0);
    let pressed: Vec<_> = world.true_taxel_pressures().collect();
    assert!(pressed[20].0 > 10.0 && pressed[100].0 == 0.0);
    world.lift(load, MS(200));
    advance(&mut world, 5.0);
    assert_eq!(world.true_force().0, 0.0);
}
