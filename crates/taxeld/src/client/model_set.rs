//! A model set: by the beginning of its id, in words, and put to use.

use std::collections::BTreeMap;

use taxel_client::model_set_named;
use taxel_engine::verdict::cause;
use taxel_proto::v1::{
    ActivateModelSetRequest, ActivateModelSetResponse, GetModelSetRequest, ModelSet, ModelSetSummary, TaxelModelSummary,
};
use taxel_skin::counted;

use super::connect::Daemon;
use super::failure::{Failure, Outcome};
use super::places::Places;
use super::table::{self, Tone};

/// The id that these characters begin; `newest` is the newest set of the patch.
///
/// # Errors
/// No set or several begin so, or no daemon.
pub async fn full_id(daemon: &Daemon, beginning: &str) -> Outcome<String> {
    let ids = daemon.model_sets().await?.into_iter().map(|set| set.model_set).collect();
    model_set_named(ids, beginning).map_err(Failure::refused)
}

/// A set that may be used, beside the one that is in use.
pub struct Candidate {
    /// Without curves.
    pub set: ModelSet,
    /// What it is.
    pub summary: ModelSetSummary,
    /// Id of the set in use of its patch; empty if there is none.
    in_use: String,
}

impl Candidate {
    /// A set of the daemon.
    ///
    /// # Errors
    /// No such set, or no daemon.
    pub async fn of(daemon: &Daemon, model_set: &str) -> Outcome<Self> {
        let request = GetModelSetRequest { model_set: model_set.to_owned(), ..GetModelSetRequest::default() };
        let set = daemon.models().get_model_set(request).await?.into_inner();
        let summary = set.summary.clone().unwrap_or_default();
        let sets = daemon.about(&summary.patch).model_sets().await?;
        let in_use = sets.into_iter().find(|other| other.active).map(|other| other.model_set).unwrap_or_default();
        Ok(Self { set, summary, in_use })
    }

    /// Uses it from now on, in place of the one that was in use when this was asked for.
    ///
    /// # Errors
    /// Refused with the daemon's reason, or no daemon.
    pub async fn activate(&self, daemon: &Daemon) -> Outcome<ActivateModelSetResponse> {
        let request = ActivateModelSetRequest {
            patch: self.summary.patch.clone(),
            model_set: self.summary.model_set.clone(),
            expected: Some(self.in_use.clone()),
        };
        Ok(daemon.models().activate_model_set(request).await?.into_inner())
    }

    /// Whether it is a good calibration.
    pub fn is_good(&self) -> bool {
        self.set.verdict.as_ref().is_some_and(|verdict| verdict.is_good)
    }

    /// How good it is, in lines.
    pub fn verdict(&self) -> &[String] {
        self.set.verdict.as_ref().map_or(&[], |verdict| &verdict.lines)
    }

    /// Prints how good it is, the first word in its colour.
    pub fn print_verdict(&self) {
        let (tone, word) = if self.is_good() { (Tone::Good, "Good") } else { (Tone::Bad, "Not good") };
        for line in self.verdict() {
            match line.strip_prefix(word) {
                Some(rest) => say!("{}{rest}", tone.paint(word)),
                None => say!("{line}"),
            }
        }
    }

    /// Where its zero comes from, and what to do.
    pub fn zero(&self) -> &'static str {
        let knows = |taxel: &TaxelModelSummary| taxel.status == "ok" && taxel.figures.contains_key("baseline_counts");
        if self.set.taxels.iter().any(knows) {
            "it has the zero of its calibration. Unload the skin, then: taxeld tare"
        } else {
            "it has no zero of its own and takes it from the next confirmed tare. Unload the skin, then: taxeld tare \
             --confirmed-by NAME"
        }
    }
}

/// Prints a set with its excluded taxels by place.
pub fn print_set(set: &ModelSet, places: &Places) {
    if let Some(summary) = &set.summary {
        let session = summary.session.map_or_else(|| "a file".to_owned(), |session| format!("session {session}"));
        let active = if summary.active { ", active" } else { "" };
        let (id, patch, made) = (&summary.model_set, &summary.patch, table::moment(summary.created.as_ref()));
        say!("model set {id} of {patch}, from {session}, made {made}{active}");
        say!("  up to {:.1} kPa; fit: {}", summary.pressure_max_kpa, summary.method);
        say!("  {} of {} taxels usable", summary.calibrated, summary.taxels);
        if !summary.derived_from.is_empty() {
            say!("  corrected from {}", summary.derived_from);
        }
    }
    let mut excluded: BTreeMap<&str, Vec<u32>> = BTreeMap::new();
    for taxel in set.taxels.iter().filter(|taxel| taxel.status != "ok") {
        let why = cause(&taxel.status).unwrap_or(&taxel.status);
        excluded.entry(why.split(':').next().unwrap_or(why)).or_default().push(taxel.taxel);
    }
    for (reason, taxels) in excluded {
        say!("    {} {reason}: {}", counted(taxels.len(), "taxel", "taxels"), places.name(taxels.iter().copied()));
    }
    let usable = set.taxels.iter().filter(|taxel| taxel.status == "ok");
    let mut errors_kpa: Vec<f64> = usable.filter_map(|taxel| taxel.figures.get("rmse_kpa").copied()).collect();
    errors_kpa.sort_by(f64::total_cmp);
    if let (Some(median), Some(worst)) = (errors_kpa.get(errors_kpa.len() / 2), errors_kpa.last()) {
        say!("  error of the fit: median {median:.2} kPa, at worst {worst:.2} kPa");
    }
    if let Some(plays) = set.in_use.get("taxels_with_plays") {
        let back =
            set.in_use.get("zero_return_counts").map(|counts| format!("; zero after a load: {counts:.2} counts off"));
        say!("  hysteresis compensated: {plays} taxels{}", back.unwrap_or_default());
    }
    set.board_settings.iter().for_each(|line| say!("  {line}"));
}
