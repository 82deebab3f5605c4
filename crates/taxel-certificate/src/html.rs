//! The certificate as a page to be printed. It loads nothing and runs nothing.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::document::{Certificate, LevelPart, LoadPart, RampPart, TaxelPart};
use crate::words::{NOT_STATED, known, number, stated, with_unit};

const STYLE: &str = include_str!("style.css");

/// What a certificate of no real skin says, first and last.
const NOT_MEASURED: &str = "SIMULATED OR REPLAYED. No skin was measured for this: a simulator or a replayed log sent the counts and \
    pressures. It certifies nothing and is not to be signed.";

impl Certificate {
    /// The page.
    #[must_use]
    pub fn to_html(&self) -> String {
        let kind =
            if self.simulated { "SIMULATED: specimen of a calibration certificate" } else { "Calibration certificate" };
        let title = format!("{kind} {}", self.number);
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    title { (title) }
                    style { (PreEscaped(STYLE)) }
                }
                body {
                    header {
                        h1 { @if self.simulated { "Specimen: not a calibration certificate" } @else { "Calibration certificate" } }
                        p { b { (self.number) } br; "model set " (self.set.id) br; (self.set.made) }
                    }
                    @if self.simulated { p class="simulated" { (NOT_MEASURED) } }
                    (self.result())
                    (self.identity())
                    (self.reference())
                    (self.procedure())
                    (self.levels_table())
                    (self.uncertainty())
                    (self.known_loads())
                    (self.limits_of_use())
                    (self.excluded_table())
                    (self.taxels_table())
                    (self.data())
                    @if self.simulated { p class="simulated" { (NOT_MEASURED) } } @else {
                        div class="sign" { div { "Calibrated by, date, signature" } div { "Approved by, date, signature" } }
                    }
                }
            }
        };
        page.into_string()
    }

    /// The figures that are looked for first.
    fn result(&self) -> Markup {
        let set = &self.set;
        let loads = self.loads_summary.as_ref().map(|loads| loads.mean_absolute_error_percent);
        html! {
            div class="key" {
                div { b { (set.usable) " / " (set.taxels) } "taxels with a usable model" }
                div { b { "0 to " (number(set.pressure_max_kpa, 1)) " kPa" } "calibrated" }
                div { b { (number(self.expanded.taxel_kpa, 2)) " kPa" } "U (k = 2) of one taxel; "
                    (number(self.expanded.mean_kpa, 2)) " kPa of the mean of all" }
                div { b { @match loads { Some(error) => { (number(error, 1)) " %" } None => "none" } }
                    @if self.loads.is_empty() { "known load was laid on" } @else { "mean error under "
                    (self.loads.len()) " known loads" } }
            }
        }
    }

    fn identity(&self) -> Markup {
        let s = &self.stated;
        html! {
            h2 { "Object and parties" }
            dl {
                (row("Customer", &stated(s.customer.as_deref())))
                (row("Robot", &stated(s.robot.as_deref())))
                (row("Patch of skin", &self.set.patch))
                (row("Serial number of the skin", &stated(s.skin_serial.as_deref())))
                (row("Calibrated by", &stated(s.laboratory.as_deref())))
                (row("Operator", &stated(s.operator.as_deref())))
                (row("Place", &stated(s.place.as_deref())))
                (row("Date of the measurements", &self.session.started))
                (row("Remarks", &stated(s.remarks.as_deref())))
            }
        }
    }

    fn reference(&self) -> Markup {
        let (s, set) = (&self.stated, &self.set);
        let environment = [
            with_unit(s.temperature_c, 1, "\u{b0}C"),
            with_unit(s.humidity_percent, 0, "% relative humidity"),
            with_unit(s.ambient_kpa, 2, "kPa ambient pressure"),
        ];
        let names = ["temperature", "humidity", "ambient pressure"];
        let environment: Vec<String> = environment
            .into_iter()
            .zip(names)
            .map(|(value, name)| if value == NOT_STATED { format!("{name} {NOT_STATED}") } else { value })
            .collect();
        let configured = format!(
            "{} % of the reading and {} kPa",
            number(100.0 * set.gauge_gain_rel, 3),
            number(set.gauge_offset_kpa, 3)
        );
        html! {
            h2 { "Reference and environment" }
            dl {
                (row("Reference sensor", &stated(s.reference_sensor.as_deref())))
                (row("Its serial number", &stated(s.reference_serial.as_deref())))
                (row("Its certificate", &stated(s.reference_certificate.as_deref())))
                (row("Calibrated on", &stated(s.reference_date.as_deref())))
                (row("Its expanded uncertainty (k = 2)", &with_unit(s.reference_expanded_uncertainty_kpa, 3, "kPa")))
                (row("Standard uncertainty as configured, with its zero", &configured))
                (row("Traceability", &stated(s.traceability.as_deref())))
                (row("Environment", &environment.join(", ")))
            }
        }
    }

    fn procedure(&self) -> Markup {
        let session = &self.session;
        let branches = if session.branches == "both" { "rising and falling" } else { "rising" };
        let refused: Vec<String> =
            session.refused.iter().map(|(reason, scans)| format!("{scans} {}", reason.replace('_', " "))).collect();
        let refused = if refused.is_empty() { "none".to_owned() } else { refused.join(", ") };
        let left_out = if session.left_out.is_empty() { "none".to_owned() } else { session.left_out.join(", ") };
        html! {
            h2 { "Procedure" }
            p { "The skin lies in a bag whose pressure below the ambient is changed slowly; the atmosphere presses on all "
                "taxels alike. The reference sensor and the skin are read on one clock. Before each ramp the unloaded skin "
                "gives the zero; counts of all ramps are brought to the zero of the first." }
            dl {
                (row("Session", &format!("{} of {}, {} scans", session.number, session.started, session.scans)))
                (row("Pressure", &format!("{branches}, up to {} kPa", number(session.target_kpa, 1))))
                (row("Rest confirmed by", session.rest_confirmed_by.as_deref().unwrap_or("the counts themselves")))
                (row("Scans that did not enter", &refused))
                (row("Modules left out", &left_out))
                (row("Fit", &self.set.method))
                @for (n, line) in self.set.board_settings.iter().enumerate() {
                    (row(if n == 0 { "Settings of the boards" } else { "" }, line))
                }
            }
            table {
                thead { tr {
                    th { "Ramp" } th { "Scans rising" } th { "falling" } th { "From kPa" } th { "to kPa" } th { "back to kPa" }
                    th { "Rise kPa/s" } th { "Fall kPa/s" } th { "Zero before it, mean shift, counts" } th { "RMS shift, counts" }
                    th { "Reference at rest, kPa" }
                } }
                tbody { @for ramp in &self.ramps { (ramp_row(ramp)) } }
            }
            p class="note" { "Shifts of the zero are against the first ramp, over the usable taxels. The zero before a ramp is "
                "the zero after the one before it. What the reference read at rest is taken off the pressures of the ramp." }
        }
    }

    fn levels_table(&self) -> Markup {
        let mean = &self.mean;
        html! {
            h2 { "Readings by level: mean of all usable taxels" }
            table {
                thead { tr {
                    th class="t" { "Branch" } th { "Level kPa" } th { "Scans" } th { "Reference kPa" } th { "Reading kPa" }
                    th { "Error kPa" } th { "SD over taxels kPa" }
                } }
                tbody { @for level in &self.levels { (level_row(level)) } }
            }
            dl {
                (row("RMS error", &format!("{} kPa", number(mean.rmse_kpa, 3))))
                (row("Greatest error", &format!("{} kPa", number(mean.max_error_kpa, 3))))
                (row("Hysteresis", &in_kpa(mean.hysteresis_kpa, "one branch only")))
                (row("Repeatability", &in_kpa(mean.repeatability_kpa, "a single ramp")))
                (row("Shift of the zero", &in_kpa(mean.zero_shift_kpa, "a single ramp")))
            }
        }
    }

    fn uncertainty(&self) -> Markup {
        html! {
            h2 { "Uncertainty budget" }
            table {
                thead { tr {
                    th class="t" { "Source" } th class="t" { "Type and evaluation" } th { "One taxel kPa" }
                    th { "Mean of all kPa" } th { "In the sum" }
                } }
                tbody { @for line in &self.budget { tr {
                    td class="t" { (line.source) } td class="t" { (line.evaluation) }
                    td { (known(line.taxel_kpa, 3)) } td { (known(line.mean_kpa, 3)) }
                    td { (if line.combined { "yes" } else { "no" }) }
                } } }
                tfoot { tr {
                    td class="t" colspan="2" { "Expanded uncertainty U, k = " (number(self.expanded.coverage_factor, 0)) }
                    td { (number(self.expanded.taxel_kpa, 3)) } td { (number(self.expanded.mean_kpa, 3)) } td {}
                } }
            }
            p class="note" { "Standard uncertainties by the Guide to the Expression of Uncertainty in Measurement, added as root "
                "sum of squares and multiplied by k = 2, about 95 % for errors of normal distribution. One taxel: root mean "
                "square over the usable taxels, a single reading. n/d: not determined, see the limits of use." }
        }
    }

    fn known_loads(&self) -> Markup {
        html! {
            h2 { "Known loads" }
            @match &self.loads_summary {
                None => p class="none" { "No known load was laid on with this model set." },
                Some(summary) => {
                    table {
                        thead { tr {
                            th { "No." } th class="t" { "Time" } th class="t" { "By, note" } th { "Mass kg" } th { "Force N" }
                            th { "U (k = 2) N" } th { "Read N" } th { "U (k = 2) N" } th { "Error %" } th { "E/U" }
                        } }
                        tbody { @for load in &self.loads { (load_row(load)) } }
                    }
                    p { "Mean absolute error " (number(summary.mean_absolute_error_percent, 2)) " %; "
                        (summary.within) " of " (summary.loads) " within their expanded uncertainty (|E/U| up to 1). "
                        @if let (Some(factor), Some(sigma)) = (summary.area_factor, summary.area_factor_sigma) {
                            "Effective-area factor of " (summary.in_factor) " of them " (number(factor, 4)) ", U (k = 2) " (number(2.0 * sigma, 4)) ". "
                            @if let Some(elsewhere) = summary.area_uncertainty {
                                "Areas at another place, U (k = 2) " (number(200.0 * elsewhere, 1)) " %. "
                            }
                            @if !summary.area_factor_doubt.is_empty() { "Not to be used: " (summary.area_factor_doubt) "." }
                        }
                    }
                }
            }
        }
    }

    fn limits_of_use(&self) -> Markup {
        html! { h2 { "Limits of use" } ul { @for line in &self.limits { li { (line) } } } }
    }

    fn excluded_table(&self) -> Markup {
        html! {
            h2 { "Excluded taxels" }
            @if self.excluded.is_empty() { p class="none" { "None." } } @else {
                table {
                    thead { tr { th { "Taxel" } th class="t" { "Place" } th class="t" { "Reason" } } }
                    tbody { @for taxel in &self.excluded { tr {
                        td { (taxel.taxel) } td class="t" { (taxel.place) } td class="t" { (taxel.reason) }
                    } } }
                }
            }
        }
    }

    fn taxels_table(&self) -> Markup {
        html! {
            h2 { "Taxels" }
            table class="dense" {
                thead { tr {
                    th { "Taxel" } th class="t" { "Board, module, taxel" } th { "Order" } th { "Counts" } th { "Range kPa" }
                    th { "Zero counts" } th { "Counts per kPa" } th { "Linearity %" } th { "RMS error kPa" }
                    th { "Hyst. kPa" } th { "Repeat. kPa" } th { "Zero shift counts" } th { "Lower limit kPa" } th { "U (k = 2) kPa" }
                } }
                tbody { @for taxel in &self.taxels { (taxel_row(taxel)) } }
            }
            p class="note" { "Figures over all scans of the session, those among them that the fit left out. Linearity: greatest "
                "distance of the curve from the straight line between its ends, in % of its span. Lower limit: 2.4 standard "
                "deviations of the errors, no less than one count (after ASTM E74). Coefficients of every curve are in the JSON." }
        }
    }

    fn data(&self) -> Markup {
        html! {
            h2 { "Data" }
            dl {
                (hash("Samples (sessions export --out)", &self.hashes.samples_csv))
                (hash("Models (models export)", &self.hashes.models_json))
                (row("Certificate made by", &self.software))
                (row("Models fitted by", self.set.fitted_by.as_deref().unwrap_or("not known: the set does not say")))
            }
            p class="note" { "SHA-256 of the files as they are exported. deploy/certificate.py recomputes every number from them "
                "and the certificate's JSON. The number of the certificate is made of its content." }
        }
    }
}

