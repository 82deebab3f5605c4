//! A DBC file as a description of signals: names become `[[patch.signals]]`, `[patch.gauge]` and the numbers of
//! `[patch.array]`, so that nothing behind this knows where they came from.

use std::cmp::Ordering;
use std::collections::{HashMap, VecDeque};
use std::path::Path;

use can_dbc::{
    AttributeValue, ByteOrder as DbcOrder, Dbc, Message, MessageId, MultiplexIndicator, Signal,
    SignalExtendedValueType, ValueType,
};
use taxel_wire::bits::{BitField, ByteOrder};
use taxel_wire::signal::PressureUnit;

use super::load::beside;
use super::number_words::{OrderOfBytes, UnitWord};
use super::parts::{GaugeSection, PatchSection};
use super::signal_parts::{
    ArraySection, FrameSection, MuxSection, NumberSection, SignalsSection, StatusSection, TemperatureSection,
};
use crate::files::read_any_text;

/// The message of a DBC file that holds signals of no message.
const INDEPENDENT: &str = "VECTOR__INDEPENDENT_SIG_MSG";
/// Selectors of a signal, with theirs, at most.
const MUX_MAX: usize = 8;

/// The section with what its DBC file says written out; `config` is the file that it is in.
///
/// # Errors
/// In words, with the file, the message and the signal.
pub fn expand(section: &PatchSection, config: &Path) -> Result<PatchSection, String> {
    let Some(array) = section.array.as_ref() else { return Ok(section.clone()) };
    let Some(name) = &array.dbc else {
        return match array.of_dbc() {
            Some(key) => Err(format!("array.{key} names what is in a DBC file: say also array.dbc = \"FILE.dbc\"")),
            None => Ok(section.clone()),
        };
    };
    if array.gauge.is_none() && array.gauge_is != Default::default() {
        return Err("array.gauge_is is used for array.gauge only, and that is not set".to_owned());
    }
    let path = beside(config, name);
    // Comments and units of old files are not always UTF-8; names are letters, digits and `_` in any encoding.
    let text = read_any_text(&path).map_err(|e| format!("dbc {}: {e}", path.display()))?;
    from_text(section, array, &text).map_err(|why| format!("dbc {}: {why}", path.display()))
}

fn from_text(section: &PatchSection, array: &ArraySection, text: &str) -> Result<PatchSection, String> {
    let file = File::new(text)?;
    let mut section = section.clone();
    let mut taxels = Vec::new();
    for pattern in &array.taxels {
        taxels.extend(file.matching(pattern)?);
    }
    for place in &taxels {
        section.signals.push(place.taxel()?);
    }
    if let Some(name) = &array.gauge {
        if section.gauge.is_some() {
            return Err("array.gauge and [patch.gauge] are both there: expected one of them".to_owned());
        }
        section.gauge = Some(file.one(name)?.gauge(array)?);
    }
    let mut array = array.clone();
    if let Some(name) = &array.dbc_counter {
        let place = file.one(name)?;
        place.is_in_all(&taxels)?;
        array.counter = Some(place.number());
    }
    if let Some(name) = &array.dbc_status {
        let place = file.one(name)?;
        array.status = Some(StatusSection { frame: place.frame(), number: place.number(), good: array.status_good });
    }
    if let Some(name) = &array.dbc_temperature {
        let place = file.one(name)?;
        let (scale, offset) = (place.signal.factor, place.signal.offset);
        array.temperature = Some(TemperatureSection { frame: place.frame(), number: place.number(), scale, offset });
    }
    section.array = Some(array);
    Ok(section)
}

/// A selector of a signal, and first and last of each run of values for which the signal is there.
type Selected<'a> = (&'a str, Vec<[u64; 2]>);

struct File {
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
struct Place<'a> {
    message: &'a Message,
    signal: &'a Signal,
    name: &'a str,
    mux: Vec<MuxSection>,
}

impl File {
    fn new(text: &str) -> Result<Self, String> {
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

    /// The signal of this name.
    fn one(&self, name: &str) -> Result<Place<'_>, String> {
        let mut all = self.matching(name)?;
        match (all.pop(), all.is_empty()) {
            (Some(place), true) => Ok(place),
            _ => Err(format!("`{name}` are several signals, expected one")),
        }
    }

