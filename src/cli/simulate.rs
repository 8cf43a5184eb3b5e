//! `pliant simulate`.

use super::failure::Failure;
use super::{file, print, trajectory, view};
use pliant::{Case, Rollout, StepOptions, rollout};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

#[derive(clap::Args)]
pub struct Arguments {
    /// Scene file (TOML).
    scene: PathBuf,
    /// File for positions and velocities of all nodes, .csv or .npz; without it nothing is written.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Page with a 3-D view of the run, .html; it needs no network.
    #[arg(long, value_name = "FILE.html")]
    view: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Output of `--json`.
#[derive(Serialize)]
struct Summary<'a> {
    schema_version: u32,
    scene: String,
    /// Steps taken, and the length of each [s].
    steps: usize,
    step_s: f64,
    newton_iterations: usize,
    factorizations: usize,
    /// Halvings of steps.
    retries: usize,
    /// Time the steps took [s].
    wall_s: f64,
    /// Total energy [J] of every state, the initial one first.
    energy: &'a [f64],
    out: Option<String>,
    view: Option<String>,
}

/// Simulates a scene.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    if let Some(out) = &arguments.out {
        trajectory::check_kind(out)?;
        file::check(out)?;
    }
    if let Some(page) = &arguments.view {
        view::check_kind(page)?;
        file::check(page)?;
    }
    let case = Case::read(&arguments.scene).map_err(|error| Failure::case(&arguments.scene, error))?;
    case.warnings.iter().for_each(|warning| print::message(&format!("warning: {warning}")));
    let theta = case.model.params().values();
    let options = StepOptions { record: false, ..StepOptions::default() };
    let begin = Instant::now();
    let run =
        rollout(&case.model, theta, &case.x0, &case.controls, options).map_err(|error| Failure::step(&arguments.scene, error))?;
    let wall_s = begin.elapsed().as_secs_f64();
    let energy = run.energy();
    if let Some(out) = &arguments.out {
        trajectory::write(out, &run, &energy)?;
    }
    if let Some(page) = &arguments.view {
        view::write(page, &arguments.scene, &run)?;
    }
    let work = run.work();
    let summary = Summary {
        schema_version: 1,
        scene: arguments.scene.display().to_string(),
        steps: run.controls.len(),
        step_s: case.model.step_length(),
        newton_iterations: work.iterations,
        factorizations: work.factorizations,
        retries: run.retries(),
        wall_s,
        energy: &energy,
        out: arguments.out.as_ref().map(|out| out.display().to_string()),
        view: arguments.view.as_ref().map(|page| page.display().to_string()),
    };
    if arguments.json { print::json(&summary) } else { print::data(&text(&summary, &run)) }
}

fn text(summary: &Summary, run: &Rollout) -> String {
    let steps = summary.steps.max(1) as f64;
    let (first, last) = (summary.energy[0], summary.energy[summary.energy.len() - 1]);
    let nodes: usize = run.model.node_spans().map(|(_, nodes)| nodes.len()).sum();
    let mut out = format!(
        "{}: {nodes} nodes, {} steps of {} s in {:.3} s ({:.1} µs per step)\n\
         Newton iterations {} ({:.2} per step), factorizations {}, halved steps {}\n\
         energy {first:.6} J -> {last:.6} J",
        summary.scene,
        summary.steps,
        summary.step_s,
        summary.wall_s,
        1e6 * summary.wall_s / steps,
        summary.newton_iterations,
        summary.newton_iterations as f64 / steps,
        summary.factorizations,
        summary.retries,
    );
    for path in summary.out.iter().chain(&summary.view) {
        out += &format!("\nwrote {path}");
    }
    out
}
