//! From the file to the plan: values checked, names looked up, and what the scene leaves out.

use std::path::Path;
use std::time::Duration;
use taxel_engine::calibration::fit::{Branch, PlaysChoice};
use taxel_engine::conflict::conflicts;
use taxel_engine::plan::{BoardSetup, DriftPlan, Gauge, LiveLimits, Outputs, PatchPlan, Plan, SessionLimits, TarePlan};
use taxel_model::{Estimator, Exclusion, FitOptions, GaugeUncertainty, Order};
use taxel_skin::{Board, BoardAddress, BusIndex, Geometry, Kilopascal, Module, ModuleKind, NormalsVerdict, Patch};
use taxel_wire::CanId;
use taxel_wire::icub::{BoardConfig, TriangleConfig};
use taxel_wire::signal::{ByteOrder, PressureMeaning, PressureUnit, SignalSpec};

use super::area_words::AreaFactorWord;
use super::file::Config;
use super::fit_section::{AutoWord, EstimatorWord, FitSection, OrderWord, PlaysWord};
use super::load::ConfigError;
use super::parts::{
    BoardSection, BranchesWord, BusSource, DriftSection, GaugeSection, KindWord, LiveSection, OrderOfBytes, OutputWord,
    PatchSection, SessionSection, UnitWord,
};

/// MTB3 holds the period in a 16-bit timer that wraps beyond this.
const PERIOD_MAX_MS: u8 = 209;

/// What an installation needs, resolved once.
#[derive(Clone, Debug)]
pub struct Scene {
    /// What the engine does.
    pub plan: Plan,
    /// What is left out and why, a line each.
    pub left_out: Vec<String>,
    /// What a user should know, a line each.
    pub remarks: Vec<String>,
}

/// Resolves a configuration; `path` is where it came from, for files relative to it and for messages.
///
/// # Errors
/// [`ConfigError::Unusable`] with the key, its value and what was expected.
pub fn resolve(config: &Config, path: &Path) -> Result<Scene, ConfigError> {
    let unusable = |problem| ConfigError::Unusable { path: path.into(), problem };
    let mut scene =
        Scene { plan: Plan { buses: config.bus.len(), patches: vec![] }, left_out: vec![], remarks: vec![] };
    check_service(config).map_err(unusable)?;
    for section in &config.patch {
        let named = |problem: String| unusable(format!("patch `{}`: {problem}", section.name));
        let plan = resolve_patch(config, section, path, &mut scene).map_err(named)?;
        if scene.plan.patches.iter().any(|p| p.patch.name() == plan.patch.name()) {
            return Err(unusable(format!("patch `{}` is there twice", section.name)));
        }
        scene.plan.patches.push(plan);
    }
    if scene.plan.patches.is_empty() {
        return Err(unusable("there is no [[patch]]: at least one is needed".to_owned()));
    }
    let conflicts: Vec<String> = conflicts(&scene.plan).iter().map(ToString::to_string).collect();
    if conflicts.is_empty() { Ok(scene) } else { Err(unusable(conflicts.join("; "))) }
}

fn check_service(config: &Config) -> Result<(), String> {
    let listen = config.service.listen;
    if !listen.ip().is_loopback() {
        return Err(format!(
            "service.listen = {listen}: only loopback addresses are served, the service is not secured"
        ));
    }
    if config.bus.len() > usize::from(u8::MAX) {
        return Err(format!("{} buses, at most 255 are possible", config.bus.len()));
    }
    for (i, bus) in config.bus.iter().enumerate() {
        if config.bus[..i].iter().any(|b| b.name == bus.name) {
            return Err(format!("bus `{}` is there twice", bus.name));
        }
        if bus.source == BusSource::SocketCan && bus.interface.is_none() {
            return Err(format!("bus `{}`: source socketcan needs an interface, for example \"can0\"", bus.name));
        }
    }
    Ok(())
}

