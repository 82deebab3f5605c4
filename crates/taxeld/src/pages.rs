//! Completions and manual pages, made from the definition of the command line itself.

use std::path::Path;

use anyhow::Context;

/// Prints the completions for a shell.
///
/// # Errors
/// If they cannot be written.
pub fn completions(mut command: clap::Command, shell: clap_complete::Shell) -> anyhow::Result<()> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut command, "taxeld", &mut text);
    taxel_files::write_text(Path::new("-"), &String::from_utf8(text)?)
}

/// Writes a manual page for each command into a folder, which is made if need be.
///
/// # Errors
/// If they cannot be written.
pub fn man(command: clap::Command, folder: &Path) -> anyhow::Result<()> {
    let named = || folder.display().to_string();
    std::fs::create_dir_all(folder).with_context(named)?;
    clap_mangen::generate_to(command, folder).with_context(named)
}
