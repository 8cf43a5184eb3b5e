//! An import under way: the scene so far, and the report on the elements read.

use super::element::Element;
use super::error::{ImportError, ImportMistake};
use super::imported::{Imported, Options};
use super::inertia::Mass;
use super::mesh::{Mesh, MeshMistake};
use super::names::Names;
use super::pose::{Pose, plain};
use super::report::{Report, Verdict};
use super::solid;
use super::view::{View, unknown_element};
use crate::constants::IMPORT;
use pliant_engine::model::{BuildError, ModelBuilder};
use pliant_math::inertia::InertiaError;
use pliant_scene::words::{list, nearest};
use pliant_scene::{Body, BodyShape, ContactRule, Coupling, Integrator, Joint, Mistake, Scene, SceneError, check};

/// Why something is ignored that the importer has no word for.
const UNREAD: &str = "not read by the importer";
/// Why something is ignored that its format does not have.
const EXTENSION: &str = "not of the format here: an extension for another program";

/// An import under way.
#[derive(Debug)]
pub struct Work<'o> {
    pub options: &'o Options,
    pub report: Report,
    pub names: Names,
    pub scene: Scene,
    /// Element that each body of the scene was made from.
    origins: Vec<ImportError>,
}

impl<'o> Work<'o> {
    pub fn new(format: &'static str, source: &str, options: &'o Options) -> Self {
        Self {
            options,
            report: Report::new(format, source.to_owned()),
            names: Names::default(),
            scene: Scene::default(),
            origins: Vec::new(),
        }
    }

    pub fn kept(&mut self, element: &Element, name: &str, reason: impl Into<String>) {
        self.report.add(element, name, Verdict::Kept, reason);
    }

    pub fn approximated(&mut self, element: &Element, name: &str, reason: impl Into<String>) {
        self.report.add(element, name, Verdict::Approximated, reason);
    }

    pub fn ignored(&mut self, element: &Element, name: &str, reason: impl Into<String>) {
        self.report.add(element, name, Verdict::Ignored, reason);
    }

    /// An element that is ignored with everything in it.
    pub fn ignored_whole(&mut self, element: &Element, reason: &str) {
        let inside = element.size() - 1;
        let with = if inside > 0 { format!(" (with {inside} elements in it)") } else { String::new() };
        self.ignored(element, element.label(), format!("{reason}{with}"));
        element.mark_all();
    }

    /// Something that makes it another model if it is left out: an error, or a line in the report if that was asked for.
    pub fn approximate(&mut self, element: &Element, what: &str, reason: &str) -> Result<(), ImportError> {
        if self.options.approximate {
            self.approximated(element, element.label(), format!("{what}: {reason}"));
            return Ok(());
        }
        let mistake = ImportMistake::NeedsApproximate { what: what.to_owned(), reason: reason.to_owned() };
        Err(ImportError::at(element, mistake))
    }

    /// Reports attributes of an element that nobody has read, each with the reason that `reasons` has for it.
    pub fn leftovers(&mut self, element: &Element, name: &str, reasons: &[(&str, &str)]) {
        let unused = element.take_unused();
        let mut said: Vec<(&str, Vec<&str>)> = Vec::new();
        for attribute in unused {
            let known = reasons.iter().find(|(words, _)| words.split_whitespace().any(|w| w == attribute));
            let reason = known.map_or("has no counterpart in a scene", |(_, reason)| *reason);
            match said.iter_mut().find(|(r, _)| *r == reason) {
                Some((_, list)) => list.push(attribute),
                None => said.push((reason, vec![attribute])),
            }
        }
        for (reason, attributes) in said {
            self.ignored(element, name, format!("{}: {reason}", attributes.join(", ")));
        }
    }

