//! From what the files say of a part to its patch: boards, modules, kinds, and what they leave open.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use taxel_skin::{Module, ModuleKind, PositionFile};

use super::drawing::Drawing;
use super::part::Part;
use super::robot::Source;
use super::settings::{BoardValues, ModuleValues, Settings};
use crate::config::KindWord;

/// Shift and converter offset of nearly all modules.
const USUAL: (i64, i64) = (2, 0x2200);
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
#[derive(Debug)]
pub struct PatchDraft {
    /// Which part.
    pub part: Part,
    /// Its bus: that of the part, with a number where several devices or CAN ports share the name.
    pub bus: String,
    /// The position file.
    pub geometry: Option<PathBuf>,
    /// Its boards, in the order of the port.
    pub boards: Vec<BoardDraft>,
    /// Bus and address of each of these in the robot's configuration, those without a module of the part included.
    pub taken: Vec<(u8, u8)>,
    /// Whether a board has the address of everyone: whatever is sent to it is sent to all.
    pub is_shared_address: bool,
    /// Why the robot's computer has no interface for it, and where its counts are instead.
    pub out_of_reach: Option<String>,
    /// Period of its boards, milliseconds.
    pub period_ms: i64,
    /// Mean area of a taxel that is no triangle's, mm2, as the distance of its neighbours tells; `None` for triangles alone.
    pub area_mm2: Option<f64>,
    /// What somebody has to look at, a line each.
    pub open: Vec<String>,
    /// What somebody may want to know, a line each.
    pub remarks: Vec<String>,
}

/// A board of a patch.
#[derive(Debug)]
pub struct BoardDraft {
    /// CAN address.
    pub address: u8,
    /// Modules and what they are.
    pub modules: Vec<(Module, ModuleKind)>,
    /// How it is configured.
    pub values: BoardValues,
    /// Shift and converter offset of most of its modules.
    pub usual: (i64, i64),
    /// Modules with others.
    pub exceptions: Vec<(Vec<u8>, (i64, i64))>,
    /// What somebody may want to know, a line each.
    pub remarks: Vec<String>,
}

/// The patch of a part. `source` is its device; `given`: whether there are files of the robot's configuration at all.
///
/// # Errors
/// If the files contradict each other or have no module.
pub fn compose(sources: &Sources, source: Option<&Source>, given: bool) -> Result<PatchDraft, String> {
    let part = sources.part;
    let mut draft = PatchDraft {
        part,
        bus: part.bus(),
        geometry: sources.positions.as_ref().map(|(path, _)| path.clone()),
        boards: Vec::new(),
        taken: Vec::new(),
        is_shared_address: false,
        out_of_reach: None,
        period_ms: 50,
        area_mm2: None,
        open: Vec::new(),
        remarks: sources.drawing.iter().flat_map(|d| &d.remarks).map(|r| format!("drawing: {r}")).collect(),
    };
    let said = source.iter().flat_map(|source| &source.device.settings.remarks);
    draft.remarks.extend(said.map(|remark| format!("the robot's configuration: {remark}")));
    let own_buses = |source: &Source| source.device.addresses.keys().copied().collect::<Vec<u8>>();
    let others = source.and_then(|source| source.device.settings.of_other_buses(&own_buses(source)));
    draft.open.extend(others);
    let modules = choose_modules(sources, &mut draft);
    let boards =
        1 + modules.keys().next_back().ok_or("no module of it has a position, and no drawing (--layout) names one")?
            / MODULES;
    let addresses = addresses(part, boards, source, given, &mut draft)?;
    draft.taken = addresses.clone();
    draft.is_shared_address = addresses.iter().any(|(_, address)| *address == EVERYONE);
    for (position, (bus, address)) in addresses.into_iter().enumerate() {
        let of_board = modules.range(position * MODULES..(position + 1) * MODULES);
        let of_board: Vec<(u8, KindWord)> = of_board.map(|(module, kind)| ((module % MODULES) as u8, *kind)).collect();
        if !of_board.is_empty() {
            draft.boards.push(board(
                part,
                (bus, address),
                &of_board,
                source.and_then(Source::settings),
                &mut draft.open,
            )?);
        }
    }
    settle_period(&mut draft);
    draft.area_mm2 = area(sources, &mut draft);
    Ok(draft)
}

