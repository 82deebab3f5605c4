//! The screen of `taxeld top`, as a function of what is known.

use std::collections::BTreeMap;

use ratatui_core::buffer::Buffer;
use ratatui_core::layout::Rect;
use ratatui_core::style::{Color, Modifier, Style};
use ratatui_core::text::{Line, Span};
use taxel_client::{Moment, troubles};
use taxel_proto::judge::word;
use taxel_proto::v1::{ForceSample, ForceState};

use super::state::{BAR, Top};
use crate::client::table::moment;

/// Lines above and below the skin.
const ABOVE: u16 = 5;
const EVENTS: u16 = 4;
const BELOW: u16 = EVENTS + 3;
const KEYS: &str = "t tare  c calibrate  r record  q quit";
const BARS: [&str; 8] = ["▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"];
/// From no pressure to the top of the scale, of the 256 colours of a terminal.
const COLOURS: [u8; 9] = [24, 31, 38, 44, 50, 84, 120, 190, 226];
/// Of a taxel that gives no value.
const NO_VALUE: u8 = 240;
/// Without colours a taxel is shown as pressed from this share of the scale on.
const PRESSED: f32 = 0.2;
/// Tops of the scale of the skin, in kPa.
const SCALES_KPA: [f32; 7] = [5.0, 10.0, 20.0, 35.0, 70.0, 100.0, 200.0];

/// Draws all of it as it is now.
pub fn draw(top: &Top, now: Moment, area: Rect, to: &mut Buffer) {
    let skin = Rect { y: area.y + ABOVE, height: area.height.saturating_sub(ABOVE + BELOW), ..area };
    let most = top.taxels.iter().map(|taxel| taxel.pressure_kpa()).fold(0.0, f32::max);
    let scale = SCALES_KPA.into_iter().find(|scale| most <= *scale).unwrap_or(most);
    let mut lines = force_lines(top, now);
    lines.extend(course_lines(top, usize::from(area.width), scale));
    let mut below = vec![Line::from(top.paint(troubles(&top.health).join("; "), Color::Red)), boards(top)];
    let events = top.events.iter().rev().take(usize::from(EVENTS)).rev();
    below.extend(
        events.map(|event| Line::from(format!("{} {}: {}", moment(event.time.as_ref()), event.kind, event.text))),
    );
    below.resize(usize::from(BELOW) - 1, Line::default());
    below.push(Line::from(if top.said.is_empty() { KEYS } else { &top.said }));
    let rows = (area.y..).zip(lines).chain((skin.bottom()..).zip(below));
    for (y, line) in rows.filter(|(y, _)| *y < area.bottom()) {
        to.set_line(area.x, y, &line, area.width);
    }
    draw_skin(top, scale, skin, to);
}

impl Top {
    fn paint<'a>(&self, text: impl Into<std::borrow::Cow<'a, str>>, colour: Color) -> Span<'a> {
        let bold = Style::new().add_modifier(Modifier::BOLD);
        Span::styled(text, if self.colour { bold.fg(colour) } else { bold })
    }
}

/// The state and what else is valid; the force; why it is not better.
fn force_lines(top: &Top, now: Moment) -> Vec<Line<'static>> {
    let none = ForceSample::default();
    let sample = top.force.as_ref().map_or(&none, |force| force.sample());
    let judged = top.force.as_ref().map(|force| force.force(now, None));
    let (state, colour) = match &judged {
        None => ("no sample yet".to_owned(), Color::Yellow),
        Some(Err(_)) => ("no force".to_owned(), Color::Red),
        Some(Ok(_)) if sample.state() == ForceState::Ok => ("OK".to_owned(), Color::Green),
        Some(Ok(_)) => (word(sample.state()).to_owned(), Color::Yellow),
    };
    let mut head = vec![Span::from(format!("{}  ", top.patch)), top.paint(state, colour)];
    if sample.simulated {
        head.push(top.paint("  simulated", Color::Yellow));
    }
    if let Some(patch) = top.health.patches.iter().find(|patch| patch.patch == top.patch) {
        let valid = patch.tare.as_ref().is_some_and(|zero| zero.valid);
        head.push(Span::from(format!("   zero {}", if valid { "valid" } else { "INVALID" })));
        head.extend(patch.gauge_kpa.map(|kpa| Span::from(format!("   gauge {kpa:.2} kPa"))));
    }
    let (force, why) = match judged {
        Some(Ok(force)) => {
            let high = sample.high_n.map_or_else(|| "N or more".to_owned(), |high| format!("to {high:.2} N"));
            let rest = format!("   {:.2} {high}   {:.0} ms old", sample.low_n(), 1e3 * force.age.as_secs_f64());
            let force = vec![top.paint(format!("{:.2} N", force.total_n), colour), rest.into()];
            (force, sample.reasons.join("; "))
        }
        Some(Err(why)) => (Vec::new(), why.to_string()),
        None => (Vec::new(), String::new()),
    };
    let counts = format!("{} active, {} excluded or faulty, {} silent", sample.active, sample.excluded, sample.stale);
    vec![Line::from(head), Line::from(force), Line::from(if why.is_empty() { counts } else { why })]
}

