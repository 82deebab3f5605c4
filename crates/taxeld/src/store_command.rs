//! `taxeld store`: what an operator does with a store that no daemon has open.

use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, Subcommand};

#[derive(Debug, Args)]
pub struct StoreArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// What it holds and what of it is damaged or lost, as the next start would tell it; changes nothing. Fails if something is.
    Check {
        /// The SQLite file, as in the configuration.
        #[arg(long, value_name = "FILE")]
        store: PathBuf,
    },
}

/// Does it.
///
/// # Errors
/// If the store cannot be opened, or a check finds damage.
pub fn store(args: &StoreArgs) -> anyhow::Result<()> {
    match &args.what {
        What::Check { store } => {
            let found = taxel_store::check(store).with_context(|| store.display().to_string())?;
            let mb = found.bytes as f64 / 1e6;
            say!("{} model sets, {} sessions, {} samples, {mb:.1} MB", found.model_sets, found.sessions, found.samples);
            for damage in &found.damage {
                say!("{damage}");
            }
            anyhow::ensure!(found.damage.is_empty(), "{} findings", found.damage.len());
        }
    }
    Ok(())
}
