//! `<compiler>`: how the rest of the file is to be understood.

use super::words;
use crate::element::Element;
use crate::error::{ImportError, ImportMistake};
use crate::pose::{about, euler, from_xy, from_z};
use crate::view::{View, check_attributes, check_children};
use crate::work::Work;
use pliant_math::rotation::{Quaternion, normalized};

/// Whether masses come from geoms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FromGeoms {
    /// Where a body has no `<inertial>`.
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

/// Conventions for the rest of the file.
#[derive(Clone, Debug)]
pub struct Compiler {
    degrees: bool,
    sequence: String,
    /// Whether a range alone makes a limit.
    pub autolimits: bool,
    pub from_geoms: FromGeoms,
    /// Groups of geoms that count for masses.
    pub groups: [f64; 2],
    pub bound_mass: f64,
    pub bound_inertia: f64,
    pub balance: bool,
    /// Whether masses of meshes are exact where a mesh does not say.
    pub exact_meshes: bool,
    /// The sum of all masses \[kg\], if it is set.
    pub total_mass: Option<f64>,
}

const ORIENTATIONS: [&str; 5] = ["quat", "axisangle", "euler", "xyaxes", "zaxis"];

impl Compiler {
    /// Reads all `<compiler>` elements; later ones override earlier ones.
    pub fn read(root: &Element, work: &mut Work) -> Result<Self, ImportError> {
        let mut compiler = Self {
            degrees: true,
            sequence: "xyz".to_owned(),
            autolimits: true,
            from_geoms: FromGeoms::Auto,
            groups: [0.0, 5.0],
            bound_mass: 0.0,
            bound_inertia: 0.0,
            balance: false,
            exact_meshes: false,
            total_mass: None,
        };
        for element in root.children_of("compiler") {
            compiler.update(element, work)?;
        }
        Ok(compiler)
    }

    fn update(&mut self, element: &Element, work: &mut Work) -> Result<(), ImportError> {
        check_attributes(element, words::COMPILER)?;
        check_children(element, &["lengthrange"])?;
        element.children.iter().for_each(|c| work.ignored_whole(c, "a matter of other transmissions"));
        let view = View::plain(element);
        if let Some(angle) = view.word("angle", &["degree", "radian"])? {
            self.degrees = angle == "degree";
        }
        if let Some(sequence) = view.text("eulerseq") {
            self.sequence = self::sequence(&view, sequence)?;
        }
        self.autolimits = view.flag("autolimits")?.unwrap_or(self.autolimits);
        self.balance = view.flag("balanceinertia")?.unwrap_or(self.balance);
        self.from_geoms = match view.word("inertiafromgeom", &["auto", "true", "false"])? {
            Some("true") => FromGeoms::Always,
            Some("false") => FromGeoms::Never,
            Some(_) => FromGeoms::Auto,
            None => self.from_geoms,
        };
        self.exact_meshes = view.flag("exactmeshinertia")?.unwrap_or(self.exact_meshes);
        self.groups = view.vector::<2>("inertiagrouprange")?.unwrap_or(self.groups);
        self.bound_mass = view.not_negative("boundmass", self.bound_mass)?;
        self.bound_inertia = view.not_negative("boundinertia", self.bound_inertia)?;
        self.total_mass = view.number("settotalmass")?.map_or(self.total_mass, |m| (m > 0.0).then_some(m));
        if view.word("coordinate", &["local", "global"])? == Some("global") {
            let what = "global coordinates".to_owned();
            let reason = "MuJoCo has given them up too; load and save the model with an old MuJoCo first".to_owned();
            return Err(view.error("coordinate", ImportMistake::Unsupported { what, reason }));
        }
        if view.flag("alignfree")? == Some(true) {
            work.approximated(element, "", "alignfree: frames of free bodies stay where the file has them");
        }
        work.leftovers(element, "", &[("", "")]);
        work.kept(element, "", "angles, masses and limits are understood as it says");
        Ok(())
    }

    /// An angle of the file in rad.
    pub fn angle(&self, x: f64) -> f64 {
        if self.degrees { x.to_radians() } else { x }
    }

    /// Whether angles are in degrees.
    pub fn is_degrees(&self) -> bool {
        self.degrees
    }

    /// An element's orientation, in whichever way it is given.
    pub fn orientation(&self, view: &View) -> Result<Quaternion<f64>, ImportError> {
        // the element's own orientation stands before any of its defaults
        for source in view.sources() {
            let given: Vec<&str> = ORIENTATIONS.into_iter().filter(|name| source.get(name).is_some()).collect();
            match given[..] {
                [] => {}
                [one] => return self.orientation_by(one, &View::plain(source)),
                [_, second, ..] => {
                    let what = format!("`{second}` beside `{}`", given[0]);
                    let reason = "an orientation can be given in one way only".to_owned();
                    return Err(View::plain(source).error(second, ImportMistake::Unsupported { what, reason }));
                }
            }
        }
        Ok([1.0, 0.0, 0.0, 0.0])
    }

    fn orientation_by(&self, name: &str, view: &View) -> Result<Quaternion<f64>, ImportError> {
        let no_direction = || view.error(name, ImportMistake::NoDirection { attribute: name.to_owned() });
        let rotation = match name {
            "quat" => view.direction::<4>(name)?.map(|q| normalized(&q)),
            "axisangle" => {
                let axis = view.direction::<4>(name)?;
                let turn = axis.map(|[x, y, z, angle]| ([x, y, z], self.angle(angle)));
                match turn {
                    Some(([0.0, 0.0, 0.0], _)) => return Err(no_direction()),
                    turn => turn.map(|(axis, angle)| about(&axis.into(), angle)),
                }
            }
            "euler" => view.vector::<3>(name)?.map(|angles| euler(&angles.map(|x| self.angle(x)), &self.sequence)),
            "xyaxes" => match view.vector::<6>(name)? {
                Some([a, b, c, d, e, f]) => Some(from_xy(&[a, b, c].into(), &[d, e, f].into()).ok_or_else(no_direction)?),
                None => None,
            },
            _ => view.direction::<3>(name)?.map(|z| from_z(&z.into())),
        };
        Ok(rotation.unwrap_or([1.0, 0.0, 0.0, 0.0]))
    }
}

fn sequence(view: &View, text: &str) -> Result<String, ImportError> {
    if text.chars().count() == 3 && text.chars().all(|c| "xyzXYZ".contains(c)) {
        return Ok(text.to_owned());
    }
    let mistake = ImportMistake::Choice {
        attribute: "eulerseq".to_owned(),
        found: text.to_owned(),
        choices: "three letters among x, y, z, X, Y, Z".to_owned(),
        nearest: None,
    };
    Err(view.error("eulerseq", mistake))
}
