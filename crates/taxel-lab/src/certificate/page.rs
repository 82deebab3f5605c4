//! The certificate as a page to be printed: what its JSON says, section by section. It loads nothing and runs nothing.

use std::fmt;

use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde::Deserialize;
use serde::de::{MapAccess, SeqAccess, Visitor};

use super::document::Certificate;
use crate::numbers::digits;

const STYLE: &str = include_str!("style.css");

/// Figures of the page have so many significant digits; the JSON has all.
const DIGITS: usize = 4;

/// What a certificate of no real skin says, first and last.
const NOT_MEASURED: &str = "SIMULATED OR REPLAYED. No skin was measured for this: a simulator or a replayed log sent the counts and \
    pressures. It certifies nothing and is not to be signed.";

/// Field of the certificate, heading, and what is said below it.
const SECTIONS: [(&str, &str, &str); 14] = [
    (
        "expanded",
        "Expanded uncertainty of a pressure",
        "Of one taxel, and of the mean of all usable ones; k = 2, about 95 %.",
    ),
    ("stated", "Object, parties, reference and environment", ""),
    ("set", "Models", ""),
    (
        "session",
        "Procedure",
        "The skin lies in a bag whose pressure below the ambient is changed slowly; the atmosphere presses on all taxels \
         alike. Before each ramp the unloaded skin gives the zero; counts of all ramps are brought to the zero of the first.",
    ),
    (
        "ramps",
        "Ramps",
        "Shifts of the zero are against the first ramp, over the usable taxels. What the reference read at rest is taken \
         off the pressures of the ramp.",
    ),
    ("levels", "Readings by level: mean of all usable taxels", ""),
    ("mean", "The mean reading over the whole session", ""),
    (
        "budget",
        "Uncertainty budget",
        "Standard uncertainties by the Guide to the Expression of Uncertainty in Measurement, added as root sum of squares \
         and multiplied by k = 2. One taxel: root mean square over the usable taxels, a single reading.",
    ),
    ("loads", "Known loads", "Beyond -1 to 1 the normalised error says that force and reading disagree."),
    ("loads_summary", "Known loads together", ""),
    ("limits", "Limits of use", ""),
    ("excluded", "Excluded taxels", ""),
    (
        "taxels",
        "Taxels",
        "Figures over all scans of the session. Linearity: greatest distance of the curve from the straight line between \
         its ends, in % of its span. Lower limit: 2.4 standard deviations of the errors, no less than one count (after ASTM \
         E74). Coefficients of every curve are in the JSON.",
    ),
    (
        "hashes",
        "Data",
        "SHA-256 of the files as `taxeld sessions export` and `taxeld models export` write them. The number of the \
         certificate is made of its content.",
    ),
];

/// A value of the JSON with its fields in their order.
enum Node {
    Nothing,
    Text(String),
    Number(f64),
    List(Vec<Node>),
    Fields(Vec<(String, Node)>),
}

impl Certificate {
    /// The page.
    ///
    /// # Errors
    /// What of the certificate JSON cannot hold.
    pub fn to_html(&self) -> anyhow::Result<String> {
        let Node::Fields(fields) = serde_json::from_str(&self.to_json()?)? else { return Ok(String::new()) };
        let field = |key: &str| fields.iter().find(|(name, _)| name == key).map(|(_, node)| node);
        let kind = if self.simulated { "Specimen: not a calibration certificate" } else { "Calibration certificate" };
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    title { (kind) " " (self.number) }
                    style { (PreEscaped(STYLE)) }
                }
                body {
                    header {
                        h1 { (kind) }
                        p { b { (self.number) } br; "model set " (self.set.id) br; "made by " (self.software) }
                    }
                    @if self.simulated { p class="simulated" { (NOT_MEASURED) } }
                    @for (key, heading, note) in SECTIONS {
                        h2 { (heading) }
                        (shown(field(key), if key == "stated" { "not stated" } else { "n/d" }))
                        @if !note.is_empty() { p class="note" { (note) } }
                    }
                    @if self.simulated { p class="simulated" { (NOT_MEASURED) } } @else {
                        div class="sign" { div { "Calibrated by, date, signature" } div { "Approved by, date, signature" } }
                    }
                }
            }
        };
        Ok(page.into_string())
    }
}

