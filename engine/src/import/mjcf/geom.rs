//! `<geom>`: a shape, of which only the mass is read.

use super::body::Part;
use super::{Reader, words};
use crate::import::error::{ImportError, ImportMistake};
use crate::import::inertia::{Mass, Shape};
use crate::import::pose::{Pose, from_z};
use crate::import::view::{View, check_attributes};
use crate::terms::Vec3;

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

const APPEARANCE: &str = "bodies do not touch and are not drawn";

impl<'a> Reader<'a> {
    /// A geom of the world.
    pub(super) fn geom_of_world(&mut self, part: &Part<'a>) -> Result<(), ImportError> {
        check_attributes(part.element, words::GEOM)?;
        self.view(part.element, part.class)?;
        self.work.ignored_whole(part.element, "a fixed shape: bodies do not touch it");
        Ok(())
    }

    /// The mass of a geom in its body's frame, if `counts` and if it has one.
    pub(super) fn geom(&mut self, part: &Part<'a>, counts: bool) -> Result<Option<Mass>, ImportError> {
        let element = part.element;
        check_attributes(element, words::GEOM)?;
        let view = self.view(element, part.class)?;
        let group = view.number("group")?.unwrap_or(0.0);
        let in_groups = (self.compiler.groups[0]..=self.compiler.groups[1]).contains(&group);
        let mass = if counts && in_groups { self.mass_of(&view, part)? } else { None };
        let rest = element.take_unused().into_iter().filter(|a| *a != "name" && *a != "class").collect::<Vec<_>>().join(", ");
        let rest = if rest.is_empty() { String::new() } else { format!(" ({rest})") };
        let touches = view.number("contype")? != Some(0.0) || view.number("conaffinity")? != Some(0.0);
        match mass {
            Some(mass) if touches => {
                self.work.approximated(element, element.label(), format!("{} kg of its body; {APPEARANCE}{rest}", mass.mass));
            }
            Some(mass) => self.work.kept(element, element.label(), format!("{} kg of its body{rest}", mass.mass)),
            None => self.work.ignored(element, element.label(), format!("without mass here; {APPEARANCE}{rest}")),
        }
        element.children.iter().for_each(|c| self.work.ignored_whole(c, "plugins are not run"));
        Ok(mass)
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
        let from_mesh = kind == "mesh" || kind == "sdf" || view.has("mesh");
        if from_mesh {
            let reason = "meshes are not read; give the body an <inertial>, or save the model from MuJoCo (mj_saveLastXML)";
            self.work.approximate(view.element, "the mass of a mesh", reason)?;
            return Ok(None);
        }
        if view.flag("shellinertia")? == Some(true) {
            self.work.approximate(view.element, "`shellinertia`", "the mass is taken to fill the shape")?;
        }
        let (shape, pose) = self.shape(kind, view)?;
        let mass = given.unwrap_or_else(|| density * shape.volume());
        Ok(Some(Mass::of_shape(&shape, mass, &part.frame.then(&pose))))
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
fn along(view: &View, [ax, ay, az, bx, by, bz]: [f64; 6]) -> Result<(Pose, f64), ImportError> {
    let (a, b) = (Vec3::new(ax, ay, az), Vec3::new(bx, by, bz));
    let half = 0.5 * (b - a).norm();
    if half == 0.0 {
        return Err(view.error("fromto", ImportMistake::NoDirection { attribute: "fromto".to_owned() }));
    }
    Ok((Pose { position: (a + b) * 0.5, rotation: from_z(&(a - b)) }, half))
}
