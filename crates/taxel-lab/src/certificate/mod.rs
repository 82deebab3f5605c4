//! The calibration certificate of a model set: what a metrologist asks for, computed once from what was exported.
//!
//! [`Certificate::of`] takes the set, its session with the samples, the known loads and what people state, and gives
//! every number as JSON; the page shows the same numbers. No clock is read and nothing is measured here: the same input gives
//! the same bytes. How each number is defined is in `doc/certificate.md`; `tests/certificate/recompute.py` recomputes them from
//! the exported data.

mod budget;
mod course;
mod evidence;
mod figures;
mod make;
mod page;
mod taxel;

pub use evidence::{Evidence, Stated};
pub use make::Certificate;

use std::path::PathBuf;

use anyhow::{Context, bail};
use taxel_client::Server;

use crate::daemon::ask;

/// The calibration certificate of a model set: of a running daemon, or of exported files.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxel-lab certificate --stated lab.toml --out certificate.html        # of the active set of a daemon\n  taxel-lab certificate m-26dc --out c.html --out c.json\n  taxel-lab certificate --models models.json --session session3.csv --out c.html\nHow each number is defined is in crates/taxel-lab/doc/certificate.md."
)]
pub struct CertificateArgs {
    #[command(flatten)]
    server: Server,
    /// Id of the set, its beginning or `newest` [default: the active one].
    #[arg(value_name = "MODEL_SET", conflicts_with_all = ["models", "session"])]
    model_set: Option<String>,
    /// Ask no daemon: a set as `taxeld models export` writes it.
    #[arg(long, value_name = "MODELS.json", requires = "session")]
    models: Option<PathBuf>,
    /// The samples that it was made of, as `taxeld sessions export` writes them.
    #[arg(long, value_name = "SESSION.csv", requires = "models")]
    session: Option<PathBuf>,
    /// What people state (customer, robot, reference and so on), TOML.
    #[arg(long, value_name = "STATED.toml")]
    stated: Option<PathBuf>,
    /// Where it goes: JSON if the name ends with .json, else a page to be printed. May be given several times; `-` is the
    /// standard output.
    #[arg(long, value_name = "FILE", required = true)]
    out: Vec<PathBuf>,
}

/// Runs `taxel-lab certificate`.
///
/// # Errors
/// No daemon, one that refuses, files that do not belong together, or one that cannot be written.
pub fn certificate(args: &CertificateArgs) -> anyhow::Result<()> {
    let outputs: Vec<_> = args.out.iter().map(PathBuf::as_path).collect();
    let inputs: Vec<_> =
        [&args.models, &args.session, &args.stated].into_iter().flatten().map(PathBuf::as_path).collect();
    taxel_files::announce(&outputs, &inputs)?;
    let stated = match &args.stated {
        Some(path) => toml::from_str(&taxel_files::read_text(path)?).with_context(|| path.display().to_string())?,
        None => Stated::default(),
    };
    let evidence = match (&args.models, &args.session) {
        (Some(models), Some(session)) => {
            Evidence::of(taxel_files::read_text(models)?, taxel_files::read_text(session)?, stated)?
        }
        _ => of_daemon(args, stated)?,
    };
    let certificate = Certificate::of(&evidence)?;
    for path in &args.out {
        let is_json = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("json"));
        taxel_files::write_text(path, &if is_json { certificate.to_json() } else { certificate.to_html()? })?;
        say!("certificate {} of {}: {}", certificate.number(), evidence.set.id, path.display());
    }
    Ok(())
}

fn of_daemon(args: &CertificateArgs, stated: Stated) -> anyhow::Result<Evidence> {
    ask(&args.server, async |daemon| {
        let models = daemon.export_set(args.model_set.as_deref().unwrap_or_default()).await?;
        let set = taxel_store::models_json::from_json(&models)?;
        let number = set.certifying_session().map_err(anyhow::Error::msg)?;
        let session = daemon.session(number).await?;
        if session.patch != set.patch {
            bail!("{} is of session {number} of patch {}, which this daemon does not have", set.id, set.patch);
        }
        let samples = daemon.samples(number).await?;
        let loads = daemon.loads(&set.patch).await?;
        let skin = daemon.skin(&set.patch).await?;
        Ok(Evidence::of(models, samples, stated)?.with(session, loads, &skin))
    })
}