fn bus_index(config: &Config, name: &str) -> Result<BusIndex, String> {
    let position = config.bus.iter().position(|bus| bus.name == name);
    let names = || config.bus.iter().map(|b| b.name.as_str()).collect::<Vec<_>>().join(", ");
    let position = position.ok_or_else(|| format!("bus `{name}` is not among the buses: {}", names()))?;
    Ok(BusIndex(position as u8))
}

fn resolve_patch(config: &Config, section: &PatchSection, path: &Path, scene: &mut Scene) -> Result<PatchPlan, String> {
    let bus = bus_index(config, &section.bus)?;
    let name = &section.name;
    if name.is_empty() || name.len() > 64 || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-') {
        return Err("a name is 1 to 64 letters, digits, `_` or `-`".to_owned());
    }
    within("period_ms", f64::from(section.period_ms), 1.0, f64::from(PERIOD_MAX_MS))?;
    within("area_mm2", super::area::mean_mm2(section), 0.01, 1e5)?;
    let area_uncertainty = super::area::uncertainty(section);
    within("area_uncertainty", area_uncertainty, 0.0, 1.0)?;
    let boards = section.board.iter().map(|b| board(b, bus)).collect::<Result<Vec<_>, _>>()?;
    let patch = Patch::new(name, boards).map_err(|e| e.to_string())?;
    let geometry = section.geometry.as_ref().map(|file| geometry(file, path, &patch)).transpose()?;
    if let Some(g) = &geometry {
        scene.remarks.extend(g.remarks.iter().map(|r| format!("{name}: geometry: {r}")));
    }
    let (areas, remark) = super::area::areas(section, &patch, geometry.as_ref());
    scene.remarks.extend(remark);
    let outputs = outputs(section, geometry.as_ref(), scene);
    let period = Duration::from_millis(u64::from(section.period_ms));
    let gauge = section.gauge.as_ref().map(|g| gauge(config, g, bus)).transpose()?;
    if gauge.is_none() {
        scene.left_out.push(format!("{name}: calibration: there is no [patch.gauge], so no pressure to fit to"));
    }
    if !section.tare.at_start {
        scene.left_out.push(format!("{name}: zero after start: tare.at_start is off, so a tare must be asked for"));
    }
    if section.period_ms < 37 {
        let period = section.period_ms;
        scene
            .remarks
            .push(format!("{name}: the converter needs 36.9 ms a scan: at {period} ms old values are repeated"));
    }
    if section.listen_only {
        scene.left_out.push(format!("{name}: board bring-up: listen_only sends nothing"));
    }
    let setups = section.board.iter().map(|b| setup(b, section.period_ms)).collect::<Result<Vec<_>, _>>()?;
    within("tare.seconds", section.tare.seconds, 0.1, 60.0)?;
    if section.tare.first_scans.is_some() {
        scene.remarks.push(format!("{name}: tare.first_scans has no effect any more: every zero is watched in full"));
    }
    let drift = drift(&section.drift)?;
    let padless = patch.modules().iter().all(|site| site.kind.thermal_slots().is_empty());
    if !drift.follow || padless {
        let why = if drift.follow { "no module has a thermal pad" } else { "drift.follow is off" };
        scene.left_out.push(format!("{name}: following of thermal drift: {why}"));
    }
    Ok(PatchPlan {
        areas,
        area_uncertainty,
        area_from_loads: section.area_factor == AreaFactorWord::FromLoads,
        bring_up: if section.listen_only { Vec::new() } else { setups },
        period,
        geometry,
        gauge,
        outputs,
        live: live(&section.live, period)?,
        faults: Default::default(),
        tare: TarePlan {
            duration: Duration::from_secs_f64(section.tare.seconds),
            at_start: section.tare.at_start,
            rest: Default::default(),
        },
        drift: DriftPlan { follow: drift.follow && !padless, ..drift },
        session: session(&section.session, section.fit.plays)?,
        fit: fit_options(&section.fit, section.gauge.as_ref())?,
        patch,
    })
}

