//! Signals by the names that a DBC file gives them, and single ones in its notation. The caller reads the file.

use std::collections::HashMap;

use can_dbc::{
    AttributeValue, ByteOrder as DbcOrder, Dbc, Message, MessageId, MultiplexIndicator, Signal,
    SignalExtendedValueType, ValueType,
};

use taxel_wire::CanId;
use taxel_wire::bits::{BitField, ByteOrder, FrameMatch, Selector};
use taxel_wire::signal::{PressureMeaning, PressureUnit, SignalSpec};

/// The message of a DBC file that holds signals of no message.
const INDEPENDENT: &str = "VECTOR__INDEPENDENT_SIG_MSG";
/// What is said of signals that several selectors, or several values of one, select.
const EXTENDED: &str =
    "it has several selectors, or several values of one (extended multiplexing): expected one value of one selector";

/// A DBC file.
pub struct DbcFile {
    dbc: Dbc,
    /// Identifiers as written, by message: the parser cuts long standard ones.
    raw_ids: HashMap<String, u64>,
    /// Every signal, as `(message, signal)` in `dbc` and its name as `Message.Signal`.
    names: Vec<(usize, usize, Name)>,
}

/// `Message.Signal`. A DBC file holds 32 characters of each; what was longer is in attributes, which other tools show.
struct Name {
    full: String,
    short: String,
}

/// A signal with all that is known of its place.
pub struct Place<'a> {
    message: &'a Message,
    /// As the file has it.
    pub signal: &'a Signal,
    /// Its name.
    pub name: &'a str,
    /// The frames that hold it.
    pub frames: FrameMatch,
    /// Where it is in them.
    pub field: BitField,
}

impl DbcFile {
    /// Of the text of a file.
    ///
    /// # Errors
    /// Where it is no DBC file.
    pub fn new(text: &str) -> Result<Self, String> {
        let dbc = Dbc::try_from(text).map_err(|e| format!("it is no DBC file: {e}"))?;
        let mut raw_ids = HashMap::new();
        for line in text.lines().filter_map(|line| line.trim_start().strip_prefix("BO_ ")) {
            let mut words = line.split([' ', ':', '\t']).filter(|word| !word.is_empty());
            if let (Some(id), Some(name)) = (words.next().and_then(|id| id.parse().ok()), words.next()) {
                raw_ids.insert(name.to_owned(), id);
            }
        }
        let names = names(&dbc);
        Ok(Self { dbc, raw_ids, names })
    }