/// The last forces as bars, and what their height and the skin's colours mean.
fn course_lines(top: &Top, width: usize, scale: f32) -> [Line<'static>; 2] {
    let shown = top.course.iter().skip(top.course.len().saturating_sub(width));
    let most = shown.clone().fold(1.0, |most: f64, n| most.max(*n));
    let bar = |n: &f64| if n.is_nan() { " " } else { BARS[((n / most * 7.99) as usize).min(7)] };
    let seconds = BAR.as_secs_f64() * shown.len() as f64;
    let scales = format!("force: 0 to {most:.1} N in {seconds:.0} s   skin: 0 to {scale} kPa");
    [Line::from(shown.map(bar).collect::<String>()), Line::from(scales)]
}

fn boards(top: &Top) -> Line<'static> {
    let of_patch = top.health.boards.iter().filter(|board| board.patch == top.patch);
    let words = of_patch.map(|b| format!("board {}: {} of {} modules", b.address, b.modules_fresh, b.modules_enabled));
    Line::from(words.collect::<Vec<_>>().join("   "))
}

/// The skin, two taxels one above the other in each character.
fn draw_skin(top: &Top, scale: f32, area: Rect, to: &mut Buffer) {
    let spread = |axis: usize| {
        let all = || top.places.iter().map(|place| place[axis]);
        (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max))
    };
    let ((left, right), (upper, lower)) = (spread(0), spread(1));
    let turned = lower - upper > right - left; // a quarter, so that it is wide as the screen is
    let (width, height) = if turned { (lower - upper, right - left) } else { (right - left, lower - upper) };
    let (columns, rows) = (f64::from(area.width) - 1.0, 2.0 * f64::from(area.height) - 1.0);
    let k = (columns / width.max(1e-6)).min(rows / height.max(1e-6)).max(0.0);
    let mut dots: BTreeMap<(u16, u16), [Option<f32>; 2]> = BTreeMap::new();
    for (place, reading) in top.places.iter().zip(&top.taxels) {
        let (x, y) = (place[0] - left, place[1] - upper);
        let (x, y) = if turned { (lower - upper - y, x) } else { (x, y) };
        let (x, y) = ((x * k).round() as u16, (y * k).round() as u16);
        let dot = &mut dots.entry((x, y / 2)).or_default()[usize::from(y % 2)];
        let share = reading.pressure_kpa.map_or(f32::NAN, |kpa| kpa / scale);
        *dot = Some(share.max(dot.unwrap_or(f32::NAN))); // the greatest of those that meet
    }
    for ((x, y), [upper, lower]) in dots.into_iter().filter(|((_, y), _)| *y < area.height) {
        let Some(cell) = to.cell_mut((area.x + x, area.y + y)) else { continue };
        if !top.colour {
            let pressed = |dot: Option<f32>| dot.is_some_and(|share| share > PRESSED);
            cell.set_symbol(["·", "▀", "▄", "█"][usize::from(pressed(upper)) + 2 * usize::from(pressed(lower))]);
        } else if upper.is_some() {
            cell.set_symbol("▀").set_fg(ink(upper)).set_bg(ink(lower));
        } else {
            cell.set_symbol("▄").set_fg(ink(lower));
        }
    }
}

