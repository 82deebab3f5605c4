//! The certificate as a page to be printed: what its JSON says, section by section.

use serde_json::Value;

use super::make::Certificate;
use crate::document::{Section, Table, words};
use crate::page::Page;

/// What a certificate of no real skin says, first and last.
const NOT_MEASURED: &str = "SIMULATED OR REPLAYED. No skin was measured for this: a simulator or a replayed log sent the counts and \
    pressures. It certifies nothing and is not to be signed.";

/// Field of the certificate, heading, the fields of it that are shown, in this order, and what is said to them.
type Part = (&'static str, &'static str, &'static str, &'static str);

const PARTS: [Part; 15] = [
    ("verdict", "Verdict", "", ""),
    (
        "expanded",
        "Expanded uncertainty of a pressure",
        "taxel_kpa mean_kpa coverage_factor",
        "Of one taxel, and of the mean of all usable ones; k = 2, about 95 %.",
    ),
    (
        "stated",
        "Object, parties, reference and environment",
        "customer laboratory operator place robot skin_serial reference_sensor reference_serial reference_certificate \
         reference_date reference_expanded_uncertainty_kpa traceability temperature_c humidity_percent ambient_kpa remarks",
        "",
    ),
    (
        "set",
        "Models",
        "id patch made method fitted_by board_settings taxels usable pressure_max_kpa gauge_gain_rel gauge_offset_kpa",
        "",
    ),
    (
        "session",
        "Procedure",
        "number started branches target_kpa unloaded_confirmed_by scans counts_per_unit",
        "The atmosphere presses on the skin in an evacuated bag. Counts of all ramps are brought to the zero of the first.",
    ),
    (
        "ramps",
        "Ramps",
        "ramp scans_rising scans_falling from_kpa top_kpa to_kpa rise_kpa_per_s fall_kpa_per_s zero_mean_counts zero_rms_counts \
         gauge_zero_kpa",
        "Shifts of the zero are against the first ramp. The reference's unloaded reading is taken off the pressures.",
    ),
    (
        "levels",
        "Readings by level: mean of all usable taxels",
        "branch from_kpa to_kpa scans reference_kpa reading_kpa error_kpa spread_kpa",
        "",
    ),
    (
        "mean",
        "The mean reading over the whole session",
        "rmse_kpa bias_kpa max_error_kpa hysteresis_kpa repeatability_kpa zero_shift_kpa",
        "",
    ),
    (
        "budget",
        "Uncertainty budget",
        "name evaluation taxel_kpa mean_kpa combined",
        "Standard uncertainties by the GUM (JCGM 100). Combined: their root sum of squares, times k = 2. One taxel: root mean \
         square over the usable taxels, a single reading.",
    ),
    (
        "loads",
        "Known loads",
        "load time by note mass_kg force_n force_sigma_n read_n read_sigma_n read_scatter_n scans error_percent \
         normalised_error",
        "Beyond -1 to 1 the normalised error says that force and reading disagree.",
    ),
    ("loads_summary", "Known loads together", "loads mean_absolute_error_percent within", ""),
    ("limits", "Limits of use", "", ""),
    ("excluded", "Excluded taxels", "taxel status reason", ""),
    (
        "taxels",
        "Taxels",
        "taxel order count_min count_max sensitivity_counts_per_kpa linearity_percent rmse_kpa bias_kpa max_error_kpa \
         hysteresis_kpa hysteresis_percent repeatability_kpa zero_counts zero_noise_counts zero_shift_counts lower_limit_kpa \
         outside_share expanded_uncertainty_kpa",
        "Over all scans of the session. Linearity: greatest distance of the curve from a straight line, in % of its span. Lower \
         limit: 2.4 standard deviations of the errors, no less than one count (after ASTM E74). The JSON has the curves.",
    ),
    (
        "hashes",
        "Data",
        "samples_csv models_json",
        "SHA-256 of what `taxeld sessions export` and `taxeld models export` write.",
    ),
];

impl Certificate {
    /// The page.
    #[must_use]
    pub fn to_html(&self) -> String {
        let simulated = self.0["simulated"] == true;
        let kind = if simulated { "Specimen: not a calibration certificate" } else { "Calibration certificate" };
        let [set, software] = [&self.0["set"]["id"], &self.0["software"]].map(words);
        let mut introduction = vec![format!("Model set {set}, certified by {software}.")];
        let mut sections: Vec<Section> = PARTS.iter().map(|part| section(*part, &self.0[part.0])).collect();
        if simulated {
            introduction.insert(0, NOT_MEASURED.to_owned());
            let text = vec![NOT_MEASURED.to_owned()];
            sections.push(Section { id: "sign", title: "Not to be signed", text, ..Section::default() });
        } else {
            let blank = vec![vec!["\u{a0}".into(); 3]; 2];
            let tables = vec![Table::new("sign", "", ["signature", "name", "date"], blank)];
            sections.push(Section { id: "sign", title: "Calibrated by, approved by", tables, ..Section::default() });
        }
        let title = format!("{kind} {}", self.number());
        Page { title: &title, introduction: &introduction, sections: &sections }.html(None)
    }
}

/// Fields as a table of two columns, rows as one of many, lines as they are.
fn section((field, heading, shown, note): Part, value: &Value) -> Section {
    let nothing = if field == "stated" { "not stated" } else { "n/d" };
    let cell = |value: &Value| match value {
        Value::Null => nothing.into(),
        Value::Bool(holds) => if *holds { "yes" } else { "no" }.into(),
        other => other.clone(),
    };
    let names: Vec<&str> = shown.split_whitespace().collect();
    let mut text: Vec<String> = [note].into_iter().filter(|note| !note.is_empty()).map(str::to_owned).collect();
    let (columns, rows) = match value {
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
    let tables = vec![Table::new(field, "", columns, rows)];
    Section { id: field, title: heading, text, tables, ..Section::default() }
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
