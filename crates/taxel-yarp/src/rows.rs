//! From the vector of a skin port to the frames that its boards sent.
//!
//! A port goes on under fresh stamps when a board died, a cable came out or the Ethernet board hangs: the robot's software
//! sends what it has. So only change counts. The ten counts of a live triangle do not all stay equal for more
//! than three scans (58,000 scans of real skin); those of a dead one stay for ever. A triangle of which nothing changed
//! sends no frame here, and is silent to the engine after as many periods as any board. Its values are as old as their
//! last change: up to a period too old, never too young.
//!
//! The first vector shows what there is and no change; no frame comes of it.

use std::time::Duration;

use taxel_skin::{BoardAddress, Module, Patch, Time};
use taxel_wire::TimedFrame;
use taxel_wire::icub::{Message, StatusWord};
use thiserror::Error;

/// Values of a triangle in a vector, and those of them that come in a board's first frame.
const VALUES: usize = 12;
const HEAD: usize = 7;
/// Triangles of a board.
const MODULES: usize = 16;
/// The robot's software puts the two halves of a triangle into its vector one by one. Where only one half changed, the other
/// is waited for, so long.
const HALF_WAIT: Duration = Duration::from_millis(10);

/// What a vector cannot be.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum Unfit {
    /// It has so many values, and the boards so many.
    #[error("it sends {0} values, expected {1}: 192 for each of `boards`")]
    Length(usize, usize),
    /// At this place, from 0, stands this.
    #[error("value {0} is \"{1}\", expected a whole number from 0 to 255")]
    NoCount(usize, String),
}

/// A triangle that the patch has.
#[derive(Clone, Debug)]
struct Triangle {
    board: BoardAddress,
    module: Module,
    /// Of its first value.
    row: usize,
    /// What was sent on last, or seen first.
    known: Option<[u8; VALUES]>,
    /// When one half changed whose other half is waited for.
    half_since: Option<Time>,
}

/// Which values of a vector belong to which triangle of which board, and what they were.
#[derive(Clone, Debug)]
pub struct Rows {
    triangles: Vec<Triangle>,
    /// Values of the port.
    length: usize,
    counts: Vec<u8>,
    /// The line that `counts` was read from: a scan is sent two or three times.
    line: Vec<u8>,
}

impl Rows {
    /// Those of a patch that has all boards of the port, in its order.
    #[must_use]
    pub fn new(patch: &Patch) -> Self {
        let triangles = patch.modules().iter().map(|site| {
            let row = VALUES * (MODULES * usize::from(site.board) + usize::from(site.module.get()));
            let board = patch.boards()[usize::from(site.board)].address;
            Triangle { board, module: site.module, row, known: None, half_since: None }
        });
        let length = patch.boards().len() * MODULES * VALUES;
        Self { triangles: triangles.collect(), length, counts: Vec::new(), line: Vec::new() }
    }

    /// The connection is a new one: what comes first shows no change.
    pub fn restart(&mut self) {
        self.line.clear();
        for triangle in &mut self.triangles {
            (triangle.known, triangle.half_since) = (None, None);
        }
    }

    /// Takes a vector that was received at `time`, and appends the frames of what changed, in the order of their times.
    ///
    /// # Errors
    /// [`Unfit`]; then nothing of it was taken.
    pub fn take(&mut self, time: Time, line: &[u8], frames: &mut Vec<TimedFrame>) -> Result<(), Unfit> {
        if line == self.line && self.triangles.iter().all(|triangle| triangle.half_since.is_none()) {
            return Ok(());
        }
        self.line.clear();
        read_counts(line, &mut self.counts)?;
        if self.counts.len() != self.length {
            return Err(Unfit::Length(self.counts.len(), self.length));
        }
        self.line.extend_from_slice(line);
        let begin = frames.len();
        for triangle in &mut self.triangles {
            let mut values = [0; VALUES];
            values.copy_from_slice(&self.counts[triangle.row..triangle.row + VALUES]);
            if let Some(changed) = triangle.changed_at(time, values) {
                frames.extend(
                    triangle.frames(values).map(|message| TimedFrame { time: changed, frame: message.encode() }),
                );
            }
        }
        frames[begin..].sort_by_key(|frame| frame.time);
        Ok(())
    }
}

impl Triangle {
    /// When the values changed, if they did and both halves are here.
    fn changed_at(&mut self, time: Time, values: [u8; VALUES]) -> Option<Time> {
        let Some(known) = self.known else {
            self.known = Some(values);
            return None;
        };
        let (head, tail) = (known[..HEAD] != values[..HEAD], known[HEAD..] != values[HEAD..]);
        if !head && !tail {
            self.half_since = None;
            return None;
        }
        let since = *self.half_since.get_or_insert(time);
        if head != tail && time.since(since) < HALF_WAIT {
            return None;
        }
        (self.known, self.half_since) = (Some(values), None);
        Some(since)
    }

    fn frames(&self, values: [u8; VALUES]) -> [Message; 2] {
        let [v0, v1, v2, v3, v4, v5, v6, v7, v8, v9, v10, v11] = values;
        let (board, module) = (self.board, self.module);
        [
            Message::Head { board, module, values: [v0, v1, v2, v3, v4, v5, v6] },
            Message::Tail { board, module, values: [v7, v8, v9, v10, v11], status: StatusWord(0) },
        ]
    }
}

