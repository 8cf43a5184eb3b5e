//! `pliant diagnose`.

use super::failure::Failure;
use super::progress::Progress;
use super::{example, print, threads};
use pliant::identify::log::{Logs, Setup};
use pliant::identify::report::{Provenance, check_folder, summary, write_report};
use pliant::identify::{DiagnoseOptions, Diagnosis, diagnose};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Arguments {
    /// Scene file (TOML) with an [experiment]; without it, the built-in example is diagnosed.
    scene: Option<PathBuf>,
    /// Log file (.csv or .npz) beyond those the scene names; may be given several times.
    #[arg(long = "log", value_name = "FILE", requires = "scene")]
    logs: Vec<PathBuf>,
    /// Folder for the report; an older report there is replaced.
    #[arg(long, value_name = "DIR", default_value = "report")]
    out: PathBuf,
    /// Print the diagnosis as one JSON object.
    #[arg(long)]
    json: bool,
    /// Seed of bootstraps and permutations.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    seed: u64,
    /// Number of threads; by default one per core. The numbers do not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
}

/// Diagnoses a scene, writes the report and prints its summary.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    check_folder(&arguments.out)?;
    let threads = threads::set(arguments.threads);
    let mut provenance =
        Provenance { command: command(), seed: arguments.seed, threads, logs: arguments.logs.clone(), ..Provenance::default() };
    // The folder of the example lives as long as this.
    let (setup, _folder) = match &arguments.scene {
        Some(scene) => (Setup::read(scene)?, None),
        None => {
            provenance.example = example::files();
            let folder = example::unpack()?;
            (example::setup(folder.path())?, Some(folder))
        }
    };
    let logs = setup.read_logs(&arguments.logs)?;
    let scene = arguments.scene.as_deref().unwrap_or(Path::new(example::SCENE));
    let diagnosis = analyse(scene, &setup, &logs, arguments.seed)?;
    write_report(&arguments.out, &diagnosis, &setup, &provenance.hash(&setup)?)?;
    if arguments.json {
        return print::json(&diagnosis);
    }
    print::data(&format!("{}\nreport: {}", summary(&diagnosis), arguments.out.join("report.html").display()))
}

/// Diagnoses a scene with default settings.
pub fn of_scene(scene: &Path, out: &Path) -> Result<(), Failure> {
    let (scene, out) = (Some(scene.to_owned()), out.to_owned());
    run(&Arguments { scene, logs: Vec::new(), out, json: false, seed: 0, threads: None })
}

fn analyse(scene: &Path, setup: &Setup, logs: &Logs, seed: u64) -> Result<Diagnosis, Failure> {
    let mut progress = Progress::start();
    let options = DiagnoseOptions { seed, ..DiagnoseOptions::default() };
    diagnose(setup, logs, &options, &mut |what| progress.tell(what)).map_err(|error| Failure::identify(scene, error))
}

/// The command as it was given, the program by its name alone.
fn command() -> Vec<String> {
    let given = std::env::args_os().skip(1).map(|argument| argument.to_string_lossy().into_owned());
    std::iter::once("pliant".to_owned()).chain(given).collect()
}
