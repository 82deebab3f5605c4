//! `taxeld certificate`: the calibration certificate of a model set.

use std::path::{Path, PathBuf};

use taxel_proto::v1::{Certificate, GetCertificateRequest};

use super::connect::Server;
use super::failure::Outcome;
use super::use_set::full_id;
use crate::files;
use crate::output;

/// The calibration certificate of a model set: of a running daemon, or of a store.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld certificate --out certificate.html                # of the active set\n  taxeld certificate m-26dc --out c.html --out c.json\n  taxeld certificate newest --config /etc/taxeld/taxeld.toml --out c.html   # no daemon runs\nHow each number is defined is in crates/taxeld/doc/certificate.md; deploy/certificate.py recomputes them."
)]
pub struct CertificateArgs {
    #[command(flatten)]
    server: Server,
    /// Id of the set, its beginning or `newest` [default: the active one].
    #[arg(value_name = "MODEL_SET")]
    model_set: Option<String>,
    /// Where it goes: JSON if the name ends with .json, else a page to be printed. May be given several times; `-` is the
    /// standard output.
    #[arg(long, value_name = "FILE", required_unless_present = "json")]
    out: Vec<PathBuf>,
    /// Print the certificate as JSON.
    #[arg(long)]
    json: bool,
    /// Ask no daemon, but read the store of this configuration.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

/// Runs it.
///
/// # Errors
/// Refused with the daemon's reason, no daemon, a store that cannot be read, or a file that cannot be written.
pub async fn certificate(args: CertificateArgs) -> Outcome {
    let made = match &args.config {
        Some(config) => offline(config, &args)?,
        None => {
            let daemon = args.server.connect().await?;
            let model_set = match &args.model_set {
                Some(beginning) => full_id(&daemon, beginning).await?,
                None => String::new(),
            };
            let request = GetCertificateRequest { model_set, patch: daemon.patch() };
            daemon.models().get_certificate(request).await?.into_inner()
        }
    };
    for path in &args.out {
        let is_json = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("json"));
        output::write_text(path, if is_json { &made.json } else { &made.html })?;
        if !files::is_standard(path) {
            say!("certificate {} of {}: {}", made.number, made.model_set, path.display());
        }
    }
    if args.json {
        output::write_text(Path::new("-"), &made.json)?;
    }
    Ok(())
}

#[cfg(feature = "certificate")]
fn offline(config: &Path, args: &CertificateArgs) -> Outcome<Certificate> {
    let (file, scene) = crate::config::examine(config).map_err(anyhow::Error::from)?;
    let wanted = (args.model_set.as_deref(), args.server.patch());
    let (model_set, made) = crate::certificate::of_store(&file, &scene, wanted)?;
    let taxel_rpc::MadeCertificate { number, json, html } = made;
    Ok(Certificate { model_set, number, json, html })
}

#[cfg(not(feature = "certificate"))]
fn offline(_: &Path, _: &CertificateArgs) -> Outcome<Certificate> {
    Err(super::failure::Failure::refused("this build makes no certificates (cargo feature `certificate`)"))
}