    /// A file of one signal, `gauge.signal`, in the notation of such files: `0|32@1-`, with factor and offset
    /// `7|16@0- (0.5,-1)`. An identifier above 0x7FF has 29 bits; one below has, where bit 31 is set.
    ///
    /// # Errors
    /// What was expected.
    pub fn of_signal(id: u32, signal: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "signal = \"{signal}\": expected START|LENGTH@ORDER as in a DBC file, ORDER being 1 for little and 0 for big \
                 endian, with - for signed and + for unsigned numbers, as in \"0|32@1-\" or \"7|16@0- (0.5,-1)\""
            )
        };
        let known = |c: char| c.is_ascii_digit() || " |@+-(),.eE".contains(c);
        if !signal.chars().all(known) {
            return Err(wrong());
        }
        let number = id & 0x7FFF_FFFF;
        if number > 0x1FFF_FFFF {
            return Err(format!("id {id:#x} has more than 29 bits"));
        }
        let id = if number > 0x7FF { 0x8000_0000 | number } else { id };
        let factor = if signal.contains('(') { "" } else { " (1,0)" };
        let text = format!(
            "VERSION \"\"\nNS_ :\nBS_:\nBU_: D\nBO_ {id} gauge: 64 D\n SG_ signal : {signal}{factor} [0|0] \"\" D\n"
        );
        Self::new(&text).map_err(|_| wrong())
    }

    /// The signal of this name.
    ///
    /// # Errors
    /// If there is none, or several.
    pub fn one(&self, name: &str) -> Result<Place<'_>, String> {
        let mut all = self.matching(name)?;
        match (all.pop(), all.is_empty()) {
            (Some(place), true) => Ok(place),
            _ => Err(format!("`{name}` are several signals, expected one")),
        }
    }

    /// All signals that a pattern `Message.Signal` names, in the order of their names, numbers in these as numbers.
    ///
    /// # Errors
    /// If there is none, or one that cannot be read.
    pub fn matching(&self, pattern: &str) -> Result<Vec<Place<'_>>, String> {
        let fits = |name: &str| matches(pattern.as_bytes(), name.as_bytes());
        let mut found: Vec<_> = self.names.iter().filter(|(.., name)| fits(&name.full)).collect();
        if found.is_empty() {
            found = self.names.iter().filter(|(.., name)| fits(&name.short)).collect();
        }
        found.sort_by_cached_key(|(.., name)| natural(&name.full));
        if found.is_empty() {
            let nearest = self.nearest(pattern).map(|name| format!("; the nearest is `{name}`")).unwrap_or_default();
            return Err(format!("no signal is named `{pattern}` (as `Message.Signal`){nearest}"));
        }
        if let Some(twice) = found.windows(2).find(|pair| pair[0].2.full == pair[1].2.full) {
            return Err(format!("two signals are named `{}`: which of them is meant is not known", twice[0].2.full));
        }
        found.into_iter().map(|(message, signal, name)| self.place(*message, *signal, &name.full)).collect()
    }

    fn nearest(&self, pattern: &str) -> Option<&str> {
        let close = |name: &str| strsim::jaro_winkler(pattern, name);
        self.names.iter().map(|(.., name)| name.full.as_str()).max_by(|a, b| close(a).total_cmp(&close(b)))
    }

    fn place<'a>(&'a self, message: usize, signal: usize, name: &'a str) -> Result<Place<'a>, String> {
        let message = &self.dbc.messages[message];
        let signal = &message.signals[signal];
        let named = |why: String| format!("signal {name}: {why}");
        let raw = self.raw_ids.get(&message.name).copied();
        let id = match message.id {
            MessageId::Standard(_) if raw.is_some_and(|id| id > 0x7FF) => {
                let id = raw.unwrap_or_default();
                let words = format!("identifier {id} has more than 11 bits and bit 31 does not mark it as extended");
                return Err(named(words));
            }
            MessageId::Standard(id) => CanId::Standard(id),
            MessageId::Extended(id) => CanId::Extended(id),
        };
        if matches!(
            self.dbc.extended_value_type_for_signal(message.id, &signal.name),
            Some(SignalExtendedValueType::IEEEfloat32Bit | SignalExtendedValueType::IEEEdouble64bit)
        ) {
            return Err(named("it is a floating-point number, expected an integer".to_owned()));
        }
        let selectors = self.selectors(message, signal).map_err(named)?;
        let field = field(signal).map_err(named)?;
        if field.bytes_needed() as u64 > message.size {
            return Err(named(format!("it ends in byte {}, the message has {}", field.bytes_needed(), message.size)));
        }
        Ok(Place { message, signal, name, frames: FrameMatch { id, selectors }, field })
    }

    /// What selects the frames that hold a signal: the one selector of its message. Of several, and of several values of one, only
    /// lines SG_MUL_VAL_ tell which is meant.
    fn selectors(&self, message: &Message, signal: &Signal) -> Result<Vec<Selector>, String> {
        let value = match signal.multiplexer_indicator {
            MultiplexIndicator::MultiplexedSignal(value) => value,
            MultiplexIndicator::MultiplexorAndMultiplexedSignal(_) => return Err(EXTENDED.to_owned()),
            MultiplexIndicator::Plain | MultiplexIndicator::Multiplexor => return Ok(Vec::new()),
        };
        let is_selector = |indicator: &MultiplexIndicator| {
            matches!(
                indicator,
                MultiplexIndicator::Multiplexor | MultiplexIndicator::MultiplexorAndMultiplexedSignal(_)
            )
        };
        let all: Vec<&Signal> = message.signals.iter().filter(|s| is_selector(&s.multiplexer_indicator)).collect();
        let parent = match all[..] {
            [parent] => parent,
            [] => return Err("it is multiplexed, and no signal of its message is the selector".to_owned()),
            _ => return Err(EXTENDED.to_owned()),
        };
        let own = |e: &&can_dbc::ExtendedMultiplex| e.message_id == message.id && e.signal_name == signal.name;
        let mut runs = self.dbc.extended_multiplex.iter().filter(own).flat_map(|extended| &extended.mappings);
        if runs.any(|run| (run.min_value, run.max_value) != (value, value)) {
            return Err(EXTENDED.to_owned());
        }
        let field = BitField::new(bits(parent.start_bit), bits(parent.size), order(parent), false);
        let (field, value) = (field.map_err(|e| format!("its selector {}: {e}", parent.name))?, i128::from(value));
        if value > field.range().1 {
            return Err(format!("its selector {} has no number {value}", parent.name));
        }
        Ok(vec![Selector { field, values: vec![(value, value)] }])
    }
}

