//! `pliant mpc`.

use super::failure::Failure;
use super::outputs::Outputs;
use super::progress::Progress;
use super::{inputs, numbers, print, violations};
use pliant::control::closed_loop::{Controller, Decision, LoopOptions, LoopRun, LoopStep, ModelPlant, Score, run_loop, score};
use pliant::control::mpc::Mpc;
use pliant::control::output::{OutputMpc, OutputOptions};
use pliant::control::plan::{Annealing, PlanOptions, PlanStatus};
use pliant::control::robust::{RobustError, RobustMpc, TubeOptions, ball_of_free_nodes};
use pliant::control::sensing::Sensors;
use pliant::scene::MOST_STEPS;
use pliant::{Case, Model, Rollout, State, TaskCase};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Failures of the controller in a row that end a run.
const FAILURES: usize = 3;

/// The course of a loop, for the help.
const LOOP: &str = "At every step the controller improves its plan from the state of the plant, and the plan's first inputs are applied. \
If it fails, those that the last plan has for this step are applied; three failures in a row end the run with exit code 1. \
If the task has a section `sensing`, the plant gives readings of these sensors, late and with noise, and the controller estimates the state.";

#[derive(clap::Args)]
#[command(after_help = LOOP, allow_negative_numbers = true)]
pub struct Arguments {
    /// Task file (TOML), beside its scene.
    task: PathBuf,
    /// Steps of the loop; by default those of the task.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=MOST_STEPS as i64))]
    steps: Option<u32>,
    /// Steps that the controller looks ahead; by default the task's `horizon`, or else its `steps`.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=MOST_STEPS as i64))]
    horizon: Option<u32>,
    /// Gauss-Newton steps of an update, at most.
    #[arg(long, value_name = "N", default_value_t = 1)]
    iterations: usize,
    /// Take derivatives of contact smoothed to this rest gap [m] at first, and of the scene's own where no step helps any more; an update
    /// goes through both if its iterations suffice.
    #[arg(long, value_name = "M", value_parser = numbers::positive)]
    rest_gap: Option<f64>,
    /// Scene (TOML) of the plant, with the states and inputs of the task's; without it, the task's own.
    #[arg(long, value_name = "SCENE.toml")]
    plant: Option<PathBuf>,
    /// Displace the plant's free nodes after every step, by a random vector from the ball of this radius [m].
    #[arg(long, value_name = "M", value_parser = numbers::not_negative)]
    disturbance: Option<f64>,
    /// Seed of the disturbance and of the readings' noise.
    #[arg(long, value_name = "N", default_value_t = 0, requires = "disturbance")]
    seed: u64,
    /// Tighten the constraints by the tube of disturbances of that radius, and of what the task's sensors do not tell.
    #[arg(long, requires = "disturbance")]
    tubes: bool,
    #[command(flatten)]
    outputs: Outputs,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Output of `--json`.
#[derive(Serialize)]
struct Summary<'a> {
    schema_version: u32,
    task: String,
    /// Scene of the plant.
    plant: String,
    /// Steps of the loop, the length of each [s], and steps that the controller looks ahead.
    steps: usize,
    step_s: f64,
    horizon: usize,
    /// Radius of the disturbances [m], and the seed of them and of noise.
    disturbance: Option<f64>,
    seed: Option<u64>,
    tubes: bool,
    /// Numbers of a reading and their delay in steps; null where the state is known.
    readings: Option<usize>,
    delay: Option<usize>,
    /// Cost of the whole loop, of each of its stages, and of the last one, which is its end.
    cost: f64,
    stage_costs: &'a [f64],
    final_stage_cost: f64,
    /// All constraints that are violated by more than 1e-9 of their unit, the largest first; `stage` is the number of steps before.
    violations: Vec<Violated<'a>>,
    /// Time of an update [s].
    update_s: Times,
    /// Updates that found no better plan, and those that failed.
    stalled: usize,
    failed: Vec<Failed>,
    /// Each update.
    updates: Vec<Updated>,
    out: Option<String>,
    inputs: Option<String>,
    view: Option<String>,
}