/// The modules of a part by their number over all boards, and what they are: those with a position, and beside them those
/// that position files do not place, fingertips.
fn choose_modules(sources: &Sources, draft: &mut PatchDraft) -> BTreeMap<usize, KindWord> {
    let part = sources.part;
    let drawn = sources.drawing.as_ref().map(|drawing| &drawing.modules);
    let posed: BTreeSet<usize> = sources.positions.iter().flat_map(|(_, file)| file.modules()).collect();
    let kind = |module: usize| {
        let known = drawn.and_then(|drawn| drawn.get(&module)).copied();
        known.unwrap_or_else(|| part.kind((module % MODULES) as u8))
    };
    let mut modules: BTreeMap<usize, KindWord> = posed.iter().map(|module| (*module, kind(*module))).collect();
    let Some(drawn) = drawn else {
        if part.is_hand() && !posed.is_empty() && posed.iter().all(|module| *module >= 8) {
            draft.open.push(
                "the position file places the palm alone. Fingertips are modules 0 to 4 of most hands: give the hand's \
                 drawing (--layout), or write modules = \"0-4 fingertip, 8-11 palm\""
                    .to_owned(),
            );
        }
        return modules;
    };
    let (mut only_drawn, not_drawn) = (Vec::new(), posed.iter().filter(|m| !drawn.contains_key(m)).copied().collect());
    for (module, kind) in drawn {
        if posed.is_empty() || (part.is_hand() && !posed.contains(module)) {
            modules.insert(*module, *kind);
        } else if !posed.contains(module) {
            only_drawn.push(*module);
        }
    }
    for (list, what) in
        [(only_drawn, "drawn but have no position: left out"), (not_drawn, "have a position and are not drawn")]
    {
        if !list.is_empty() {
            draft.open.push(format!("modules {} {what}. Are both files of this robot's version?", by_board(&list)));
        }
    }
    modules
}

/// Modules by their number over all boards, in words: `2 and 5 of the first board`.
fn by_board(modules: &[usize]) -> String {
    let words = modules.chunk_by(|a, b| a / MODULES == b / MODULES).map(|run| {
        let numbers: Vec<String> = run.iter().map(|module| (module % MODULES).to_string()).collect();
        format!("{} of board {}", numbers.join(", "), run[0] / MODULES + 1)
    });
    words.collect::<Vec<_>>().join("; ")
}

/// The addresses of a part's boards, each with the number of its bus in the robot's configuration (0: not known).
fn addresses(
    part: Part,
    boards: usize,
    source: Option<&Source>,
    given: bool,
    draft: &mut PatchDraft,
) -> Result<Vec<(u8, u8)>, String> {
    let usual: Vec<(u8, u8)> = part.addresses().iter().map(|address| (0, *address)).collect();
    let Some(source) = source.filter(|source| !source.device.addresses.is_empty()) else {
        if boards > usual.len() {
            let most = usual.len();
            return Err(format!("the files have modules on {boards} boards, and the part has {most} on an iCub"));
        }
        let how = if given { "no device of the robot's files fits" } else { "the robot's own files (--xml) tell them" };
        draft.open.push(format!("addresses as on nearly all iCubs: {how}. `taxeld scan` shows what is on the bus"));
        return Ok(usual.into_iter().take(boards).collect());
    };
    let all = source.device.in_order();
    // Without a port the place is that of most robots, or the end of a list that is only of this part.
    let usual_place = match part.first_board() {
        first if all.len() <= part.addresses().len() => first.min(all.len().saturating_sub(boards)),
        first => first,
    };
    let first = source.first_board.unwrap_or(usual_place);
    let own: Vec<(u8, u8)> = all.iter().skip(first).take(boards).copied().collect();
    if own.len() < boards {
        let device = &source.device.name;
        let list: Vec<String> = all.iter().map(|(_, address)| address.to_string()).collect();
        return Err(format!(
            "its {boards} boards would be from place {} on in the list of {device}, which has {}: {}",
            first + 1,
            all.len(),
            list.join(" ")
        ));
    }
    if own.iter().any(|(bus, _)| *bus != own[0].0) {
        draft.open.push("its boards are on two buses, and a patch has one: make two patches of it".to_owned());
    }
    if own.iter().map(|(_, address)| address).ne(usual.iter().take(boards).map(|(_, address)| address)) {
        draft
            .remarks
            .push("the robot's configuration has other addresses here than most iCubs: these are taken".to_owned());
    }
    Ok(own)
}

