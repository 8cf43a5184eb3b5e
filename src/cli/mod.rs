//! The command: arguments, dispatch, exit codes.
//!
//! Data go to stdout, messages and progress to stderr. Exit codes: 0 done, 1 the numerics failed or a check failed, 2 the input is
//! wrong, 3 a check is inconclusive. An interrupt (Ctrl-C) ends the process as the system does it, 130 in a shell; files are complete then too.

mod cable;
mod diagnose;
mod example;
mod failure;
mod file;
mod fit;
mod gradcheck;
mod import;
mod init;
mod inputs;
mod mpc;
mod numbers;
mod outputs;
mod plan;
#[cfg(feature = "png")]
mod png;
mod print;
mod progress;
mod report;
mod schema;
mod simulate;
mod threads;
mod trajectory;
mod view;
mod violations;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Differentiable physics of ropes, rods, cloth and articulated bodies: simulation, gradient checks, fits and diagnosis.
#[derive(Parser)]
#[command(
    version,
    after_help = "Exit codes: 0 done, 1 the numerics failed or a check failed, 2 the input is wrong, 3 a check is inconclusive."
)]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Simulate a scene; write its trajectory, or a page with a 3-D view.
    Simulate(simulate::Arguments),
    /// Compare the gradients of a scene's rollout with finite differences.
    Gradcheck(gradcheck::Arguments),
    /// Fit the free parameters of a scene to its logs.
    Fit(fit::Arguments),
    /// Write a scene for a model and its logs, whose columns are matched by name, to be diagnosed.
    Init(init::Arguments),
    /// Find the physical effects that a scene lacks to explain its logs, and write a report.
    Diagnose(diagnose::Arguments),
    /// Write the page of a diagnosis again from its JSON, and its figures as SVG or PNG files.
    Report(report::Arguments),
    /// Plan the inputs of a task: those of least cost within its limits.
    Plan(plan::Arguments),
    /// Control a task in closed loop, with a simulated plant.
    Mpc(mpc::Arguments),
    /// Convert an MJCF (MuJoCo) or URDF (ROS) model to a scene, with a report of every element.
    Import(import::Arguments),
    /// Write the scene of a cable: a chain of capsules, with clips and a floor.
    Cable(cable::Arguments),
    /// Print the JSON Schema of scene files or task files, of the output of `diagnose` or `fit`, or of a diagnosis's progress.
    Schema(schema::Arguments),
}

/// Runs the command and returns its exit code.
pub fn run(arguments: Arguments) -> ExitCode {
    let done = match arguments.command {
        Command::Simulate(arguments) => simulate::run(&arguments),
        Command::Gradcheck(arguments) => gradcheck::run(&arguments),
        Command::Fit(arguments) => fit::run(&arguments),
        Command::Init(arguments) => init::run(&arguments),
        Command::Diagnose(arguments) => diagnose::run(&arguments),
        Command::Report(arguments) => report::run(&arguments),
        Command::Plan(arguments) => plan::run(&arguments),
        Command::Mpc(arguments) => mpc::run(&arguments),
        Command::Import(arguments) => import::run(&arguments),
        Command::Cable(arguments) => cable::run(&arguments),
        Command::Schema(arguments) => schema::run(&arguments),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            print::message(&failure.to_string());
            failure.exit_code()
        }
    }
}
