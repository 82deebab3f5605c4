use super::*;
use proptest::prelude::*;

fn a_view() -> impl Strategy<Value = SessionView> {
    let words = (".*", ".*", proptest::option::of(".*"), proptest::option::of("m-[0-9a-f]{16}"));
    let numbers =
        (any::<u64>(), any::<i64>(), any::<i64>(), 0.0..100.0_f64, any::<u16>(), any::<u64>(), any::<(bool, bool)>());
    (words, numbers, 0..SessionState::ALL.len(), any::<[u64; SampleRefusal::ALL.len()]>(), any::<(u32, u32)>())
        .prop_map(|((patch, reason, confirmed_by, model_set), numbers, state, refused, responding)| SessionView {
            number: numbers.0,
            patch,
            state: SessionState::ALL[state],
            reason,
            started_wall_ns: numbers.1,
            changed_wall_ns: numbers.2,
            confirmed_by,
            target_kpa: numbers.3,
            branches: if numbers.6.0 { Branch::Both } else { Branch::Rising },
            direction: if numbers.6.1 { Direction::Falling } else { Direction::Rising },
            ramps: numbers.4,
            accepted: numbers.5,
            refused: RefusalCounts(refused),
            durable: numbers.5,
            coverage: numbers.3 / 100.0,
            responding,
            model_set: model_set.map(Into::into),
            predecessor: numbers.6.0.then_some(numbers.5),
            board_settings: if numbers.6.1 { vec![format!("board {}", numbers.4)].into() } else { Default::default() },
            gauge: if numbers.6.0 { format!("gauge {}", numbers.4) } else { String::new() },
            ..SessionView::default()
        })
}

proptest! {
    #[test]
    fn a_view_comes_back_as_it_went(view in a_view()) {
        let text = view_to_text(&view).unwrap();
        prop_assert_eq!(view_from_text(&text).unwrap(), view);
    }

    #[test]
    fn a_baseline_comes_back_bit_for_bit(numbers in proptest::collection::vec(any::<(u64, u64)>(), 0..40)) {
        let taxel = |(mean, noise)| TaxelBaseline { mean: f64::from_bits(mean), noise: f64::from_bits(noise) };
        let baseline: Vec<_> = numbers.iter().copied().map(taxel).collect();
        let back = baseline_from_blob(&baseline_to_blob(&baseline)).unwrap();
        let bits: Vec<_> = back.iter().map(|taxel| (taxel.mean.to_bits(), taxel.noise.to_bits())).collect();
        prop_assert_eq!(bits, numbers);
    }
}

#[test]
fn a_torn_baseline_is_refused() {
    assert!(baseline_from_blob(&[0; 15]).is_none());
    assert!(baseline_from_blob(&[0; 24]).is_none());
    assert!(ramp_from_blob(0, &[0; 15]).is_none());
    assert!(ramp_from_blob(0, &[0; 33]).is_none());
}

#[test]
fn a_ramp_comes_back_with_the_zero_of_its_gauge_and_an_earlier_one_without() {
    let taxels = vec![TaxelBaseline { mean: 240.0, noise: 0.5 }; 3];
    for gauge_kpa in [None, Some(5.8), Some(-0.02)] {
        let ramp = RampBaseline { ramp: 2, taxels: taxels.clone(), gauge_kpa };
        assert_eq!(ramp_from_blob(2, &ramp_to_blob(&ramp)), Some(ramp));
    }
    assert_eq!(ramp_from_blob(2, &baseline_to_blob(&taxels)).unwrap().gauge_kpa, None);
}

#[test]
fn a_view_of_an_earlier_version_is_of_the_rising_branch() {
    let text = view_to_text(&SessionView::default()).unwrap();
    let old = text.replace("\"both_branches\":false,\"falling\":false,", "");
    assert_ne!(old, text);
    assert_eq!(view_from_text(&old).unwrap(), SessionView::default());
}

#[test]
fn what_is_no_view_is_refused_with_the_reason() {
    assert!(view_from_text("{}").unwrap_err().contains("number"));
    let text = view_to_text(&SessionView::default()).unwrap().replace("TARING", "DANCING");
    assert!(view_from_text(&text).unwrap_err().contains("DANCING"));
}

/// Whatever of a row is another has another checksum, and so has a row of another sort.
#[test]
fn checksums_tell_rows_apart() {
    let sums = [
        view_checksum(1, "v"),
        view_checksum(2, "v"),
        view_checksum(1, "w"),
        ramp_checksum(1, 0, b"b"),
        ramp_checksum(2, 0, b"b"),
        ramp_checksum(1, 1, b"b"),
        ramp_checksum(1, 0, b"c"),
        activation_checksum(1, "p", "m", 5),
        activation_checksum(2, "p", "m", 5),
        activation_checksum(1, "q", "m", 5),
        activation_checksum(1, "p", "n", 5),
        activation_checksum(1, "p", "m", 6),
        active_checksum(1, "m", b"t"),
        active_checksum(2, "m", b"t"),
        active_checksum(1, "n", b"t"),
        active_checksum(1, "m", b"u"),
        index_checksum(1, b"s", "e"),
        index_checksum(2, b"s", "e"),
        index_checksum(1, b"t", "e"),
        index_checksum(1, b"s", "f"),
        load_checksum(1, "l"),
        load_checksum(2, "l"),
        load_checksum(1, "k"),
        deleted_session_checksum(1, 5),
        deleted_session_checksum(2, 5),
        deleted_session_checksum(1, 6),
        deleted_set_checksum(1, "m", 3, 5),
        deleted_set_checksum(2, "m", 3, 5),
        deleted_set_checksum(1, "n", 3, 5),
        deleted_set_checksum(1, "m", 4, 5),
        deleted_set_checksum(1, "m", 3, 6),
        audit_checksum("asked", 1, "e"),
        audit_checksum("done", 1, "e"),
        audit_checksum("asked", 2, "e"),
        audit_checksum("asked", 1, "f"),
        tally_checksum("s", 1),
        tally_checksum("t", 1),
        tally_checksum("s", 2),
    ];
    for (at, sum) in sums.iter().enumerate() {
        assert_eq!(sum.len(), 8, "{at}");
        assert_eq!(sums.iter().position(|other| other == sum), Some(at));
    }
}

#[test]
fn a_sample_whose_pressure_is_less_than_nothing_by_its_sign_alone_is_the_same_row() {
    let of = |pressure_kpa: f64| {
        sample_checksum(1, 2, &Sample { ramp: 0, time_ns: 3, pressure_kpa, counts: vec![1_u8, 2].into() })
    };
    assert_eq!(of(-0.0), of(0.0));
    assert_ne!(of(-1.0), of(1.0));
}

#[test]
fn a_blob_of_bytes_or_of_half_a_count_holds_no_wide_counts() {
    let words = |words: &[u16]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
    assert!(wide_counts(&words(&[4_095, 0, 4_095])).is_some());
    for blob in [vec![], words(&[255, 1, 2]), words(&[4_095, 4_096]), [words(&[4_095, 1]), vec![7]].concat()] {
        assert!(wide_counts(&blob).is_none(), "{blob:?}");
    }
}