#[derive(Serialize)]
struct Violated<'a> {
    stage: usize,
    constraint: &'a str,
    by: f64,
}

#[derive(Clone, Copy, Serialize)]
struct Times {
    mean: f64,
    p95: f64,
    worst: f64,
}

#[derive(Serialize)]
struct Failed {
    step: usize,
    error: String,
}

/// An update; cost and what follows are of its plan, null where it failed.
#[derive(Serialize)]
struct Updated {
    time_s: f64,
    status: &'static str,
    cost: Option<f64>,
    penalty: Option<f64>,
    rollouts: Option<usize>,
    violations: Option<usize>,
    /// With tubes: the largest tightening of a constraint, constraints that the tube reaches beyond, and steps of the plan in which a
    /// gripper seizes or lets go, through which it is not valid.
    tightening: Option<f64>,
    tube_violations: Option<usize>,
    switches: Option<Vec<usize>>,
}

/// A closed loop with what it came to.
struct Looped {
    run: Rollout,
    steps: Vec<LoopStep>,
    score: Score,
}

/// Runs a task in closed loop.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    arguments.outputs.check()?;
    let case = TaskCase::read(&arguments.task).map_err(|error| Failure::case(&arguments.task, error))?;
    let other = arguments.plant.as_deref().map(|path| read_plant(path, &case.case.model)).transpose()?;
    let plant = other.as_ref().unwrap_or(&case.case);
    case.case.warnings.iter().for_each(|warning| print::message(&format!("warning: {warning}")));
    let horizon = arguments.horizon.map_or(case.task.horizon.unwrap_or(case.task.steps), |horizon| horizon as usize);
    let steps = arguments.steps.map_or(case.task.steps, |steps| steps as usize);
    let mut controller = controller(arguments, &case, horizon).map_err(|error| Failure::controller(&arguments.task, error))?;
    let looped = close(arguments, &case, plant, controller.as_mut(), steps)?;
    let of_task = arguments.task.parent().unwrap_or(Path::new("")).join(&case.task.scene);
    let scene = arguments.plant.clone().unwrap_or(of_task);
    arguments.outputs.write(&looped.run, &scene, &inputs::names(&plant.scene))?;
    let violated = looped.score.violations.len();
    if arguments.json && violated > 0 {
        print::message(&format!("warning: the closed loop violates {violated} constraint(s)"));
    }
    let summary = summary(arguments, case.problem.sensors(), &scene, horizon, &looped);
    if arguments.json { print::json(&summary) } else { print::data(&text(&summary, &arguments.outputs)) }
}

/// Reads the scene of a plant whose states, inputs and steps are those of `model`.
fn read_plant(path: &Path, model: &Model) -> Result<Case, Failure> {
    let plant = Case::read(path).map_err(|error| Failure::case(path, error))?;
    let other = &plant.model;
    for (what, own, its) in [
        ("numbers of state (nx)", model.nx(), other.nx()),
        ("inputs (nu)", model.nu(), other.nu()),
        ("positions (nq)", model.nq(), other.nq()),
        ("velocities (nv)", model.nv(), other.nv()),
    ] {
        if own != its {
            let what = format!("the plant has {its} {what}, but the task's scene has {own}");
            return Err(Failure::Plant { plant: path.to_owned(), what });
        }
    }
    let (own, its) = (model.step_length(), other.step_length());
    if own.to_bits() != its.to_bits() {
        let what = format!("the plant's `time.step` is {its} s, but that of the task's scene is {own} s");
        return Err(Failure::Plant { plant: path.to_owned(), what });
    }
    Ok(plant)
}

