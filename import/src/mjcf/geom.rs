//! `<geom>`: a shape, which gives its body mass, and which touches others.

use super::body::Part;
use super::contact::Touching;
use super::{Reader, words};
use crate::element::Element;
use crate::error::{ImportError, ImportMistake};
use crate::inertia::{Mass, Shape};
use crate::pose::{Pose, from_z};
use crate::solid;
use crate::solid::NO_CONTACT;
use crate::view::{View, check_attributes};
use pliant_math::Vec3;
use pliant_scene::BodyShape;

/// Kinds of geoms, with the numbers of `size` they need, and with `fromto`.
const KINDS: [(&str, usize, usize); 9] = [
    ("sphere", 1, 1),
    ("capsule", 2, 1),
    ("cylinder", 2, 1),
    ("box", 3, 1),
    ("ellipsoid", 3, 1),
    ("plane", 0, 0),
    ("hfield", 0, 0),
    ("mesh", 0, 0),
    ("sdf", 0, 0),
];

const OFF: &str = "touches nothing (contype and conaffinity 0)";

/// Holder of a geom: the world, or a body, with its pose if it cannot move.
#[derive(Clone, Copy)]
enum Holder<'h> {
    World,
    Body(&'h str, Option<Pose>),
}

/// Contact geometry made of a geom, with its description: a shape of its body, an object of its own by name, or none and why.
enum Made {
    Shape(BodyShape, String),
    Fixed(String, String),
    Nothing(String),
}

/// Attributes that are only appearance, in brackets.
fn rest(element: &Element) -> String {
    let rest = element.take_unused().into_iter().filter(|a| *a != "name" && *a != "class").collect::<Vec<_>>().join(", ");
    if rest.is_empty() { String::new() } else { format!(" (not {rest})") }
}

/// What a geom became, and the names of the object and of the body that has it.
type Named = (Made, Option<String>, Option<String>);

impl<'a> Reader<'a> {
    /// A geom of the world.
    pub(super) fn geom_of_world(&mut self, part: &Part<'a>) -> Result<(), ImportError> {
        let element = part.element;
        check_attributes(element, words::GEOM)?;
        let view = self.view(element, part.class)?;
        match self.touch(&view, part, Holder::World)? {
            Made::Nothing(why) => self.work.ignored_whole(element, &why),
            Made::Fixed(name, what) => self.close(element, &name, what),
            Made::Shape(..) => {}
        }
        Ok(())
    }

    /// The mass of a geom in its body's frame, if `counts` and if it has one, and its contact geometry.
    pub(super) fn geom(
        &mut self,
        part: &Part<'a>,
        body: &str,
        counts: bool,
        fixed: Option<Pose>,
    ) -> Result<(Option<Mass>, Option<BodyShape>), ImportError> {
        let element = part.element;
        check_attributes(element, words::GEOM)?;
        let view = self.view(element, part.class)?;
        let group = view.number("group")?.unwrap_or(0.0);
        let in_groups = (self.compiler.groups[0]..=self.compiler.groups[1]).contains(&group);
        let mass = if counts && in_groups { self.mass_of(&view, part)? } else { None };
        let made = self.touch(&view, part, Holder::Body(body, fixed))?;
        let has = mass.map_or(String::new(), |mass| format!("{} kg of its body; ", mass.mass));
        let (shape, what) = match made {
            Made::Shape(shape, what) => (Some(shape), what),
            Made::Fixed(name, what) => (None, format!("{what}, as \"{name}\"")),
            Made::Nothing(why) => {
                let wanted = why != OFF && why != NO_CONTACT;
                let rest = rest(element);
                match mass {
                    Some(_) if wanted => self.work.approximated(element, element.label(), format!("{has}{why}{rest}")),
                    Some(_) => self.work.kept(element, element.label(), format!("{has}{why}{rest}")),
                    None => self.work.ignored(element, element.label(), format!("without mass here; {why}{rest}")),
                }
                element.children.iter().for_each(|c| self.work.ignored_whole(c, "plugins are not run"));
                return Ok((mass, None));
            }
        };
        self.close(element, element.label(), format!("{has}{what}"));
        Ok((mass, shape))
    }