fn row(name: &str, value: &str) -> Markup {
    let class = if value.ends_with(NOT_STATED) && !value.contains(',') { "none" } else { "" };
    html! { dt { (name) } dd class=[Some(class).filter(|class| !class.is_empty())] { (value) } }
}

fn hash(name: &str, value: &str) -> Markup {
    html! { dt { (name) } dd { code { (value) } } }
}

fn in_kpa(value: Option<f64>, why_not: &str) -> String {
    value.map_or_else(|| format!("not determined: {why_not}"), |kpa| format!("{} kPa", number(kpa, 3)))
}

fn ramp_row(ramp: &RampPart) -> Markup {
    html! { tr {
        td { (ramp.ramp) } td { (ramp.scans_rising) } td { (ramp.scans_falling) }
        td { (known(ramp.from_kpa, 2)) } td { (known(ramp.top_kpa, 2)) } td { (known(ramp.to_kpa, 2)) }
        td { (known(ramp.rise_kpa_per_s, 2)) } td { (known(ramp.fall_kpa_per_s, 2)) }
        td { (known(ramp.zero_mean_counts, 2)) } td { (known(ramp.zero_rms_counts, 2)) }
        td { (known(ramp.gauge_zero_kpa, 2)) }
    } }
}

fn level_row(level: &LevelPart) -> Markup {
    html! { tr {
        td class="t" { (level.branch) } td { (number(level.from_kpa, 1)) " to " (number(level.to_kpa, 1)) } td { (level.scans) }
        td { (number(level.reference_kpa, 3)) } td { (number(level.reading_kpa, 3)) } td { (number(level.error_kpa, 3)) }
        td { (known(level.spread_kpa, 3)) }
    } }
}

