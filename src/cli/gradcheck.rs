//! `pliant gradcheck`.

use super::failure::Failure;
use super::print;
use super::progress::Progress;
use pliant::Case;
use pliant::gradcheck::{BlockReport, Report, Verdict, default_steps, gradcheck_with_progress};
use pliant::scene::{MOST_STEPS, control_rows};
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;

#[derive(clap::Args)]
#[command(
    after_help = "Each block of inputs passes, fails, or is inconclusive: no difference is free of switches of contacts, motors, \
plasticity or substeps, and certain to 1e-6. Exit codes: 0 all blocks pass, 1 some fail (or the numerics failed), 2 the input is \
wrong, 3 none fails and some are inconclusive."
)]
pub struct Arguments {
    /// Scene file (TOML).
    scene: PathBuf,
    /// Number of steps to differentiate; by default the scene's first 100, fewer of models beyond 100 degrees of freedom (never under 10). Beyond its duration its motions go on.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=MOST_STEPS as i64))]
    steps: Option<u32>,
    /// Differentiate all steps of the scene's duration.
    #[arg(long, conflicts_with = "steps")]
    full: bool,
    /// Seed of weights and directions.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Output<'a> {
    schema_version: u32,
    scene: String,
    steps: usize,
    seed: u64,
    #[serde(flatten)]
    report: &'a Report,
}

/// Checks the gradients of a scene's rollout.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut case = Case::read(&arguments.scene).map_err(|error| Failure::case(&arguments.scene, error))?;
    if let Some(steps) = arguments.steps {
        case.controls =
            control_rows(&case.scene, steps as usize).map_err(|error| Failure::case(&arguments.scene, error.into()))?;
    } else if !arguments.full {
        case.controls.truncate(default_steps(&case.model));
    }
    let (theta, progress) = (case.model.params().values(), Progress::start());
    let mut tell = |k, n, name: &str| progress.tell(&format!("block {} of {n}: {name}", k + 1));
    let report = gradcheck_with_progress(&case.model, theta, &case.x0, &case.controls, arguments.seed, &mut tell)
        .map_err(|error| Failure::adjoint(&arguments.scene, error))?;
    drop(progress);
    if arguments.json {
        let (scene, steps) = (arguments.scene.display().to_string(), case.controls.len());
        print::json(&Output { schema_version: 2, scene, steps, seed: arguments.seed, report: &report })?;
    } else {
        print::data(&text(&report, case.controls.len()))?;
    }
    match report.verdict {
        Verdict::Pass => Ok(()),
        Verdict::Fail => Err(Failure::NotPassed(listed(&report, Verdict::Fail))),
        Verdict::Inconclusive => Err(Failure::Inconclusive(listed(&report, Verdict::Inconclusive))),
    }
}

/// The blocks with a verdict, each with its reason.
fn listed(report: &Report, verdict: Verdict) -> String {
    let block = |b: &BlockReport| format!("{}: {}", b.name, b.reason.as_deref().unwrap_or("no reason"));
    report.with(verdict).map(block).collect::<Vec<_>>().join("\n")
}

fn text(report: &Report, steps: usize) -> String {
    let width = report.blocks.iter().map(|block| block.name.chars().count()).max().unwrap_or(0).max(5);
    let mut out =
        format!("{:width$}  size   gradient    difference   rel. error  floor     slope  jvp=vjp   switches\n", "input");
    for block in &report.blocks {
        let _ = writeln!(out, "{}", row(block, width)); // a String takes everything
    }
    let slope = report.taylor_slope.map_or("- (affine)".to_owned(), |slope| format!("{slope:.3}"));
    let _ = writeln!(
        out,
        "worst relative error {:.1e}, Taylor slope {slope}, dot test {:.1e}, halved steps {}",
        report.worst_relative_error, report.dot_test, report.retries
    );
    let _ = write!(out, "{} of {} blocks judged over {steps} steps", report.judged, report.total);
    let inconclusive: Vec<&str> = report.with(Verdict::Inconclusive).map(|b| b.name.as_str()).collect();
    if !inconclusive.is_empty() {
        let _ = write!(out, "; inconclusive: {}", inconclusive.join(", "));
    }
    let _ = write!(out, "; verdict: {}", name(report.verdict));
    out
}

fn name(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Pass => "pass",
        Verdict::Fail => "FAIL",
        Verdict::Inconclusive => "inconclusive",
    }
}

fn row(block: &BlockReport, width: usize) -> String {
    let slope = block.taylor_slope.map_or("    -".to_owned(), |slope| format!("{slope:5.2}"));
    format!(
        "{:width$} {:5}  {:+.4e} {:+.4e}  {:.1e}     {:.1e}  {slope}  {:.1e}  {:8}{}{}",
        block.name,
        block.size,
        block.derivative,
        block.difference,
        block.relative_error,
        block.floor,
        block.dot_test,
        block.switches,
        if block.one_sided { "  one-sided" } else { "" },
        if block.verdict == Verdict::Pass { String::new() } else { format!("  {}", name(block.verdict)) },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(name: &str, verdict: Verdict, reason: Option<&str>) -> BlockReport {
        BlockReport {
            name: name.to_owned(),
            size: 1,
            derivative: 1.0,
            difference: 1.0,
            relative_error: 0.0,
            floor: 0.0,
            step: 1e-5,
            taylor_slope: None,
            dot_test: 0.0,
            switches: 0,
            one_sided: false,
            verdict,
            reason: reason.map(str::to_owned),
        }
    }

    #[test]
    fn blocks_that_do_not_pass_are_named_with_their_reasons() {
        let report = Report {
            verdict: Verdict::Fail,
            judged: 2,
            total: 3,
            worst_relative_error: 0.0,
            taylor_slope: None,
            dot_test: 0.0,
            switches: 2,
            retries: 0,
            blocks: vec![
                block("u", Verdict::Fail, Some("wrong")),
                block("x0.q", Verdict::Pass, None),
                block("x0.v", Verdict::Inconclusive, Some("2 switches")),
            ],
        };
        assert_eq!(listed(&report, Verdict::Fail), "u: wrong");
        assert_eq!(listed(&report, Verdict::Inconclusive), "x0.v: 2 switches");
        assert!(text(&report, 7).ends_with("\n2 of 3 blocks judged over 7 steps; inconclusive: x0.v; verdict: FAIL"));
    }
}
