//! `pliant report`.

use super::failure::Failure;
use super::print;
use pliant::identify::report::{Saved, summary};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Arguments {
    /// Folder that `pliant diagnose` wrote, or a file with the output of `pliant diagnose --json`.
    report: PathBuf,
    /// Folder for the figures of the page, each as an SVG file.
    #[arg(long, value_name = "DIR")]
    svg: Option<PathBuf>,
    /// Folder for the same figures as PNG files, if pliant was built with the feature `png`; their texts need a font of this machine.
    #[arg(long, value_name = "DIR")]
    png: Option<PathBuf>,
}

/// Writes the page of a diagnosis again, and its figures.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let saved = Saved::read(&arguments.report)?;
    let page = saved.write_page()?;
    let figures = arguments.svg.as_ref().map(|folder| saved.write_figures(folder)).transpose()?.unwrap_or_default();
    let pictures = arguments.png.as_ref().map(|folder| pictures(folder, &saved)).transpose()?.unwrap_or_default();
    let wrote: String = figures.iter().chain(&pictures).map(|path| format!("\nwrote {}", path.display())).collect();
    print::data(&format!("{}\nreport: {}{wrote}", summary(&saved.diagnosis), page.display()))
}

#[cfg(feature = "png")]
fn pictures(folder: &Path, saved: &Saved) -> Result<Vec<PathBuf>, Failure> {
    super::png::write(folder, &saved.figures())
}

#[cfg(not(feature = "png"))]
fn pictures(_: &Path, _: &Saved) -> Result<Vec<PathBuf>, Failure> {
    Err(Failure::NoPictures)
}
