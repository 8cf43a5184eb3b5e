//! `pliant fit`.

use super::failure::Failure;
use super::progress::Progress;
use super::{print, threads};
use pliant::identify::fit_scene;
use pliant::identify::log::Setup;
use std::path::PathBuf;

/// Paths of free parameters, for the help.
const FREE: &str = "Free parameters are listed in [experiment.fit] of the scene: any path of the model (cable.bend_stiffness), a pattern \
that ties several (cable.node[*].mass), and those of the markers' sensor: sensor.bias[0] to [2] [m], sensor.scale [-], \
sensor.rotation[0] to [2] [rad], sensor.time_offset [s]. Known errors of the sensor are given in [experiment.sensor].";

#[derive(clap::Args)]
#[command(after_help = FREE)]
pub struct Arguments {
    /// Scene file (TOML) with an [experiment] that lists free parameters.
    scene: PathBuf,
    /// Log file (.csv or .npz) beyond those the scene names; may be given several times.
    #[arg(long = "log", value_name = "FILE")]
    logs: Vec<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    /// Number of threads; by default one per core. The numbers do not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
}

/// Fits the declared free parameters of a scene.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    threads::set(arguments.threads);
    let setup = Setup::read(&arguments.scene)?;
    let logs = setup.read_logs(&arguments.logs)?;
    let report = {
        let progress = Progress::start();
        fit_scene(&setup, &logs, &mut |what| progress.tell(what)).map_err(|error| Failure::identify(&arguments.scene, error))?
    };
    if arguments.json {
        print::json(&report)?;
    } else {
        print::data(report.to_string().trim_end())?;
    }
    if report.converged {
        return Ok(());
    }
    let iterations = report.iterations;
    Err(Failure::NotPassed(format!("the fit did not converge in {iterations} iterations; its estimates are not to be trusted")))
}
