//! URDF, the format of ROS.
//!
//! Each link becomes a body with the joint that carries it; links on fixed joints become bodies without joints. The root link is
//! fixed to the world, or flies if [`crate::Options::free_base`] says so.

mod joint;
mod link;
mod tree;

use super::element::Element;
use super::error::ImportError;
use super::pose::{Pose, euler};
use super::view::View;
use super::work::Work;
use super::{Imported, Options};
use pliant_scene::{JointKind, Time};
use std::path::Path;
use tree::Links;

/// Elements that a robot may hold.
const SECTIONS: [&str; 8] = ["link", "joint", "material", "transmission", "gazebo", "mujoco", "sensor", "plugin"];

/// A robot under way.
struct Reader<'a> {
    work: Work<'a>,
    links: Links<'a>,
    path: &'a Path,
    n_joints: usize,
    /// Names in the file and in the scene of joints that move.
    joints: Vec<(String, String)>,
    /// `<mimic>` elements, with the joints that have them.
    mimics: Vec<(&'a Element, String, JointKind)>,
}

/// Reads a robot whose root element is `root`.
pub fn import(mut root: Element, path: &Path, options: &Options) -> Result<Imported, ImportError> {
    let mut work = Work::new("urdf", &root.file, options);
    substitute(&mut root, &mut work);
    let root = &root;
    root.mark_all_of("name");
    work.leftovers(root, root.label(), &[("version", "of the format")]);
    work.skip_unknown(root, "name version", &SECTIONS)?;
    for element in root.children.iter().filter(|c| SECTIONS.contains(&c.tag.as_str())) {
        match element.tag.as_str() {
            "link" | "joint" => {}
            "material" => work.ignored_whole(element, "bodies are not drawn"),
            "transmission" => {
                work.ignored_whole(element, "motors are not made from transmissions: add an [[actuator]] to the scene")
            }
            _ => work.ignored_whole(element, "an extension for another program"),
        }
    }
    work.scene.time = Time { step: 0.002, ..Time::default() };
    let links = Links::read(root)?;
    let base = links.root(root)?;
    let mut reader = Reader { work, links, path, n_joints: 0, joints: Vec::new(), mimics: Vec::new() };
    reader.link(base, None, 0)?;
    reader.couple_mimics()?;
    reader.work.finish(root)
}

/// Puts the default in the place of `$(optenv VARIABLE default)`, which an expansion of macros may leave behind.
fn substitute(element: &mut Element, work: &mut Work) {
    for k in 0..element.attributes.len() {
        let value = element.attributes[k].value.trim();
        let inside = value.strip_prefix("$(optenv ").and_then(|rest| rest.strip_suffix(')')).filter(|rest| !rest.contains("$("));
        let Some((variable, default)) = inside.and_then(|rest| rest.trim().split_once(' ')) else { continue };
        let (variable, default) = (variable.to_owned(), default.trim().to_owned());
        element.attributes[k].value.clone_from(&default);
        let reason = format!("`{}`: {default}, the default of the variable {variable}", element.attributes[k].name);
        work.kept(element, element.label(), reason);
    }
    element.children.iter_mut().for_each(|child| substitute(child, work));
}

/// An `<origin>` in a holder, or none.
fn origin(work: &mut Work, holder: &Element) -> Result<Pose, ImportError> {
    let Some(element) = holder.child("origin") else { return Ok(Pose::identity()) };
    work.skip_unknown(element, "xyz rpy quat_xyzw", &[])?;
    let view = View::plain(element);
    let position = view.vector::<3>("xyz")?.unwrap_or_default();
    work.check_lengths(&view, "xyz", &position)?;
    let angles = view.vector::<3>("rpy")?.unwrap_or_default();
    work.check_angles(&view, "rpy", &angles)?;
    work.leftovers(element, "", &[("quat_xyzw", "rpy is read instead")]);
    element.mark();
    // roll, pitch, yaw about fixed axes
    Ok(Pose { position: position.into(), rotation: euler(&angles, "XYZ") })
}