    /// Reports a geom that touches.
    fn close(&mut self, element: &Element, name: &str, what: String) {
        let unread: Vec<&str> = element.attributes.iter().filter(|a| !a.is_used()).map(|a| a.name.as_str()).collect();
        for (names, reason) in words::CONTACT_REASONS {
            let hard: Vec<&str> = names.split_whitespace().filter(|n| unread.contains(n)).collect();
            hard.iter().for_each(|n| {
                element.get(n);
            });
            if !hard.is_empty() {
                self.work.ignored(element, name, format!("{}: {reason}", hard.join(", ")));
            }
        }
        self.work.kept(element, name, format!("{what}{}", rest(element)));
        element.children.iter().for_each(|c| self.work.ignored_whole(c, "plugins are not run"));
    }

    /// Contact geometry of a geom, noted for the pairs it makes.
    fn touch(&mut self, view: &View<'a>, part: &Part<'a>, holder: Holder) -> Result<Made, ImportError> {
        let mask = |name| -> Result<u32, ImportError> { Ok(view.number(name)?.unwrap_or(1.0) as i64 as u32) };
        let masks = [mask("contype")?, mask("conaffinity")?];
        self.claim(view.element, "geom")?;
        if let Some(name) = view.text("mesh") {
            self.missing_mesh(view, name)?;
        }
        let original = view.text("name").unwrap_or("");
        if !original.is_empty() {
            self.known_geoms.insert(original.to_owned());
        }
        if masks == [0, 0] && !self.is_paired(original) {
            return Ok(Made::Nothing(OFF.to_owned()));
        }
        if self.work.options.no_contact || !self.physics.contact {
            return Ok(Made::Nothing(NO_CONTACT.to_owned()));
        }
        let friction = view.numbers("friction", 1..=3)?.map_or(1.0, |f| f[0]);
        if friction < 0.0 {
            let mistake = ImportMistake::Sign { attribute: "friction".to_owned(), value: friction, must: "not be negative" };
            return Err(view.error("friction", mistake));
        }
        let (condim, priority) = (view.number("condim")?.unwrap_or(3.0), view.number("priority")?.unwrap_or(0.0));
        if condim > 3.0 {
            self.work.ignored(
                view.element,
                original,
                format!("condim {condim}: friction against twisting and rolling is not simulated"),
            );
        }
        let own = if condim < 3.0 { 0.0 } else { friction };
        let (made, object, body) = self.make(view, part, holder, own)?;
        if let Some(object) = object {
            self.touching.push(Touching { element: view.element, original, object, body, masks, friction, condim, priority });
        }
        Ok(made)
    }

    /// The shape or the fixed object of a geom, with the names of the object and of the body that has it.
    fn make(&mut self, view: &View, part: &Part, holder: Holder, friction: f64) -> Result<Named, ImportError> {
        let kind = view.word("type", &KINDS.map(|k| k.0))?.unwrap_or("sphere");
        if kind == "hfield" {
            self.work.approximate(view.element, "a height field", "it has no counterpart in a scene: nothing stands on it")?;
        }
        let nothing =
            |what: &str| Ok((Made::Nothing(format!("touches nothing: {what} have no counterpart in a scene")), None, None));
        if kind == "mesh" {
            return self.make_hull(view, part, holder, friction);
        }
        if view.has("mesh") || matches!(kind, "sdf" | "hfield") {
            return nothing("shapes fitted to meshes, distance fields and height fields");
        }
        let (body, place) = match holder {
            Holder::World => (None, Some(Pose::identity())),
            Holder::Body(body, fixed) => (Some(body.to_owned()), fixed),
        };
        let original = view.text("name").unwrap_or("");
        if kind == "plane" {
            view.numbers("size", 1..=3)?;
            let Some(place) = place else { return nothing("planes that move") };
            let pose = place.then(&part.frame).then(&self.plane_pose(view)?);
            let name = self.work.names.give(original, "plane", self.work.scene.plane.len() + 1);
            self.work.scene.plane.push(solid::plane(&name, &pose, friction));
            return Ok((Made::Fixed(name.clone(), format!("a fixed half-space of friction {friction}")), Some(name), body));
        }
        let (shape, pose) = self.shape(kind, view)?;
        let pose = part.frame.then(&pose);
        let words = format!("{} of friction {friction}", solid::words(&shape));
        if let Some(body) = body {
            let made = solid::of_body(&shape, &pose, friction);
            return made
                .map_or_else(|| nothing("ellipsoids"), |made| Ok((Made::Shape(made, words), Some(body.clone()), Some(body))));
        }
        if matches!(shape, Shape::Ellipsoid { .. }) {
            return nothing("ellipsoids");
        }
        let name = self.work.names.give(original, kind, self.work.scene.n_shapes() + 1);
        solid::add_fixed(&mut self.work.scene, &name, &shape, &pose, friction);
        Ok((Made::Fixed(name.clone(), format!("fixed: {words}")), Some(name), None))
    }