/// The colour of a share of the scale.
fn ink(share: Option<f32>) -> Color {
    let step = |share: f32| COLOURS[((share * 8.0).round() as usize).min(8)];
    share.map_or(Color::Reset, |share| Color::Indexed(if share.is_nan() { NO_VALUE } else { step(share) }))
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, SystemTime};

    use ratatui_core::backend::TestBackend;
    use ratatui_core::terminal::Terminal;
    use taxel_client::Received;
    use taxel_proto::v1::{BoardHealth, Event, Health, PatchHealth, Skin, TareStatus, TaxelLayout, TaxelReading};

    use super::*;
    use crate::client::top::state::News;

    const GOLDEN: &str = "\
palm  OK  simulated   zero valid   gauge 0.12 kPa
4.93 N   4.51 to 5.36 N   41 ms old
2 active, 1 excluded or faulty, 0 silent
█▅ █
force: 0 to 4.9 N in 1 s   skin: 0 to 20 kPa
·  · ·  ·  ·  · ·  ·  ·  · ▀  ·  · ·  ·  ·  · ·  ·  · ·  ·  ·  · ·  ·  ·  · ·  ·
·  · ·  ·  ·  · ·  ·  ·  · ·  ▄  · ·  ·  ·  · ·  ·  · ·  ·  ·  · ·  ·  ·  · ·  ·










board 13: 1 of 3 modules are silent
board 13: 2 of 3 modules
 tared: unloaded



t tare  c calibrate  r record  q quit";

    /// Two rows of taxels, of which two are pressed and one gives no value.
    fn palm(now: Moment) -> Top {
        let mut top = Top { colour: false, ..Top::default() };
        let taxel = |taxel| TaxelLayout { taxel, board: 13, ..TaxelLayout::default() };
        let kpa = |pressure_kpa| TaxelReading { pressure_kpa, ..TaxelReading::default() };
        let sample = ForceSample {
            patch: "palm".to_owned(),
            state: ForceState::Ok.into(),
            total_n: Some(4.93),
            low_n: Some(4.51),
            high_n: Some(5.36),
            age_s: Some(0.041),
            max_age_s: 10.0,
            sent: Some((SystemTime::now() + Duration::from_secs(3600)).into()), // took no time
            active: 2,
            excluded: 1,
            simulated: true,
            ..ForceSample::default()
        };
        let tare = Some(TareStatus { valid: true, ..TareStatus::default() });
        let patch = PatchHealth { patch: "palm".to_owned(), tare, gauge_kpa: Some(0.12), ..PatchHealth::default() };
        let board = BoardHealth {
            patch: "palm".to_owned(),
            address: 13,
            modules_enabled: 3,
            modules_fresh: 2,
            ..BoardHealth::default()
        };
        let event = Event { kind: "tared".to_owned(), text: "unloaded".to_owned(), ..Event::default() };
        let half = ForceSample { total_n: Some(2.5), ..sample.clone() };
        let none = ForceSample { total_n: None, state: ForceState::Stale.into(), ..sample.clone() };
        let skin = Skin { patch: "palm".to_owned(), taxels: (0..60).map(taxel).collect(), ..Skin::default() };
        let mut pressed = vec![kpa(Some(0.0)); 60];
        pressed[10] = kpa(Some(12.0));
        pressed[41] = kpa(Some(5.0));
        pressed[59] = kpa(None);
        top.take(News::Skin(skin), now);
        top.take(News::Health(Health { boards: vec![board], patches: vec![patch], ..Health::default() }), now);
        top.take(News::Event(event), now);
        top.taxels = pressed;
        for (bar, sample) in (0..).zip([sample.clone(), half, none, sample]) {
            top.take(News::Force(Received::now(sample)), now + bar * BAR);
        }
        top
    }

    fn screen(top: &Top, now: Moment) -> TestBackend {
        let mut terminal = Terminal::new(TestBackend::new(80, 24)).unwrap();
        terminal.draw(|frame| draw(top, now, frame.area(), frame.buffer_mut())).unwrap();
        terminal.backend().clone()
    }

    #[test]
    fn eighty_columns_have_the_force_the_skin_its_boards_and_what_happened() {
        let now = Moment::now();
        let lines = screen(&palm(now), now).to_string();
        let shown: Vec<&str> = lines.lines().map(|line| line.trim_matches('"').trim_end()).collect();
        assert_eq!(shown.join("\n"), GOLDEN, "{lines}");
    }

    #[test]
    fn a_force_that_grew_old_is_no_number_on_the_screen_and_pressure_is_a_colour() {
        let now = Moment::now();
        let mut top = palm(now);
        assert!(!screen(&top, now + Duration::from_secs(20)).to_string().contains("4.93 N"));
        top.colour = true;
        let buffer = screen(&top, now).buffer().clone();
        let colours = buffer.content().iter().filter(|cell| cell.symbol() == "▀").map(|cell| cell.fg);
        let colours: std::collections::HashSet<Color> = colours.collect();
        assert!(colours.contains(&Color::Indexed(COLOURS[0])) && colours.len() > 1, "{colours:?}");
    }
}
