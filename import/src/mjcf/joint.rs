//! `<joint>` and `<freejoint>`.

use super::body::Part;
use super::{Reader, words};
use crate::constants::IMPORT;
use crate::element::Element;
use crate::error::{ImportError, ImportMistake};
use crate::view::{View, check_attributes};
use pliant_math::Vec3;
use pliant_scene::{Joint, JointKind};

/// A joint that was read, as actuators find it.
#[derive(Clone, Debug)]
pub struct JointPlace<'a> {
    pub element: &'a Element,
    /// Name in the file.
    pub original: String,
    /// Name in the scene.
    pub name: String,
    pub kind: JointKind,
    /// MuJoCo's coordinate when the scene's is zero [rad or m].
    pub zero: f64,
    /// Least and largest force of all its motors together [N·m or N].
    pub force_range: Option<[f64; 2]>,
}

impl<'a> Reader<'a> {
    /// A joint of a body.
    pub(super) fn joint(&mut self, part: &Part<'a>) -> Result<Joint, ImportError> {
        let element = part.element;
        let free = element.tag == "freejoint";
        check_attributes(element, if free { words::FREEJOINT } else { words::JOINT })?;
        let view = if free { View::plain(element) } else { self.view(element, part.class)? };
        let kind = match view.word("type", &["hinge", "slide", "ball", "free"])? {
            _ if free => JointKind::Free,
            Some("slide") => JointKind::Prismatic,
            Some("ball") => JointKind::Ball,
            Some("free") => JointKind::Free,
            _ => JointKind::Revolute,
        };
        self.claim(element, "joint")?;
        let original = view.text("name").unwrap_or("").to_owned();
        let name = self.work.names.give(&original, "joint", self.joints.len() + 1);
        let mut joint = Joint { name: name.clone(), kind, ..Joint::default() };
        self.place(&view, part, &mut joint)?;
        let zero = self.zero(&view, kind)?;
        self.forces(&view, &mut joint, zero)?;
        let force_range = self.force_range(&view)?;
        self.report_joint(&view, &mut joint, zero)?;
        self.joints.push(JointPlace { element, original, name, kind, zero, force_range });
        Ok(joint)
    }

    /// Axis and anchor, which frames around the joint move.
    fn place(&mut self, view: &View, part: &Part, joint: &mut Joint) -> Result<(), ImportError> {
        if joint.kind == JointKind::Free {
            view.has("pos");
            view.has("axis");
            if view.flag("align")? == Some(true) {
                self.work.approximated(view.element, &joint.name, "align: the body's frame stays where the file has it");
            }
            return Ok(());
        }
        let anchor = view.vector::<3>("pos")?.unwrap_or_default();
        self.work.check_lengths(view, "pos", &anchor)?;
        joint.anchor = part.frame.point(&anchor.into()).map(|x| x + 0.0).into();
        if joint.kind == JointKind::Ball {
            view.has("axis");
        } else {
            let axis = Vec3::from(view.direction::<3>("axis")?.unwrap_or([0.0, 0.0, 1.0]));
            joint.axis = part.frame.direction(&axis).map(|x| x + 0.0).into();
        }
        Ok(())
    }

    /// MuJoCo's coordinate where the bodies stand as the file says.
    fn zero(&self, view: &View, kind: JointKind) -> Result<f64, ImportError> {
        let zero = view.number("ref")?.unwrap_or(0.0);
        Ok(match kind {
            JointKind::Revolute => self.compiler.angle(zero),
            JointKind::Prismatic => zero,
            _ => 0.0,
        })
    }

    /// Armature, friction, springs.
    fn forces(&mut self, view: &View, joint: &mut Joint, zero: f64) -> Result<(), ImportError> {
        joint.armature = view.not_negative("armature", 0.0)?;
        self.damping(view, joint)?;
        self.stiffness(view, joint)?;
        let rest = view.number("springref")?.unwrap_or(0.0);
        joint.rest = match joint.kind {
            _ if joint.stiffness == 0.0 && joint.cubic_stiffness == 0.0 => 0.0,
            JointKind::Revolute => self.compiler.angle(rest) - zero,
            JointKind::Prismatic => rest - zero,
            _ => 0.0,
        };
        if view.numbers("springdamper", 2..=2)?.is_some_and(|x| x.iter().any(|x| *x > 0.0)) {
            let reason = "MuJoCo computes stiffness and damping from the inertia; write them as numbers";
            self.work.approximate(view.element, "`springdamper`", reason)?;
        }
        if joint.kind == JointKind::Free && (joint.stiffness != 0.0 || joint.cubic_stiffness != 0.0) {
            self.work.approximate(view.element, "the stiffness of a free joint", "free bodies have no springs")?;
            (joint.stiffness, joint.cubic_stiffness) = (0.0, 0.0);
        }
        if joint.kind == JointKind::Free && joint.damping != 0.0 {
            self.work.approximate(view.element, "the damping of a free joint", "free bodies have no friction")?;
            joint.damping = 0.0;
        }
        Ok(())
    }

    /// f = −(d + d₁ |v| + d₂ v²) v; the first is kept, and the second of joints of one axis if it damps.
    fn damping(&mut self, view: &View, joint: &mut Joint) -> Result<(), ImportError> {
        let numbers = view.numbers("damping", 1..=3)?.unwrap_or_else(|| vec![0.0]);
        joint.damping = self.positive(view, "damping", numbers[0])?;
        let quadratic = numbers.get(1).copied().filter(|d| is_axial(joint) && *d >= 0.0);
        joint.quadratic_damping = quadratic.unwrap_or(0.0);
        let kept = if quadratic.is_some() { 2 } else { 1 };
        if numbers[kept..].iter().any(|x| *x != 0.0) {
            let reason = "damping grows with the speed and, of a joint of one axis, with its square";
            self.work.approximate(view.element, "`damping` of higher order", reason)?;
        }
        if !self.physics.dampers {
            (joint.damping, joint.quadratic_damping) = (0.0, 0.0);
        }
        Ok(())
    }

