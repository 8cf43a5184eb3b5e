//! `pliant schema`.

use super::failure::Failure;
use super::print;
use clap::ValueEnum;
use pliant::control::task::Task;
use pliant::identify::journal::Partial;
use pliant::identify::log::Experiment;
use pliant::identify::{Diagnosis, FitReport};
use pliant::scene::json_schema;

#[derive(clap::Args)]
pub struct Arguments {
    /// The format to describe.
    #[arg(value_enum, default_value_t = Subject::Scene)]
    subject: Subject,
}

#[derive(Clone, Copy, ValueEnum)]
enum Subject {
    /// Scene files, their [experiment] included.
    Scene,
    /// Task files of `pliant plan` and `pliant mpc`.
    Task,
    /// Output of `pliant diagnose --json`.
    Diagnosis,
    /// The file `progress.json` of a diagnosis that is not finished.
    Progress,
    /// Output of `pliant fit --json`.
    Fit,
}

/// Prints a JSON Schema.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    match arguments.subject {
        Subject::Scene => print::json(&json_schema::<Experiment>()),
        Subject::Task => print::json(&schemars::schema_for!(Task)),
        Subject::Diagnosis => print::json(&schemars::schema_for!(Diagnosis)),
        Subject::Progress => print::json(&schemars::schema_for!(Partial)),
        Subject::Fit => print::json(&schemars::schema_for!(FitReport)),
    }
}
