//! Pressures on a port as gauges that send frames.

use taxel_skin::Time;
use taxel_wire::{TimedFrame, reading};

/// Appends the frames of a message that was received at `time`: of the values at these places.
///
/// # Errors
/// What it has at one of them, if that is no number.
pub(crate) fn take(indices: &[usize], time: Time, line: &[u8], frames: &mut Vec<TimedFrame>) -> Result<(), String> {
    let tokens: Vec<_> = line.split(u8::is_ascii_whitespace).filter(|token| !token.is_empty()).collect();
    for &index in indices {
        let token = String::from_utf8_lossy(tokens.get(index).copied().unwrap_or_default());
        let number = token.parse::<f64>().ok().filter(|number| number.is_finite()).ok_or_else(|| {
            let shown: String = token.chars().take(20).collect();
            format!("value {index} is \"{shown}\", expected a pressure")
        })?;
        frames.push(TimedFrame { time, frame: reading::frame(index, number) });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_value_at_its_place_is_the_pressure() {
        let at = |indices: &[usize], line: &[u8]| {
            let mut frames = Vec::new();
            take(indices, Time::from_nanos(7), line, &mut frames).map(|()| frames)
        };
        let frames = at(&[1, 0], b"3 -12.5 nan").unwrap();
        let read: Vec<_> = frames.iter().map(|f| (f.time, f.frame.id.to_string(), f.frame.bytes().to_vec())).collect();
        let frame = |id: &str, steps: i64| (Time::from_nanos(7), id.to_owned(), steps.to_le_bytes().to_vec());
        assert_eq!(read, [frame("002", -12_500_000), frame("001", 3_000_000)]);
        assert_eq!(at(&[2], b"3 -12.5 nan").unwrap_err(), "value 2 is \"nan\", expected a pressure");
        assert_eq!(at(&[5], b"3").unwrap_err(), "value 5 is \"\", expected a pressure");
    }
}
