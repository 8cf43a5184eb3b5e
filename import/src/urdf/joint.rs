//! `<joint>`: how a link hangs on its parent.

use super::tree::Edge;
use super::{Reader, origin};
use crate::element::Element;
use crate::error::{ImportError, ImportMistake};
use crate::pose::Pose;
use crate::view::View;
use pliant_scene::words::{list, nearest};
use pliant_scene::{Coupling, Integrator, Joint, JointKind};

const KINDS: [&str; 6] = ["fixed", "revolute", "continuous", "prismatic", "floating", "planar"];

impl<'a> Reader<'a> {
    /// Where a link stands in its parent, and its joint, if it can move.
    pub(super) fn joint(&mut self, edge: &Edge<'a>) -> Result<(Pose, Vec<Joint>), ImportError> {
        let element = edge.joint;
        let known = ["origin", "parent", "child", "axis", "limit", "dynamics", "mimic", "calibration", "safety_controller"];
        self.work.skip_unknown(element, "name type", &known)?;
        let view = View::plain(element);
        view.required("type")?;
        view.text("name");
        let kind = match view.word("type", &KINDS)? {
            Some("revolute" | "continuous") => JointKind::Revolute,
            Some("prismatic") => JointKind::Prismatic,
            Some("floating") => JointKind::Free,
            Some("planar") => {
                let (what, reason) = ("a planar joint".to_owned(), "write two prismatic joints and a continuous one".to_owned());
                return Err(view.error("type", ImportMistake::Unsupported { what, reason }));
            }
            _ => return self.fixed(element),
        };
        self.n_joints += 1;
        let name = self.work.names.give(element.label(), "joint", self.n_joints);
        let mut joint = Joint { name, kind, axis: [1.0, 0.0, 0.0], ..Joint::default() };
        let pose = origin(&mut self.work, element)?;
        self.axis(element, &mut joint)?;
        self.limit(element, &mut joint)?;
        self.dynamics(element, &mut joint)?;
        self.mimic(element, &joint)?;
        self.joints.push((element.label().to_owned(), joint.name.clone()));
        self.rest(element);
        let what = view.text("type").unwrap_or("");
        self.work.kept(element, &joint.name, what);
        Ok((pose, vec![joint]))
    }

    fn fixed(&mut self, element: &'a Element) -> Result<(Pose, Vec<Joint>), ImportError> {
        let pose = origin(&mut self.work, element)?;
        let no_effect = ["axis", "limit", "dynamics", "mimic", "calibration", "safety_controller"];
        for child in element.children.iter().filter(|c| no_effect.contains(&c.tag.as_str())) {
            self.work.ignored_whole(child, "without effect on a fixed joint");
        }
        self.work.kept(element, element.label(), "fixed: the link is a body without joints");
        Ok((pose, Vec::new()))
    }

    fn axis(&mut self, element: &'a Element, joint: &mut Joint) -> Result<(), ImportError> {
        let Some(axis) = element.child("axis") else { return Ok(()) };
        self.work.skip_unknown(axis, "xyz", &[])?;
        if joint.kind == JointKind::Free {
            self.work.ignored_whole(axis, "a floating joint has no axis");
            return Ok(());
        }
        joint.axis = View::plain(axis).direction::<3>("xyz")?.unwrap_or(joint.axis);
        axis.mark();
        Ok(())
    }

    fn limit(&mut self, element: &'a Element, joint: &mut Joint) -> Result<(), ImportError> {
        let continuous = element.value("type") == Some("continuous");
        let Some(limit) = element.child("limit") else { return Ok(()) };
        self.work.skip_unknown(limit, "lower upper effort velocity acceleration jerk deceleration", &[])?;
        let view = View::plain(limit);
        let (low, high) = (view.number("lower")?.unwrap_or(0.0), view.number("upper")?.unwrap_or(0.0));
        if low > high {
            return Err(view.error("lower", ImportMistake::LimitOrder { attribute: "lower".to_owned(), low, high }));
        }
        if joint.kind == JointKind::Revolute && !continuous {
            self.work.check_angles(&view, "lower", &[low])?;
            self.work.check_angles(&view, "upper", &[high])?;
        }
        if joint.kind == JointKind::Prismatic {
            self.work.check_lengths(&view, "lower", &[low])?;
            self.work.check_lengths(&view, "upper", &[high])?;
        }
        let effort = view.number("effort")?.map_or(String::new(), |x| format!(", effort {x}"));
        let velocity = view.number("velocity")?.map_or(String::new(), |x| format!(", velocity {x}"));
        let bounded = ["lower", "upper"].iter().any(|key| limit.value(key).is_some());
        limit.take_unused();
        if continuous || joint.kind == JointKind::Free || !bounded {
            self.work.ignored(limit, &joint.name, format!("{low} … {high}{effort}{velocity}: not limits of this joint's place"));
            return Ok(());
        }
        self.work.stops(limit, joint, [low, high], &format!("{low} … {high}"));
        if !(effort.is_empty() && velocity.is_empty()) {
            let given = format!("{effort}{velocity}");
            let reason = "a file has no motors that they could limit";
            self.work.ignored(limit, &joint.name, format!("{}: {reason}", given.trim_start_matches(", ")));
        }
        Ok(())
    }