fn board(
    part: Part,
    (bus, address): (u8, u8),
    modules: &[(u8, KindWord)],
    robot: Option<&Settings>,
    open: &mut Vec<String>,
) -> Result<BoardDraft, String> {
    let module = |(module, kind): &(u8, KindWord)| {
        let module = Module::from_nibble(*module);
        Ok((module, kind.at(module).map_err(|e| format!("board {address}: {e}"))?))
    };
    let kinds = modules.iter().map(module).collect::<Result<Vec<_>, String>>()?;
    let values = match robot {
        Some(robot) => robot.board(bus, address),
        None => BoardValues { period_ms: 50, board_type: i64::from(part.is_hand()), no_load: 240 },
    };
    let value = |(number, kind): &(u8, KindWord)| match robot {
        Some(robot) => {
            let ModuleValues { shift, cdc_offset, .. } = robot.module(bus, address, *number);
            (shift, cdc_offset)
        }
        None if *kind == KindWord::Fingertip => (0, 0x2000),
        None => USUAL,
    };
    if robot.is_none() && part.is_hand() {
        open.push(
            "board_type, shift and cdc_offset as on most hands; hands with newer fingertips have others".to_owned(),
        );
    }
    let mut groups: Vec<((i64, i64), Vec<u8>)> = Vec::new();
    for entry in modules {
        match groups.iter_mut().find(|(values, _)| *values == value(entry)) {
            Some((_, list)) => list.push(entry.0),
            None => groups.push((value(entry), vec![entry.0])),
        }
    }
    groups.sort_by_key(|(values, list)| (*values != USUAL, std::cmp::Reverse(list.len())));
    let usual = groups.first().map_or(USUAL, |(values, _)| *values);
    let exceptions = groups.into_iter().skip(1).map(|(values, list)| (list, values)).collect();
    let remarks = robot.map_or_else(Vec::new, |robot| remainders(robot, (bus, address), modules));
    Ok(BoardDraft { address, modules: kinds, values, usual, exceptions, remarks })
}

/// Where the robot's configuration has other modules than the files of positions.
fn remainders(robot: &Settings, (bus, address): (u8, u8), modules: &[(u8, KindWord)]) -> Vec<String> {
    let here = |module: &u8| modules.iter().any(|(m, _)| m == module);
    let enabled: Vec<u8> = (0..16).filter(|m| robot.module(bus, address, *m).enabled).collect();
    let join = |list: Vec<u8>| list.iter().map(u8::to_string).collect::<Vec<_>>().join(", ");
    let more: Vec<u8> = enabled.iter().filter(|m| !here(m)).copied().collect();
    let fewer: Vec<u8> = modules.iter().map(|(m, _)| *m).filter(|m| !enabled.contains(m)).collect();
    let mut remarks = Vec::new();
    if enabled.len() == 16 && !more.is_empty() {
        remarks.push("the robot's configuration lets all 16 modules send".to_owned());
    } else if !more.is_empty() {
        remarks.push(format!("the robot's configuration also enables modules {}", join(more)));
    }
    if !fewer.is_empty() {
        remarks.push(format!("the robot's configuration does not enable modules {}", join(fewer)));
    }
    remarks
}

/// A patch has one period, its boards may have several.
fn settle_period(draft: &mut PatchDraft) {
    draft.period_ms = draft.boards.iter().map(|board| board.values.period_ms).max().unwrap_or(50);
    if draft.boards.iter().any(|board| board.values.period_ms != draft.period_ms) {
        draft
            .open
            .push("its boards have several periods in the robot's configuration: the longest is taken".to_owned());
    }
}

/// The area of a taxel of palm or fingertips: nobody has published it, so that of the square between neighbours is taken.
fn area(sources: &Sources, draft: &mut PatchDraft) -> Option<f64> {
    let kinds = draft.boards.iter().flat_map(|board| &board.modules);
    if kinds.clone().all(|(_, kind)| *kind == ModuleKind::Triangle) {
        return None;
    }
    draft
        .open
        .push("the area of a taxel is estimated: known loads (area_factor = \"from-loads\") tell it better".to_owned());
    let rows = sources.positions.as_ref().map_or(&[][..], |(_, file)| file.rows());
    let places: Vec<[f64; 3]> = rows.iter().flatten().map(|pose| pose.position).collect();
    let distance = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    let nearest = places.iter().enumerate().filter_map(|(i, place)| {
        let others = places.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, other)| distance(place, other));
        others.filter(|d| *d > 1e-6).min_by(f64::total_cmp)
    });
    let mut nearest: Vec<f64> = nearest.collect();
    nearest.sort_by(f64::total_cmp);
    let pitch_mm = nearest.get(nearest.len() / 2).map_or(5.0, |metres| metres * 1e3);
    Some((pitch_mm * pitch_mm * 10.0).round() / 10.0)
}
