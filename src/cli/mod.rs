//! The command: arguments, dispatch, exit codes.
//!
//! Data go to stdout, messages and progress to stderr. Exit codes: 0 done, 1 the numerics failed (or a check did not pass),
//! 2 the input is wrong.

mod cable;
mod diagnose;
mod example;
mod failure;
mod file;
mod fit;
mod gradcheck;
mod import;
mod print;
mod progress;
mod schema;
mod simulate;
mod threads;
mod trajectory;
mod view;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Differentiable physics for things that bend: simulate, check gradients, fit, and find out what a simulation lacks.
#[derive(Parser)]
#[command(version, after_help = "Exit codes: 0 done, 1 the numerics failed or a check did not pass, 2 the input is wrong.")]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Simulate a scene, and write where its nodes go, or a page that shows it.
    Simulate(simulate::Arguments),
    /// Compare the gradients of a scene's rollout with differences.
    Gradcheck(gradcheck::Arguments),
    /// Fit the free parameters of a scene to its logs.
    Fit(fit::Arguments),
    /// Find out what a scene lacks that its logs show, and write a report.
    Diagnose(diagnose::Arguments),
    /// Turn a model of MuJoCo (MJCF) or ROS (URDF) into a scene, and say what became of every element.
    Import(import::Arguments),
    /// Write the scene of a cable: a chain of capsules, clips to lay it in, a floor.
    Cable(cable::Arguments),
    /// Print the JSON Schema of scene files, or of what `diagnose` or `fit` prints.
    Schema(schema::Arguments),
}

/// Runs the command and returns its exit code.
pub fn run(arguments: Arguments) -> ExitCode {
    let done = match arguments.command {
        Command::Simulate(arguments) => simulate::run(&arguments),
        Command::Gradcheck(arguments) => gradcheck::run(&arguments),
        Command::Fit(arguments) => fit::run(&arguments),
        Command::Diagnose(arguments) => diagnose::run(&arguments),
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