    /// Reports and skips children and attributes that a format with extensions does not have; `attributes` are separated by spaces. One
    /// that is likely a typing error would change the model.
    pub fn skip_unknown(&mut self, element: &Element, attributes: &str, children: &[&str]) -> Result<(), ImportError> {
        let words = || attributes.split_whitespace();
        for unknown in element.attributes.iter().filter(|a| words().all(|known| known != a.name)) {
            if let (Some(near), false) = (nearest(&unknown.name, words()), self.options.approximate) {
                let (nearest, known) = (Some(near.to_owned()), list(words()));
                let mistake = ImportMistake::UnknownAttribute { name: unknown.name.clone(), nearest, known };
                return Err(ImportError::at_attribute(element, unknown, mistake));
            }
            unknown.mark();
            self.ignored(element, element.label(), format!("`{}`: {EXTENSION}", unknown.name));
        }
        for child in element.children.iter().filter(|c| !children.contains(&c.tag.as_str())) {
            if nearest(&child.tag, children.iter().copied()).is_some() && !self.options.approximate {
                return Err(unknown_element(child, element, children));
            }
            self.ignored_whole(child, EXTENSION);
        }
        Ok(())
    }

    /// The convex hull of a mesh as a shape at `place`, its pose and friction; none of a format that is not read, or of a defect that is
    /// reported because that was asked for.
    pub fn hull(
        &mut self,
        element: &Element,
        name: &str,
        mesh: Result<Mesh, MeshMistake>,
        path: &str,
        (pose, friction): (&Pose, f64),
    ) -> Result<Option<BodyShape>, ImportError> {
        let checked = |mesh: Mesh| if self.options.approximate { Ok(mesh) } else { mesh.check_size().map(|()| mesh) };
        let (corners, left_out, outside) = match mesh.and_then(checked).and_then(|mesh| mesh.touching()) {
            Ok(touching) => touching,
            Err(error) if self.options.approximate || matches!(error, MeshMistake::Format { .. }) => {
                self.ignored_whole(element, &format!("touches nothing: the mesh \"{path}\" {error}"));
                return Ok(None);
            }
            Err(error) => return Err(ImportError::at(element, ImportMistake::Mesh { path: path.to_owned(), error })),
        };
        let reason = format!("the convex hull of a mesh, {} corners, of friction {friction}", corners.len());
        match left_out {
            0 => self.kept(element, name, reason),
            n => self.approximated(
                element,
                name,
                format!("{reason}; {n} more are left out, which reach {outside:.1e} m out of it at most"),
            ),
        }
        Ok(Some(solid::hull(&corners, pose, friction)))
    }

    /// Refuses lengths that are likely in millimetres.
    pub fn check_lengths(&self, view: &View, attribute: &str, values: &[f64]) -> Result<(), ImportError> {
        match values.iter().find(|x| x.abs() > IMPORT.longest) {
            Some(value) if !self.options.approximate => {
                let mistake = ImportMistake::Unit { attribute: attribute.to_owned(), value: *value, unit: "m", likely: "mm" };
                Err(view.error(attribute, mistake))
            }
            _ => Ok(()),
        }
    }

    /// Refuses angles that are likely in degrees: beyond two turns.
    pub fn check_angles(&self, view: &View, attribute: &str, values: &[f64]) -> Result<(), ImportError> {
        match values.iter().find(|x| x.abs() > IMPORT.largest_angle) {
            Some(value) if !self.options.approximate => {
                let mistake =
                    ImportMistake::Unit { attribute: attribute.to_owned(), value: *value, unit: "rad", likely: "degrees" };
                Err(view.error(attribute, mistake))
            }
            _ => Ok(()),
        }
    }

    /// Stops of a joint [rad or m], in the scene's coordinate. They need an integrator that allows contact, and a start between them.
    pub fn stops(&mut self, element: &Element, joint: &mut Joint, [low, high]: [f64; 2], given: &str) {
        if low == high {
            self.ignored(element, &joint.name, format!("{given}: both stops at one place, which holds no joint in a scene"));
            return;
        }
        if self.options.without_stops.contains(&joint.name) {
            self.ignored(element, &joint.name, format!("{given}: stops that are not reached, left out as wanted"));
            return;
        }
        joint.limits = Some([low, high]);
        self.scene.time.integrator = Integrator::Euler;
        self.kept(
            element,
            &joint.name,
            format!("{given}: hard stops without rebound; the integrator is `euler`, which takes impacts best"),
        );
        if !(low..=high).contains(&0.0) {
            let start = if low > 0.0 { low } else { high };
            joint.start = vec![start];
            self.approximated(element, &joint.name, format!("its zero is beyond a stop: it starts at that stop, {start}"));
        }
    }

