//! The line that `candump -d` writes into a log where the kernel lost frames.
//!
//! `DROPCOUNT: dropped 300 CAN frames on 'can0' socket (total drops 300)`

/// What such a line says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Lost<'a> {
    /// Frames since the last such line.
    pub frames: u64,
    /// Where, as candump was told: `any` for all.
    pub interface: &'a str,
}

impl<'a> Lost<'a> {
    /// `None` of any other line.
    pub fn read(line: &'a [u8]) -> Option<Self> {
        let line = str::from_utf8(line).ok()?.trim();
        let (frames, rest) = line.strip_prefix("DROPCOUNT: dropped ")?.split_once(' ')?;
        let interface = rest.split('\'').nth(1)?;
        Some(Self { frames: frames.parse().ok()?, interface })
    }
}
