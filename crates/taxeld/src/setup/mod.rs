//! `taxeld setup`: from the robot's own files to a configuration.

mod compose;
mod part;
mod robot;
mod settings;
#[cfg(test)]
mod tests;
mod write;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use taxel_skin::{Drawing, PositionFile};

use crate::config;
use part::Part;
use robot::{Robot, Source};
use taxel_files::read_any_text;

pub use compose::{BoardDraft, PatchDraft};
use compose::{Sources, compose};
pub use settings::{BoardValues, USUAL};
pub use write::text;

/// What the files are.
#[derive(Debug, clap::Args)]
pub struct SetupArgs {
    /// iCub's position files, one a part; the part is known by the file's name or its `name` line, or said: PART=FILE.
    #[arg(long, num_args = 1.., value_name = "FILE", required_unless_present = "layout")]
    positions: Vec<PathBuf>,
    /// Skin drawing files (.ini), which say what each module is.
    #[arg(long, num_args = 1.., value_name = "FILE")]
    layout: Vec<PathBuf>,
    /// The robot's configuration: skin devices, their specifications, port wrappers.
    #[arg(long, num_args = 1.., value_name = "FILE")]
    xml: Vec<PathBuf>,
    /// Read all parts over ports of YARP, also those on a CAN interface of this computer.
    #[arg(long, conflicts_with = "can")]
    yarp: bool,
    /// Read no part over a port: you have wired the buses to this computer.
    #[arg(long)]
    can: bool,
    /// The configuration to write; `-` is the standard output.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Write over a file that is there.
    #[arg(long)]
    force: bool,
}

/// Writes a configuration.
///
/// # Errors
/// What cannot be read, what contradicts itself, and what cannot be written; nothing is written then.
pub fn setup(args: &SetupArgs) -> anyhow::Result<()> {
    if args.out.exists() && !taxel_files::is_standard(&args.out) && !args.force {
        bail!("{}: is there already; --force writes over it", args.out.display());
    }
    taxel_files::announce(&[&args.out], &[])?;
    let (drafts, notes) = drafts(args)?;
    let folder = args.out.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let text = text("Written by `taxeld setup` from the robot's own files.", &drafts, folder);
    let (_, scene) =
        config::examine_text(&args.out, &text).context("what was made of the files is no configuration")?;
    taxel_files::write_text(&args.out, &text)?;
    for (draft, plan) in drafts.iter().zip(&scene.plan.patches) {
        let poses = plan.geometry.as_ref().map_or(0, |geometry| geometry.poses.iter().flatten().count());
        let (name, taxels, modules) = (plan.patch.name(), draft.taxels(), plan.patch.modules().len());
        say!("{name}: {taxels} taxels ({poses} with a position), modules: {modules}, boards: {}", draft.boards.len());
        if let Some(port) = &draft.port {
            say!("{name}: on no CAN interface of this computer, read over the YARP port {}", port.name);
        }
    }
    notes.iter().for_each(|note| say!("{note}"));
    let open = text.matches(write::CHECK).count() - 1; // the first one explains the mark
    say!("{}: written; {open} lines marked {} say what is left to look at", args.out.display(), write::CHECK);
    Ok(())
}

/// All that the files say, part by part, and what of them is not used, a line each.
fn drafts(args: &SetupArgs) -> anyhow::Result<(Vec<PatchDraft>, Vec<String>)> {
    let (mut sources, mut notes): (Vec<Sources>, Vec<String>) = (Vec::new(), Vec::new());
    for argument in &args.positions {
        let (word, path) = named(argument);
        let file = PositionFile::parse(&read_any_text(&path)?).with_context(|| format!("{}", path.display()))?;
        let source = of_part(&mut sources, word.as_deref(), &path, file.name())?;
        if file.modules().is_empty() {
            notes.push(format!("{}: not used: all its positions are zero", path.display()));
        } else if let Some((other, _)) = source.positions.replace((path.clone(), file)) {
            bail!("{} and {} are both of {}: one is expected", other.display(), path.display(), source.part.name());
        }
    }
    for argument in &args.layout {
        let (word, path) = named(argument);
        let drawing = Drawing::parse(&read_any_text(&path)?);
        let source = of_part(&mut sources, word.as_deref(), &path, drawing.part.as_deref())?;
        if source.drawing.replace(drawing).is_some() {
            bail!("{}: a drawing of {} was given before: one is expected", path.display(), source.part.name());
        }
    }
    let robot = Robot::read(&args.xml)?;
    let (mut drafts, mut of_patches): (Vec<PatchDraft>, Vec<Source<'_>>) = (Vec::new(), Vec::new());
    for sources in &sources {
        let part = sources.part.name();
        let wrong = |why: String| anyhow::anyhow!("{part}: {why}");
        let source = robot.source(sources.part, &sources.names).map_err(wrong)?;
        let mut draft = compose(sources, source.as_ref(), !args.xml.is_empty()).map_err(wrong)?;
        let by_port = source.as_ref().filter(|source| args.yarp || source.device.is_out_of_reach() && !args.can);
        draft.port = by_port.map(|source| source.port.clone());
        match draft.port {
            Some(_) => draft.bus = "robot".to_owned(),
            None => name_bus(&mut draft, &drafts),
        }
        drafts.push(draft);
        of_patches.extend(source);
    }
    notes.extend(robot.unused(&of_patches));
    Ok((drafts, notes))
}

/// Parts of one limb may be on several devices, or on both CAN ports of one: each is a bus of its own, and the second and later
/// ones of a name get a number.
fn name_bus(draft: &mut PatchDraft, before: &[PatchDraft]) {
    let same: Vec<&PatchDraft> = before.iter().filter(|other| other.limb == draft.limb).collect();
    if let Some(known) = same.iter().find(|other| other.line == draft.line) {
        draft.bus.clone_from(&known.bus);
    } else if draft.line.is_some() && !same.is_empty() {
        let names: BTreeSet<&String> = same.iter().map(|other| &other.bus).collect();
        draft.bus = format!("{}_{}", draft.bus, names.len() + 1);
    }
}

/// What is known so far of the part that was said, or that the file's name or the file itself names.
fn of_part<'a>(
    sources: &'a mut Vec<Sources>,
    said: Option<&str>,
    path: &Path,
    inside: Option<&str>,
) -> anyhow::Result<&'a mut Sources> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let part = match said {
        Some(said) => {
            Part::named(said).with_context(|| format!("{said}: no part of an iCub, for example left_forearm"))
        }
        None => Part::named(&stem).or_else(|| Part::named(inside?)).with_context(|| {
            let path = path.display();
            format!("{path}: neither its name nor its content names a part: say which, for example left_forearm={path}")
        }),
    }?;
    let position = sources.iter().position(|source| source.part == part).unwrap_or_else(|| {
        sources.push(Sources { part, positions: None, drawing: None, names: Vec::new() });
        sources.len() - 1
    });
    sources[position].names.extend([Some(stem), inside.map(str::to_owned)].into_iter().flatten());
    Ok(&mut sources[position])
}

/// `PART=FILE`, or a file alone.
fn named(argument: &Path) -> (Option<String>, PathBuf) {
    let text = argument.to_string_lossy();
    match text.split_once('=').filter(|_| !argument.exists()) {
        Some((part, file)) => (Some(part.to_owned()), PathBuf::from(file)),
        None => (None, argument.to_owned()),
    }
}