    /// The convex hull of a mesh: a shape of its body, or of a body that is fixed to the world.
    fn make_hull(&mut self, view: &View, part: &Part, holder: Holder, friction: f64) -> Result<Named, ImportError> {
        let nothing = || (Made::Nothing("touches nothing: its mesh is not there or not read".to_owned()), None, None);
        let Some(found) = self.find_mesh(view)? else { return Ok(nothing()) };
        let (mesh, path) = match found {
            Ok(found) => (Ok((*found.mesh).clone()), found.path),
            Err((path, error)) => (Err(error), path),
        };
        let pose = part.frame.then(&self.pose(view)?);
        let name = match holder {
            Holder::Body(body, _) => body.to_owned(),
            Holder::World => {
                let number = self.work.scene.body.len() + 1;
                self.work.names.give(view.text("name").unwrap_or(""), "mesh", number)
            }
        };
        let Some(shape) = self.work.hull(view.element, &name, mesh, &path, (&pose, friction))? else { return Ok(nothing()) };
        let words = format!("its convex hull of friction {friction}");
        if let Holder::Body(..) = holder {
            return Ok((Made::Shape(shape, words), Some(name.clone()), Some(name)));
        }
        self.work.add_body(view.element, &name, (None, &Pose::identity()), &Mass::none(), (Vec::new(), vec![shape]));
        Ok((Made::Fixed(name.clone(), format!("fixed: {words}, as a body without joints")), Some(name), None))
    }

    /// Where a plane stands. Only its height says how large things are: its middle may be far away.
    fn plane_pose(&self, view: &View) -> Result<Pose, ImportError> {
        let position = Vec3::from(view.vector::<3>("pos")?.unwrap_or_default());
        let pose = Pose { position, rotation: self.compiler.orientation(view)? };
        self.work.check_lengths(view, "pos", &[pose.direction(&Vec3::z()).dot(&position)])?;
        Ok(pose)
    }

    fn mass_of(&mut self, view: &View, part: &Part) -> Result<Option<Mass>, ImportError> {
        let (given, density) = (view.number("mass")?, view.number("density")?.unwrap_or(1000.0));
        for (name, value) in [("mass", given.unwrap_or(0.0)), ("density", density)] {
            if value < 0.0 {
                return Err(view.error(name, ImportMistake::Sign { attribute: name.to_owned(), value, must: "not be negative" }));
            }
        }
        if given.unwrap_or(density) == 0.0 {
            return Ok(None);
        }
        let kind = view.word("type", &KINDS.map(|k| k.0))?.unwrap_or("sphere");
        if kind == "plane" || kind == "hfield" {
            return Ok(None);
        }
        if kind == "mesh" {
            return self.mass_of_mesh(view, part, given, density);
        }
        if kind == "sdf" || view.has("mesh") {
            let reason = "it is not made; give the body an <inertial>, or save the model from MuJoCo (mj_saveLastXML)";
            self.work.approximate(view.element, "the mass of a shape fitted to a mesh or of a distance field", reason)?;
            return Ok(None);
        }
        if view.flag("shellinertia")? == Some(true) {
            self.work.approximate(view.element, "`shellinertia`", "the mass is taken to fill the shape")?;
        }
        let (shape, pose) = self.shape(kind, view)?;
        let mass = given.unwrap_or_else(|| density * shape.volume());
        Ok(Some(Mass::of_shape(&shape, mass, &part.frame.then(&pose))))
    }

