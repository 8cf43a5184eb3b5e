//! MJCF, the format of MuJoCo.
//!
//! The order of reading: included files are put in place; compiler, options and defaults of the whole model; bodies, each before
//! those that hang on it; actuators; and the rest, which is only reported.

mod actuator;
mod body;
mod compiler;
mod contact;
mod defaults;
mod equality;
mod geom;
mod gravcomp;
mod include;
mod inertial;
mod joint;
mod mesh;
mod option;
mod saturation;
mod sections;
mod site;
mod words;

use super::element::Element;
use super::error::{ImportError, ImportMistake};
use super::pose::Pose;
use super::view::{View, check_children};
use super::work::Work;
use super::{Imported, Options};
use compiler::Compiler;
use contact::{Paired, Touching};
use defaults::Defaults;
use gravcomp::Carried;
use joint::JointPlace;
use mesh::Meshes;
use option::Physics;
use site::Site;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// A model under way.
struct Reader<'a> {
    work: Work<'a>,
    compiler: Compiler,
    physics: Physics,
    defaults: Defaults<'a>,
    joints: Vec<JointPlace<'a>>,
    /// Names in the file and in the scene of all bodies.
    bodies: Vec<(String, String)>,
    /// Geoms that may touch.
    touching: Vec<Touching<'a>>,
    /// Pairs of geoms that `<pair>` names.
    paired: Vec<Paired<'a>>,
    /// Names of all geoms in the file.
    known_geoms: BTreeSet<String>,
    /// Lines of all names of a kind: each may be given once.
    given: BTreeMap<(&'static str, String), usize>,
    meshes: Meshes<'a>,
    /// Sites that have a name.
    sites: Vec<Site<'a>>,
    /// Bodies whose weight is carried, by how much of it.
    carried: Vec<Carried<'a>>,
}

/// Reads a model whose root element is `root`.
pub fn import(root: Element, path: &Path, options: &Options) -> Result<Imported, ImportError> {
    let (root, includes) = include::expand(root, path)?;
    check_children(&root, &words::SECTIONS)?;
    root.mark_all_of("model");
    let mut work = Work::new("mjcf", &root.file, options);
    includes.iter().for_each(|i| work.kept(i, i.value("file").unwrap_or(""), "the file's elements, in its place"));
    let meshes = Meshes::list(&root, path);
    let compiler = Compiler::read(&root, &mut work)?;
    let physics = Physics::read(&root, &mut work)?;
    let defaults = Defaults::read(&root)?;
    let mut reader = Reader {
        work,
        compiler,
        physics,
        defaults,
        meshes,
        joints: Vec::new(),
        bodies: Vec::new(),
        touching: Vec::new(),
        paired: Vec::new(),
        known_geoms: BTreeSet::new(),
        given: BTreeMap::new(),
        sites: Vec::new(),
        carried: Vec::new(),
    };
    reader.read_pairs(&root)?;
    for world in root.children_of("worldbody") {
        reader.world(world)?;
    }
    reader.set_total_mass();
    reader.carry_weights();
    for section in root.children_of("actuator") {
        reader.actuators(section)?;
    }
    reader.joint_force_limits();
    reader.contacts(&root)?;
    reader.sections(&root)?;
    reader.work.finish(&root)
}

impl<'a> Reader<'a> {
    /// An element with the defaults of its class, or of `class` if it names none.
    fn view(&self, element: &'a Element, class: Option<&str>) -> Result<View<'a>, ImportError> {
        let class = element.value("class").or(class);
        Ok(View::new(element, self.defaults.chain(element, class, &[&element.tag])?.into_iter().rev()))
    }

    /// Refuses a name that another element of the kind has.
    fn claim(&mut self, element: &Element, kind: &'static str) -> Result<(), ImportError> {
        let Some(name) = element.value("name").filter(|name| !name.is_empty()) else { return Ok(()) };
        match self.given.insert((kind, name.to_owned()), element.line) {
            Some(first) => Err(ImportError::at(element, ImportMistake::Duplicate { what: kind, name: name.to_owned(), first })),
            None => Ok(()),
        }
    }

    /// Where an element's frame stands: its position and orientation.
    fn pose(&self, view: &View) -> Result<Pose, ImportError> {
        let position = view.vector::<3>("pos")?.unwrap_or_default();
        self.work.check_lengths(view, "pos", &position)?;
        Ok(Pose { position: position.into(), rotation: self.compiler.orientation(view)? })
    }
}
