//! The scenes and integrators that examples go through.

use pliant_scene::Integrator;
use std::io;
use std::path::PathBuf;

/// All integrators.
pub const INTEGRATORS: [Integrator; 4] = [Integrator::Euler, Integrator::Midpoint, Integrator::Sdirk2, Integrator::QuasiStatic];

/// The files of the command line; without any, those of `tests/scenes` and `examples`.
pub fn scene_files() -> io::Result<Vec<PathBuf>> {
    let mut files: Vec<PathBuf> = std::env::args().skip(1).map(PathBuf::from).collect();
    if files.is_empty() {
        for folder in ["tests/scenes", "examples"] {
            let listed = std::fs::read_dir(folder)?.map(|entry| entry.map(|e| e.path())).collect::<Result<Vec<_>, _>>()?;
            files.extend(listed.into_iter().filter(|path| path.extension().is_some_and(|e| e == "toml")));
        }
        files.sort();
    }
    Ok(files)
}
