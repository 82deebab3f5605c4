//! One register of a gauge that speaks Modbus, over TCP or as RTU on a serial line: function 3 or 4, and nothing that writes.

/// How frames are wrapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Framing {
    /// A header with a transaction number and a length before the frame.
    Tcp,
    /// A check sum after it.
    Rtu,
}

/// How a number lies in its registers, the first of which is the higher half unless it says otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Number {
    /// 16 bits without a sign,
    U16,
    /// with one;
    I16,
    /// 32 bits without a sign,
    U32,
    /// with one;
    I32,
    /// a floating-point number of 32 bits,
    F32,
    /// with the lower half first.
    F32Swapped,
}

impl Number {
    /// The names of all.
    pub const NAMES: &str = "u16, i16, u32, i32, f32, f32-swapped";

    /// The one of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Some(match name {
            "u16" => Self::U16,
            "i16" => Self::I16,
            "u32" => Self::U32,
            "i32" => Self::I32,
            "f32" => Self::F32,
            "f32-swapped" => Self::F32Swapped,
            _ => return None,
        })
    }

    const fn registers(self) -> u8 {
        match self {
            Self::U16 | Self::I16 => 1,
            Self::U32 | Self::I32 | Self::F32 | Self::F32Swapped => 2,
        }
    }

    /// The number in bytes that are as many as its registers have; `None` if it is none.
    fn read(self, bytes: &[u8]) -> Option<f64> {
        let long = || bytes.try_into().ok().map(u32::from_be_bytes);
        let short = || bytes.try_into().ok().map(u16::from_be_bytes);
        let number = match self {
            Self::U16 => f64::from(short()?),
            Self::I16 => f64::from(short()?.cast_signed()),
            Self::U32 => f64::from(long()?),
            Self::I32 => f64::from(long()?.cast_signed()),
            Self::F32 => f64::from(f32::from_bits(long()?)),
            Self::F32Swapped => f64::from(f32::from_bits(long()?.rotate_left(16))),
        };
        Some(number).filter(|number| number.is_finite())
    }
}

/// Where a pressure is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Register {
    /// The device: 1 to 247, or 0 to 255 over TCP.
    pub slave: u8,
    /// Whether it is an input register, which function 4 reads, or a holding register, which function 3 does.
    pub input: bool,
    /// Its address, from 0.
    pub address: u16,
    /// How the number lies there.
    pub number: Number,
    /// What a step of the number is, in the gauge's unit.
    pub scale: f64,
}

impl Register {
    /// Reads one from words: `holding 18` or `input 18`, then where they are not i16, x1 and slave 1 the type, the step and the
    /// device, as in `input 18 f32 x0.1 slave 9`.
    ///
    /// # Errors
    /// What was expected.
    pub fn new(text: &str) -> Result<Self, String> {
        let expected =
            || format!("expected \"holding 18\" or \"input 18\", then one of {}, \"x0.1\", \"slave 9\"", Number::NAMES);
        let mut words = text.split_whitespace();
        let input = match words.next() {
            Some("input") => true,
            Some("holding") => false,
            _ => return Err(expected()),
        };
        let address = words.next().and_then(|word| word.parse().ok()).ok_or_else(expected)?;
        let mut register = Self { slave: 1, input, address, number: Number::I16, scale: 1.0 };
        while let Some(word) = words.next() {
            let scale = word.strip_prefix('x').and_then(|scale| scale.parse::<f64>().ok());
            match (Number::named(word), scale.filter(|scale| scale.is_finite() && *scale != 0.0)) {
                (Some(number), _) => register.number = number,
                (None, Some(scale)) => register.scale = scale,
                (None, None) if word == "slave" => {
                    register.slave = words.next().and_then(|word| word.parse().ok()).ok_or_else(expected)?;
                }
                (None, None) => return Err(expected()),
            }
        }
        Ok(register)
    }

    const fn function(&self) -> u8 {
        if self.input { 4 } else { 3 }
    }