/// Reads a vector of counts.
///
/// # Errors
/// [`Unfit::NoCount`].
pub fn read_counts(line: &[u8], counts: &mut Vec<u8>) -> Result<(), Unfit> {
    counts.clear();
    for (place, token) in line.split(u8::is_ascii_whitespace).filter(|token| !token.is_empty()).enumerate() {
        counts.push(read_count(token).ok_or_else(|| {
            Unfit::NoCount(place, String::from_utf8_lossy(&token[..token.len().min(20)]).into_owned())
        })?);
    }
    Ok(())
}

/// `240`, `240.0`, or what else is a whole number as YARP writes numbers.
fn read_count(token: &[u8]) -> Option<u8> {
    let (whole, fraction) = match token.iter().position(|&byte| byte == b'.') {
        Some(point) => (&token[..point], &token[point + 1..]),
        None => (token, &token[..0]),
    };
    if (1..=3).contains(&whole.len())
        && whole.iter().all(u8::is_ascii_digit)
        && fraction.iter().all(|&byte| byte == b'0')
    {
        let number = whole.iter().fold(0, |number: u16, digit| 10 * number + u16::from(digit - b'0'));
        return u8::try_from(number).ok();
    }
    let number: f64 = std::str::from_utf8(token).ok()?.parse().ok()?;
    (number.fract() == 0.0 && (0.0..=255.0).contains(&number)).then_some(number as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use taxel_skin::{Board, BusIndex, ModuleKind};

    fn ms(ms: u64) -> Time {
        Time::from_nanos(0) + Duration::from_millis(ms)
    }

    fn line(counts: &[u8]) -> Vec<u8> {
        counts.iter().map(|count| format!("{count}.0")).collect::<Vec<_>>().join(" ").into_bytes()
    }

    /// Two boards as on a robot's forearm, of which triangle 3 of board 13 and 0 of board 12 are there.
    fn forearm() -> Rows {
        let board = |address, module| Board {
            bus: BusIndex(0),
            address: BoardAddress::new(address).unwrap(),
            modules: vec![(Module::from_nibble(module), ModuleKind::Triangle)],
        };
        Rows::new(&Patch::new("forearm", vec![board(13, 3), board(12, 0)]).unwrap())
    }

    fn take(rows: &mut Rows, time: Time, counts: &[u8]) -> Vec<(u64, String)> {
        let mut frames = Vec::new();
        rows.take(time, &line(counts), &mut frames).unwrap();
        frames.iter().map(|f| (f.time.since(ms(0)).as_millis() as u64, f.frame.id.to_string())).collect()
    }

    #[test]
    fn a_triangle_that_changed_sends_its_two_frames_and_another_none() {
        let (mut rows, mut counts) = (forearm(), vec![240; 384]);
        assert_eq!(take(&mut rows, ms(0), &counts), [], "the first vector shows no change");
        assert_eq!(take(&mut rows, ms(20), &counts), [], "the same vector again");
        (counts[36], counts[47]) = (239, 1);
        assert_eq!(take(&mut rows, ms(40), &counts), [(40, "4D3".into()), (40, "4D3".into())]);
        (counts[0], counts[192], counts[203]) = (1, 2, 3); // triangle 0 of board 13 is not in the patch
        assert_eq!(take(&mut rows, ms(60), &counts), [(60, "4C0".into()), (60, "4C0".into())]);
        rows.restart();
        counts[36] = 7;
        assert_eq!(take(&mut rows, ms(80), &counts), [], "a new connection");
    }

    #[test]
    fn half_a_triangle_waits_for_the_other_and_keeps_the_time_of_its_change() {
        let (mut rows, mut counts) = (forearm(), vec![240; 384]);
        take(&mut rows, ms(0), &counts);
        counts[36] = 239;
        assert_eq!(take(&mut rows, ms(20), &counts), []);
        counts[47] = 1;
        assert_eq!(take(&mut rows, ms(40), &counts)[0], (20, "4D3".into()));
        counts[36] = 238;
        assert_eq!(take(&mut rows, ms(60), &counts), []);
        assert_eq!(take(&mut rows, ms(80), &counts)[0], (60, "4D3".into()), "the other half is as it was");
    }

    #[test]
    fn what_is_no_vector_of_counts_is_named() {
        let mut rows = forearm();
        let mut refuse = |line: &[u8]| rows.take(ms(0), line, &mut Vec::new()).unwrap_err().to_string();
        let expected = "expected 384: 192 for each of `boards`";
        assert_eq!(refuse(b"1 2 3"), format!("it sends 3 values, {expected}"));
        assert_eq!(refuse(&line(&[240; 576])), format!("it sends 576 values, {expected}"));
        for (wrong, shown) in [("256.0", "256.0"), ("3.5", "3.5"), ("(240", "(240"), ("nan", "nan"), ("-1", "-1")] {
            let line = format!("240 {wrong}");
            let expected = format!("value 1 is \"{shown}\", expected a whole number from 0 to 255");
            assert_eq!(refuse(line.as_bytes()), expected);
        }
    }

    proptest! {
        #[test]
        fn whole_numbers_are_read_however_they_are_written(count: u8) {
            for text in [format!("{count}"), format!("{count}.0"), format!("{count}.000000"), format!("{:e}", f64::from(count))] {
                prop_assert_eq!(read_count(text.as_bytes()), Some(count), "{}", text);
            }
        }

        #[test]
        fn any_bytes_are_read_or_refused(line in proptest::collection::vec(any::<u8>(), 0..4000)) {
            let _ = forearm().take(ms(0), &line, &mut Vec::new());
        }
    }
}
