//! From what the files say of a part to its patch: boards, modules, kinds, and what they leave open.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use taxel_skin::{Drawing, KindWord, Module, ModuleKind, PositionFile};

use super::part::Part;
use super::robot::{DraftPort, Source};
use super::settings::{BoardValues, ModuleValues, Settings, USUAL};

/// The address that all boards listen to.
const EVERYONE: u8 = 15;
/// Modules of a board.
const MODULES: usize = 16;

/// What the files say of a part.
#[derive(Debug)]
pub struct Sources {
    /// Which part.
    pub part: Part,
    /// Its position file and where that is.
    pub positions: Option<(PathBuf, PositionFile)>,
    /// Its drawing.
    pub drawing: Option<Drawing>,
    /// What its files call it, beside the part's own name.
    pub names: Vec<String>,
}

/// A patch of the configuration, with what is to be said of it in comments.
#[derive(Debug, Default)]
pub struct PatchDraft {
    /// Its name.
    pub name: String,
    /// The bus of its part.
    pub limb: String,
    /// Its own bus: that of the part, with a number where several devices or CAN ports share the name.
    pub bus: String,
    /// The network interface of that, where it is known.
    pub interface: Option<String>,
    /// Which CAN bus of the robot that is, where its configuration says so.
    pub line: Option<String>,
    /// The position file.
    pub geometry: Option<PathBuf>,
    /// Its boards, in the order of the port.
    pub boards: Vec<BoardDraft>,
    /// Why nothing is to be sent to its boards, if that is so.
    pub listens: Option<&'static str>,
    /// The port of YARP that its counts come over, where the robot's computer has no interface for its bus.
    pub port: Option<DraftPort>,
    /// Period of its boards, milliseconds.
    pub period_ms: i64,
    /// Mean area of a taxel that is no triangle's, mm2, as the distance of its neighbours tells; `None` for triangles alone.
    pub area_mm2: Option<f64>,
    /// What somebody has to look at, a line each.
    pub open: Vec<String>,
}

impl PatchDraft {
    /// How many taxels it has.
    pub fn taxels(&self) -> usize {
        self.boards.iter().flat_map(BoardDraft::modules).map(|(_, kind)| kind.taxel_slots().len()).sum()
    }
}

/// A board of a patch.
#[derive(Debug)]
pub struct BoardDraft {
    /// CAN address.
    pub address: u8,
    /// How it is configured.
    pub values: BoardValues,
    /// Modules and what they are, those with the same values together, most of them first.
    pub modules: Vec<(ModuleValues, Vec<(Module, ModuleKind)>)>,
}

impl BoardDraft {
    /// All of its modules.
    pub fn modules(&self) -> impl Iterator<Item = &(Module, ModuleKind)> {
        self.modules.iter().flat_map(|(_, modules)| modules)
    }
}

/// The patch of a part. `source` is its device; `given`: whether there are files of the robot's configuration at all.
///
/// # Errors
/// If the files contradict each other or have no module.
pub fn compose(sources: &Sources, source: Option<&Source<'_>>, given: bool) -> Result<PatchDraft, String> {
    let part = sources.part;
    let mut open: Vec<String> =
        sources.drawing.iter().flat_map(|d| &d.remarks).map(|r| format!("drawing: {r}")).collect();
    open.extend(source.iter().flat_map(|source| &source.device.open).cloned());
    let modules = choose_modules(sources, &mut open);
    let last =
        modules.keys().next_back().ok_or("no module of it has a position, and no drawing (--layout) names one")?;
    let addresses = addresses(part, 1 + last / MODULES, source, given, &mut open)?;
    let settings = source.and_then(|source| source.device.settings());
    if settings.is_none() && part.is_hand() {
        open.push(
            "board_type, shift and cdc_offset as on most hands; hands with newer fingertips have others".to_owned(),
        );
    }
    let mut boards = Vec::new();
    for (position, place) in addresses.iter().enumerate() {
        let of_board = modules.range(position * MODULES..(position + 1) * MODULES);
        let of_board: Vec<_> = of_board.map(|(module, kind)| ((module % MODULES) as u8, *kind)).collect();
        if !of_board.is_empty() {
            boards.push(board(part, *place, &of_board, settings)?);
        }
    }
    let period_ms = boards.iter().map(|board| board.values.period_ms).max().unwrap_or(50);
    if boards.iter().any(|board| board.values.period_ms != period_ms) {
        open.push("its boards have several periods in the robot's configuration: the longest is taken".to_owned());
    }
    let area_mm2 = area(sources, &boards);
    if area_mm2.is_some() {
        let words =
            "the area of a taxel is estimated: known loads (`taxeld load`, `taxeld recalibrate`) tell it better";
        open.push(words.to_owned());
    }
    Ok(PatchDraft {
        name: part.name(),
        limb: part.bus(),
        bus: part.bus(),
        interface: None,
        line: source.zip(addresses.first()).map(|(source, (bus, _))| source.device.line(*bus)),
        geometry: sources.positions.as_ref().map(|(path, _)| path.clone()),
        boards,
        listens: addresses
            .iter()
            .any(|(_, address)| *address == EVERYONE)
            .then_some("a command to board 15 would go to all boards of the bus"),
        port: None,
        period_ms,
        area_mm2,
        open,
    })
}

