use super::*;
use crate::document::{Axis, Level};

const HOSTILE: [f64; 10] =
    [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -1.0, 1e-300, 5e-324, f64::MAX, f64::MIN, 1.0];

fn figure(log: bool, values: &[f64]) -> Figure {
    let point = |(k, y): (usize, &f64)| Point {
        x: values[(k + 3) % values.len()],
        x_spread: Some((values[(k + 1) % values.len()], values[(k + 2) % values.len()])),
        y: *y,
        mark: k.to_string(),
    };
    let looks = [Look::Signs, Look::Plain, Look::Dashed, Look::Dots, Look::Marks, Look::Bars(0.5)];
    let line = |look: &Look| {
        let points = values.iter().enumerate().map(point).collect();
        Line { name: format!("<b> {look:?}"), ours: false, look: *look, points }
    };
    let axis = |label: &str| Axis { label: label.to_owned(), log };
    let levels = |label: &str| values.iter().map(|at| Level::new(*at, label)).collect();
    Figure {
        id: "hostile".to_owned(),
        title: "a < b & \"c\" \u{1}".to_owned(),
        x: axis("x < 1"),
        y: axis("y & z"),
        lines: looks.iter().map(line).collect(),
        bands: levels("a band > another"),
        levels: levels("limit & co"),
        ..Figure::default()
    }
}

/// Every number in every attribute that places something.
fn assert_sound(picture: &str) {
    for word in ["NaN", "inf", "<b>", "a < b", "\u{1}"] {
        assert!(!picture.contains(word), "{word} in {picture}");
    }
    for name in [" x=\"", " y=\"", " width=\"", " height=\""] {
        for value in picture.split(name).skip(1) {
            let value: f64 = value.split('"').next().unwrap().parse().unwrap();
            assert!((-1.0..=1200.0).contains(&value), "{name}{value}");
        }
    }
    assert_eq!(picture.matches("<text").count(), picture.matches("</text>").count());
    assert!(picture.starts_with("<svg ") && picture.ends_with("</svg>\n"));
}

#[test]
fn hostile_numbers_give_a_sound_picture_in_which_every_line_has_its_name() {
    for log in [false, true] {
        let picture = svg(&figure(log, &HOSTILE));
        assert_sound(&picture);
        for name in ["Signs", "Plain", "Dashed", "Dots", "Marks", "Bars(0.5)"] {
            assert!(picture.contains(&format!(">&lt;b&gt; {name}<")), "{name}");
        }
        for value in HOSTILE {
            assert_sound(&svg(&figure(log, &[value])));
        }
    }
    assert_sound(&svg(&Figure::default()));
}

#[test]
fn nothing_is_left_out_silently() {
    let points = [(1.0, 1.0), (2.0, 0.0), (3.0, f64::NAN), (f64::NAN, 4.0), (5.0, 5.0)];
    let points = points.map(|(x, y)| Point { x, y, ..Point::default() }).to_vec();
    let line = Line { name: "a".to_owned(), ours: true, points, ..Line::default() };
    let picture = svg(&Figure { x: Axis::log(""), y: Axis::log(""), lines: vec![line], ..Figure::default() });
    assert!(picture.contains("0 or less (1)") && picture.contains("no finite value (1)"), "{picture}");
    assert!(picture.contains("horizontal axis: 1."), "{picture}");
    // One sign in the legend, two at their places, one open at the edge.
    assert_eq!(picture.matches("class=\"f-c0 s-c0\"").count(), 3);
    assert_eq!(picture.matches("class=\"f-paper s-c0\"").count(), 1);
}

#[test]
fn lines_differ_in_print_and_marks_do_not_overlap() {
    let lines: Vec<Line> = (0..12).map(|k| Line { ours: k % 3 == 0, ..Line::default() }).collect();
    let looks: std::collections::HashSet<_> = styles(&lines).iter().map(|style| (style.colour, style.dash)).collect();
    assert_eq!(looks.len(), lines.len());
    let one = Room { left: 0.0, top: 0.0, right: 2.0, bottom: 2.0 };
    let other = Room { left: 1.0, top: 1.0, right: 3.0, bottom: 3.0 };
    assert!(one.meets(&other) && !one.meets(&Room { left: 2.0, ..other }));
}
