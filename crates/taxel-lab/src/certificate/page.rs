//! The certificate as a page to be printed: what its JSON says, section by section.

use serde::Deserialize;
use serde_json::Value;

use super::figures::figures;
use super::make::Certificate;
use crate::document::{Section, Table, words};
use crate::page::Page;

/// What a certificate of no real skin says, first and last.
const NOT_MEASURED: &str = "SIMULATED OR REPLAYED. No skin was measured for this: a simulator or a replayed log sent the counts and \
    pressures. It certifies nothing. Do not sign it.";

/// What is shown of the certificate.
#[derive(Deserialize)]
struct Shown {
    section: Vec<Part>,
}

#[derive(Deserialize)]
struct Part {
    field: String,
    heading: String,
    #[serde(default)]
    shown: String,
    #[serde(default)]
    note: String,
}

impl Certificate {
    /// The page.
    ///
    /// # Errors
    /// None: what is shown is compiled in.
    pub fn to_html(&self) -> anyhow::Result<String> {
        let simulated = self.0["simulated"] == true;
        let kind = if simulated { "Specimen: not a calibration certificate" } else { "Calibration certificate" };
        let [set, software] = [&self.0["set"]["id"], &self.0["software"]].map(words);
        let mut introduction =
            vec![format!("Number {}.", self.number()), format!("Model set {set}; certificate made by {software}.")];
        let shown: Shown = toml::from_str(include_str!("page.toml"))?;
        let mut sections: Vec<Section> = shown.section.into_iter().map(|part| section(part, &self.0)).collect();
        let id = "sign".to_owned();
        if simulated {
            introduction.insert(0, NOT_MEASURED.to_owned());
            let (title, text) = ("Not to be signed".to_owned(), vec![NOT_MEASURED.to_owned()]);
            sections.push(Section { id, title, text, ..Section::default() });
        } else {
            let blank = vec![vec!["\u{a0}".into(); 3]; 2];
            let tables = vec![Table::new("sign", "", ["signature", "name", "date"], blank)];
            sections.push(Section { id, title: "Calibrated by, approved by".to_owned(), tables, ..Section::default() });
        }
        Ok(Page { title: kind, introduction: &introduction, sections: &sections }.html(None))
    }
}

/// Fields as a table of two columns, rows as one of many, lines as they are.
fn section(Part { field, heading, shown, note }: Part, certificate: &Value) -> Section {
    let nothing = match field.as_str() {
        "stated" => "not stated",
        "session" | "set" => "none",
        _ => "not determined",
    };
    let cell = |value: &Value| match value {
        Value::Null => nothing.into(),
        Value::Bool(holds) => if *holds { "yes" } else { "no" }.into(),
        other => other.clone(),
    };
    let names: Vec<&str> = shown.split_whitespace().collect();
    let mut text: Vec<String> = [note].into_iter().filter(|note| !note.is_empty()).collect();
    let (columns, rows) = match &certificate[&field] {
        Value::Object(fields) => {
            let row = |name: &&str| vec![label(name).into(), cell(&fields[*name])];
            (Vec::new(), names.iter().map(row).collect())
        }
        Value::Array(all) if shown.is_empty() => {
            text.extend(all.iter().map(words));
            (Vec::new(), Vec::new())
        }
        Value::Array(all) if !all.is_empty() => {
            let row = |one: &Value| names.iter().map(|name| cell(&one[name])).collect();
            (names.iter().map(|name| label(name)).collect(), all.iter().map(row).collect())
        }
        _ => (Vec::new(), vec![vec!["None.".into()]]),
    };
    let tables = vec![Table::new(&field, "", columns, rows)];
    let figures = figures(&field, certificate);
    Section { id: field, title: heading, text, tables, figures, ..Section::default() }
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
    match name {
        "within" => return "loads within -1 to 1".to_owned(),
        "number" => return "session".to_owned(),
        _ => {}
    }
    let unit = UNITS.iter().find_map(|(end, unit)| Some((name.strip_suffix(end)?, *unit)));
    let (name, unit) = unit.unwrap_or((name, ""));
    format!("{}{unit}", name.replace('_', " "))
}
