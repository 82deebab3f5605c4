//! Which frames make up a scan of a described device.
//!
//! A page is a frame that comes once a scan: one identifier, or one choice of its selectors. A taxel that is in several
//! pages is read from each of them and keeps the newest number, so that a scan is complete when each page has come.

use taxel_wire::bits::{BitField, FrameMatch};

/// A taxel's number, in all frames that hold it.
#[derive(Clone, Debug)]
pub struct Cell {
    /// The frames.
    pub frames: FrameMatch,
    /// Its place there.
    pub field: BitField,
    /// For messages.
    pub name: String,
}

/// A frame that comes once a scan.
#[derive(Clone, Debug)]
pub struct Page<'a> {
    /// Which one.
    pub frames: &'a FrameMatch,
    /// The positions of its taxels among the cells.
    pub taxels: Vec<usize>,
}

/// The pages of a device, in the order of their taxels.
///
/// # Errors
/// Two taxels that share some frames while each is in others without the other: what makes up a scan is not known. Two
/// taxels that share a bit.
pub fn pages(cells: &[Cell]) -> Result<Vec<Page<'_>>, String> {
    let mut kinds: Vec<&Cell> = Vec::new();
    for cell in cells {
        let mut known = false;
        for kind in kinds.iter().filter(|kind| !kind.frames.excludes(&cell.frames)) {
            let (wider, narrower) = (kind.frames.is_within(&cell.frames), cell.frames.is_within(&kind.frames));
            if !wider && !narrower {
                return Err(format!(
                    "{} and {} are together in some frames {} and not in others, so that no frame comes once a scan: \
                     expected selectors by which one is in all frames of the other, or in none",
                    kind.name, cell.name, cell.frames.id
                ));
            }
            known |= wider && narrower;
        }
        if !known {
            kinds.push(cell);
        }
    }
    let is_within_another = |kind: &Cell| {
        let other = |other: &&Cell| other.frames != kind.frames && other.frames.is_within(&kind.frames);
        kinds.iter().any(other)
    };
    let pages: Vec<Page<'_>> = kinds
        .iter()
        .filter(|kind| !is_within_another(kind))
        .map(|kind| {
            let holds = |taxel: &usize| kind.frames.is_within(&cells[*taxel].frames);
            Page { frames: &kind.frames, taxels: (0..cells.len()).filter(holds).collect() }
        })
        .collect();
    pages.iter().try_for_each(|page| no_overlap(page, cells))?;
    Ok(pages)
}

/// No bit is part of two taxels, or of a taxel and what selects its frame.
fn no_overlap(page: &Page<'_>, cells: &[Cell]) -> Result<(), String> {
    let mut used: Vec<Option<&str>> = vec![None; 512];
    let selectors = page.frames.selectors.iter().flat_map(|selector| selector.field.bits());
    selectors.for_each(|bit| used[usize::from(bit)] = Some("what selects the frame"));
    for cell in page.taxels.iter().map(|taxel| &cells[*taxel]) {
        for bit in cell.field.bits() {
            if let Some(other) = used[usize::from(bit)].replace(&cell.name) {
                let id = page.frames.id;
                return Err(format!("{}: bit {bit} of frame {id} is also part of {other}", cell.name));
            }
        }
    }
    Ok(())
}

/// The frame that begins a scan does so once: it is one page or a part of it, or no page at all.
///
/// # Errors
/// The page that it is also part of.
pub fn begins_once(sync: &FrameMatch, pages: &[Page<'_>]) -> Result<(), String> {
    let unclear = |page: &&Page<'_>| !sync.excludes(page.frames) && !sync.is_within(page.frames);
    if pages.iter().any(|page| unclear(&page)) {
        return Err(format!(
            "array.sync: frames {} also come in the middle of a scan, so that none would be whole: expected a signal that is \
             in the first of them alone",
            sync.id
        ));
    }
    Ok(())
}

/// A counter of scans is no taxel, and not what selects a frame.
///
/// # Errors
/// What it is part of.
pub fn counts_scans(counter: BitField, pages: &[Page<'_>], cells: &[Cell]) -> Result<(), String> {
    let cell = |taxel: usize| Cell { name: "array.counter".to_owned(), field: counter, ..cells[taxel].clone() };
    for page in pages {
        let mut with: Vec<Cell> = page.taxels.iter().map(|taxel| cells[*taxel].clone()).collect();
        with.extend(page.taxels.first().map(|taxel| cell(*taxel)));
        no_overlap(&Page { frames: page.frames, taxels: (0..with.len()).collect() }, &with)?;
    }
    Ok(())
}