fn load_row(load: &LoadPart) -> Markup {
    let mut words = vec![load.by.clone(), load.note.clone()];
    let told = |why: &String, what: &str| if why.is_empty() { String::new() } else { format!("{what}: {why}") };
    words.push(told(&load.outdated_because, "does not count"));
    words.push(told(&load.left_out_because, "not in the factor"));
    words.retain(|word| !word.is_empty());
    html! { tr {
        td { (load.load) } td class="t whole" { (load.time) } td class="t" { (words.join(", ")) }
        td { @match load.mass_kg { Some(mass) => (number(mass, 3)), None => "-" } }
        td { (number(load.force_n, 3)) } td { (number(2.0 * load.force_sigma_n, 3)) }
        td { (number(load.read_n, 3)) } td { (number(2.0 * load.read_sigma_n, 3)) }
        td { (number(load.error_percent, 2)) } td { (number(load.normalised_error, 2)) }
    } }
}

/// The numbers of a place alone, as its column names them: `board 13 module 2 taxel 9` is `13, 2, 9`.
fn short_place(place: &str) -> String {
    let numbers: Vec<&str> = place.split_whitespace().filter(|word| word.parse::<u64>().is_ok()).collect();
    if numbers.len() == 3 { numbers.join(", ") } else { place.to_owned() }
}

fn taxel_row(taxel: &TaxelPart) -> Markup {
    let [low, high] = taxel.range_kpa;
    html! { tr {
        td { (taxel.taxel) } td class="t" { (short_place(&taxel.place)) } td { (taxel.order) }
        td { (number(taxel.count_min, 0)) " to " (number(taxel.count_max, 0)) }
        td { (number(low, 1)) " to " (number(high, 1)) } td { (known(taxel.zero_counts, 1)) }
        td { (number(taxel.sensitivity_counts_per_kpa, 2)) } td { (number(taxel.linearity_percent, 1)) }
        td { (number(taxel.rmse_kpa, 2)) } td { (known(taxel.hysteresis_kpa, 2)) }
        td { (known(taxel.repeatability_kpa, 2)) } td { (known(taxel.zero_shift_counts, 2)) }
        td { (number(taxel.lower_limit_kpa, 2)) } td { (number(taxel.expanded_uncertainty_kpa, 2)) }
    } }
}
