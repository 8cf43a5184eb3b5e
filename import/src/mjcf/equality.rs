//! `<equality>`: loops that are closed, and joints that follow others.
//!
//! MuJoCo holds them by soft forces (`solref`, `solimp`), a scene as hard as contact. Both take the held pose from where the file has
//! the bodies, with all joints at zero.

use super::{Reader, words};
use crate::constants::IMPORT;
use crate::element::Element;
use crate::error::ImportError;
use crate::pose::Pose;
use crate::pose::plain;
use crate::view::{View, check_attributes, check_children};
use pliant_math::Vec3;
use pliant_scene::{Closure, ClosureKind, Coupling, Integrator, JointKind};

impl<'a> Reader<'a> {
    /// All constraints of a section.
    pub(super) fn equalities(&mut self, section: &'a Element) -> Result<(), ImportError> {
        check_children(section, &["connect", "weld", "joint", "tendon", "flex", "flexvert", "flexstrain"])?;
        for element in &section.children {
            let class = element.value("class");
            let defaults = self.defaults.chain(element, class, &["equality"])?;
            let view = View::new(element, defaults.into_iter().rev());
            if !view.flag("active")?.unwrap_or(true) || !self.physics.constraints {
                self.work.ignored_whole(element, "a constraint that is switched off");
                continue;
            }
            match element.tag.as_str() {
                "connect" | "weld" => self.closure(&view)?,
                "joint" => self.coupling(&view)?,
                _ => {
                    let reason = "only points, axes and joints are held together in a scene";
                    self.work.approximate(element, "an equality constraint", reason)?;
                    element.mark_all();
                }
            }
        }
        self.closed(section);
        Ok(())
    }

    /// `<connect>` or `<weld>`.
    fn closure(&mut self, view: &View) -> Result<(), ImportError> {
        let element = view.element;
        check_attributes(element, words::EQUALITY)?;
        let weld = element.tag == "weld";
        let by_sites = view.has("site1") || view.has("site2");
        let sites = if by_sites { Some([self.find_site(view, "site1")?, self.find_site(view, "site2")?]) } else { None };
        let mut sides = match &sites {
            Some(sites) => sites.clone().map(|(body, _)| body),
            None => [self.find_body(view, "body1")?, if view.has("body2") { self.find_body(view, "body2")? } else { None }],
        };
        let moving = [0, 1].map(|k| sides[k].as_deref().and_then(|name| self.carrier(name)).map(str::to_owned));
        if moving[0] == moving[1] {
            self.work.ignored_whole(element, "it holds what is one rigid body anyway");
            return Ok(());
        }
        let poses = [0, 1].map(|k| self.work.pose_at_zero(sides[k].as_deref()));
        // a weld's anchor is in the second body, a connection's in the first
        let own = usize::from(weld);
        let anchor = match &sites {
            Some(sites) => {
                self.sites_meet(view, [0, 1].map(|k| poses[k].then(&sites[k].1)), weld)?;
                sites[own].1.position.into()
            }
            None => self.anchor(view, weld)?,
        };
        let place = poses[own].point(&Vec3::from(anchor));
        let mut points: [[f64; 3]; 2] = poses.map(|pose| plain(pose.matrix().tr_mul(&(place - pose.position)).into()));
        points[own] = plain(anchor);
        if weld && !by_sites {
            self.as_they_stand(view, &poses)?;
        }
        if sides[0].is_none() {
            sides.reverse();
            points.reverse();
        }
        let [Some(body), to] = sides else { return Ok(()) };
        let name = self.work.names.give(element.label(), "closure", self.work.scene.closure.len() + 1);
        view.text("name");
        self.work.leftovers(element, &name, &words::EQUALITY_REASONS);
        let other = to.as_deref().unwrap_or("the world");
        let what = if weld { "welded to" } else { "a point of it stays at one of" };
        self.work.kept(element, &name, format!("{body}: {what} {other}, as a [[closure]]"));
        self.needs_steps_that_hold();
        let kind = if weld { ClosureKind::Weld } else { ClosureKind::Connect };
        self.work.scene.closure.push(Closure {
            name,
            kind,
            body,
            to,
            point: points[0],
            to_point: Some(points[1]),
            compliance: None,
        });
        Ok(())
    }

