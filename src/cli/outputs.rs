//! Files that a motion is written to.

use super::failure::Failure;
use super::{file, inputs, trajectory, view};
use pliant::Rollout;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Outputs {
    /// File for positions and velocities of all nodes, .csv or .npz; without it nothing is written.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// File for the inputs, .csv: a column `t` [s], the time at which a step begins, and one per input by its name.
    #[arg(long, value_name = "FILE.csv")]
    inputs: Option<PathBuf>,
    /// Page with a 3-D view of the motion, .html; it needs no network.
    #[arg(long, value_name = "FILE.html")]
    view: Option<PathBuf>,
}

impl Outputs {
    /// Refuses files of another kind, and places that cannot be written to, before anything is computed.
    pub fn check(&self) -> Result<(), Failure> {
        self.out.iter().try_for_each(|path| trajectory::check_kind(path))?;
        self.inputs.iter().try_for_each(|path| inputs::check_kind(path))?;
        self.view.iter().try_for_each(|path| view::check_kind(path))?;
        self.out.iter().chain(&self.inputs).chain(&self.view).try_for_each(|path| file::check(path))
    }

    /// Writes a motion of a scene, whose inputs have these names.
    pub fn write(&self, run: &Rollout, scene: &Path, names: &[String]) -> Result<(), Failure> {
        if let Some(out) = &self.out {
            trajectory::write(out, run, &run.energy())?;
        }
        if let Some(path) = &self.inputs {
            inputs::write(path, names, run.model.step_length(), &run.controls)?;
        }
        self.view.iter().try_for_each(|page| view::write(page, scene, run))
    }

    /// Their names, for `--json`: trajectory, inputs, page.
    pub fn names(&self) -> [Option<String>; 3] {
        [&self.out, &self.inputs, &self.view].map(|path| path.as_ref().map(|path| path.display().to_string()))
    }

    /// A line for each.
    pub fn lines(&self) -> String {
        self.names().iter().flatten().map(|path| format!("\nwrote {path}")).collect()
    }
}
