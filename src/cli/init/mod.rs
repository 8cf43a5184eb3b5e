//! `pliant init`: from a model and its logs to a scene that can be diagnosed.

mod advice;
mod clock;
mod draft;
mod drives;
mod log;
mod matching;
mod names;
mod stops;
mod units;

use super::failure::Failure;
use super::{diagnose, file, print};
use draft::Draft;
use log::Log;
use std::io::Write;
use std::path::PathBuf;

#[derive(clap::Args)]
pub struct Arguments {
    /// Model: URDF, MJCF, or a scene without an [experiment] (.toml).
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Logs (.csv) of one run each, to be fitted: `--log run*.csv`, or given several times.
    #[arg(long = "log", value_name = "FILE.csv", required = true, num_args = 1..)]
    logs: Vec<PathBuf>,
    /// Logs that only judge; may be given several times. Without them the last of several logs is held out.
    #[arg(long = "held-out", value_name = "FILE.csv", num_args = 1..)]
    held_out: Vec<PathBuf>,
    /// Column to read as if it were not there; may be given several times.
    #[arg(long = "leave-out", value_name = "COLUMN")]
    leave_out: Vec<String>,
    /// Folder for the scene, `scene.toml`.
    #[arg(long, value_name = "DIR", default_value = "diagnosis")]
    out: PathBuf,
    /// Replace a scene that is there.
    #[arg(long)]
    force: bool,
    /// Diagnose at once; the report goes to `report` in the folder.
    #[arg(long)]
    run: bool,
}

/// Writes the scene, says what was assumed, and diagnoses it if wanted.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let path = arguments.out.join("scene.toml");
    if path.exists() && !arguments.force {
        return Err(Failure::Init {
            place: path.display().to_string(),
            what: "is there already".to_owned(),
            cause: "an earlier `pliant init`, or a scene of your own",
            fix: "choose another folder with `--out`, or replace it with `--force`".to_owned(),
        });
    }
    let logs = logs(arguments)?;
    let mut draft = Draft::new(&arguments.model, &logs, &arguments.out)?;
    draft.check(&path, &logs)?;
    std::fs::create_dir_all(&arguments.out).map_err(|error| Failure::write(&arguments.out, error))?;
    file::write(&path, |file| file.write_all(draft.text.as_bytes()))?;
    let next = format!("pliant diagnose {} --out {}", path.display(), arguments.out.join("report").display());
    draft.assumed.push(match arguments.run {
        true => format!("wrote {}", path.display()),
        false => format!("wrote {}\nnext: {next}", path.display()),
    });
    print::data(&draft.assumed.join("\n"))?;
    if arguments.run { diagnose::of_scene(&path, &arguments.out.join("report")) } else { Ok(()) }
}

/// All logs: those to be fitted, then those that judge.
fn logs(arguments: &Arguments) -> Result<Vec<Log>, Failure> {
    let read = |path: &PathBuf| Log::read(path, &arguments.leave_out);
    let mut all: Vec<Log> = arguments.logs.iter().chain(&arguments.held_out).map(read).collect::<Result<_, _>>()?;
    let is_there = |name: &&String| all.iter().any(|log| log.without.contains(name));
    if let Some(name) = arguments.leave_out.iter().find(|name| !is_there(name)) {
        return Err(Failure::Init {
            place: all[0].path.display().to_string(),
            what: format!("no log has a column `{name}` to leave out; there are {}", all[0].header.join(", ")),
            cause: "a typing error in `--leave-out`",
            fix: "write the name as the header has it, in quotation marks if it has a space".to_owned(),
        });
    }
    let fitted = match arguments.held_out.is_empty() && all.len() > 1 {
        true => all.len() - 1,
        false => arguments.logs.len(),
    };
    all.iter_mut().skip(fitted).for_each(|log| log.held_out = true);
    Ok(all)
}
