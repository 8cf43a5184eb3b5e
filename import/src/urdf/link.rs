//! `<link>`: a body and its mass.

use super::tree::Edge;
use super::{Reader, origin};
use crate::constants::IMPORT;
use crate::element::Element;
use crate::error::{ImportError, ImportMistake};
use crate::inertia::{Mass, Shape};
use crate::mesh::Mesh;
use crate::paths::locate;
use crate::pose::Pose;
use crate::solid;
use crate::solid::NO_CONTACT;
use crate::view::View;
use crate::xml::too_deep;
use pliant_math::spatial::full;
use pliant_scene::{BodyShape, Joint, JointKind};
use std::path::{Path, PathBuf};

/// Elements that a link may hold.
const IN_LINK: [&str; 7] = ["inertial", "visual", "collision", "self_collision_checking", "contact", "sensor", "gazebo"];

impl<'a> Reader<'a> {
    /// A link on the joint that carries it, and then those that hang on it. `carrier` is that joint with the parent's name in the
    /// scene; the root has none.
    pub(super) fn link(&mut self, link: &'a Element, carrier: Option<(Edge<'a>, &str)>, depth: usize) -> Result<(), ImportError> {
        if depth > IMPORT.deepest {
            return Err(ImportError::at(link, too_deep()));
        }
        self.work.skip_unknown(link, "name type", &IN_LINK)?;
        link.get("name");
        let name = self.work.names.give(link.label(), "body", self.work.scene.body.len() + 1);
        let mass = self.mass(link, &name)?;
        let shapes = self.shapes(link, &name)?;
        let (mut pose, joints) = match carrier {
            Some((edge, _)) => self.joint(&edge)?,
            None => (Pose::identity(), self.base()),
        };
        let mut parent = carrier.map(|(_, parent)| parent);
        if joints.iter().any(|j| j.kind == JointKind::Free) {
            // a free body hangs on the world; below a link that moves the scene's check refuses it
            if let Some(fixed) = parent.and_then(|p| self.work.fixed_pose(p)) {
                (pose, parent) = (fixed.then(&pose), None);
            }
        }
        self.work.leftovers(link, &name, &[("type", "without effect")]);
        self.work.kept(link, &name, format!("{} kg, {} joint(s)", mass.mass, joints.len()));
        // links joined to a fixed one are neighbours too, which a scene of other makes would let touch
        let still = parent.filter(|p| !joints.is_empty() && self.work.fixed_pose(p).is_some());
        let with_shapes = |name: &str| self.work.scene.body.iter().any(|b| b.name == name && !b.shape.is_empty());
        let ignored = still.filter(|p| !shapes.is_empty() && with_shapes(p)).map(str::to_owned);
        self.work.add_body(link, &name, (parent, &pose), &mass, (joints, shapes));
        if let Some(parent) = ignored {
            self.work.kept(link, &name, format!("it does not touch its neighbour \"{parent}\", as a [[contact.pair]]"));
            self.work.ignore_pair(&parent, &name);
        }
        for edge in self.links.below(link) {
            if let Some(child) = self.links.find(edge.child) {
                self.link(child, Some((edge, &name)), depth + 1)?;
            }
        }
        Ok(())
    }

    /// The joint that carries the root.
    fn base(&mut self) -> Vec<Joint> {
        if !self.work.options.free_base {
            return Vec::new();
        }
        let name = self.work.names.give("base", "joint", 0);
        vec![Joint { name, kind: JointKind::Free, ..Joint::default() }]
    }

    fn mass(&mut self, link: &Element, name: &str) -> Result<Mass, ImportError> {
        let Some(inertial) = link.child("inertial") else { return Ok(Mass::none()) };
        self.work.skip_unknown(inertial, "", &["origin", "mass", "inertia"])?;
        let (mass, inertia) = (View::plain(needed(inertial, "mass")?), View::plain(needed(inertial, "inertia")?));
        mass.required("value")?;
        let mass = mass.not_negative("value", 0.0)?;
        let mut numbers = [0.0; 6];
        for (slot, name) in numbers.iter_mut().zip(["ixx", "iyy", "izz", "ixy", "ixz", "iyz"]) {
            // the products may be left out, as most readers allow
            let number = inertia.number(name)?;
            *slot = match number {
                Some(number) => number,
                None if name == "ixx" || name == "iyy" || name == "izz" => return Err(inertia.missing(&format!("`{name}`"))),
                None => 0.0,
            };
        }
        let pose = origin(&mut self.work, inertial)?;
        self.work.kept(inertial, name, format!("{mass} kg"));
        if mass == 0.0 {
            Ok(Mass::none())
        } else {
            self.work.possible(inertial, name, Mass::with_inertia(mass, &full(&numbers), &pose))
        }
    }

    /// Collision shapes; visual ones are left out.
    fn shapes(&mut self, link: &Element, body: &str) -> Result<Vec<BodyShape>, ImportError> {
        let mut shapes = Vec::new();
        let friction = self.friction(link)?;
        for element in link.children.iter().filter(|c| IN_LINK.contains(&c.tag.as_str())) {
            match element.tag.as_str() {
                "inertial" => {}
                "collision" => shapes.extend(self.collision(element, body, friction)?),
                "visual" => {
                    self.mesh_file(element)?;
                    self.work.ignored_whole(element, "bodies are not drawn");
                }
                "contact" => self.contact(element, body),
                _ => self.work.ignored_whole(element, "an extension for another program"),
            }
        }
        Ok(shapes)
    }

    /// Bullet's numbers of a link's contact.
    fn contact(&mut self, element: &Element, body: &str) {
        element.mark();
        for child in &element.children {
            let value = child.value("value").map_or(String::new(), |value| format!("{value}: "));
            let reason = match child.tag.as_str() {
                "lateral_friction" => {
                    self.work.kept(child, body, format!("friction {}", value.trim_end_matches(": ")));
                    continue;
                }
                "rolling_friction" | "spinning_friction" => "friction against rolling and twisting is not simulated",
                "stiffness" | "damping" | "contact_cfm" | "contact_erp" => "contact of a scene is hard",
                "restitution" => "impacts of a scene do not rebound",
                "inertia_scaling" => "a help for Bullet's solver: the inertia is that of the file",
                _ => "an extension for another program",
            };
            self.work.ignored_whole(child, &format!("{value}{reason}"));
        }
    }

    /// Friction of a link's shapes: 1 unless an extension of Bullet's says otherwise.
    fn friction(&self, link: &Element) -> Result<f64, ImportError> {
        let given = link.child("contact").and_then(|c| c.child("lateral_friction"));
        given.map_or(Ok(1.0), |friction| View::plain(friction).not_negative("value", 1.0))
    }

    fn collision(&mut self, element: &Element, body: &str, friction: f64) -> Result<Option<BodyShape>, ImportError> {
        self.work.skip_unknown(element, "name", &["origin", "geometry"])?;
        let mesh = self.mesh_file(element)?;
        if self.work.options.no_contact {
            self.work.ignored_whole(element, NO_CONTACT);
            return Ok(None);
        }
        let pose = origin(&mut self.work, element)?;
        let geometry = needed(element, "geometry")?;
        let missing = || ImportError::at(geometry, ImportMistake::Missing { what: "a shape".to_owned() });
        let form = geometry.children.first().ok_or_else(missing)?;
        let view = View::plain(form);
        let shape = match form.tag.as_str() {
            "sphere" => Shape::Sphere { radius: self.size(&view, "radius")? },
            "cylinder" => Shape::Cylinder { radius: self.size(&view, "radius")?, half: 0.5 * self.size(&view, "length")? },
            "capsule" => Shape::Capsule { radius: self.size(&view, "radius")?, half: 0.5 * self.size(&view, "length")? },
            "box" => {
                let sides = view.vector::<3>("size")?.ok_or_else(|| view.missing("`size`"))?;
                if let Some(value) = sides.iter().copied().find(|x| *x <= 0.0) {
                    let mistake = ImportMistake::Sign { attribute: "size".to_owned(), value, must: "be positive" };
                    return Err(view.error("size", mistake));
                }
                self.work.check_lengths(&view, "size", &sides)?;
                Shape::Box { half: sides.map(|x| 0.5 * x) }
            }
            "mesh" => return self.hull(element, &view, mesh.as_deref(), body, (&pose, friction)),
            _ => {
                self.work.ignored_whole(element, &format!("a {} touches nothing: primitive shapes and meshes do", form.tag));
                return Ok(None);
            }
        };
        self.work.kept(element, body, format!("{} of friction {friction}", solid::words(&shape)));
        element.mark_all();
        Ok(solid::of_body(&shape, &pose, friction))
    }

    /// The convex hull of a mesh; none without its file, and of a format that is not read.
    fn hull(
        &mut self,
        element: &Element,
        view: &View,
        file: Option<&Path>,
        body: &str,
        (pose, friction): (&Pose, f64),
    ) -> Result<Option<BodyShape>, ImportError> {
        let scale = view.vector::<3>("scale")?.unwrap_or([1.0; 3]);
        view.required("filename")?;
        self.work.leftovers(view.element, "", &[]);
        element.mark_all();
        let Some(file) = file else { return Ok(None) };
        let mesh = Mesh::read(file).map(|mesh| mesh.scaled(&scale));
        self.work.hull(element, body, mesh, &file.display().to_string(), (pose, friction))
    }

    fn size(&self, view: &View, name: &str) -> Result<f64, ImportError> {
        let value = view.number(name)?.ok_or_else(|| view.missing(&format!("`{name}`")))?;
        if value <= 0.0 {
            return Err(view.error(name, ImportMistake::Sign { attribute: name.to_owned(), value, must: "be positive" }));
        }
        self.work.check_lengths(view, name, &[value])?;
        Ok(value)
    }

    /// The file of a mesh that the shape names. A model without its files is likely incomplete, also where a mesh is not read.
    fn mesh_file(&mut self, shape: &Element) -> Result<Option<PathBuf>, ImportError> {
        let Some(mesh) = shape.child("geometry").and_then(|g| g.child("mesh")) else { return Ok(None) };
        let name = View::plain(mesh).required("filename")?;
        let places = match locate(self.path, name, &self.work.options.packages) {
            Ok(file) => return Ok(Some(file)),
            Err(places) => places,
        };
        if self.work.options.approximate {
            self.work.ignored(mesh, "", format!("the file \"{name}\" is not there"));
            return Ok(None);
        }
        let looked = places.iter().map(|place| place.display().to_string()).collect();
        Err(ImportError::at(mesh, ImportMistake::MissingFile { what: "mesh", path: name.to_owned(), looked }))
    }
}

fn needed<'e>(element: &'e Element, tag: &'e str) -> Result<&'e Element, ImportError> {
    let missing = || ImportError::at(element, ImportMistake::Missing { what: format!("<{tag}>") });
    element.child(tag).inspect(|e| e.mark()).ok_or_else(missing)
}