/// The names of all signals.
fn names(dbc: &Dbc) -> Vec<(usize, usize, Name)> {
    let text = |value: &AttributeValue| match value {
        AttributeValue::String(text) if !text.is_empty() => Some(text.clone()),
        _ => None,
    };
    let messages = dbc.attribute_values_message.iter().filter(|a| a.name == "SystemMessageLongSymbol");
    let messages: HashMap<_, _> = messages.filter_map(|a| Some((a.message_id, text(&a.value)?))).collect();
    let signals = dbc.attribute_values_signal.iter().filter(|a| a.name == "SystemSignalLongSymbol");
    let signals: HashMap<_, _> =
        signals.filter_map(|a| Some(((a.message_id, a.signal_name.as_str()), text(&a.value)?))).collect();
    let used = dbc.messages.iter().enumerate().filter(|(_, message)| message.name != INDEPENDENT);
    let of = |(m, message): (usize, &Message)| {
        let long_message = messages.get(&message.id).unwrap_or(&message.name);
        let of = |(s, signal): (usize, &Signal)| {
            let long = signals.get(&(message.id, signal.name.as_str())).unwrap_or(&signal.name);
            let short = format!("{}.{}", message.name, signal.name);
            (m, s, Name { full: format!("{long_message}.{long}"), short })
        };
        message.signals.iter().enumerate().map(of).collect::<Vec<_>>()
    };
    used.flat_map(of).collect()
}

impl Place<'_> {
    /// What it says of a pressure, taken for one of the difference to the ambient pressure.
    #[must_use]
    pub fn pressure(&self, unit: PressureUnit) -> SignalSpec {
        let Signal { start_bit, size, factor, offset, .. } = *self.signal;
        SignalSpec {
            id: self.frames.id,
            start_bit: bits(start_bit),
            length_bits: bits(size),
            byte_order: order(self.signal),
            signed: self.signal.value_type == ValueType::Signed,
            scale: factor,
            offset,
            unit,
            meaning: PressureMeaning::Differential,
        }
    }

    /// Its bits.
    #[must_use]
    pub fn length_bits(&self) -> u16 {
        bits(self.signal.size)
    }

    /// Who sends it.
    #[must_use]
    pub fn sender(&self) -> &str {
        self.message.transmitter.as_deref().unwrap_or_default()
    }

    /// Whether each frame of `other` has this number at the same place.
    #[must_use]
    pub fn is_beside(&self, other: &Self) -> bool {
        let place = |signal: &Signal| (signal.start_bit, signal.size, signal.byte_order);
        self.frames.selectors.is_empty() && other.message.signals.iter().any(|s| place(s) == place(self.signal))
    }
}

fn field(signal: &Signal) -> Result<BitField, String> {
    let signed = signal.value_type == ValueType::Signed;
    BitField::new(bits(signal.start_bit), bits(signal.size), order(signal), signed).map_err(|e| e.to_string())
}

/// A number of bits: one that is too large is beyond any frame.
fn bits(number: u64) -> u16 {
    u16::try_from(number).unwrap_or(u16::MAX)
}

fn order(signal: &Signal) -> ByteOrder {
    match signal.byte_order {
        DbcOrder::LittleEndian => ByteOrder::Little,
        DbcOrder::BigEndian => ByteOrder::Big,
    }
}

/// Whether a name fits a pattern in which `*` stands for any letters, also none.
fn matches(pattern: &[u8], name: &[u8]) -> bool {
    match (pattern.split_first(), name.split_first()) {
        (None, None) => true,
        (Some((b'*', rest)), _) => (0..=name.len()).any(|from| matches(rest, &name[from..])),
        (Some((a, pattern)), Some((b, name))) => a == b && matches(pattern, name),
        _ => false,
    }
}

/// By what names are ordered: runs of digits in them as numbers, for which all have as many digits.
fn natural(name: &str) -> String {
    let runs = name.as_bytes().chunk_by(|a, b| a.is_ascii_digit() == b.is_ascii_digit()).map(String::from_utf8_lossy);
    runs.map(|run| if run.starts_with(|c: char| c.is_ascii_digit()) { format!("{run:0>20}") } else { run.into() })
        .collect()
}

#[cfg(test)]
mod tests;
