//! What a command does before it writes.

use std::path::Path;

use anyhow::ensure;
use taxel_files::{is_standard, say};

/// Prepares for these outputs: none may be an input, and text for people makes way for data on standard output.
///
/// # Errors
/// An output that is an input.
pub fn announce(outputs: &[&Path], inputs: &[&Path]) -> anyhow::Result<()> {
    for output in outputs {
        let there = std::fs::canonicalize(output).ok();
        let is_input = inputs.iter().any(|input| there.is_some() && std::fs::canonicalize(input).ok() == there);
        ensure!(!is_input, "the output {} is an input: name another file", output.display());
    }
    if outputs.iter().any(|output| is_standard(output)) {
        say::step_aside();
    }
    Ok(())
}