/// The modules of a part by their number over all boards, and what they are: those with a position, and beside them those
/// that position files do not place, fingertips.
fn choose_modules(sources: &Sources, open: &mut Vec<String>) -> BTreeMap<usize, KindWord> {
    let part = sources.part;
    let posed: BTreeSet<usize> = sources.positions.iter().flat_map(|(_, file)| file.modules()).collect();
    let of_part = |module: &usize| (*module, part.kind((module % MODULES) as u8));
    let mut modules: BTreeMap<usize, KindWord> = posed.iter().map(of_part).collect();
    let Some(Drawing { modules: drawn, .. }) = &sources.drawing else {
        if part.is_hand() && !posed.is_empty() && posed.iter().all(|module| *module >= 8) {
            let words = "the position file places the palm alone. Fingertips are modules 0 to 4 of most hands: give the hand's \
                         drawing (--layout), or write modules = \"0-4 fingertip, 8-11 palm\"";
            open.push(words.to_owned());
        }
        return modules;
    };
    let taken = |module: &usize| posed.contains(module) || posed.is_empty() || part.is_hand();
    modules.extend(drawn.iter().filter(|(module, _)| taken(module)).map(|(module, kind)| (*module, *kind)));
    if !drawn.keys().all(taken) || !posed.iter().all(|module| drawn.contains_key(module)) {
        let words = "drawing and positions have other modules: those with a position are taken. Are both of this robot's version?";
        open.push(words.to_owned());
    }
    modules
}

/// The addresses of a part's boards, each with the number of its bus in the robot's configuration (0: not known).
fn addresses(
    part: Part,
    boards: usize,
    source: Option<&Source<'_>>,
    given: bool,
    open: &mut Vec<String>,
) -> Result<Vec<(u8, u8)>, String> {
    let Some(source) = source else {
        let most = part.addresses().len();
        if boards > most {
            return Err(format!("the files have modules on {boards} boards, and the part has {most} on an iCub"));
        }
        let how = if given {
            "no wrapper of the robot's files has its port"
        } else {
            "the robot's own files (--xml) tell them"
        };
        open.push(format!("addresses as on nearly all iCubs: {how}. `taxeld scan` shows what is on the bus"));
        return Ok(part.addresses().iter().take(boards).map(|address| (0, *address)).collect());
    };
    let (all, first) = (source.device.in_order(), source.first_board);
    let Some(own) = all.get(first..first + boards) else {
        let list: Vec<String> = all.iter().map(|(_, address)| address.to_string()).collect();
        return Err(format!(
            "its {boards} boards would be from place {} on in the list of {}, which is: {}",
            first + 1,
            source.device.name,
            list.join(" ")
        ));
    };
    if own.iter().any(|(bus, _)| *bus != own[0].0) {
        open.push("its boards are on two buses, and a patch has one: make two patches of it".to_owned());
    }
    Ok(own.to_vec())
}

fn board(
    part: Part,
    (bus, address): (u8, u8),
    modules: &[(u8, KindWord)],
    robot: Option<&Settings>,
) -> Result<BoardDraft, String> {
    let usual = BoardValues { period_ms: 50, board_type: i64::from(part.is_hand()), no_load: 240 };
    let mut groups: Vec<(ModuleValues, Vec<(Module, ModuleKind)>)> = Vec::new();
    for (number, kind) in modules {
        let module = Module::from_nibble(*number);
        let entry = (module, kind.at(module).map_err(|e| format!("board {address}: {e}"))?);
        let values = match robot {
            Some(robot) => robot.module(bus, address, *number),
            None if *kind == KindWord::Fingertip => (0, 0x2000),
            None => USUAL,
        };
        match groups.iter_mut().find(|(of, _)| *of == values) {
            Some((_, list)) => list.push(entry),
            None => groups.push((values, vec![entry])),
        }
    }
    groups.sort_by_key(|(values, list)| (*values != USUAL, std::cmp::Reverse(list.len())));
    Ok(BoardDraft { address, values: robot.map_or(usual, |robot| robot.board(bus, address)), modules: groups })
}

/// The area of a taxel of palm or fingertips: nobody has published it, so that of the square between neighbours is taken.
fn area(sources: &Sources, boards: &[BoardDraft]) -> Option<f64> {
    if boards.iter().flat_map(BoardDraft::modules).all(|(_, kind)| *kind == ModuleKind::Triangle) {
        return None;
    }
    let rows = sources.positions.as_ref().map_or(&[][..], |(_, file)| file.rows());
    let places: Vec<[f64; 3]> = rows.iter().flatten().map(|pose| pose.position).collect();
    let distance = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    let nearest =
        |place| places.iter().map(|other| distance(place, other)).filter(|d| *d > 1e-6).min_by(f64::total_cmp);
    let mut nearest: Vec<f64> = places.iter().filter_map(nearest).collect();
    nearest.sort_by(f64::total_cmp);
    let pitch_mm = nearest.get(nearest.len() / 2).map_or(5.0, |metres| metres * 1e3);
    Some((pitch_mm * pitch_mm * 10.0).round() / 10.0)
}
