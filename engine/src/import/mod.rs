//! Reading models of other formats, MJCF and URDF, into scenes.
//!
//! ```text
//! file ── xml (elements with lines) ── mjcf or urdf ── Work: Scene and Report ── scene::check ── Imported
//! ```
//! Nothing is dropped silently: every element ends up in the [`Report`] as kept, approximated or ignored. What would make it another
//! model if it were left out (tendons, masses from meshes) is an error unless [`Options::approximate`] is set.
//!
//! Conventions are those of MuJoCo: coordinates q and velocities v of the imported model are MuJoCo's `qpos` and `qvel`, joint by
//! joint, except that a joint's `ref` is subtracted.
//!
//! ```
//! use pliant_engine::import::{Options, import_text};
//! let text = r#"
//! <mujoco>
//!   <worldbody>
//!     <body name="rod" pos="0 0 1">
//!       <joint name="hinge" axis="0 1 0" damping="0.1"/>
//!       <geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02"/>
//!     </body>
//!   </worldbody>
//! </mujoco>"#;
//! let imported = import_text(text, "rod.xml", &Options::default())?;
//! assert_eq!(imported.scene.body[0].joint[0].damping, 0.1);
//! assert!(imported.to_toml().contains("name = \"hinge\""));
//! # Ok::<(), pliant_engine::import::ImportError>(())
//! ```

mod advice;
mod error;
mod inertia;
mod mjcf;
mod names;
mod pose;
mod report;
mod solid;
mod urdf;
mod view;
mod work;
mod xml;

pub use error::{ImportError, ImportMistake};
pub use report::{Entry, Report, Verdict};

use crate::scene::{Scene, to_toml};
use std::path::Path;
use xml::Element;

/// How to import.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// Import models that cannot be kept as what can be, instead of refusing them.
    pub approximate: bool,
    /// Let the root link of a URDF fly, instead of fixing it to the world.
    pub free_base: bool,
    /// Leave out the shapes that bodies touch with.
    pub no_contact: bool,
}

/// A model that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// What it is now.
    pub scene: Scene,
    /// What became of every element.
    pub report: Report,
}

impl Imported {
    /// The scene as a file.
    pub fn to_toml(&self) -> String {
        let count = |verdict| self.report.count(verdict);
        let comment = format!(
            "Imported from {} ({}): {} elements kept, {} approximated, {} ignored.",
            self.report.source,
            self.report.format,
            count(Verdict::Kept),
            count(Verdict::Approximated),
            count(Verdict::Ignored)
        );
        to_toml(&self.scene, &comment)
    }
}

/// Reads an MJCF or URDF file.
///
/// # Errors
/// Anything that is wrong with it, by file, line and element.
pub fn import_model(path: impl AsRef<Path>, options: &Options) -> Result<Imported, ImportError> {
    let path = path.as_ref();
    import(xml::read(path, None)?, path, options)
}

/// Reads an MJCF or URDF text; `file` is what errors call it, and files that it names are looked for beside it.
///
/// # Errors
/// As [`import_model`].
pub fn import_text(text: &str, file: &str, options: &Options) -> Result<Imported, ImportError> {
    import(xml::parse(text, file)?, Path::new(file), options)
}

fn import(root: Element, path: &Path, options: &Options) -> Result<Imported, ImportError> {
    match root.tag.as_str() {
        "mujoco" => mjcf::import(root, path, options),
        "robot" => urdf::import(&root, path, options),
        _ => Err(ImportError::at(&root, ImportMistake::NotAModel { root: root.tag.clone() })),
    }
}
