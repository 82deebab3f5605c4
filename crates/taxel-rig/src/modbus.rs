//! Registers of a gauge or a drive that speaks Modbus, over TCP or as RTU on a serial line: functions 3 and 4 read one number,
//! functions 6 and 16 write what a drive is told.

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
    /// with the lower half first;
    F32Swapped,
    /// the higher byte of a register,
    High,
    /// the lower one.
    Low,
}

impl Number {
    /// The names of all.
    pub const NAMES: &str = "u16, i16, u32, i32, f32, f32-swapped, high, low";

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
            "high" => Self::High,
            "low" => Self::Low,
            _ => return None,
        })
    }

    const fn registers(self) -> u8 {
        match self {
            Self::U16 | Self::I16 | Self::High | Self::Low => 1,
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
            Self::High => f64::from(short()? >> 8),
            Self::Low => f64::from(short()? & 0xFF),
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
}

/// What is asked of a device.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// What a register holds.
    Read(Register),
    /// To write registers: one by function 6, whose answer repeats the value, or several by function 16.
    Write {
        /// The device.
        slave: u8,
        /// Address of the first register, from 0.
        address: u16,
        /// What goes into it and those after it.
        values: Vec<u16>,
    },
}

impl Request {
    /// The device, and the address of its first register.
    #[must_use]
    pub const fn of(&self) -> (u8, u16) {
        match self {
            Self::Read(register) => (register.slave, register.address),
            Self::Write { slave, address, .. } => (*slave, *address),
        }
    }

    fn frame(&self) -> Vec<u8> {
        let (slave, address) = self.of();
        let [high, low] = address.to_be_bytes();
        match self {
            Self::Read(register) => vec![slave, register.function(), high, low, 0, register.number.registers()],
            Self::Write { values, .. } => {
                let count = values.len() as u8;
                let several = [slave, 16, high, low, 0, count, 2 * count];
                let head = if count == 1 { &[slave, 6, high, low] } else { several.as_slice() };
                head.iter().copied().chain(values.iter().flat_map(|value| value.to_be_bytes())).collect()
            }
        }
    }

    /// The bytes that ask; `transaction` ties an answer over TCP to them.
    #[must_use]
    pub fn question(&self, framing: Framing, transaction: u16) -> Vec<u8> {
        framing.wrap(&self.frame(), transaction)
    }

    /// The answer to the question with this number, taken out of `bytes`: the value that was read, or nothing but that it was
    /// written. `None` while it has not come whole. What answers an older question is left out.
    pub fn answer(
        &self,
        framing: Framing,
        transaction: u16,
        bytes: &mut Vec<u8>,
    ) -> Option<Result<Option<f64>, String>> {
        let length = match self {
            Self::Read(register) => 3 + 2 * usize::from(register.number.registers()),
            Self::Write { .. } => 6,
        };
        let frame = framing.frame_in(transaction, length, bytes)?;
        Some(frame.and_then(|frame| self.accepted(&frame)))
    }

    fn accepted(&self, answer: &[u8]) -> Result<Option<f64>, String> {
        let (asked, (_, address)) = (self.frame(), self.of());
        match (self, answer) {
            (_, [_, found, code]) if *found == asked[1] | 0x80 => {
                Err(format!("the device refuses register {address}: {}", exception(*code)))
            }
            (_, answer) if answer.get(..2) != Some(&asked[..2]) => Err(STRANGE.to_owned()),
            (Self::Read(register), [_, _, count, bytes @ ..]) if usize::from(*count) == bytes.len() => {
                let number = register.number.read(bytes).ok_or("the register holds no number of this type")?;
                Ok(Some(number * register.scale))
            }
            (Self::Read(_), _) => Err(STRANGE.to_owned()),
            (Self::Write { .. }, answer) if *answer == asked[..6] => Ok(None),
            (Self::Write { .. }, _) => Err(format!("register {address} took another value than it was given")),
        }
    }
}

/// An answer that is to no question of ours.
const STRANGE: &str = "an answer came that is not to the question: does something else use the line?";

impl Framing {
    fn wrap(self, frame: &[u8], transaction: u16) -> Vec<u8> {
        match self {
            Self::Tcp => {
                let [high, low] = transaction.to_be_bytes();
                [&[high, low, 0, 0, 0, frame.len() as u8], frame].concat()
            }
            Self::Rtu => [frame, &crc(frame).to_le_bytes()].concat(),
        }
    }

