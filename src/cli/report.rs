//! `pliant report`.

use super::failure::Failure;
use super::print;
use pliant::identify::report::{Saved, summary};
use std::path::PathBuf;

#[derive(clap::Args)]
pub struct Arguments {
    /// Folder that `pliant diagnose` wrote, or a file with the output of `pliant diagnose --json`.
    report: PathBuf,
    /// Folder for the figures of the page, each as an SVG file.
    #[arg(long, value_name = "DIR")]
    svg: Option<PathBuf>,
}

/// Writes the page of a diagnosis again, and its figures.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let saved = Saved::read(&arguments.report)?;
    let page = saved.write_page()?;
    let figures = arguments.svg.as_ref().map(|folder| saved.write_figures(folder)).transpose()?.unwrap_or_default();
    let wrote: String = figures.iter().map(|path| format!("\nwrote {}", path.display())).collect();
    print::data(&format!("{}\nreport: {}{wrote}", summary(&saved.diagnosis), page.display()))
}
