use super::*;
use proptest::prelude::*;

const OK: StatusWord = StatusWord(0);
const PERIOD: Duration = Duration::from_millis(50);
const WINDOW: Duration = Duration::from_millis(40);

fn ms(millis: f64) -> Time {
    Time::from_seconds(millis * 1e-3)
}

fn scan(time: Time, head: u8, tail: u8) -> ModuleScan {
    let mut values = [head; 12];
    values[7..].fill(tail);
    ModuleScan { time, values, status: OK }
}

#[test]
fn the_window_is_exclusive_and_what_waits_for_so_long_is_an_orphan_once() {
    let mut pairer = Pairer::new(WINDOW);
    pairer.head(ms(0.0), [1; 7]);
    assert_eq!(pairer.tail(ms(40.0), [1; 5], OK), None);
    assert_eq!(pairer.orphans(), Orphans { heads: 1, tails: 1 });
    pairer.head(ms(100.0), [1; 7]);
    assert!(pairer.tail(ms(139.999), [1; 5], OK).is_some());
    pairer.head(ms(140.0), [1; 7]); // a whole window after the last head it is no duplicate
    assert!(pairer.tail(ms(140.0), [1; 5], OK).is_some(), "frames of one batch may share a time");
    pairer.head(ms(200.0), [1; 7]);
    for (now, heads) in [(239.9, 1), (240.0, 2), (500.0, 2)] {
        pairer.expire(ms(now));
        assert_eq!(pairer.orphans().heads, heads, "at {now} ms");
    }
}

#[test]
fn duplicates_before_and_after_the_pairing_change_nothing() {
    let mut pairer = Pairer::new(WINDOW);
    pairer.head(ms(0.0), [1; 7]);
    pairer.head(ms(0.1), [1; 7]);
    assert_eq!(pairer.tail(ms(0.2), [1; 5], OK), Some(scan(ms(0.2), 1, 1)));
    assert_eq!(pairer.tail(ms(0.3), [1; 5], OK), None);
    pairer.head(ms(0.4), [1; 7]);
    assert_eq!(pairer.duplicates(), Duplicates { heads: 2, tails: 1 });
    assert_eq!(pairer.orphans(), Orphans::default());

    pairer.head(ms(50.0), [1; 7]);
    assert!(pairer.tail(ms(50.2), [1; 5], OK).is_some(), "the next scan with the same values is no duplicate");
}

#[test]
fn a_tail_of_other_values_or_status_is_no_duplicate() {
    let mut pairer = Pairer::new(WINDOW);
    pairer.head(ms(0.0), [1; 7]);
    pairer.tail(ms(0.2), [1; 5], OK);
    pairer.tail(ms(0.3), [2; 5], OK);
    pairer.tail(ms(0.3), [1; 5], StatusWord(1));
    assert_eq!(pairer.orphans(), Orphans { heads: 0, tails: 2 });
}

#[test]
fn a_clock_that_steps_back_costs_one_scan() {
    let mut pairer = Pairer::new(WINDOW);
    pairer.head(ms(1e9), [1; 7]);
    assert_eq!(pairer.tail(ms(0.1), [1; 5], OK), None, "stamped before the head: not its tail");
    pairer.expire(ms(0.1));
    pairer.head(ms(50.0), [2; 7]);
    assert_eq!(pairer.tail(ms(50.1), [2; 5], OK), Some(scan(ms(50.1), 2, 2)));
    assert_eq!(pairer.orphans(), Orphans { heads: 1, tails: 1 });
}

/// One half on its way: lost, late, doubled.
#[derive(Clone, Debug)]
struct Fate {
    value: u8,
    lost: bool,
    delay_us: i64,
    copies_delay_us: Vec<i64>,
}

#[derive(Clone, Copy, Debug)]
struct Arrival {
    at_us: i64,
    scan: usize,
    is_tail: bool,
}

const JITTER_US: i64 = 10_000; // the period less the window
const GAP_US: i64 = 120; // a frame's length on the bus

fn any_fate() -> impl Strategy<Value = Fate> {
    let copies = prop_oneof![4 => Just(vec![]), 1 => prop::collection::vec(0..=JITTER_US, 1..3)];
    let delay = prop_oneof![Just(0), 0..=JITTER_US];
    // Few values, so that scans often repeat each other as they do on real skin.
    (0..3_u8, prop::bool::weighted(0.2), delay, copies).prop_map(|(value, lost, delay_us, copies_delay_us)| Fate {
        value,
        lost,
        delay_us,
        copies_delay_us,
    })
}

fn arrivals(scans: &[(Fate, Fate)]) -> Vec<Arrival> {
    let mut arrivals = Vec::new();
    for (scan, (head, tail)) in scans.iter().enumerate() {
        let sent_us = scan as i64 * PERIOD.as_micros() as i64;
        for (half, is_tail, sent_us) in [(head, false, sent_us), (tail, true, sent_us + GAP_US)] {
            let first = (!half.lost).then_some(half.delay_us);
            let delays = first.into_iter().chain(half.copies_delay_us.iter().copied());
            arrivals.extend(delays.map(|delay_us| Arrival { at_us: sent_us + delay_us, scan, is_tail }));
        }
    }
    arrivals.sort_by_key(|arrival| arrival.at_us);
    arrivals
}

#[derive(Default)]
struct Tally {
    heads: u64,
    tails: u64,
    scans: u64,
}

fn counts_add_up(pairer: &Pairer, tally: &Tally) -> Result<(), TestCaseError> {
    let (orphans, duplicates) = (pairer.orphans(), pairer.duplicates());
    let counted = tally.scans + orphans.heads + duplicates.heads;
    prop_assert!(tally.heads == counted || tally.heads == counted + 1, "one may wait");
    prop_assert_eq!(tally.tails, tally.scans + orphans.tails + duplicates.tails);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2048))]

    #[test]
    fn two_scans_are_never_mixed(scans in prop::collection::vec((any_fate(), any_fate()), 1..40)) {
        let mut pairer = Pairer::new(WINDOW);
        let mut tally = Tally::default();
        for arrival in arrivals(&scans) {
            let (head, tail) = &scans[arrival.scan];
            let time = Time::from_nanos(arrival.at_us * 1000);
            if arrival.is_tail {
                tally.tails += 1;
                if let Some(published) = pairer.tail(time, [tail.value; 5], OK) {
                    tally.scans += 1;
                    prop_assert_eq!(published, scan(time, head.value, tail.value), "of scan {}", arrival.scan);
                }
            } else {
                tally.heads += 1;
                pairer.head(time, [head.value; 7]);
            }
            counts_add_up(&pairer, &tally)?;
        }
    }

    #[test]
    fn in_order_and_without_loss_each_scan_comes_out_once(
        values in prop::collection::vec(0..3_u8, 1..40),
        copies in 1..4_usize,
    ) {
        let mut pairer = Pairer::new(WINDOW);
        let mut published = 0;
        for (n, &value) in values.iter().enumerate() {
            let start = Time::default() + PERIOD * n as u32;
            for _ in 0..copies {
                pairer.head(start, [value; 7]);
            }
            for _ in 0..copies {
                published += usize::from(pairer.tail(start + PERIOD / 100, [value; 5], OK).is_some());
            }
        }
        prop_assert_eq!(published, values.len());
        prop_assert_eq!(pairer.orphans(), Orphans::default());
    }
}