    fn dynamics(&mut self, element: &'a Element, joint: &mut Joint) -> Result<(), ImportError> {
        let Some(dynamics) = element.child("dynamics") else { return Ok(()) };
        self.work.skip_unknown(dynamics, "damping friction", &[])?;
        let view = View::plain(dynamics);
        let damping = view.not_negative("damping", 0.0)?;
        let friction = view.not_negative("friction", 0.0)?;
        if joint.kind == JointKind::Free && (damping > 0.0 || friction > 0.0) {
            self.work.ignored(dynamics, &joint.name, "free bodies have no friction");
        } else {
            (joint.damping, joint.friction) = (damping, friction);
            let dry = if friction > 0.0 { format!(", dry friction {friction}") } else { String::new() };
            self.work.kept(dynamics, &joint.name, format!("damping {damping}{dry}"));
        }
        Ok(())
    }

    /// A joint that follows another one; which may not have been read yet.
    fn mimic(&mut self, element: &'a Element, joint: &Joint) -> Result<(), ImportError> {
        let Some(mimic) = element.child("mimic") else { return Ok(()) };
        self.work.skip_unknown(mimic, "joint multiplier offset", &[])?;
        let other = View::plain(mimic).required("joint")?;
        if self.links.joint(other).is_none() {
            let mistake = ImportMistake::NoSuch {
                what: "joint",
                name: other.to_owned(),
                nearest: nearest(other, self.links.joint_names()).map(str::to_owned),
                known: list(self.links.joint_names()),
            };
            return Err(ImportError::at(mimic, mistake));
        }
        mimic.mark();
        self.mimics.push((mimic, joint.name.clone(), joint.kind));
        Ok(())
    }

    /// All joints that follow others, as couplings: q = multiplier q_other + offset.
    pub(super) fn couple_mimics(&mut self) -> Result<(), ImportError> {
        for (mimic, joint, kind) in std::mem::take(&mut self.mimics) {
            let view = View::plain(mimic);
            let (multiplier, offset) = (view.number("multiplier")?.unwrap_or(1.0), view.number("offset")?.unwrap_or(0.0));
            let original = view.required("joint")?;
            let other = self.joints.iter().find(|(name, _)| name == original).map(|(_, name)| name.clone());
            let floats = |name: &str| {
                let mut joints = self.work.scene.body.iter().flat_map(|b| &b.joint);
                joints.any(|j| j.name == name && j.kind == JointKind::Free)
            };
            if kind == JointKind::Free || other.as_deref().is_some_and(floats) || other.as_deref() == Some(joint.as_str()) {
                let reason = "a joint of one axis follows another one of one axis; this one moves freely";
                self.work.approximate(mimic, "such a joint that follows another", reason)?;
                continue;
            }
            let (coefficients, reason) = match &other {
                Some(other) => {
                    (vec![offset, multiplier], format!("{joint} = {multiplier} {other} + {offset}, as a [[coupling]]"))
                }
                None => (vec![offset], format!("{original} is fixed: {joint} is held at {offset}, as a [[coupling]]")),
            };
            let name = self.work.names.give(&format!("{joint}_follows"), "coupling", self.work.scene.coupling.len() + 1);
            self.work.kept(mimic, &name, reason);
            if self.work.scene.time.integrator == Integrator::Midpoint {
                self.work.scene.time.integrator = Integrator::Sdirk2;
            }
            self.work.couple(mimic, Coupling { name, joint, to: other, coefficients, reference: 0.0, compliance: None });
        }
        Ok(())
    }

    fn rest(&mut self, element: &'a Element) {
        for tag in ["calibration", "safety_controller"] {
            element.children_of(tag).for_each(|c| self.work.ignored_whole(c, "a matter of the robot's controller"));
        }
    }
}
