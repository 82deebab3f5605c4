//! The picture of `taxeld demo`: measured against true force, as one self-contained SVG.

use std::fmt::Write;

use crate::demo::Weighing;

const WIDTH_PX: f64 = 720.0;
const HEIGHT_PX: f64 = 536.0;
/// The plot's own rectangle; around it stand title, ticks and names of the axes.
const LEFT_PX: f64 = 76.0;
const RIGHT_PX: f64 = 696.0;
const TOP_PX: f64 = 100.0;
const BOTTOM_PX: f64 = 472.0;

/// Mean error on the real forearm, as the paper reports it: the band to compare with.
const PAPER_ERROR: f64 = 0.12;

/// Weighings of one mass stand side by side, or their bars would hide each other; the spread of a mass in newton.
const SPREAD_N: f64 = 1.1;

/// Both axes begin at zero and end here, so that the identity is the diagonal.
struct Scale {
    end_n: f64,
}

impl Scale {
    fn x(&self, newton: f64) -> f64 {
        LEFT_PX + (RIGHT_PX - LEFT_PX) * newton / self.end_n
    }

    fn y(&self, newton: f64) -> f64 {
        BOTTOM_PX - (BOTTOM_PX - TOP_PX) * newton / self.end_n
    }
}

/// Draws all weighings of so many `skins`; `filled` says whether excluded taxels took their neighbours' pressure.
///
/// Forces are in newton. A weighing that is not finite is left out of the picture.
pub fn svg(weighings: &[&Weighing], skins: usize, filled: bool) -> String {
    let drawn: Vec<&Weighing> = weighings.iter().copied().filter(|w| w.error().is_finite()).collect();
    let top_n = |w: &Weighing| w.true_n.max(w.measured_n + 2.0 * sigma(w)) + SPREAD_N / 2.0;
    let highest = drawn.iter().map(|w| top_n(w)).fold(1.0, f64::max);
    let scale = Scale { end_n: highest.ceil() };
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = draw(&mut out, &drawn, &scale, &subtitle(&drawn, skins, filled));
    out
}

fn sigma(weighing: &Weighing) -> f64 {
    if weighing.sigma_n.is_finite() { weighing.sigma_n } else { 0.0 }
}

/// What was weighed and how far it is off, in two lines.
fn subtitle(drawn: &[&Weighing], skins: usize, filled: bool) -> [String; 2] {
    let error = crate::demo::mean(drawn.iter().map(|w| w.error().abs()));
    let error = if error.is_finite() { format!("{:.1} %", 100.0 * error) } else { "none".to_owned() };
    let plural = if skins == 1 { "" } else { "s" };
    let excluded = if filled { "filled" } else { "left out" };
    [
        format!("{} weighings on {skins} simulated forearm{plural}: mean absolute error {error}", drawn.len()),
        format!("Excluded taxels {excluded}. Weighings of a mass are drawn side by side."),
    ]
}