    /// The point that is held, in its body; a weld's is the origin unless it is given.
    fn anchor(&self, view: &View, weld: bool) -> Result<[f64; 3], ImportError> {
        let anchor = view.vector::<3>("anchor")?;
        if anchor.is_none() && !weld {
            return Err(view.missing("`anchor`"));
        }
        let anchor = anchor.unwrap_or_default();
        self.work.check_lengths(view, "anchor", &anchor)?;
        Ok(anchor)
    }

    /// Refuses sites that stand apart, or whose axes do if they are to be welded.
    fn sites_meet(&mut self, view: &View, [a, b]: [Pose; 2], weld: bool) -> Result<(), ImportError> {
        let apart = (a.position - b.position).norm();
        let turned = weld && (a.matrix() - b.matrix()).amax() > IMPORT.weld_pose;
        if apart > IMPORT.weld_pose || turned {
            let by = if apart > IMPORT.weld_pose { format!("by {apart:.3e} m") } else { "by their axes".to_owned() };
            let (held, how) = if weld { (2, "welded as they stand in the file") } else { (1, "held there") };
            let reason = format!("a scene starts with its loops closed; the bodies are {how}, where site{held} is");
            self.work.approximate(view.element, &format!("a constraint between sites that are apart {by}"), &reason)?;
        }
        Ok(())
    }

    /// Refuses a weld whose `relpose` is another than that of the bodies as the file has them.
    fn as_they_stand(&mut self, view: &View, poses: &[Pose; 2]) -> Result<(), ImportError> {
        let Some([x, y, z, q @ ..]) = view.vector::<7>("relpose")? else { return Ok(()) };
        if q == [0.0; 4] {
            return Ok(());
        }
        let wanted = pliant_math::rotation::matrix(&pliant_math::rotation::normalized(&q));
        let axes = poses[0].matrix().tr_mul(&poses[1].matrix());
        let between = poses[0].matrix().tr_mul(&(poses[1].position - poses[0].position));
        if (axes - wanted).amax() > IMPORT.weld_pose || (between - Vec3::new(x, y, z)).amax() > IMPORT.weld_pose {
            let reason = "a scene starts with its loops closed; the bodies are welded as they stand in the file";
            self.work.approximate(view.element, "a `relpose` that is not how the bodies stand", reason)?;
        }
        Ok(())
    }

    /// `<joint>`: MuJoCo's polynomial is between coordinates less `ref`, which are the scene's.
    fn coupling(&mut self, view: &View) -> Result<(), ImportError> {
        let element = view.element;
        check_attributes(element, words::EQUALITY)?;
        let joint = self.find_joint(element, view.required("joint1")?)?.clone();
        let to = match view.text("joint2") {
            Some(name) => Some(self.find_joint(element, name)?.clone()),
            None => None,
        };
        let single = |kind| matches!(kind, JointKind::Revolute | JointKind::Prismatic);
        if !single(joint.kind) || to.as_ref().is_some_and(|to| !single(to.kind)) {
            let reason = "ball and free joints have no single coordinate, and MuJoCo refuses them too";
            self.work.approximate(element, "a coupling of such a joint", reason)?;
            element.mark_all();
            return Ok(());
        }
        let mut coefficients = vec![0.0, 1.0, 0.0, 0.0, 0.0];
        let given = view.numbers("polycoef", 1..=5)?.unwrap_or_default();
        coefficients.iter_mut().zip(&given).for_each(|(slot, c)| *slot = *c);
        let needed = coefficients.iter().rposition(|c| *c != 0.0).map_or(1, |k| k + 1);
        coefficients.truncate(if to.is_some() { needed } else { 1 });
        let name = self.work.names.give(element.label(), "coupling", self.work.scene.coupling.len() + 1);
        view.text("name");
        self.work.leftovers(element, &name, &words::EQUALITY_REASONS);
        let reason = match &to {
            Some(to) => format!("{} follows {} with coefficients {coefficients:?}, as a [[coupling]]", joint.name, to.name),
            None => format!("{} is held at {}, as a [[coupling]]", joint.name, coefficients[0]),
        };
        self.work.kept(element, &name, reason);
        self.needs_steps_that_hold();
        let to = to.map(|to| to.name);
        self.work.couple(element, Coupling { name, joint: joint.name, to, coefficients, reference: 0.0, compliance: None });
        Ok(())
    }

    /// Midpoint holds nothing at the end of its steps.
    fn needs_steps_that_hold(&mut self) {
        if self.work.scene.time.integrator == Integrator::Midpoint {
            self.work.scene.time.integrator = Integrator::Sdirk2;
        }
    }
}
