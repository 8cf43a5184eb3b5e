//! `pliant diagnose`.

use super::failure::Failure;
use super::progress::Progress;
use super::{example, print, threads};
use pliant::identify::journal::{Begun, Journal};
use pliant::identify::log::{Logs, Setup};
use pliant::identify::report::{InputFile, Provenance, check_folder, summary, write_report};
use pliant::identify::{DiagnoseOptions, Diagnosis, diagnose_kept};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

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

/// Diagnoses a scene, writes the report and prints its summary. Interrupted, it goes on where it was when it is given again.
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
    let provenance = provenance.hash(&setup)?;
    let diagnosis = analyse(scene, &setup, &logs, &provenance, &arguments.out)?;
    write_report(&arguments.out, &diagnosis, &setup, &provenance)?;
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

/// Diagnoses a scene; what it has finished lies in the folder of the report until that is written.
fn analyse(scene: &Path, setup: &Setup, logs: &Logs, provenance: &Provenance, out: &Path) -> Result<Diagnosis, Failure> {
    let progress = Arc::new(Progress::start());
    let options = DiagnoseOptions { seed: provenance.seed, ..DiagnoseOptions::default() };
    let told = Arc::clone(&progress);
    let inputs = inputs(setup, provenance, &options);
    let (journal, begun) = Journal::at(out, inputs, Box::new(move |line| told.tell(line)));
    if begun != Begun::Anew {
        progress.note(&begun.to_string());
    }
    progress.note("may be interrupted (Ctrl-C): the same command then goes on from what is finished");
    // an error comes again with the same inputs, and nothing is to be kept for it
    diagnose_kept(setup, logs, &options, &journal).map_err(|error| {
        journal.remove();
        Failure::identify(scene, error)
    })
}

/// Name and hash of everything that a diagnosis depends on.
fn inputs(setup: &Setup, provenance: &Provenance, options: &DiagnoseOptions) -> BTreeMap<String, String> {
    let files = provenance.files.iter().map(|file| (file.path.clone(), file.fnv1a64.clone()));
    // with the meshes that it names
    let read = ("the scene as it is read".to_owned(), hash(&format!("{:?}", setup.scene)));
    let options = ("the options".to_owned(), format!("{options:?}"));
    files.chain([read, options, ("the program".to_owned(), program())]).collect()
}

fn hash(text: &str) -> String {
    InputFile::new(String::new(), text.as_bytes()).fnv1a64
}

/// The version of the program, and when its file was made: a build of other sources may have the same version.
fn program() -> String {
    let file = std::env::current_exe().and_then(std::fs::metadata);
    let made = file.and_then(|file| Ok((file.len(), file.modified()?)));
    format!("pliant {} {}", env!("CARGO_PKG_VERSION"), hash(&format!("{:?}", made.ok())))
}

/// The command as it was given, the program by its name alone.
fn command() -> Vec<String> {
    let given = std::env::args_os().skip(1).map(|argument| argument.to_string_lossy().into_owned());
    std::iter::once("pliant".to_owned()).chain(given).collect()
}