    /// A mass that scenes accept.
    pub fn possible(&mut self, element: &Element, body: &str, mass: Mass) -> Result<Mass, ImportError> {
        if mass.mass > IMPORT.heaviest && !self.options.approximate {
            let mistake = ImportMistake::Unit { attribute: "mass".to_owned(), value: mass.mass, unit: "kg", likely: "g" };
            return Err(ImportError::at(element, mistake));
        }
        match mass.check() {
            Ok(()) => Ok(mass),
            Err(InertiaError::Triangle(..) | InertiaError::Negative(0.0)) if self.options.approximate => {
                let made = mass.made_possible();
                self.approximated(element, body, "moments of inertia that no mass has, raised to the nearest that one has");
                Ok(made)
            }
            Err(error) => Err(ImportError::at(element, ImportMistake::Inertia { body: body.to_owned(), error })),
        }
    }

    /// Adds a body to the scene; `mass` as [`Work::possible`] returns it, or none.
    pub fn add_body(
        &mut self,
        element: &Element,
        name: &str,
        place: (Option<&str>, &Pose),
        mass: &Mass,
        carried: (Vec<Joint>, Vec<BodyShape>),
    ) {
        let ((parent, pose), (joint, shape)) = (place, carried);
        self.origins.push(ImportError::at(element, ImportMistake::Massless { body: name.to_owned() }));
        self.scene.body.push(Body {
            name: name.to_owned(),
            parent: parent.map(str::to_owned),
            position: plain(pose.position.into()),
            quaternion: plain(pose.rotation),
            mass: mass.mass,
            center_of_mass: plain(mass.center.into()),
            inertia: (mass.mass > 0.0).then(|| plain(mass.numbers())),
            joint,
            shape,
            ..Body::default()
        });
    }

    /// The checked scene and the report.
    pub fn finish(mut self, root: &Element) -> Result<Imported, ImportError> {
        self.sweep(root);
        self.allow_contact(root);
        check(&self.scene).map_err(|error| self.blame(root, error))?;
        self.separate(root)?;
        Ok(Imported { scene: self.scene, report: self.report })
    }

    /// Steps that impacts do not upset, if anything can touch.
    fn allow_contact(&mut self, root: &Element) {
        let carriers = self.scene.body.iter().filter(|b| !b.shape.is_empty()).count();
        if carriers == 0 && self.scene.n_shapes() > 0 {
            self.clear_world(root);
        }
        if carriers + self.scene.n_shapes().min(1) < 2 {
            return;
        }
        self.scene.time.integrator = Integrator::Euler;
        self.kept(root, "", "bodies touch: the integrator is `euler`, which takes impacts best");
    }

    /// Takes out fixed shapes where nothing that moves has a shape to touch them with.
    fn clear_world(&mut self, root: &Element) {
        let scene = &mut self.scene;
        let count = scene.n_shapes();
        (scene.plane, scene.sphere, scene.capsule, scene.block, scene.cylinder) = Default::default();
        scene.contact.pair.clear();
        self.ignored(root, "", format!("{count} fixed shape(s): no body has a shape that could touch them"));
    }

    /// Lets bodies that overlap as the scene begins pass through each other if that was asked for; otherwise an error.
    fn separate(&mut self, root: &Element) -> Result<(), ImportError> {
        let pairs = self.scene.body.len() * (self.scene.body.len() + self.scene.n_shapes());
        for _ in 0..=pairs {
            let Err(error) = ModelBuilder::new(&self.scene) else { return Ok(()) };
            let BuildError::Scene(error) = error else { return Ok(()) };
            let Mistake::Overlap { first, second, depth } = (*error.mistake).clone() else { return Err(self.blame(root, error)) };
            if !self.options.approximate {
                return Err(self.blame(root, error));
            }
            let [first, second] = [&first, &second].map(|name| name.trim_matches('`').split('.').next().unwrap_or("").to_owned());
            let reason = format!("it overlaps \"{second}\" by {depth:.1e} m at the start: the two pass through each other");
            self.approximated(root, &first, reason);
            self.ignore_pair(&first, &second);
        }
        Ok(())
    }