fn draw(out: &mut String, drawn: &[&Weighing], scale: &Scale, subtitle: &[String; 2]) -> std::fmt::Result {
    writeln!(
        out,
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH_PX} {HEIGHT_PX}" role="img" aria-label="Measured against true force" font-family="Helvetica, Arial, sans-serif" fill="{INK}">"#
    )?;
    writeln!(out, r##"<rect width="{WIDTH_PX}" height="{HEIGHT_PX}" fill="#ffffff"/>"##)?;
    writeln!(out, r#"<text x="{LEFT_PX}" y="34" font-size="20" font-weight="bold">Force of known masses</text>"#)?;
    let [what, how] = subtitle;
    writeln!(out, r#"<text x="{LEFT_PX}" y="59" font-size="15">{what}</text>"#)?;
    writeln!(out, r#"<text x="{LEFT_PX}" y="80" font-size="13" fill="{FAINT}">{how}</text>"#)?;
    axes(out, scale)?;
    paper(out, scale)?;
    points(out, drawn, scale)?;
    key(out)?;
    writeln!(out, "</svg>")
}

const INK: &str = "#222222";
const FAINT: &str = "#555555";
const DOT: &str = "#1f5fa8";
const BAND: &str = "#f3dfc1";

fn axes(out: &mut String, scale: &Scale) -> std::fmt::Result {
    for step in 0..=(scale.end_n / 2.0) as u32 {
        let newton = 2.0 * f64::from(step);
        let (x, y) = (scale.x(newton), scale.y(newton));
        let grid = r##"stroke="#e4e4e4""##;
        writeln!(out, r#"<path d="M{x:.1} {TOP_PX}V{BOTTOM_PX}M{LEFT_PX} {y:.1}H{RIGHT_PX}" {grid}/>"#)?;
        let below = BOTTOM_PX + 20.0;
        writeln!(out, r#"<text x="{x:.1}" y="{below}" font-size="14" text-anchor="middle">{newton}</text>"#)?;
        let (beside, middle) = (LEFT_PX - 9.0, y + 5.0);
        writeln!(out, r#"<text x="{beside}" y="{middle:.1}" font-size="14" text-anchor="end">{newton}</text>"#)?;
    }
    let (x, y) = ((LEFT_PX + RIGHT_PX) / 2.0, HEIGHT_PX - 16.0);
    writeln!(out, r#"<text x="{x}" y="{y}" font-size="15" text-anchor="middle">true force, N</text>"#)?;
    let (x, y) = (28.0, (TOP_PX + BOTTOM_PX) / 2.0);
    let turned = format!(r#"transform="rotate(-90 {x} {y})""#);
    writeln!(out, r#"<text x="{x}" y="{y}" font-size="15" text-anchor="middle" {turned}>measured force, N</text>"#)
}

/// The identity and the band of the paper's mean error about it.
fn paper(out: &mut String, scale: &Scale) -> std::fmt::Result {
    let (x0, y0) = (scale.x(0.0), scale.y(0.0));
    let (x1, y1) = (scale.x(scale.end_n), scale.y(scale.end_n));
    // The band's upper edge leaves the plot through its top, short of the right side.
    let upper_x = scale.x(scale.end_n / (1.0 + PAPER_ERROR));
    let lower_y = scale.y(scale.end_n * (1.0 - PAPER_ERROR));
    writeln!(
        out,
        r#"<path d="M{x0:.1} {y0:.1}L{upper_x:.1} {y1:.1}H{x1:.1}V{lower_y:.1}Z" fill="{BAND}" fill-opacity="0.7"/>"#
    )?;
    writeln!(out, r##"<path d="M{x0:.1} {y0:.1}L{x1:.1} {y1:.1}" stroke="#777777" stroke-width="1.3"/>"##)?;
    writeln!(out, r##"<path d="M{LEFT_PX} {TOP_PX}V{BOTTOM_PX}H{RIGHT_PX}" fill="none" stroke="#555555"/>"##)
}

fn points(out: &mut String, drawn: &[&Weighing], scale: &Scale) -> std::fmt::Result {
    for (position, weighing) in drawn.iter().enumerate() {
        let of_mass = |w: &&&Weighing| w.true_n == weighing.true_n;
        let (all, before) = (drawn.iter().filter(of_mass).count(), drawn[..position].iter().filter(of_mass).count());
        let shift_n = SPREAD_N * ((before as f64 + 0.5) / all as f64 - 0.5);
        // Along the identity, so that a shifted weighing stays as far from it as it is.
        let (x, y) = (scale.x(weighing.true_n + shift_n), scale.y(weighing.measured_n + shift_n));
        let half_px = scale.y(0.0) - scale.y(2.0 * sigma(weighing));
        let (low, high) = (y + half_px, y - half_px);
        writeln!(out, r#"<path d="M{x:.1} {low:.1}V{high:.1}" stroke="{DOT}" stroke-opacity="0.35"/>"#)?;
        writeln!(out, r#"<circle cx="{x:.1}" cy="{y:.1}" r="2.4" fill="{DOT}" fill-opacity="0.9"/>"#)?;
    }
    Ok(())
}

fn key(out: &mut String) -> std::fmt::Result {
    let (x, text) = (LEFT_PX + 20.0, LEFT_PX + 52.0);
    let (dot, line, band) = (TOP_PX + 22.0, TOP_PX + 46.0, TOP_PX + 70.0);
    let (low, high, end, middle) = (dot + 8.0, dot - 8.0, x + 22.0, x + 11.0);
    writeln!(out, r#"<path d="M{middle} {low}V{high}" stroke="{DOT}" stroke-opacity="0.5"/>"#)?;
    writeln!(out, r#"<circle cx="{middle}" cy="{dot}" r="2.8" fill="{DOT}"/>"#)?;
    writeln!(out, r##"<path d="M{x} {line}H{end}" stroke="#777777" stroke-width="1.3"/>"##)?;
    writeln!(out, r#"<rect x="{x}" y="{}" width="22" height="14" fill="{BAND}"/>"#, band - 7.0)?;
    let lines = [
        (dot, "a weighing, with 2 standard uncertainties"),
        (line, "measured = true"),
        (band, "12 %: mean error in the paper, on a real forearm"),
    ];
    for (y, words) in lines {
        writeln!(out, r#"<text x="{text}" y="{:.1}" font-size="14">{words}</text>"#, y + 5.0)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weighing(true_n: f64, measured_n: f64, sigma_n: f64) -> Weighing {
        Weighing { contact: crate::demo::Contact::Mass, true_n, measured_n, sigma_n }
    }

    #[test]
    fn every_finite_weighing_is_a_point_within_the_picture() {
        let all = [weighing(2.0, 2.1, 0.1), weighing(9.8, 60.0, f64::NAN), weighing(2.0, f64::NAN, 0.1)];
        let picture = svg(&all.iter().collect::<Vec<_>>(), 1, true);
        let of_key = 1;
        assert_eq!(picture.matches("<circle").count(), 2 + of_key);
        assert!(!picture.contains("NaN") && !picture.contains("inf"), "{picture}");
        for circle in picture.split("cy=\"").skip(1) {
            let y: f64 = circle.split('"').next().unwrap().parse().unwrap();
            assert!((TOP_PX..=BOTTOM_PX).contains(&y), "{y}");
        }
    }

    #[test]
    fn no_weighing_at_all_is_still_a_picture() {
        let picture = svg(&[], 1, false);
        assert!(picture.ends_with("</svg>\n") && !picture.contains("NaN"), "{picture}");
    }
}
