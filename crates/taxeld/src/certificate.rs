//! The certificate of a model set, for the service and for a store that no daemon has open.

use std::sync::Arc;

use anyhow::{Context, anyhow, bail};
use taxel_certificate::{Certificate, Entered, Evidence};
use taxel_engine::Restored;
use taxel_engine::calibration::SessionView;
use taxel_engine::known_set::KnownSet;
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::PatchPlan;
use taxel_rpc::{CertificateMaker, CertificateOf, MadeCertificate};
use taxel_skin::Patch;
use taxel_store::{StoreFile, models_json};

use crate::config::{CertificateSection, Config, Scene};
use crate::store_at::read_store;

/// What makes certificates, as the certificate names it.
const SOFTWARE: &str = concat!("taxeld ", env!("CARGO_PKG_VERSION"));

/// Makes certificates for the service: what people state of each patch is in the configuration.
pub fn maker(config: &Config, scene: &Scene) -> CertificateMaker {
    let entered = entered_by_patch(config);
    let plans = scene.plan.patches.clone();
    Arc::new(move |of| {
        let (plan, entered) = plans.get(of.patch).zip(entered.get(of.patch)).ok_or("there is no such patch")?;
        make(of, plan, entered)
    })
}

fn make(of: &CertificateOf, plan: &PatchPlan, entered: &Entered) -> Result<MadeCertificate, String> {
    let (places, left_out) = (places(&plan.patch), left_out(&plan.patch, &of.session));
    let certificate = Certificate::of(&Evidence {
        set: &of.set,
        models_json: &of.models_json,
        session: &of.session,
        samples: &of.samples,
        about: &plan.about(&of.session),
        loads: &of.loads,
        entered,
        places: &places,
        left_out: &left_out,
        software: SOFTWARE,
    })?;
    let number = certificate.number().to_owned();
    Ok(MadeCertificate { number, json: certificate.to_json()?, html: certificate.to_html() })
}

/// The certificate of a set in the store of this configuration, which no daemon may have open, with the set's id. `beginning` is that of the
/// set's id, `newest` is the newest; the active one without it.
///
/// # Errors
/// A store that is not there or in use, no such set, or a set that cannot be certified.
pub fn of_store(
    config: &Config,
    scene: &Scene,
    (beginning, patch): (Option<&str>, Option<&str>),
) -> anyhow::Result<(String, MadeCertificate)> {
    let store = read_store(&config.store.path)?;
    let restored = store.restored();
    let set = stored(&store, &find(restored, beginning, patch)?)?;
    let position = scene.plan.patches.iter().position(|plan| plan.patch.name() == set.patch);
    let position = position.with_context(|| format!("patch `{}` is not in the configuration", set.patch))?;
    let number = set.certifying_session().map_err(anyhow::Error::msg)?;
    let session = restored.sessions.iter().find(|view| view.number == number && view.patch == set.patch);
    let session = session.with_context(|| format!("{} is of session {number}, which is not in the store", set.id))?;
    let of = CertificateOf {
        models_json: models_json::to_json(&set)?,
        patch: position,
        session: Arc::clone(session),
        samples: store.samples(number)?,
        loads: restored.loads.iter().filter(|load| load.patch == set.patch).map(Arc::clone).collect(),
        set,
    };
    let made = make(&of, &scene.plan.patches[position], &entered_by_patch(config)[position]);
    Ok((of.set.id.clone(), made.map_err(|problem| anyhow!(problem))?))
}

/// The set itself.
fn stored(store: &StoreFile, known: &KnownSet) -> anyhow::Result<Arc<ModelSet>> {
    match &known.at_hand {
        Some(set) => Ok(Arc::clone(set)),
        None => Ok(Arc::new(models_json::from_json(&store.model_set(&known.id)?)?)),
    }
}

fn find(restored: &Restored, beginning: Option<&str>, patch: Option<&str>) -> anyhow::Result<KnownSet> {
    let of_patch = |set: &&KnownSet| patch.is_none_or(|patch| set.patch == patch);
    let sets: Vec<&KnownSet> = restored.model_sets.iter().filter(of_patch).collect();
    let active = |set: &&KnownSet| restored.active.iter().any(|(name, id)| (name, id) == (&set.patch, &set.id));
    let found: Vec<&KnownSet> = match beginning {
        Some("newest") => sets.last().copied().into_iter().collect(),
        Some(beginning) => sets.into_iter().filter(|set| set.id.starts_with(beginning)).collect(),
        None => sets.into_iter().filter(active).collect(),
    };
    match (found.as_slice(), beginning) {
        ([set], _) => Ok(KnownSet::clone(set)),
        ([], Some(beginning)) => bail!("there is no model set `{beginning}` in the store"),
        ([], None) => bail!("no model set is active in the store: name one"),
        (several, _) => {
            bail!("several sets fit: {}", several.iter().map(|set| set.id.as_str()).collect::<Vec<_>>().join(", "))
        }
    }
}

/// What people state of each patch: its own section before the general one.
fn entered_by_patch(config: &Config) -> Vec<Entered> {
    let general = entered(config.certificate.as_ref());
    config.patch.iter().map(|patch| entered(patch.certificate.as_ref()).or(&general)).collect()
}

fn entered(section: Option<&CertificateSection>) -> Entered {
    let stated = section.cloned().unwrap_or_default();
    Entered {
        customer: stated.customer,
        laboratory: stated.laboratory,
        operator: stated.operator,
        place: stated.place,
        robot: stated.robot,
        skin_serial: stated.skin_serial,
        reference_sensor: stated.reference_sensor,
        reference_serial: stated.reference_serial,
        reference_certificate: stated.reference_certificate,
        reference_date: stated.reference_date,
        reference_expanded_uncertainty_kpa: stated.reference_expanded_uncertainty_kpa,
        traceability: stated.traceability,
        temperature_c: stated.temperature_c,
        humidity_percent: stated.humidity_percent,
        ambient_kpa: stated.ambient_kpa,
        remarks: stated.remarks,
    }
}

/// Where each taxel is: board, module, and its number in the module.
fn places(patch: &Patch) -> Vec<String> {
    let place = |(number, taxel): (usize, &taxel_skin::TaxelSite)| {
        let module = patch.modules().get(usize::from(taxel.module))?;
        let in_module = number.saturating_sub(usize::from(module.first_taxel));
        Some(format!("{} taxel {in_module}", module_name(patch, usize::from(taxel.module))?))
    };
    patch.taxels().iter().enumerate().map(|taxel| place(taxel).unwrap_or_default()).collect()
}

fn module_name(patch: &Patch, position: usize) -> Option<String> {
    let module = patch.modules().get(position)?;
    let board = patch.boards().get(usize::from(module.board))?;
    Some(format!("board {} module {}", board.address, module.module.get()))
}

fn left_out(patch: &Patch, session: &SessionView) -> Vec<String> {
    session.left_out.iter().filter_map(|position| module_name(patch, usize::from(*position))).collect()
}
