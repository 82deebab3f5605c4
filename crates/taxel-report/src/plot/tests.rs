use super::*;
use crate::document::{Axis, Band};

fn figure(log: bool, values: &[f64]) -> Figure {
    let point = |(k, y): (usize, &f64)| Point {
        x: values[(k + 3) % values.len()],
        x_spread: Some((values[(k + 1) % values.len()], values[(k + 2) % values.len()])),
        y: *y,
        mark: k.to_string(),
    };
    let line = |name: &str| Line {
        name: name.to_owned(),
        ours: false,
        points: values.iter().enumerate().map(point).collect(),
    };
    let axis = |label: &str| Axis { label: label.to_owned(), log };
    Figure {
        id: "hostile".to_owned(),
        caption: "a < b & \"c\"".to_owned(),
        x: axis("x < 1"),
        y: axis("y & z"),
        lines: vec![line("one <b>"), line("two")],
        bands: values.iter().map(|y| Band { y: *y, label: "a band > another".to_owned() }).collect(),
    }
}

/// Every number in every attribute that places something.
fn assert_sound(picture: &str) {
    for word in ["NaN", "inf", "<b>", "a < b"] {
        assert!(!picture.contains(word), "{word} in {picture}");
    }
    for name in [" x=\"", " y=\"", " cx=\"", " cy=\""] {
        for value in picture.split(name).skip(1) {
            let value: f64 = value.split('"').next().unwrap().parse().unwrap();
            assert!((-1.0..=1200.0).contains(&value), "{name}{value}");
        }
    }
    assert_eq!(picture.matches("<text").count(), picture.matches("</text>").count());
    assert!(picture.starts_with("<svg ") && picture.ends_with("</svg>\n"));
}

#[test]
fn hostile_numbers_give_a_sound_picture() {
    let hostile = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -1.0, 1e-300, 5e-324, f64::MAX, f64::MIN, 1.0];
    for log in [false, true] {
        assert_sound(&svg(&figure(log, &hostile)));
        for value in hostile {
            assert_sound(&svg(&figure(log, &[value])));
        }
    }
    assert_sound(&svg(&Figure::default()));
}

#[test]
fn nothing_is_left_out_silently() {
    let points = [(1.0, 1.0), (2.0, 0.0), (3.0, f64::NAN), (f64::NAN, 4.0), (5.0, 5.0)];
    let points = points.map(|(x, y)| Point { x, y, ..Point::default() }).to_vec();
    let log = Axis { label: String::new(), log: true };
    let lines = vec![Line { name: "a".to_owned(), ours: true, points }];
    let picture = svg(&Figure { x: log.clone(), y: log, lines, ..Figure::default() });
    assert!(picture.contains("0 or less (1)") && picture.contains("no finite value (1)"), "{picture}");
    assert!(picture.contains("horizontal axis: 1."), "{picture}");
    // One marker in the legend, three drawn points.
    assert_eq!(picture.matches("<circle").count(), 1 + 3);
}

#[test]
fn lines_differ_in_print_and_marks_do_not_overlap() {
    let lines: Vec<Line> = (0..12).map(|k| Line { ours: k % 3 == 0, ..Line::default() }).collect();
    let looks: std::collections::HashSet<_> = styles(&lines).iter().map(|style| (style.colour, style.dash)).collect();
    assert_eq!(looks.len(), lines.len());
    let one =
        [Room { left: 0.0, top: 0.0, right: 2.0, bottom: 2.0 }, Room { left: 1.0, top: 1.0, right: 3.0, bottom: 3.0 }];
    assert!(one[0].meets(&one[1]) && !one[0].meets(&Room { left: 2.0, ..one[1] }));
}
