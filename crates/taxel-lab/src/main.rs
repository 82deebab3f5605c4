//! taxel-lab: fits recordings, compares and certifies calibrations, draws the paper's figures and the report.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use taxel_files::say::error_line;
use taxel_lab::{apply, certificate, compare, fit, paper, report};

/// What is done at a desk with recordings, exported sessions and the model sets of taxeld.
///
/// The robot needs none of it. `taxel-lab COMMAND --help` has examples.
#[derive(Debug, Parser)]
#[command(name = "taxel-lab", version)]
struct Cli {
    #[command(subcommand)]
    command: Commands,
}

#[derive(Debug, Subcommand)]
enum Commands {
    /// Fits models to a recording and writes MODELS.json.
    Fit(fit::FitArgs),
    /// Turns the counts of a recording into pressures, and says how right they are where it has a gauge.
    Apply(apply::ApplyArgs),
    /// What changed from one model set to another.
    Compare(compare::CompareArgs),
    /// The calibration certificate of a model set.
    Certificate(certificate::CertificateArgs),
    /// Every figure and table of the paper that a recording, or the simulator, can draw.
    Paper(paper::PaperArgs),
    /// Error against run time, the stability table and what a configuration costs, as one page.
    Report(report::ReportArgs),
}

fn main() -> ExitCode {
    let done = match Cli::parse().command {
        Commands::Fit(args) => fit::fit(&args),
        Commands::Apply(args) => apply::apply(&args),
        Commands::Compare(args) => compare::compare(&args),
        Commands::Certificate(args) => certificate::certificate(&args),
        Commands::Paper(args) => paper::paper(&args),
        Commands::Report(args) => report::report(&args),
    };
    if let Err(error) = done {
        error_line(format_args!("taxel-lab: {error:#}"));
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}