    /// All signals that a pattern `Message.Signal` names, in the order of their names, numbers in these as numbers.
    fn matching(&self, pattern: &str) -> Result<Vec<Place<'_>>, String> {
        let fits = |name: &str| matches(pattern.as_bytes(), name.as_bytes());
        let mut found: Vec<_> = self.names.iter().filter(|(.., name)| fits(&name.full)).collect();
        if found.is_empty() {
            found = self.names.iter().filter(|(.., name)| fits(&name.short)).collect();
        }
        found.sort_by(|(.., a), (.., b)| natural(&a.full, &b.full));
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
        if let (MessageId::Standard(_), Some(id)) = (message.id, raw.filter(|id| *id > 0x7FF)) {
            return Err(named(format!(
                "identifier {id} has more than 11 bits and bit 31 does not mark it as extended"
            )));
        }
        if matches!(
            self.dbc.extended_value_type_for_signal(message.id, &signal.name),
            Some(SignalExtendedValueType::IEEEfloat32Bit | SignalExtendedValueType::IEEEdouble64bit)
        ) {
            return Err(named("it is a floating-point number, expected an integer".to_owned()));
        }
        let mux = self.mux(message, signal).map_err(named)?;
        let place = Place { message, signal, name, mux };
        let field = place.field()?;
        if field.bytes_needed() as u64 > message.size {
            return Err(named(format!("it ends in byte {}, the message has {}", field.bytes_needed(), message.size)));
        }
        Ok(place)
    }

    /// What selects the frames that hold a signal: its own selectors, then theirs.
    fn mux(&self, message: &Message, signal: &Signal) -> Result<Vec<MuxSection>, String> {
        let (mut mux, mut open): (Vec<MuxSection>, _) = (Vec::new(), VecDeque::from([signal]));
        while let Some(signal) = open.pop_front() {
            for (selector, runs) in self.selected_by(message, signal)? {
                let [value, _] = *runs.first().ok_or("it is selected by no value")?;
                let parent = message.signals.iter().find(|s| s.name == selector);
                let parent = parent.ok_or_else(|| format!("its selector {selector} is not there"))?;
                let (start_bit, length_bits) = (parent.start_bit as u16, parent.size as u16);
                mux.push(MuxSection { start_bit, length_bits, byte_order: order(parent), value, also: runs });
                if mux.len() > MUX_MAX {
                    return Err("its selectors select each other".to_owned());
                }
                open.push_back(parent);
            }
        }
        Ok(mux)
    }

    /// The selectors of a signal and the values for which it is there: it is where all of them say so.
    fn selected_by<'a>(&'a self, message: &'a Message, signal: &'a Signal) -> Result<Vec<Selected<'a>>, String> {
        let mut selected: Vec<Selected<'a>> = Vec::new();
        let own = |e: &&can_dbc::ExtendedMultiplex| e.message_id == message.id && e.signal_name == signal.name;
        for extended in self.dbc.extended_multiplex.iter().filter(own) {
            let selector = extended.multiplexor_signal_name.as_str();
            let runs = extended.mappings.iter().map(|run| [run.min_value, run.max_value]);
            match selected.iter_mut().find(|(known, _)| *known == selector) {
                Some((_, known)) => known.extend(runs),
                None => selected.push((selector, runs.collect())),
            }
        }
        let (MultiplexIndicator::MultiplexedSignal(value) | MultiplexIndicator::MultiplexorAndMultiplexedSignal(value)) =
            signal.multiplexer_indicator
        else {
            return Ok(selected);
        };
        if !selected.is_empty() {
            return Ok(selected);
        }
        let selects = |s: &&Signal| s.multiplexer_indicator == MultiplexIndicator::Multiplexor;
        let mut selectors = message.signals.iter().filter(selects);
        match (selectors.next(), selectors.next()) {
            (Some(selector), None) => Ok(vec![(selector.name.as_str(), vec![[value, value]])]),
            (None, _) => Err("it is multiplexed, and no signal of its message is the selector".to_owned()),
            (Some(one), Some(other)) => Err(format!(
                "{} and {} are both selectors of its message, and no SG_MUL_VAL_ line says which is its own",
                one.name, other.name
            )),
        }
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
    fn named(&self, why: impl std::fmt::Display) -> String {
        format!("signal {}: {why}", self.name)
    }

    fn field(&self) -> Result<BitField, String> {
        let narrow = |number: u64| u16::try_from(number).unwrap_or(u16::MAX);
        let order = match self.signal.byte_order {
            DbcOrder::LittleEndian => ByteOrder::Little,
            DbcOrder::BigEndian => ByteOrder::Big,
        };
        let (start, size) = (narrow(self.signal.start_bit), narrow(self.signal.size));
        BitField::new(start, size, order, self.signal.value_type == ValueType::Signed).map_err(|e| self.named(e))
    }

    fn id(&self) -> (u32, bool) {
        match self.message.id {
            MessageId::Standard(id) => (u32::from(id), false),
            MessageId::Extended(id) => (id, true),
        }
    }

    fn frame(&self) -> FrameSection {
        let (id, extended) = self.id();
        FrameSection { id, extended, mux: self.mux.clone() }
    }

    fn number(&self) -> NumberSection {
        NumberSection {
            start_bit: self.signal.start_bit as u16, // [`File::place`] has seen that these fit
            length_bits: self.signal.size as u16,
            byte_order: order(self.signal),
            signed: self.signal.value_type == ValueType::Signed,
        }
    }

    fn taxel(&self) -> Result<SignalsSection, String> {
        let NumberSection { start_bit, length_bits, byte_order, signed } = self.number();
        if !(4..=24).contains(&length_bits) {
            return Err(self.named(format!("a taxel of {length_bits} bits, expected 4 to 24")));
        }
        let ((id, extended), mux) = (self.id(), self.mux.clone());
        Ok(SignalsSection {
            id,
            extended,
            start_bit,
            length_bits,
            byte_order,
            signed,
            count: 1,
            stride_bits: None,
            mux,
            frames: 1,
            id_step: 0,
            mux_step: 0,
            device: 1,
            name: self.name.to_owned(),
        })
    }

    /// Whether every frame of these taxels has this number at the same place.
    fn is_in_all(&self, taxels: &[Self]) -> Result<(), String> {
        if !self.mux.is_empty() {
            return Err(self.named("it is multiplexed, expected a counter in every frame of its message"));
        }
        let place = |signal: &Signal| (signal.start_bit, signal.size, signal.byte_order);
        let has = |taxel: &&Self| taxel.message.signals.iter().any(|signal| place(signal) == place(self.signal));
        match taxels.iter().find(|taxel| !has(taxel)) {
            Some(taxel) => Err(self.named(format!("expected a counter of all taxels, and {} has none", taxel.name))),
            None => Ok(()),
        }
    }

    fn gauge(&self, array: &ArraySection) -> Result<GaugeSection, String> {
        if !self.mux.is_empty() {
            return Err(self.named("it is multiplexed, expected a gauge in every frame of its message"));
        }
        let (number, is, (id, extended)) = (self.number(), &array.gauge_is, self.id());
        let unknown = || {
            self.named(format!(
                "its unit is \"{}\", which is none of {}: say in [patch.array] gauge_is = {{ unit = \"kPa\", scale = 0.1 }} \
                 with the kPa of a step as scale",
                self.signal.unit,
                PressureUnit::NAMES
            ))
        };
        Ok(GaugeSection {
            bus: None,
            id,
            extended,
            start_bit: number.start_bit,
            length_bits: number.length_bits,
            byte_order: number.byte_order,
            signed: number.signed,
            scale: is.scale.unwrap_or(self.signal.factor),
            offset: is.offset.unwrap_or(self.signal.offset),
            unit: is.unit.or_else(|| PressureUnit::named(&self.signal.unit).map(UnitWord)).ok_or_else(unknown)?,
            ambient_kpa: is.ambient_kpa,
            gain_uncertainty: is.gain_uncertainty,
            offset_uncertainty_kpa: is.offset_uncertainty_kpa,
            noise_kpa: is.noise_kpa,
        })
    }
}

fn order(signal: &Signal) -> OrderOfBytes {
    match signal.byte_order {
        DbcOrder::LittleEndian => OrderOfBytes::Little,
        DbcOrder::BigEndian => OrderOfBytes::Big,
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

/// Compares names, and runs of digits in them as numbers.
fn natural(a: &str, b: &str) -> Ordering {
    let parts = |text: &str| -> Vec<(bool, u64, String)> {
        let runs = text.as_bytes().chunk_by(|a, b| a.is_ascii_digit() == b.is_ascii_digit());
        let part = |run: &[u8]| {
            let text = String::from_utf8_lossy(run).into_owned();
            (run[0].is_ascii_digit(), text.parse().unwrap_or(u64::MAX), text)
        };
        runs.map(part).collect()
    };
    let (a_parts, b_parts) = (parts(a), parts(b));
    for ((a_digits, a_number, a_text), (b_digits, b_number, b_text)) in a_parts.iter().zip(&b_parts) {
        let order = if *a_digits && *b_digits { a_number.cmp(b_number) } else { a_text.cmp(b_text) };
        if order != Ordering::Equal {
            return order;
        }
    }
    a_parts.len().cmp(&b_parts.len()).then_with(|| a.cmp(b))
}

#[cfg(test)]
mod tests;