    /// Lets two objects pass through each other.
    pub fn ignore_pair(&mut self, first: &str, second: &str) {
        let rule = ContactRule { between: [first.to_owned(), second.to_owned()], ignore: true, ..ContactRule::default() };
        let same = |r: &&mut ContactRule| r.between == rule.between || (r.between[0] == second && r.between[1] == first);
        match self.scene.contact.pair.iter_mut().find(same) {
            Some(old) => *old = rule,
            None => self.scene.contact.pair.push(rule),
        }
    }

    /// Reports the elements that no reader claimed, so that nothing is dropped silently.
    fn sweep(&mut self, element: &Element) {
        if !element.is_seen() {
            self.ignored_whole(element, UNREAD);
            return;
        }
        let unused = element.take_unused().join(", ");
        if !unused.is_empty() {
            self.ignored(element, element.label(), format!("{unused}: {UNREAD}"));
        }
        element.children.iter().for_each(|child| self.sweep(child));
    }

    /// The pose in the world of a body of the scene that cannot move.
    pub fn fixed_pose(&self, body: &str) -> Option<Pose> {
        let body = self.scene.body.iter().find(|b| b.name == body).filter(|b| b.joint.is_empty())?;
        let own = Pose { position: body.position.into(), rotation: body.quaternion };
        body.parent.as_deref().map_or(Some(own), |parent| Some(self.fixed_pose(parent)?.then(&own)))
    }

    /// The pose in the world of a body of the scene with all joints at zero; the world's without one.
    pub fn pose_at_zero(&self, body: Option<&str>) -> Pose {
        let Some(body) = body.and_then(|name| self.scene.body.iter().find(|b| b.name == name)) else { return Pose::identity() };
        let own = Pose { position: body.position.into(), rotation: body.quaternion };
        self.pose_at_zero(body.parent.as_deref()).then(&own)
    }

    /// Adds a coupling, and lets its joint start where it follows to.
    pub fn couple(&mut self, element: &Element, coupling: Coupling) {
        self.scene.coupling.push(coupling);
        // those that follow it start elsewhere too
        for _ in 0..self.scene.coupling.len() {
            for coupling in &self.scene.coupling {
                let joints = || self.scene.body.iter().flat_map(|b| &b.joint);
                let start = |name: &str| joints().find(|j| j.name == name).and_then(|j| j.start.first().copied()).unwrap_or(0.0);
                let d = coupling.to.as_deref().map_or(0.0, |to| start(to) - coupling.reference);
                let wanted = coupling.coefficients.iter().rev().fold(0.0, |p, c| p * d + c);
                if (start(&coupling.joint) - wanted).abs() <= IMPORT.coupled {
                    continue;
                }
                let name = coupling.joint.clone();
                if let Some(joint) = self.scene.body.iter_mut().flat_map(|b| &mut b.joint).find(|j| j.name == name) {
                    joint.start = vec![wanted];
                }
                let reason = format!("it starts at {wanted}, where the joint that it follows has it");
                self.report.add(element, &name, Verdict::Approximated, reason);
            }
        }
    }

    /// The element that a mistake in the scene comes from.
    fn blame(&self, root: &Element, error: SceneError) -> ImportError {
        let number = error.place.field.strip_prefix("body[").and_then(|rest| rest.split(']').next()?.parse::<usize>().ok());
        let origin = number.and_then(|b| self.origins.get(b));
        let mistake = match *error.mistake {
            Mistake::Massless { ref body } => ImportMistake::Massless { body: body.clone() },
            Mistake::FreeBelow { ref body } => ImportMistake::FreeBelow { body: body.clone() },
            Mistake::Overlap { ref first, ref second, depth } => {
                ImportMistake::Overlap { first: first.clone(), second: second.clone(), depth }
            }
            _ => ImportMistake::Scene { error },
        };
        match origin {
            Some(origin) => ImportError { mistake: Box::new(mistake), ..origin.clone() },
            None => ImportError::at(root, mistake),
        }
    }
}