fn within(key: &str, value: f64, min: f64, max: f64) -> Result<f64, String> {
    if value >= min && value <= max { Ok(value) } else { Err(format!("{key} = {value}: expected {min} to {max}")) }
}

fn board(section: &BoardSection, bus: BusIndex) -> Result<Board, String> {
    let address = BoardAddress::new(section.address).map_err(|e| e.to_string())?;
    let kind = match section.kind {
        KindWord::Triangle => ModuleKind::Triangle,
        KindWord::Fingertip => ModuleKind::Fingertip,
        KindWord::PalmPad11 => ModuleKind::PalmPad11,
        KindWord::PalmPad7 => ModuleKind::PalmPad7,
    };
    let modules = modules(&section.modules).map_err(|e| format!("board {address}: {e}"))?;
    Ok(Board { bus, address, modules: modules.into_iter().map(|m| (m, kind)).collect() })
}

/// `"0-3, 7"`: ascending numbers and ranges of 0 to 15.
fn modules(text: &str) -> Result<Vec<Module>, String> {
    let wrong = || format!("modules = \"{text}\": expected ascending numbers or ranges of 0 to 15, as in \"0-3, 7\"");
    let mut list: Vec<Module> = Vec::new();
    for part in text.split(',').map(str::trim) {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let parse = |word: &str| word.trim().parse::<u8>().ok().filter(|m| *m < 16).ok_or_else(wrong);
        let (first, last) = (parse(first)?, parse(last)?);
        if first > last || list.last().is_some_and(|m| m.get() >= first) {
            return Err(wrong());
        }
        list.extend((first..=last).map(Module::from_nibble));
    }
    Ok(list)
}

fn setup(section: &BoardSection, period_ms: u8) -> Result<BoardSetup, String> {
    let board = BoardConfig { kind: section.board_type, period_ms, no_load: section.no_load };
    let mut triangles = Vec::new();
    let enabled = modules(&section.modules)?;
    for (first, last) in runs(&enabled) {
        let (shift, cdc_offset) = (section.shift, section.cdc_offset);
        triangles.push(TriangleConfig { first, last, shift, enabled: true, cdc_offset });
    }
    for exception in &section.exception {
        let list = modules(&exception.modules)?;
        if let Some(stranger) = list.iter().find(|m| !enabled.contains(m)) {
            return Err(format!("board {}: exception for module {stranger}, which is not enabled", section.address));
        }
        for (first, last) in runs(&list) {
            let (shift, cdc_offset) = (exception.shift, exception.cdc_offset);
            triangles.push(TriangleConfig { first, last, shift, enabled: true, cdc_offset });
        }
    }
    Ok(BoardSetup { board, triangles })
}

/// First and last of each run of consecutive modules.
fn runs(modules: &[Module]) -> Vec<(Module, Module)> {
    modules.chunk_by(|a, b| a.get() + 1 == b.get()).filter_map(|run| Some((*run.first()?, *run.last()?))).collect()
}

fn geometry(file: &Path, config: &Path, patch: &Patch) -> Result<Geometry, String> {
    let file = config.parent().unwrap_or(Path::new("")).join(file);
    let text = std::fs::read_to_string(&file).map_err(|e| format!("geometry {}: {e}", file.display()))?;
    Geometry::parse(&text, patch).map_err(|e| format!("geometry {}: {e}", file.display()))
}

fn outputs(section: &PatchSection, geometry: Option<&Geometry>, scene: &mut Scene) -> Outputs {
    let asked = |word| section.outputs.contains(&word);
    let directed = geometry.is_some_and(|g| g.normals == NormalsVerdict::Usable);
    let lacks = if geometry.is_some() { "the geometry has no usable normals" } else { "there is no geometry" };
    let mut decide = |word, what: &str, possible: bool| {
        let computed = asked(word) && possible;
        let why = match (asked(word), possible) {
            (true, _) => lacks.to_owned(),
            (false, true) => "not asked for in outputs".to_owned(),
            (false, false) => format!("not asked for in outputs, and {lacks}"),
        };
        if !computed {
            scene.left_out.push(format!("{}: {what}: {why}", section.name));
        }
        computed
    };
    Outputs {
        resultant: decide(OutputWord::Resultant, "resultant", directed),
        moment: decide(OutputWord::Moment, "moment and centre of pressure", directed),
        contacts: decide(OutputWord::Contacts, "contacts", geometry.is_some()),
        fill: decide(OutputWord::Fill, "fill of excluded taxels", geometry.is_some()),
    }
}

