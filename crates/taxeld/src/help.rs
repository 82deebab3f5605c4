//! What `taxeld` says of itself: its commands in groups, completions and manual pages.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Context;
use clap::Command;

/// Every command is in one of these groups.
const GROUPS: [(&str, &[&str]); 5] = [
    ("Start", &["demo", "setup", "scan", "check", "run"]),
    ("Calibrate", &["calibrate", "tare", "load", "recalibrate", "bring-up"]),
    ("Look", &["watch", "health", "events"]),
    ("Keep", &["models", "sessions", "audit"]),
    ("Logs", &["replay"]),
];

/// The command line with its commands in groups.
pub fn grouped(command: Command) -> Command {
    let mut text = "{about-with-newline}\n{usage-heading} {usage}\n".to_owned();
    for (group, names) in GROUPS {
        let found = names.iter().filter_map(|name| command.find_subcommand(name));
        let _ = write!(text, "\n{group}:\n"); // a String takes everything
        for one in found {
            let about = one.get_about().map(ToString::to_string).unwrap_or_default();
            let _ = writeln!(text, "  {:<12} {about}", one.get_name());
        }
    }
    command.help_template(text + "\nOptions:\n{options}{after-help}")
}

/// Prints the completions for a shell.
///
/// # Errors
/// If they cannot be written.
pub fn completions(mut command: Command, shell: clap_complete::Shell) -> anyhow::Result<()> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut command, "taxeld", &mut text);
    taxel_files::write_text(Path::new("-"), &String::from_utf8(text)?)
}

/// Writes a manual page for each command into a folder, which is made if need be.
///
/// # Errors
/// If they cannot be written.
pub fn man(command: Command, folder: &Path) -> anyhow::Result<()> {
    let named = || folder.display().to_string();
    std::fs::create_dir_all(folder).with_context(named)?;
    clap_mangen::generate_to(command, folder).with_context(named)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn every_command_is_in_one_group_with_one_line() {
        let command = crate::Cli::command();
        let shown = command.get_subcommands().filter(|one| !one.is_hide_set());
        for one in shown {
            let name = one.get_name();
            assert_eq!(
                GROUPS.iter().flat_map(|(_, names)| *names).filter(|known| **known == name).count(),
                1,
                "{name}"
            );
            let about = one.get_about().unwrap().to_string();
            assert!(about.chars().count() <= 100, "{name}: {about}");
        }
    }
}