    /// The mass of a mesh, `given` or of that density.
    fn mass_of_mesh(&mut self, view: &View, part: &Part, given: Option<f64>, density: f64) -> Result<Option<Mass>, ImportError> {
        let Some(found) = self.find_mesh(view)? else { return Ok(None) };
        let unit = found.and_then(|found| found.mesh.mass(found.filling).map_err(|error| (found.path, error)));
        let unit = match unit {
            Ok(unit) => unit,
            Err((path, error)) => {
                if self.work.options.approximate {
                    self.work.approximated(
                        view.element,
                        view.element.label(),
                        format!("without mass: the mesh \"{path}\" {error}"),
                    );
                    return Ok(None);
                }
                return Err(view.error("mesh", ImportMistake::Mesh { path, error }));
            }
        };
        let pose = part.frame.then(&self.pose(view)?);
        let mass = given.unwrap_or(density * unit.mass);
        let center = Pose { position: pose.point(&unit.center), ..pose };
        Ok(Some(Mass::with_inertia(mass, &(unit.inertia * (mass / unit.mass)), &center)))
    }

    /// A primitive shape and where it stands in the frames around it.
    fn shape(&self, kind: &str, view: &View) -> Result<(Shape, Pose), ImportError> {
        let ends = view.vector::<6>("fromto")?.filter(|_| kind != "sphere");
        let (_, with_size, with_ends) = KINDS.iter().find(|k| k.0 == kind).copied().unwrap_or(KINDS[0]);
        let needed = if ends.is_some() { with_ends } else { with_size };
        let mut size = view.numbers("size", 1..=3)?.ok_or_else(|| view.missing("`size`"))?;
        if size.len() < needed {
            let mistake = ImportMistake::Count { attribute: "size".to_owned(), found: size.len(), expected: needed.to_string() };
            return Err(view.error("size", mistake));
        }
        if let Some(value) = size[..needed].iter().copied().find(|x| *x <= 0.0) {
            return Err(view.error("size", ImportMistake::Sign { attribute: "size".to_owned(), value, must: "be positive" }));
        }
        self.work.check_lengths(view, "size", &size[..needed])?;
        let pose = match ends {
            Some(ends) => {
                let (pose, half) = along(view, ends)?;
                let radius = size[0];
                size = if kind == "box" || kind == "ellipsoid" { vec![radius, radius, half] } else { vec![radius, half] };
                pose
            }
            None => self.pose(view)?,
        };
        let shape = match kind {
            "sphere" => Shape::Sphere { radius: size[0] },
            "capsule" => Shape::Capsule { radius: size[0], half: size[1] },
            "cylinder" => Shape::Cylinder { radius: size[0], half: size[1] },
            "box" => Shape::Box { half: [size[0], size[1], size[2]] },
            _ => Shape::Ellipsoid { half: [size[0], size[1], size[2]] },
        };
        Ok((shape, pose))
    }
}

/// The frame in the middle between two points, its z axis along them, and half their distance.
pub(super) fn along(view: &View, [ax, ay, az, bx, by, bz]: [f64; 6]) -> Result<(Pose, f64), ImportError> {
    let (a, b) = (Vec3::new(ax, ay, az), Vec3::new(bx, by, bz));
    let half = 0.5 * (b - a).norm();
    if half == 0.0 {
        return Err(view.error("fromto", ImportMistake::NoDirection { attribute: "fromto".to_owned() }));
    }
    Ok((Pose { position: (a + b) * 0.5, rotation: from_z(&(a - b)) }, half))
}
