//! `pliant gradcheck`.

use super::failure::Failure;
use super::print;
use pliant::Case;
use pliant::gradcheck::{BlockReport, DOT_TEST, Report, gradcheck};
use pliant::scene::{MOST_STEPS, control_rows};
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;

#[derive(clap::Args)]
pub struct Arguments {
    /// Scene file (TOML).
    scene: PathBuf,
    /// Number of steps to differentiate; by default the scene's duration, beyond which its motions go on.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=MOST_STEPS as i64))]
    steps: Option<u32>,
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
    }
    let theta = case.model.params().values();
    let report = gradcheck(&case.model, theta, &case.x0, &case.controls, arguments.seed)
        .map_err(|error| Failure::adjoint(&arguments.scene, error))?;
    if arguments.json {
        let (scene, steps) = (arguments.scene.display().to_string(), case.controls.len());
        print::json(&Output { schema_version: 1, scene, steps, seed: arguments.seed, report: &report })?;
    } else {
        print::data(&text(&report))?;
    }
    if report.pass { Ok(()) } else { Err(Failure::NotPassed(failed(&report))) }
}

/// What disagrees with what, and in which blocks.
fn failed(report: &Report) -> String {
    let names = |bad: fn(&BlockReport) -> bool| {
        let names: Vec<&str> = report.blocks.iter().filter(|block| bad(block)).map(|block| block.name.as_str()).collect();
        names.join(", ")
    };
    let (modes, differences) = (names(|b| !b.modes_agree()), names(|b| !b.agrees_with_differences()));
    let modes = (!modes.is_empty()).then(|| format!("jvp and vjp disagree by more than {DOT_TEST:e} in {modes}"));
    let differences = (!differences.is_empty()).then(|| format!("gradients and differences disagree in {differences}"));
    modes.into_iter().chain(differences).collect::<Vec<_>>().join("; ")
}

fn text(report: &Report) -> String {
    let width = report.blocks.iter().map(|block| block.name.chars().count()).max().unwrap_or(0).max(5);
    let mut out =
        format!("{:width$}  size   gradient    difference   rel. error  floor     slope  jvp=vjp   switches\n", "input");
    for block in &report.blocks {
        let _ = writeln!(out, "{}", row(block, width)); // a String takes everything
    }
    let slope = report.taylor_slope.map_or("- (affine)".to_owned(), |slope| format!("{slope:.3}"));
    let _ = write!(
        out,
        "worst relative error {:.1e}, Taylor slope {slope}, dot test {:.1e}, contact switches {}, halved steps {}: {}",
        report.worst_relative_error,
        report.dot_test,
        report.contact_switches,
        report.retries,
        if report.pass { "pass" } else { "FAIL" }
    );
    out
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
        block.contact_switches,
        if block.one_sided { "  one-sided" } else { "" },
        if block.pass { "" } else { "  FAIL" },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(name: &str, dot_test: f64, relative_error: f64) -> BlockReport {
        BlockReport {
            name: name.to_owned(),
            size: 1,
            derivative: 1.0,
            difference: 1.0,
            relative_error,
            floor: 0.0,
            step: 1e-5,
            taylor_slope: None,
            dot_test,
            contact_switches: 0,
            one_sided: false,
            pass: false,
        }
    }

    #[test]
    fn the_failure_names_what_disagrees() {
        let message = |blocks: Vec<BlockReport>| {
            failed(&Report {
                worst_relative_error: 0.0,
                taylor_slope: None,
                dot_test: 0.0,
                contact_switches: 0,
                retries: 0,
                blocks,
                pass: false,
            })
        };
        assert_eq!(message(vec![block("u", 1e-9, 0.0), block("x0.q", 0.0, 0.0)]), "jvp and vjp disagree by more than 1e-11 in u");
        assert_eq!(message(vec![block("u", 0.0, 0.1)]), "gradients and differences disagree in u");
        assert!(message(vec![block("u", 1e-9, 0.1)]).contains("in u; gradients and differences disagree in u"));
    }
}
