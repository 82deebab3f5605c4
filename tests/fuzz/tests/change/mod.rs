//! Random changes of an input, as a fuzzer makes them.

/// SplitMix64: the same numbers in each run and on each machine.
pub struct Random(u64);

impl Random {
    /// A sequence of its own for each name.
    pub fn new(name: &str) -> Self {
        Self(name.bytes().fold(1, |sum, byte| sum.wrapping_mul(31).wrapping_add(byte.into())))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ mixed >> 31
    }

    /// A number below `end`; 0 if there is none.
    pub fn below(&mut self, end: usize) -> usize {
        self.next() as usize % end.max(1)
    }
}

/// What readers of texts and of numbers trip over.
const WORDS: [&[u8]; 16] = [
    b"\xFF\xFF\xFF\xFF\xFF\xFF\xFF\xFF",
    b"\x00\x00\x00\x00\x00\x00\x00\x00",
    b"\x00\x00\x00\x80",
    b"\xFF\xFF\xFF\x7F",
    b"-1",
    b"1e308",
    b"1e-320",
    b"NaN",
    b"null",
    b"18446744073709551616",
    b"\"",
    b"\n",
    b"\r\n",
    b"#",
    b"\xEF\xBB\xBF",
    b"[]{}",
];

/// One to eight changes.
pub fn change(input: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    for _ in 0..=random.below(8) {
        let at = random.below(input.len() + 1);
        let length = 1 + random.below(8);
        let end = (at + length).min(input.len());
        match random.below(8) {
            0 => drop(input.drain(at..end)),
            1 => drop(input.splice(at..at, input[at..end].to_vec())),
            2 => drop(input.splice(at..end, WORDS[random.below(WORDS.len())].iter().copied())),
            3 => drop(input.splice(at..at, WORDS[random.below(WORDS.len())].iter().copied())),
            4 => {
                let from = random.below(other.len() + 1);
                let to = (from + 1 + random.below(40)).min(other.len());
                drop(input.splice(at..end, other[from..to].iter().copied()));
            }
            5 => input.truncate(at),
            kind => {
                if let Some(byte) = input.get_mut(at) {
                    *byte = if kind == 6 { *byte ^ 1 << random.below(8) } else { random.next() as u8 };
                }
            }
        }
    }
}
