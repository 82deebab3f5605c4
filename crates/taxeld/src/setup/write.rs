//! The configuration as text, with comments where the files leave something open.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use taxel_skin::written_modules;

use super::compose::{BoardDraft, PatchDraft};
use super::settings::ModuleValues;

/// Marks what somebody has to look at.
pub const CHECK: &str = "CHECK:";

/// What each configuration begins with, behind who wrote it.
const HEAD: &str = "Lines with `CHECK:` say what is left open.
# deploy/taxeld.toml explains every key.

# Without [access] everybody on this machine is administrator; with all four lines the group skin are operators, over the
# Unix socket (security.md):
# listen = [\"unix:/run/taxeld/taxeld.sock\", \"tcp:127.0.0.1:50051\"]
# socket_group = \"skin\"
# [access]
# operators = [\"group:skin\"]

[store]
path = \"/var/lib/taxeld/taxeld.db\" # sessions, samples and model sets; one SQLite file
";

/// The text of a configuration; `folder` is where it will lie.
pub fn text(written: &str, drafts: &[PatchDraft], folder: &Path) -> String {
    let mut text = format!("# {written} {HEAD}");
    let is_first = |(n, draft): &(usize, &PatchDraft)| drafts[..*n].iter().all(|before| before.bus != draft.bus);
    let mut interfaces = 0..;
    for (_, PatchDraft { bus, .. }) in drafts.iter().enumerate().filter(is_first) {
        let _ = write!(text, "\n[[bus]]\nname = \"{bus}\"\n");
        let on_it = || drafts.iter().filter(|draft| draft.bus == *bus);
        if on_it().any(|draft| draft.port.is_some()) {
            text.push_str(
                "source = \"yarp\" # the name server that `yarp conf` names; else: server = \"10.0.0.2:10000\"\n",
            );
        } else if let Some(interface) = on_it().find_map(|draft| draft.interface.as_ref()) {
            let _ = writeln!(text, "interface = {}", quoted(interface));
        } else {
            let number = interfaces.next().unwrap_or(0);
            let _ = writeln!(text, "interface = \"can{number}\" # {CHECK} which interface is the bus of {bus}");
        }
    }
    drafts.iter().for_each(|draft| patch(&mut text, draft, folder));
    text
}

fn patch(text: &mut String, draft: &PatchDraft, folder: &Path) {
    let PatchDraft { name, bus, .. } = draft;
    let _ = writeln!(text, "\n# {name}: {} taxels", draft.taxels());
    for line in &draft.open {
        let _ = writeln!(text, "# {CHECK} {line}");
    }
    let _ = write!(text, "[[patch]]\nname = \"{name}\"\nbus = \"{bus}\"\n");
    if let Some(port) = &draft.port {
        let _ = writeln!(text, "port = {} # the robot's own software configures the boards", quoted(&port.name));
    } else {
        let why =
            draft.listens.unwrap_or("true: the robot's own software configures the boards, nothing is sent to them");
        let _ = writeln!(text, "listen_only = {} # {why}", draft.listens.is_some());
    }
    let _ = writeln!(text, "period_ms = {}", draft.period_ms);
    if let Some(path) = &draft.geometry {
        let _ = writeln!(text, "geometry = {}", quoted(&relative(path, folder).to_string_lossy()));
        text.push_str("outputs = [] # beside the total: \"resultant\", \"moment\", \"contacts\", \"fill\"\n");
    }
    if let Some(area_mm2) = draft.area_mm2 {
        let _ = write!(text, "area = \"equal\"\narea_mm2 = {area_mm2:?}\narea_uncertainty = 0.3\n");
    }
    text.push_str("boards = [\n");
    match &draft.port {
        // All boards of the port, in its order, also those of which the part has nothing.
        Some(port) => port.boards.iter().for_each(|address| {
            let of_board = draft.boards.iter().filter(|board| board.address == *address);
            let mut modules: Vec<_> = of_board.flat_map(BoardDraft::modules).copied().collect();
            modules.sort_by_key(|(module, _)| module.get());
            let _ = writeln!(text, "    {{ address = {address}, modules = \"{}\" }},", written_modules(&modules));
        }),
        None => draft.boards.iter().for_each(|board| {
            board.modules.iter().for_each(|(values, modules)| entry(text, board, &written_modules(modules), *values));
        }),
    }
    text.push_str("]\n");
    let words = "without the bag's pressure sensor there is no calibration, only force. Put in yours:";
    let _ = writeln!(text, "# {CHECK} {words}");
    text.push_str(match draft.port {
        Some(_) => "# gauge = { port = \"/bag/pressure:o\", index = 0, unit = \"kPa\" }\n",
        None => "# gauge = { id = 0x3A1, signal = \"0|32@1-\", unit = \"Pa\" }\n",
    });
}

/// Modules of a board that are configured alike; what is as on most boards is left out.
fn entry(text: &mut String, board: &BoardDraft, modules: &str, (shift, cdc_offset): ModuleValues) {
    let (address, values) = (board.address, &board.values);
    let _ = write!(text, "    {{ address = {address}, modules = \"{modules}\"");
    let keys = [
        ("board_type", values.board_type != 0, values.board_type.to_string()),
        ("no_load", values.no_load != 240, values.no_load.to_string()),
        ("shift", shift != 2, shift.to_string()),
        ("cdc_offset", cdc_offset != 0x2200, format!("{cdc_offset:#06x}")),
    ];
    for (key, _, value) in keys.iter().filter(|(_, is_other, _)| *is_other) {
        let _ = write!(text, ", {key} = {value}");
    }
    text.push_str(" },\n");
}

/// A string as TOML has it.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// A path as the configuration has it: below its own folder a relative one.
fn relative(path: &Path, folder: &Path) -> PathBuf {
    let whole = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let path = whole(path);
    path.strip_prefix(whole(folder)).map(Path::to_owned).unwrap_or(path)
}
