//! `pliant plan`.

use super::failure::Failure;
use super::outputs::Outputs;
use super::progress::Progress;
use super::{inputs, numbers, print, violations};
use pliant::TaskCase;
use pliant::control::plan::{Annealing, Plan, PlanError, PlanOptions, PlanStatus, PlanStep, Search};
use pliant::control::problem::Problem;
use pliant::scene::MOST_STEPS;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// The parts of a task, for the help.
const TASK: &str = "A task file (TOML) names its scene, costs and limits; `pliant schema task` describes every key. A plan that violates \
constraints is written and reported, with exit code 0: raise their prices, or give more steps. \
Violations up to 1e-9 m or rad count as rounding.";

#[derive(clap::Args)]
#[command(after_help = TASK, allow_negative_numbers = true)]
pub struct Arguments {
    /// Task file (TOML), beside its scene.
    task: PathBuf,
    /// Steps of the plan; by default those of the task.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=MOST_STEPS as i64))]
    steps: Option<u32>,
    /// First guess (CSV): a column per input by its name, a row per step; without it, the motions of the scene.
    #[arg(long, value_name = "FILE.csv")]
    guess: Option<PathBuf>,
    /// Largest number of Gauss-Newton steps.
    #[arg(long, value_name = "N", default_value_t = PlanOptions::default().iterations)]
    iterations: usize,
    /// The plan is done when a step would lower the cost by less than this part of it.
    #[arg(long, value_name = "R", default_value_t = PlanOptions::default().tolerance, value_parser = numbers::not_negative)]
    tolerance: f64,
    /// Time [s] after which no further step is begun; the best plan so far is returned.
    #[arg(long, value_name = "S", value_parser = numbers::positive)]
    time_limit: Option<f64>,
    /// Take derivatives of contact smoothed to this rest gap [m] at first, and of the scene's own at last.
    #[arg(long, value_name = "M", value_parser = numbers::positive)]
    rest_gap: Option<f64>,
    /// Do not draw empty grippers to what is worth holding.
    #[arg(long)]
    no_holding: bool,
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
    scene: String,
    /// Steps of the plan, and the length of each [s].
    steps: usize,
    step_s: f64,
    /// Cost, and price of the violated constraints, of the first guess.
    cost_before: f64,
    penalty_before: f64,
    /// The same of the plan.
    cost: f64,
    penalty: f64,
    /// "converged", "iterations", "time" or "stalled".
    status: &'static str,
    /// Whether the last step was taken with surrogate terms or derivatives.
    surrogate: bool,
    /// All constraints that are violated by more than 1e-9 of their unit, the largest first.
    violations: Vec<Violated<'a>>,
    /// Gauss–Newton steps.
    search: Vec<Step>,
    /// Rollouts, that of the first guess included.
    rollouts: usize,
    /// Time that planning took [s].
    wall_s: f64,
    out: Option<String>,
    inputs: Option<String>,
    view: Option<String>,
}

#[derive(Serialize)]
struct Violated<'a> {
    constraint: &'a str,
    by: f64,
}

#[derive(Serialize)]
struct Step {
    cost: f64,
    penalty: f64,
    predicted: f64,
    achieved: f64,
    damping: f64,
    rollouts: usize,
    approaches: usize,
    rest_gap: Option<f64>,
}

impl From<&PlanStep> for Step {
    fn from(step: &PlanStep) -> Self {
        let PlanStep { cost, penalty, predicted, achieved, damping, rollouts, approaches, rest_gap } = *step;
        Self { cost, penalty, predicted, achieved, damping, rollouts, approaches, rest_gap }
    }
}

/// A plan, and the cost and penalty before and after.
struct Found {
    plan: Plan,
    before: (f64, f64),
    after: (f64, f64),
    time: Duration,
}

/// Plans a task.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    arguments.outputs.check()?;
    let case = TaskCase::read(&arguments.task).map_err(|error| Failure::case(&arguments.task, error))?;
    case.case.warnings.iter().for_each(|warning| print::message(&format!("warning: {warning}")));
    let names = inputs::names(&case.case.scene);
    let steps = arguments.steps.map_or(case.task.steps, |steps| steps as usize);
    let guess = match &arguments.guess {
        Some(path) => {
            let guess = inputs::read(path, &names, steps)?;
            let outside = outside(&case.problem, &guess);
            if outside > 0 {
                print::message(&format!(
                    "note: {}: {outside} inputs lie outside of their limits and are moved to them",
                    path.display()
                ));
            }
            guess
        }
        None => case.first_guess(steps),
    };
    let found = plan(arguments, &case, &guess).map_err(|error| Failure::plan(&arguments.task, error))?;
    let scene = arguments.task.parent().unwrap_or(Path::new("")).join(&case.task.scene);
    arguments.outputs.write(&found.plan.rollout, &scene, &names)?;
    let violated = found.plan.violations.len();
    if arguments.json && violated > 0 {
        print::message(&format!("warning: the plan violates {violated} constraint(s)"));
    }
    let summary = summary(arguments, &scene, &found);
    if arguments.json { print::json(&summary) } else { print::data(&text(&summary, &found, &arguments.outputs)) }
}