    /// The question for its value; `transaction` ties an answer over TCP to it.
    #[must_use]
    pub fn question(&self, framing: Framing, transaction: u16) -> Vec<u8> {
        let [high, low] = self.address.to_be_bytes();
        let frame = [self.slave, self.function(), high, low, 0, self.number.registers()];
        match framing {
            Framing::Tcp => {
                let [high, low] = transaction.to_be_bytes();
                [&[high, low, 0, 0, 0, frame.len() as u8], frame.as_slice()].concat()
            }
            Framing::Rtu => [frame.as_slice(), &crc(&frame).to_le_bytes()].concat(),
        }
    }

    /// The value in the answer to the question with this number, taken out of `bytes`; `None` while it has not come whole. What
    /// answers an older question is left out.
    pub fn answer(&self, framing: Framing, transaction: u16, bytes: &mut Vec<u8>) -> Option<Result<f64, String>> {
        let frame = match framing {
            Framing::Tcp => loop {
                let length = usize::from(u16::from_be_bytes([*bytes.get(4)?, *bytes.get(5)?]));
                if bytes[2..4] != [0, 0] || !(3..=256).contains(&length) {
                    return Some(Err("no frame of Modbus came: is the port right?".to_owned()));
                }
                if bytes.len() < 6 + length {
                    return None;
                }
                let whole: Vec<u8> = bytes.drain(..6 + length).collect();
                if whole[..2] == transaction.to_be_bytes() {
                    break whole[6..].to_vec();
                }
            },
            Framing::Rtu => {
                let failed = bytes.get(1)? & 0x80 != 0;
                let length = if failed { 5 } else { 5 + 2 * usize::from(self.number.registers()) };
                if bytes.len() < length {
                    return None;
                }
                let mut whole: Vec<u8> = bytes.drain(..length).collect();
                let sum = [whole[length - 2], whole[length - 1]];
                whole.truncate(length - 2);
                if crc(&whole).to_le_bytes() != sum {
                    bytes.clear();
                    return Some(Err(
                        "the check sum of an answer is wrong: noise on the line, or another baud".to_owned()
                    ));
                }
                whole
            }
        };
        Some(self.value(&frame))
    }

    fn value(&self, frame: &[u8]) -> Result<f64, String> {
        let function = self.function();
        match *frame {
            [_, found, code] if found == function | 0x80 => {
                Err(format!("the gauge refuses register {}: {}", self.address, exception(code)))
            }
            [slave, found, count, ref bytes @ ..]
                if (slave, found) == (self.slave, function) && usize::from(count) == bytes.len() =>
            {
                let number = self.number.read(bytes).ok_or("the register holds no number of this type")?;
                Ok(number * self.scale)
            }
            _ => Err("an answer came that is not to the question: does something else use the line?".to_owned()),
        }
    }
}

fn exception(code: u8) -> String {
    match code {
        1 => "exception 1, it has no such function: try the other of holding and input".to_owned(),
        2 => "exception 2, it has no such register".to_owned(),
        3 => "exception 3, it has not as many registers there".to_owned(),
        code => format!("exception {code}"),
    }
}

