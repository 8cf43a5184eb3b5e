//! `pliant import`.

use super::failure::Failure;
use super::{file, print};
use pliant::import::{Imported, Options, Report, import_model};
use serde::Serialize;
use std::io::Write;
use std::path::PathBuf;

#[derive(clap::Args)]
pub struct Arguments {
    /// Model file: MJCF (root element `mujoco`) or URDF (`robot`).
    model: PathBuf,
    /// File for the scene (TOML); without it the scene goes to stdout and the report to stderr.
    #[arg(long, value_name = "SCENE.toml")]
    out: Option<PathBuf>,
    /// Print the report as one JSON object, with the scene in it unless --out is given.
    #[arg(long)]
    json: bool,
    /// Approximate a model that uses tendons, sites in constraints or shapes that scenes do not have, instead of refusing it.
    #[arg(long)]
    approximate: bool,
    /// Give the root link of a URDF a free joint, instead of fixing it to the world.
    #[arg(long)]
    free_base: bool,
    /// Folder of a package, for `package://NAME/…` in a URDF; may be given several times. Others are looked for around the model.
    #[arg(long = "package", value_name = "NAME=PATH", value_parser = package)]
    packages: Vec<(String, PathBuf)>,
    /// Omit the collision shapes of bodies.
    #[arg(long)]
    no_contact: bool,
}

/// Output of `--json`.
#[derive(Serialize)]
struct Summary<'a> {
    #[serde(flatten)]
    report: &'a Report,
    bodies: usize,
    joints: usize,
    actuators: usize,
    out: Option<String>,
    scene: Option<&'a str>,
}

fn package(text: &str) -> Result<(String, PathBuf), String> {
    let parts = text.split_once('=').filter(|(name, path)| !name.is_empty() && !path.is_empty());
    parts.map(|(name, path)| (name.to_owned(), path.into())).ok_or_else(|| "write NAME=PATH".to_owned())
}

/// Imports a model.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    if let Some(out) = &arguments.out {
        file::check(out)?;
    }
    let options = Options {
        packages: arguments.packages.clone(),
        approximate: arguments.approximate,
        free_base: arguments.free_base,
        no_contact: arguments.no_contact,
        ..Options::default()
    };
    let imported = import_model(&arguments.model, &options)?;
    let scene = imported.to_toml();
    if let Some(out) = &arguments.out {
        file::write(out, |file| file.write_all(scene.as_bytes()))?;
    }
    let out = arguments.out.as_ref().map(|out| out.display().to_string());
    if arguments.json {
        return json(&imported, &scene, out);
    }
    match out {
        Some(out) => print::data(&format!("{}\nwrote {out}: {}", imported.report.text(), size(&imported))),
        None => {
            print::message(&imported.report.text());
            print::data(scene.trim_end())
        }
    }
}

fn json(imported: &Imported, scene: &str, out: Option<String>) -> Result<(), Failure> {
    print::json(&Summary {
        report: &imported.report,
        bodies: imported.scene.body.len(),
        joints: joints(imported),
        actuators: imported.scene.actuator.len(),
        scene: out.is_none().then_some(scene),
        out,
    })
}

fn joints(imported: &Imported) -> usize {
    imported.scene.body.iter().map(|b| b.joint.len()).sum()
}

fn size(imported: &Imported) -> String {
    format!("{} bodies, {} joints, {} actuators", imported.scene.body.len(), joints(imported), imported.scene.actuator.len())
}