fn controller(arguments: &Arguments, case: &TaskCase, horizon: usize) -> Result<Box<dyn Controller>, RobustError> {
    let smoothing = arguments.rest_gap.map(Annealing::from_gap);
    let options = PlanOptions { iterations: arguments.iterations, smoothing, ..PlanOptions::default() };
    let (model, guess) = (&case.case.model, case.first_guess(horizon));
    let theta = model.params().values();
    let problem = case.problem.clone();
    let mut tubes = TubeOptions::of_ball(model, arguments.disturbance.unwrap_or(0.0));
    if let (Some(sensors), Some(sensing)) = (problem.sensors().cloned(), &case.task.sensing) {
        tubes.initial = ball_of_free_nodes(model, sensing.initial);
        let options_of_output = OutputOptions { sensors, tubes, tighten: arguments.tubes };
        let (x0, options) = (&case.case.x0, options);
        return Ok(Box::new(OutputMpc::new(problem, model, theta, x0, guess, options, options_of_output)?));
    }
    Ok(if arguments.tubes {
        Box::new(RobustMpc::new(problem, model, theta, guess, options, tubes)?)
    } else {
        Box::new(Mpc::new(problem, model, theta, guess, options)?)
    })
}

/// Runs the loop; the states after its steps are the plant's own.
fn close(
    arguments: &Arguments,
    case: &TaskCase,
    of_plant: &Case,
    controller: &mut dyn Controller,
    steps: usize,
) -> Result<Looped, Failure> {
    let (model, theta) = (&of_plant.model, of_plant.model.params().values());
    let scene = arguments.plant.as_deref().unwrap_or(&arguments.task);
    let mut plant = ModelPlant::new(model, theta, &of_plant.x0).map_err(|error| Failure::step(scene, error))?;
    if let Some(radius) = arguments.disturbance {
        plant = plant.disturbed(radius, arguments.seed);
    }
    if let Some(sensors) = case.problem.sensors() {
        plant = plant.read_by(sensors.clone(), arguments.seed);
    }
    let progress = Progress::start();
    // a simulation that fails once fails again from the same state
    let options = LoopOptions { steps, silence: 0, failures: FAILURES };
    let LoopRun { steps, end } = run_loop(controller, &mut plant, options, &mut |k, step| {
        let said = match (&step.decision, &step.failure) {
            (Some(Decision { cost, .. }), _) => format!("cost of the plan {cost:.4e}"),
            (None, Some(error)) => format!("no update, inputs are held: {error}"),
            (None, None) => "inputs are held".to_owned(),
        };
        progress.tell(&format!("step {} of {}: {said}", k + 1, options.steps));
    })
    .map_err(|error| Failure::looped(&arguments.task, error))?;
    drop(progress);
    let states: Vec<State> = steps.iter().filter_map(|step| step.state.clone()).chain(end).collect();
    let controls: Vec<Vec<f64>> = steps.iter().map(|step| step.inputs.clone()).collect();
    let mut score = score(&case.problem, &states, &controls).map_err(|error| Failure::plan(&arguments.task, error))?;
    score.violations.retain(|v| v.by > violations::ROUNDING);
    let run = Rollout {
        model: model.clone(),
        theta: theta.to_vec(),
        states,
        controls,
        traces: Vec::new(),
        records: Vec::new(),
        checkpoints: None,
    };
    Ok(Looped { run, steps, score })
}

fn summary<'a>(
    arguments: &Arguments,
    sensors: Option<&Sensors>,
    scene: &Path,
    horizon: usize,
    looped: &'a Looped,
) -> Summary<'a> {
    let [out, inputs, view] = arguments.outputs.names();
    let Looped { run, steps, score } = looped;
    let stalled = |step: &&LoopStep| step.decision.as_ref().is_some_and(|d| d.status == PlanStatus::Stalled);
    let failed = |(k, step): (usize, &LoopStep)| step.failure.as_ref().map(|e| Failed { step: k, error: e.to_string() });
    Summary {
        schema_version: 1,
        task: arguments.task.display().to_string(),
        plant: scene.display().to_string(),
        steps: steps.len(),
        step_s: run.model.step_length(),
        horizon,
        disturbance: arguments.disturbance,
        seed: (arguments.disturbance.is_some() || sensors.is_some()).then_some(arguments.seed),
        tubes: arguments.tubes,
        readings: sensors.map(|sensors| sensors.len(&run.model)),
        delay: sensors.map(|sensors| sensors.delay),
        cost: score.stage_costs.iter().sum(),
        stage_costs: &score.stage_costs,
        final_stage_cost: score.stage_costs.last().copied().unwrap_or(0.0),
        violations: score.violations.iter().map(|v| Violated { stage: v.stage, constraint: &v.constraint, by: v.by }).collect(),
        update_s: times(steps.iter().map(|step| step.time).collect()),
        stalled: steps.iter().filter(stalled).count(),
        failed: steps.iter().enumerate().filter_map(failed).collect(),
        updates: steps.iter().map(updated).collect(),
        out,
        inputs,
        view,
    }
}