fn gauge(config: &Config, section: &GaugeSection, patch_bus: BusIndex) -> Result<Gauge, String> {
    let bus = section.bus.as_ref().map_or(Ok(patch_bus), |name| bus_index(config, name))?;
    let id = if section.extended {
        CanId::Extended(section.id)
    } else {
        CanId::Standard(
            u16::try_from(section.id).map_err(|_| format!("gauge.id {:#x} has more than 11 bits", section.id))?,
        )
    };
    let signal = SignalSpec {
        id,
        start_bit: section.start_bit,
        length_bits: section.length_bits,
        byte_order: match section.byte_order {
            OrderOfBytes::Little => ByteOrder::Little,
            OrderOfBytes::Big => ByteOrder::Big,
        },
        signed: section.signed,
        scale: section.scale,
        offset: section.offset,
        unit: match section.unit {
            UnitWord::Pa => PressureUnit::Pascal,
            UnitWord::Kpa => PressureUnit::Kilopascal,
            UnitWord::Bar => PressureUnit::Bar,
            UnitWord::Mbar => PressureUnit::Millibar,
            UnitWord::Psi => PressureUnit::Psi,
        },
        meaning: section
            .ambient_kpa
            .map_or(PressureMeaning::Differential, |ambient_kpa| PressureMeaning::AbsoluteBag { ambient_kpa }),
    };
    signal.validate().map_err(|e| format!("gauge: {e}"))?;
    Ok(Gauge { bus, signal })
}

fn live(section: &LiveSection, period: Duration) -> Result<LiveLimits, String> {
    let defaults = LiveLimits::default();
    let or = |key: &str, value: Option<f64>, default: f64, min: f64, max: f64| {
        within(&format!("live.{key}"), value.unwrap_or(default), min, max)
    };
    let periods = section.stale_periods.unwrap_or(3);
    within("live.stale_periods", f64::from(periods), 2.0, 100.0)?;
    Ok(LiveLimits {
        activation_sigmas: or("activation_sigmas", section.activation_sigmas, defaults.activation_sigmas, 0.0, 100.0)?,
        activation_floor_counts: or(
            "activation_floor_counts",
            section.activation_floor_counts,
            defaults.activation_floor_counts,
            0.0,
            255.0,
        )?,
        stale_after: period * periods,
        stale_share_max: or("stale_share_max", section.stale_share_max, defaults.stale_share_max, 0.0, 1.0)?,
        ..defaults
    })
}

fn drift(section: &DriftSection) -> Result<DriftPlan, String> {
    let defaults = DriftPlan::default();
    let rate = section.rate_counts_per_min.unwrap_or(defaults.rate_max_counts_per_min);
    let bound = section.bound_counts.unwrap_or(defaults.bound_counts);
    Ok(DriftPlan {
        follow: section.follow,
        rate_max_counts_per_min: within("drift.rate_counts_per_min", rate, 0.01, 60.0)?,
        bound_counts: within("drift.bound_counts", bound, 0.1, 50.0)?,
    })
}

