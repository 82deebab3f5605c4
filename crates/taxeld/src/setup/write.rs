//! The configuration as text, with comments where the files leave something open.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use taxel_skin::Module;

use super::compose::{BoardDraft, PatchDraft};
use crate::config::modules_written;

/// Marks what somebody has to look at.
pub const CHECK: &str = "CHECK:";

/// The text of a configuration. `interfaces` are the network interfaces of buses, where they are known; `gauge` are the keys
/// of the gauge's section; `folder` is where the configuration will lie.
#[must_use]
pub fn text(
    drafts: &[PatchDraft],
    interfaces: &BTreeMap<String, String>,
    gauge: Option<&toml::Table>,
    folder: &Path,
) -> String {
    let mut text = String::new();
    comment(&mut text, "Written by `taxeld setup` from the robot's own files.");
    comment(
        &mut text,
        &format!("Lines with `{CHECK}` say what these leave open. deploy/taxeld.toml explains every key."),
    );
    text.push_str(
        "\n# Without [access] everybody on this machine is administrator; with all four lines the group skin are operators, over the\n\
         # Unix socket (security.md):\n\
         # listen = [\"unix:/run/taxeld/taxeld.sock\", \"tcp:127.0.0.1:50051\"]\n# socket_group = \"skin\"\n\
         # [access]\n# operators = [\"group:skin\"]\n",
    );
    text.push_str(
        "\n[store]\npath = \"/var/lib/taxeld/taxeld.db\" # sessions, samples and model sets; one SQLite file\n",
    );
    let mut buses: Vec<String> = Vec::new();
    for draft in drafts {
        if !buses.contains(&draft.bus) {
            buses.push(draft.bus.clone());
        }
    }
    for (position, bus) in buses.iter().enumerate() {
        let known = interfaces.get(bus).cloned();
        let none = drafts.iter().any(|draft| draft.bus == *bus && draft.out_of_reach.is_some());
        let question = if none { "this computer has none for" } else { "which interface is" };
        let (interface, mark) = known.map_or_else(
            || (format!("can{position}"), format!(" # {CHECK} {question} the bus of {bus}")),
            |interface| (interface, String::new()),
        );
        let _ = write!(text, "\n[[bus]]\nname = \"{bus}\"\ninterface = {}{mark}\n", quoted(&interface));
    }
    for draft in drafts {
        patch(&mut text, draft, gauge, folder);
    }
    text
}

fn patch(text: &mut String, draft: &PatchDraft, gauge: Option<&toml::Table>, folder: &Path) {
    let (name, bus) = (draft.part.name(), &draft.bus);
    text.push('\n');
    let taxels: usize = draft.boards.iter().flat_map(|b| &b.modules).map(|(_, kind)| kind.taxel_slots().len()).sum();
    comment(text, &format!("{name}: {taxels} taxels"));
    let out_of_reach = draft.out_of_reach.iter();
    out_of_reach.chain(&draft.open).for_each(|line| comment(text, &format!("{CHECK} {line}")));
    draft.remarks.iter().for_each(|line| comment(text, line));
    let _ = write!(text, "[[patch]]\nname = \"{name}\"\nbus = \"{bus}\"\n");
    let (listen_only, why) = match draft {
        draft if draft.is_shared_address => (true, "a command to board 15 would go to all boards of the bus"),
        draft if draft.out_of_reach.is_some() => (true, "the robot's own software configures the boards"),
        _ => (false, "true: the robot's own software configures the boards, nothing is sent to them"),
    };
    let _ = writeln!(text, "listen_only = {listen_only} # {why}");
    let _ = writeln!(text, "period_ms = {}", draft.period_ms);
    if let Some(path) = &draft.geometry {
        let _ = writeln!(text, "geometry = {}", quoted(&relative(path, folder).to_string_lossy()));
        text.push_str("outputs = [] # beside the total: \"resultant\", \"moment\", \"contacts\", \"fill\"\n");
    }
    if let Some(area_mm2) = draft.area_mm2 {
        let _ = write!(text, "area = \"equal\"\narea_mm2 = {area_mm2:?}\narea_uncertainty = 0.3\n");
    }
    text.push_str("boards = [\n");
    draft.boards.iter().for_each(|draft| board(text, draft));
    text.push_str("]\n");
    match gauge {
        Some(keys) => {
            let key = |(key, value): (&String, &toml::Value)| match value.as_integer().filter(|_| key == "id") {
                Some(id) => format!("id = {id:#x}"),
                None => format!("{key} = {value}"),
            };
            let _ = writeln!(text, "gauge = {{ {} }}", keys.iter().map(key).collect::<Vec<_>>().join(", "));
        }
        None => {
            comment(
                text,
                &format!(
                    "{CHECK} without the bag's pressure sensor there is no calibration, only force. Put in the identifier of \
                     yours: `taxeld scan` shows frames that could be a pressure"
                ),
            );
            comment(text, "gauge = { id = 0x5F1, signal = \"0|32@1-\", unit = \"Pa\" }");
        }
    }
}

fn board(text: &mut String, board: &BoardDraft) {
    board.remarks.iter().for_each(|line| {
        text.push_str("    ");
        comment(text, line);
    });
    let is_exception = |module: &Module| board.exceptions.iter().any(|(list, _)| list.contains(&module.get()));
    let of = |wanted: &dyn Fn(&Module) -> bool| {
        let modules = board.modules.iter().filter(|(module, _)| wanted(module));
        modules_written(&modules.copied().collect::<Vec<_>>())
    };
    entry(text, board, of(&|module| !is_exception(module)), board.usual);
    for (list, values) in &board.exceptions {
        entry(text, board, of(&|module| list.contains(&module.get())), *values);
    }
}

fn entry(text: &mut String, board: &BoardDraft, modules: String, (shift, cdc_offset): (i64, i64)) {
    let (address, values) = (board.address, &board.values);
    let _ = write!(text, "    {{ address = {address}, modules = \"{modules}\"");
    for (key, value, default) in
        [("board_type", values.board_type, 0), ("no_load", values.no_load, 240), ("shift", shift, 2)]
    {
        if value != default {
            let _ = write!(text, ", {key} = {value}");
        }
    }
    if cdc_offset != 0x2200 {
        let _ = write!(text, ", cdc_offset = {cdc_offset:#06x}");
    }
    text.push_str(" },\n");
}

/// A comment, broken where a line would be too long.
fn comment(text: &mut String, line: &str) {
    let mut width = 0;
    text.push('#');
    for word in line.split_whitespace() {
        if width + word.len() > 112 {
            text.push_str("\n#");
            width = 1;
        }
        let _ = write!(text, " {word}");
        width += word.len() + 1;
    }
    text.push('\n');
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