    /// The frame that answers, of so many bytes unless it is a refusal, taken out of what came; `None` while it is not whole.
    fn frame_in(self, transaction: u16, length: usize, bytes: &mut Vec<u8>) -> Option<Result<Vec<u8>, String>> {
        match self {
            Self::Tcp => loop {
                let length = usize::from(u16::from_be_bytes([*bytes.get(4)?, *bytes.get(5)?]));
                if bytes[2..4] != [0, 0] || !(3..=256).contains(&length) {
                    return Some(Err("no frame of Modbus came: is the port right?".to_owned()));
                }
                if bytes.len() < 6 + length {
                    return None;
                }
                let whole: Vec<u8> = bytes.drain(..6 + length).collect();
                if whole[..2] == transaction.to_be_bytes() {
                    return Some(Ok(whole[6..].to_vec()));
                }
            },
            Self::Rtu => {
                let length = 2 + if bytes.get(1)? & 0x80 != 0 { 3 } else { length };
                if bytes.len() < length {
                    return None;
                }
                let mut whole: Vec<u8> = bytes.drain(..length).collect();
                let sum = whole.split_off(length - 2);
                if crc(&whole).to_le_bytes() != sum[..] {
                    bytes.clear();
                    return Some(Err(
                        "the check sum of an answer is wrong: noise on the line, or another baud".to_owned()
                    ));
                }
                Some(Ok(whole))
            }
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

    fn asked(number: Number) -> Request {
        Request::Read(register(number))
    }

    fn rtu(frame: &[u8]) -> Vec<u8> {
        [frame, &crc(frame).to_le_bytes()].concat()
    }

    /// The first frame is an example of many manuals: slave 1, 10 holding registers from 0, check sum C5 CD.
    #[test]
    fn questions_are_as_the_specification_has_them() {
        assert_eq!(crc(&[1, 3, 0, 0, 0, 10]).to_le_bytes(), [0xC5, 0xCD]);
        let question = Request::Read(Register { input: true, ..register(Number::I16) }).question(Framing::Rtu, 0);
        assert_eq!(question[..6], [1, 4, 0, 18, 0, 1]);
        let question = Request::Read(register(Number::F32)).question(Framing::Tcp, 0x1234);
        assert_eq!(question, [0x12, 0x34, 0, 0, 0, 6, 1, 3, 0, 18, 0, 2]);
    }

    /// Both frames are examples of the specification (V1.1b3, 6.6 and 6.12), for slave 17.
    #[test]
    fn one_register_is_written_by_function_6_and_several_by_16() {
        let one = Request::Write { slave: 17, address: 1, values: vec![3] };
        assert_eq!(one.question(Framing::Rtu, 0)[..6], [17, 6, 0, 1, 0, 3]);
        let answers = |frame: &[u8]| one.answer(Framing::Rtu, 0, &mut rtu(frame)).unwrap();
        assert_eq!(answers(&[17, 6, 0, 1, 0, 3]), Ok(None));
        assert!(answers(&[17, 6, 0, 1, 0, 2]).unwrap_err().contains("register 1 took another value"));
        assert!(answers(&[17, 0x86, 4]).unwrap_err().contains("refuses register 1: exception 4"));
        let two = Request::Write { slave: 17, address: 1, values: vec![10, 258] };
        assert_eq!(two.question(Framing::Tcp, 1)[6..], [17, 16, 0, 1, 0, 2, 4, 0, 10, 1, 2]);
        assert_eq!(two.answer(Framing::Rtu, 0, &mut rtu(&[17, 16, 0, 1, 0, 2])), Some(Ok(None)));
        assert_eq!(two.answer(Framing::Rtu, 0, &mut vec![17, 16, 0]), None);
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
            assert_eq!(asked(Number::I16).answer(Framing::Rtu, 0, &mut whole[..cut].to_vec()), None);
        }
        let read = |number: Number, bytes: &[u8]| {
            let mut tcp = [&[0, 7, 0, 0, 0, 3 + bytes.len() as u8, 1, 3, bytes.len() as u8], bytes].concat();
            asked(number).answer(Framing::Tcp, 7, &mut tcp).unwrap()
        };
        let close = |read: Result<Option<f64>, String>, value: f64| {
            assert!((read.unwrap().unwrap() - value).abs() < 1e-6, "{value}");
        };
        close(asked(Number::I16).answer(Framing::Rtu, 0, &mut whole.clone()).unwrap(), -20.0);
        close(read(Number::U16, &[0xFF, 0x38]), 6_533.6);
        close(read(Number::I32, &[0xFF, 0xFF, 0xFF, 0x38]), -20.0);
        close(read(Number::F32, &305.0_f32.to_be_bytes()), 30.5);
        let [a, b, c, d] = 305.0_f32.to_be_bytes();
        close(read(Number::F32Swapped, &[c, d, a, b]), 30.5);
        close(read(Number::High, &[9, 88]), 0.9);
        close(read(Number::Low, &[9, 88]), 8.8);
        assert!(read(Number::F32, &f32::NAN.to_be_bytes()).unwrap_err().contains("no number"));
    }

    #[test]
    fn what_is_no_answer_is_told() {
        let of = |bytes: &[u8]| asked(Number::I16).answer(Framing::Rtu, 0, &mut bytes.to_vec()).unwrap().unwrap_err();
        assert!(of(&rtu(&[1, 0x83, 2])).contains("refuses register 18: exception 2"), "{}", of(&rtu(&[1, 0x83, 2])));
        assert!(of(&[1, 3, 2, 0, 1, 0, 0]).contains("check sum"));
        assert!(of(&rtu(&[9, 3, 2, 0, 1])).contains("not to the question"));
        let mut http = b"HTTP/1.1 400".to_vec();
        assert!(
            asked(Number::I16).answer(Framing::Tcp, 0, &mut http).unwrap().unwrap_err().contains("is the port right")
        );
    }

    #[test]
    fn a_late_answer_over_tcp_is_left_out() {
        let answer = |transaction: u8, value: u8| [0, transaction, 0, 0, 0, 5, 1, 3, 2, 0, value];
        let mut bytes = [answer(6, 99), answer(7, 50)].concat();
        let read = asked(Number::I16).answer(Framing::Tcp, 7, &mut bytes).unwrap().unwrap().unwrap();
        assert!((read - 5.0).abs() < 1e-9 && bytes.is_empty(), "{read}");
    }

    proptest! {
        #[test]
        fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..40), number in 0..2_usize, tcp: bool) {
            let framing = if tcp { Framing::Tcp } else { Framing::Rtu };
            let mut bytes = bytes;
            let _ = asked([Number::I16, Number::F32][number]).answer(framing, 1, &mut bytes);
        }
    }
}