/// The check sum of RTU: polynomial 0xA001, begun with 0xFFFF.
fn crc(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xFFFF, |sum, byte| {
        (0..8).fold(sum ^ u16::from(*byte), |sum, _| if sum & 1 == 1 { (sum >> 1) ^ 0xA001 } else { sum >> 1 })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn register(number: Number) -> Register {
        Register { slave: 1, input: false, address: 18, number, scale: 0.1 }
    }

    fn rtu(frame: &[u8]) -> Vec<u8> {
        [frame, &crc(frame).to_le_bytes()].concat()
    }

    /// The first frame is an example of many manuals: slave 1, 10 holding registers from 0, check sum C5 CD.
    #[test]
    fn questions_are_as_the_specification_has_them() {
        assert_eq!(crc(&[1, 3, 0, 0, 0, 10]).to_le_bytes(), [0xC5, 0xCD]);
        let question = Register { input: true, ..register(Number::I16) }.question(Framing::Rtu, 0);
        assert_eq!(question[..6], [1, 4, 0, 18, 0, 1]);
        let question = register(Number::F32).question(Framing::Tcp, 0x1234);
        assert_eq!(question, [0x12, 0x34, 0, 0, 0, 6, 1, 3, 0, 18, 0, 2]);
    }

    #[test]
    fn a_register_is_written_in_words() {
        let plain = Register { slave: 1, input: false, address: 18, number: Number::I16, scale: 1.0 };
        assert_eq!(Register::new("holding 18"), Ok(plain));
        let full = Register { slave: 9, input: true, number: Number::F32, scale: -0.1, ..plain };
        assert_eq!(Register::new("input 18 f32 slave 9 x-0.1"), Ok(full));
        for text in ["", "18", "coil 18", "holding", "holding -1", "holding 18 f64", "input 18 x0", "input 18 slave"] {
            assert!(Register::new(text).unwrap_err().starts_with("expected \"holding 18\""), "{text}");
        }
    }

    #[test]
    fn an_answer_is_read_once_it_is_whole_and_with_its_type() {
        let whole = rtu(&[1, 3, 2, 0xFF, 0x38]);
        for cut in 0..whole.len() {
            assert_eq!(register(Number::I16).answer(Framing::Rtu, 0, &mut whole[..cut].to_vec()), None);
        }
        let read = |number: Number, bytes: &[u8]| {
            let mut tcp = [&[0, 7, 0, 0, 0, 3 + bytes.len() as u8, 1, 3, bytes.len() as u8], bytes].concat();
            register(number).answer(Framing::Tcp, 7, &mut tcp).unwrap()
        };
        let close = |read: Result<f64, String>, value: f64| assert!((read.unwrap() - value).abs() < 1e-6, "{value}");
        close(register(Number::I16).answer(Framing::Rtu, 0, &mut whole.clone()).unwrap(), -20.0);
        close(read(Number::U16, &[0xFF, 0x38]), 6_533.6);
        close(read(Number::I32, &[0xFF, 0xFF, 0xFF, 0x38]), -20.0);
        close(read(Number::F32, &305.0_f32.to_be_bytes()), 30.5);
        let [a, b, c, d] = 305.0_f32.to_be_bytes();
        close(read(Number::F32Swapped, &[c, d, a, b]), 30.5);
        assert!(read(Number::F32, &f32::NAN.to_be_bytes()).unwrap_err().contains("no number"));
    }

    #[test]
    fn what_is_no_answer_is_told() {
        let of =
            |bytes: &[u8]| register(Number::I16).answer(Framing::Rtu, 0, &mut bytes.to_vec()).unwrap().unwrap_err();
        assert!(of(&rtu(&[1, 0x83, 2])).contains("refuses register 18: exception 2"), "{}", of(&rtu(&[1, 0x83, 2])));
        assert!(of(&[1, 3, 2, 0, 1, 0, 0]).contains("check sum"));
        assert!(of(&rtu(&[9, 3, 2, 0, 1])).contains("not to the question"));
        let mut http = b"HTTP/1.1 400".to_vec();
        assert!(
            register(Number::I16)
                .answer(Framing::Tcp, 0, &mut http)
                .unwrap()
                .unwrap_err()
                .contains("is the port right")
        );
    }

    #[test]
    fn a_late_answer_over_tcp_is_left_out() {
        let answer = |transaction: u8, value: u8| [0, transaction, 0, 0, 0, 5, 1, 3, 2, 0, value];
        let mut bytes = [answer(6, 99), answer(7, 50)].concat();
        let read = register(Number::I16).answer(Framing::Tcp, 7, &mut bytes).unwrap().unwrap();
        assert!((read - 5.0).abs() < 1e-9 && bytes.is_empty(), "{read}");
    }

    proptest! {
        #[test]
        fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..40), number in 0..2_usize, tcp: bool) {
            let framing = if tcp { Framing::Tcp } else { Framing::Rtu };
            let mut bytes = bytes;
            let _ = register([Number::I16, Number::F32][number]).answer(framing, 1, &mut bytes);
        }
    }
}