fn updated(step: &LoopStep) -> Updated {
    let decision = step.decision.as_ref();
    let reach = decision.and_then(|d| d.reach.as_ref());
    Updated {
        time_s: step.time.as_secs_f64(),
        status: decision.map_or("failed", |d| d.status.word()),
        cost: decision.map(|d| d.cost),
        penalty: decision.map(|d| d.penalty),
        rollouts: decision.map(|d| 1 + d.steps.iter().map(|step| step.rollouts).sum::<usize>()),
        violations: decision.map(|d| d.violations.len()),
        tightening: reach.map(|r| r.tightening),
        tube_violations: reach.map(|r| r.violations.len()),
        switches: reach.map(|r| r.switches.clone()),
    }
}

/// Mean, 95 % quantile (the least time that 95 % do not exceed) and the longest.
fn times(mut times: Vec<Duration>) -> Times {
    times.sort();
    let seconds = |k: usize| times.get(k).map_or(0.0, Duration::as_secs_f64);
    let n = times.len();
    let mean = times.iter().map(Duration::as_secs_f64).sum::<f64>() / n.max(1) as f64;
    Times { mean, p95: seconds((19 * n).div_ceil(20).saturating_sub(1)), worst: seconds(n.saturating_sub(1)) }
}

fn text(summary: &Summary, outputs: &Outputs) -> String {
    let Times { mean, p95, worst } = summary.update_s;
    let disturbed = match (summary.disturbance, summary.seed) {
        (Some(radius), Some(seed)) => format!(", disturbed by up to {radius} m a step (seed {seed})"),
        _ => String::new(),
    };
    let read = match (summary.readings, summary.delay) {
        (Some(readings), Some(delay)) => format!(", from readings of {readings} numbers {delay} step(s) late"),
        _ => String::new(),
    };
    let mut out = format!(
        "{}: {} steps of {} s in closed loop, {} ahead{}{read}{disturbed}\n\
         cost {:.6}, of the end alone {:.6}\n\
         an update takes {:.2} ms in the mean, 95 % at most {:.2} ms, the longest {:.2} ms; {} stalled, {} failed",
        summary.task,
        summary.steps,
        summary.step_s,
        summary.horizon,
        if summary.tubes { " with tubes" } else { "" },
        summary.cost,
        summary.final_stage_cost,
        1e3 * mean,
        1e3 * p95,
        1e3 * worst,
        summary.stalled,
        summary.failed.len(),
    );
    for Failed { step, error } in &summary.failed {
        out += &format!("\nno update at step {step}, inputs were held: {error}");
    }
    if summary.tubes {
        let beyond = summary.updates.iter().filter(|u| u.tube_violations.is_some_and(|n| n > 0)).count();
        let most = summary.updates.iter().filter_map(|u| u.tightening).fold(0.0, f64::max);
        out += &format!("\ntubes tighten by at most {most:.3e}; {beyond} of them reach beyond a constraint");
    }
    out += "\n";
    out += &violations::text("the closed loop", summary.violations.iter().map(|v| (v.by, v.constraint)));
    out + &outputs.lines()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_times_that_were_measured() {
        let of = |n: u64| times((1..=n).rev().map(Duration::from_millis).collect());
        let ms = |t: Times| [t.mean, t.p95, t.worst].map(|s| (1e3 * s * 1e6).round() / 1e6);
        assert_eq!(ms(of(100)), [50.5, 95.0, 100.0]);
        assert_eq!(ms(of(20)), [10.5, 19.0, 20.0]);
        assert_eq!(ms(of(3)), [2.0, 3.0, 3.0]);
        assert_eq!(ms(times(Vec::new())), [0.0; 3]);
    }
}