/// Fields as a list, rows as a table.
fn shown(node: Option<&Node>, nothing: &str) -> Markup {
    match node {
        Some(Node::Fields(fields)) => html! {
            dl { @for (name, node) in fields { dt { (label(name)) } dd { (words(node, nothing)) } } }
        },
        Some(Node::List(rows)) if matches!(rows.first(), Some(Node::Fields(_))) => table(rows, nothing),
        Some(Node::List(lines)) if !lines.is_empty() => html! {
            ul { @for line in lines { li { (words(line, nothing)) } } }
        },
        _ => html! { p class="none" { "None." } },
    }
}

/// The fields of a row, without the lists among them, which have no room in a table.
fn cells(row: &Node) -> Vec<&(String, Node)> {
    match row {
        Node::Fields(fields) => fields.iter().filter(|(_, node)| !matches!(node, Node::List(_))).collect(),
        _ => Vec::new(),
    }
}

fn table(rows: &[Node], nothing: &str) -> Markup {
    let is_text = |node: &Node| matches!(node, Node::Text(_)).then_some("t");
    let first = rows.first().map(cells).unwrap_or_default();
    html! {
        table class=[(first.len() > 12).then_some("dense")] {
            thead { tr { @for (name, node) in &first { th class=[is_text(node)] { (label(name)) } } } }
            tbody { @for row in rows { tr {
                @for (_, node) in cells(row) { td class=[is_text(node)] { (words(node, nothing)) } }
            } } }
        }
    }
}

/// A field's name as a reader's words: `rise_kpa_per_s` is `rise, kPa/s`.
fn label(name: &str) -> String {
    const UNITS: [(&str, &str); 8] = [
        ("_kpa_per_s", ", kPa/s"),
        ("_counts_per_kpa", ", counts/kPa"),
        ("_kpa", ", kPa"),
        ("_percent", ", %"),
        ("_counts", ", counts"),
        ("_kg", ", kg"),
        ("_n", ", N"),
        ("_c", ", \u{b0}C"),
    ];
    let unit = UNITS.iter().find_map(|(end, unit)| Some((name.strip_suffix(end)?, *unit)));
    let (name, unit) = unit.unwrap_or((name, ""));
    format!("{}{unit}", name.replace('_', " "))
}

fn words(node: &Node, nothing: &str) -> String {
    match node {
        Node::Nothing => nothing.to_owned(),
        Node::Text(text) => text.clone(),
        Node::Number(value) => digits(*value, DIGITS),
        Node::List(all) => all.iter().map(|node| words(node, nothing)).collect::<Vec<_>>().join(", "),
        Node::Fields(fields) => {
            let all = fields.iter().map(|(name, node)| format!("{} {}", words(node, nothing), label(name)));
            all.collect::<Vec<_>>().join(", ")
        }
    }
}

impl<'de> Deserialize<'de> for Node {
    fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_any(NodeVisitor)
    }
}

struct NodeVisitor;

impl<'de> Visitor<'de> for NodeVisitor {
    type Value = Node;

    fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str("any JSON")
    }

    fn visit_unit<E>(self) -> Result<Node, E> {
        Ok(Node::Nothing)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Node, E> {
        Ok(Node::Text(if value { "yes" } else { "no" }.to_owned()))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Node, E> {
        Ok(Node::Number(value as f64))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Node, E> {
        Ok(Node::Number(value as f64))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Node, E> {
        Ok(Node::Number(value))
    }

    fn visit_str<E>(self, text: &str) -> Result<Node, E> {
        Ok(Node::Text(text.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut from: A) -> Result<Node, A::Error> {
        let mut all = Vec::new();
        while let Some(node) = from.next_element()? {
            all.push(node);
        }
        Ok(Node::List(all))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut from: A) -> Result<Node, A::Error> {
        let mut fields = Vec::new();
        while let Some(field) = from.next_entry()? {
            fields.push(field);
        }
        Ok(Node::Fields(fields))
    }
}