/// Inputs of a guess that are outside of their limits.
fn outside(problem: &dyn Problem, guess: &[Vec<f64>]) -> usize {
    let nu = guess.first().map_or(0, Vec::len);
    let (mut lower, mut upper) = (vec![0.0; nu], vec![0.0; nu]);
    let of_step = |(k, row): (usize, &Vec<f64>)| {
        problem.bounds(k, &mut lower, &mut upper);
        row.iter().zip(lower.iter().zip(&upper)).filter(|(u, (low, high))| *u < low || *u > high).count()
    };
    guess.iter().enumerate().map(of_step).sum()
}

fn plan(arguments: &Arguments, case: &TaskCase, guess: &[Vec<f64>]) -> Result<Found, PlanError> {
    let options = PlanOptions {
        iterations: arguments.iterations,
        tolerance: arguments.tolerance,
        // a limit beyond the longest duration is none
        time_limit: arguments.time_limit.and_then(|limit| Duration::try_from_secs_f64(limit).ok()),
        holding: !arguments.no_holding,
        smoothing: arguments.rest_gap.map(Annealing::from_gap),
    };
    let progress = Progress::start();
    let (model, start) = (&case.case.model, Instant::now());
    let mut search = Search::new(&case.problem, model, model.params().values(), &case.case.x0, guess, options)?;
    let before = search.value();
    let (steps, status) = search.run_and_tell(options, start, &mut |k, step| {
        let penalty = if step.penalty > 0.0 { format!(", violations {:.4e}", step.penalty) } else { String::new() };
        progress.tell(&format!("step {k}: cost {:.4e}{penalty}, lowered by {:.2e}", step.cost, step.achieved));
    })?;
    let after = search.value();
    let mut plan = search.finish(steps, status)?;
    plan.violations.retain(|v| v.by > violations::ROUNDING);
    Ok(Found { plan, before, after, time: start.elapsed() })
}

fn summary<'a>(arguments: &Arguments, scene: &Path, found: &'a Found) -> Summary<'a> {
    let plan = &found.plan;
    let [out, inputs, view] = arguments.outputs.names();
    Summary {
        schema_version: 1,
        task: arguments.task.display().to_string(),
        scene: scene.display().to_string(),
        steps: plan.rollout.controls.len(),
        step_s: plan.rollout.model.step_length(),
        cost_before: found.before.0,
        penalty_before: found.before.1,
        cost: found.after.0,
        penalty: found.after.1,
        status: plan.status.word(),
        surrogate: plan.surrogate,
        violations: plan.violations.iter().map(|v| Violated { constraint: &v.constraint, by: v.by }).collect(),
        search: plan.steps.iter().map(Step::from).collect(),
        rollouts: 1 + plan.steps.iter().map(|step| step.rollouts).sum::<usize>(),
        wall_s: found.time.as_secs_f64(),
        out,
        inputs,
        view,
    }
}

fn text(summary: &Summary, found: &Found, outputs: &Outputs) -> String {
    let mut out = format!(
        "{}: {} steps of {} s\ncost {:.6} -> {:.6}, price of violated constraints {:.6} -> {:.6}\n\
         {}: {} Gauss-Newton steps, {} rollouts, {:.3} s",
        summary.task,
        summary.steps,
        summary.step_s,
        summary.cost_before,
        summary.cost,
        summary.penalty_before,
        summary.penalty,
        ended(found.plan.status),
        summary.search.len(),
        summary.rollouts,
        summary.wall_s,
    );
    if summary.surrogate {
        out += "\nthe last step was taken with surrogate terms: the plan need not be a minimum of the cost";
    }
    out += "\n";
    out += &violations::text("the plan", found.plan.violations.iter().map(|v| (v.by, v.constraint.as_str())));
    out + &outputs.lines()
}

/// Why the search ended.
fn ended(status: PlanStatus) -> &'static str {
    match status {
        PlanStatus::Converged => "converged: no step lowers the cost by more than the tolerance",
        PlanStatus::Iterations => "not converged: all iterations were used",
        PlanStatus::Time => "not converged: the time was over",
        PlanStatus::Stalled => "stalled: no step that was tried, however short, lowers the cost by more than the tolerance",
    }
}