fn session(section: &SessionSection, plays: PlaysWord) -> Result<SessionLimits, String> {
    let defaults = SessionLimits::default();
    let or = |key: &str, value: Option<f64>, default: f64, min: f64, max: f64| {
        within(&format!("session.{key}"), value.unwrap_or(default), min, max)
    };
    let seconds = |key: &str, value: Option<f64>, default: Duration, min, max| {
        or(key, value, default.as_secs_f64(), min, max).map(Duration::from_secs_f64)
    };
    Ok(SessionLimits {
        target: Kilopascal(or("target_kpa", section.target_kpa, defaults.target.0, 1.0, 1000.0)?),
        noise_band: Kilopascal(or("noise_band_kpa", section.noise_band_kpa, defaults.noise_band.0, 0.0, 50.0)?),
        rise_max_kpa_per_s: or(
            "rise_max_kpa_per_s",
            section.rise_max_kpa_per_s,
            defaults.rise_max_kpa_per_s,
            0.1,
            1000.0,
        )?,
        branches: match section.branches {
            BranchesWord::Rising => Branch::Rising,
            BranchesWord::Both => Branch::Both,
        },
        fall_max_kpa_per_s: or(
            "fall_max_kpa_per_s",
            section.fall_max_kpa_per_s.or(section.rise_max_kpa_per_s),
            defaults.fall_max_kpa_per_s,
            0.1,
            1000.0,
        )?,
        fall_end: Kilopascal(or("fall_end_kpa", section.fall_end_kpa, defaults.fall_end.0, 0.0, 1000.0)?),
        plays: match plays {
            PlaysWord::Auto => PlaysChoice::Auto,
            PlaysWord::On => PlaysChoice::On,
            PlaysWord::Off => PlaysChoice::Off,
        },
        gauge_timeout: seconds("gauge_timeout_s", section.gauge_timeout_s, defaults.gauge_timeout, 0.01, 1.0)?,
        patience: seconds("patience_s", section.patience_s, defaults.patience, 1.0, 3600.0)?,
        vented_below: Kilopascal(or(
            "vented_below_kpa",
            section.vented_below_kpa,
            defaults.vented_below.0,
            0.1,
            1000.0,
        )?),
        ..defaults
    })
}

fn fit_options(section: &FitSection, gauge: Option<&GaugeSection>) -> Result<FitOptions, String> {
    let defaults = FitOptions::default();
    if let OrderWord::Fixed(order) = section.order {
        within("fit.order", f64::from(order), 1.0, 10.0)?;
    }
    if section.estimator == EstimatorWord::Paper && section.plays == PlaysWord::On {
        return Err("fit.plays is \"on\", but the paper's estimator compensates no hysteresis".to_owned());
    }
    if section.estimator == EstimatorWord::Paper && section.max_interval_share.is_some() {
        return Err(
            "fit.max_interval_share is set, but the paper's estimator excludes by min_swing_counts alone".to_owned()
        );
    }
    Ok(FitOptions {
        order: match section.order {
            OrderWord::Fixed(order) => Order::Fixed(order),
            OrderWord::Auto(AutoWord::Auto) => Order::Auto,
        },
        exact: section.exact,
        estimator: match section.estimator {
            EstimatorWord::PressureBinned => Estimator::PressureBinned,
            EstimatorWord::PerSample => Estimator::PerSample,
            EstimatorWord::Paper => Estimator::Paper,
        },
        exclusion: Exclusion {
            min_swing_counts: within("fit.min_swing_counts", section.min_swing_counts, 0.0, 255.0)?,
            max_interval_share: match section.max_interval_share {
                Some(share) => within("fit.max_interval_share", share, 0.001, 100.0)?,
                None => defaults.exclusion.max_interval_share,
            },
            ..defaults.exclusion
        },
        gauge: gauge.map_or(Ok::<_, String>(defaults.gauge), |g| {
            Ok(GaugeUncertainty {
                gain_rel: within("gauge.gain_uncertainty", g.gain_uncertainty, 0.0, 1.0)?,
                offset_kpa: within("gauge.offset_uncertainty_kpa", g.offset_uncertainty_kpa, 0.0, 100.0)?,
                noise_kpa: within("gauge.noise_kpa", g.noise_kpa, 0.0, 100.0)?,
            })
        })?,
        ..defaults
    })
}