    /// f = −(k x + k₁ x² + k₂ x³); the first and the last are kept.
    fn stiffness(&mut self, view: &View, joint: &mut Joint) -> Result<(), ImportError> {
        let numbers = view.numbers("stiffness", 1..=3)?.unwrap_or_else(|| vec![0.0]);
        joint.stiffness = self.positive(view, "stiffness", numbers[0])?;
        let axial = is_axial(joint);
        joint.cubic_stiffness = if axial { numbers.get(2).copied().unwrap_or(0.0) } else { 0.0 };
        let lost = if axial { &numbers[1..numbers.len().min(2)] } else { &numbers[1..] };
        if lost.iter().any(|x| *x != 0.0) {
            self.work.approximate(view.element, "`stiffness` of second order", "springs are linear and cubic")?;
        }
        if !self.physics.springs {
            (joint.stiffness, joint.cubic_stiffness) = (0.0, 0.0);
        }
        Ok(())
    }

    fn positive(&self, view: &View, name: &str, value: f64) -> Result<f64, ImportError> {
        if value >= 0.0 {
            return Ok(value);
        }
        Err(view.error(name, ImportMistake::Sign { attribute: name.to_owned(), value, must: "not be negative" }))
    }

    fn report_joint(&mut self, view: &View, joint: &mut Joint, zero: f64) -> Result<(), ImportError> {
        self.limits(view, joint, zero)?;
        let friction = view.not_negative("frictionloss", 0.0)?;
        let (element, name) = (view.element, joint.name.as_str());
        if friction > 0.0 && self.physics.friction {
            if is_axial(joint) {
                joint.friction = friction;
                self.work.kept(element, name, format!("frictionloss {friction}: dry friction that sticks"));
            } else {
                let reason = "dry friction is simulated in joints of one axis only";
                self.work.approximate(element, &format!("frictionloss {friction}"), reason)?;
            }
        }
        if zero != 0.0 {
            self.work.approximated(element, name, format!("ref: the coordinate is MuJoCo's less {zero}; the motion is the same"));
        }
        self.work.leftovers(element, name, &words::JOINT_REASONS);
        let kind = match joint.kind {
            JointKind::Revolute => "revolute",
            JointKind::Prismatic => "prismatic",
            JointKind::Ball => "ball",
            _ => "free",
        };
        self.work.kept(element, name, kind);
        Ok(())
    }

    /// Checks a joint's limits, and makes them stops.
    fn limits(&mut self, view: &View, joint: &mut Joint, zero: f64) -> Result<(), ImportError> {
        let limited = view.word("limited", &["auto", "true", "false"])?;
        let Some([low, high]) = view.vector::<2>("range")? else {
            return if limited == Some("true") { Err(view.missing("`range`")) } else { Ok(()) };
        };
        let is_limited = limited == Some("true") || (limited != Some("false") && self.compiler.autolimits);
        if !is_limited || joint.kind == JointKind::Free || !self.physics.limits {
            return Ok(());
        }
        if low > high {
            return Err(view.error("range", ImportMistake::LimitOrder { attribute: "range".to_owned(), low, high }));
        }
        let turns = joint.kind != JointKind::Prismatic;
        if turns && !self.compiler.is_degrees() {
            self.work.check_angles(view, "range", &[low, high])?;
        }
        let unit = match (turns, self.compiler.is_degrees()) {
            (true, true) => "degrees",
            (true, false) => "rad",
            _ => "m",
        };
        let doubt = if unit == "degrees" && low.abs().max(high.abs()) < IMPORT.small_range {
            " (radians? then angle=\"radian\" is missing)"
        } else {
            ""
        };
        let given = format!("range {low} … {high} {unit}{doubt}");
        if joint.kind == JointKind::Ball {
            self.work.approximate(view.element, &given, "a ball's largest turn is not simulated")?;
            return Ok(());
        }
        let limits = [low, high].map(|x| if turns { self.compiler.angle(x) } else { x } - zero);
        self.work.stops(view.element, joint, limits, &given);
        Ok(())
    }

    /// Limits, if enabled, of the total torque of its motors.
    fn force_range(&self, view: &View) -> Result<Option<[f64; 2]>, ImportError> {
        let limited = view.word("actuatorfrclimited", &["auto", "true", "false"])?;
        let counts = limited == Some("true") || (limited != Some("false") && self.compiler.autolimits);
        let range = if counts { view.vector::<2>("actuatorfrcrange")? } else { None };
        Ok(range.filter(|[low, high]| low < high))
    }

    /// The joint of that name in the file; `user` names it.
    pub(super) fn find_joint(&self, user: &Element, name: &str) -> Result<&JointPlace<'a>, ImportError> {
        self.joints.iter().find(|j| j.original == name).ok_or_else(|| {
            let names = || self.joints.iter().map(|j| j.original.as_str()).filter(|n| !n.is_empty());
            let mistake = ImportMistake::NoSuch {
                what: "joint",
                name: name.to_owned(),
                nearest: pliant_scene::words::nearest(name, names()).map(str::to_owned),
                known: names().collect::<Vec<_>>().join(", "),
            };
            ImportError::at(user, mistake)
        })
    }
}

fn is_axial(joint: &Joint) -> bool {
    matches!(joint.kind, JointKind::Revolute | JointKind::Prismatic)
}
