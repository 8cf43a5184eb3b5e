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
//! use pliant_import::{Options, import_text};
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
//! # Ok::<(), pliant_import::ImportError>(())
//! ```

mod advice;
mod constants;
mod element;
mod error;
mod imported;
mod inertia;
mod mesh;
mod mjcf;
mod names;
mod paths;
mod pose;
mod report;
mod solid;
mod urdf;
mod view;
mod work;
mod xml;

pub use error::{ImportError, ImportMistake};
pub use imported::{Imported, Options};
pub use mesh::MeshMistake;
pub use report::{Entry, Report, Verdict};

use element::Element;
use std::path::Path;

/// Reads an MJCF or URDF file.
///
/// # Errors
/// Anything that is wrong with it, by file, line and element.
pub fn import_model(path: impl AsRef<Path>, options: &Options) -> Result<Imported, ImportError> {
    let path = path.as_ref();
    import(xml::read(path, None)?, path, options)
}

/// Reads an MJCF or URDF text; `file` is its name in errors, and files that it names are looked for beside it.
///
/// # Errors
/// As [`import_model`].
pub fn import_text(text: &str, file: &str, options: &Options) -> Result<Imported, ImportError> {
    import(xml::parse(text, file)?, Path::new(file), options)
}

fn import(root: Element, path: &Path, options: &Options) -> Result<Imported, ImportError> {
    match root.tag.as_str() {
        "mujoco" => mjcf::import(root, path, options),
        "robot" => urdf::import(root, path, options),
        _ => Err(ImportError::at(&root, ImportMistake::NotAModel { root: root.tag.clone() })),
    }
}
