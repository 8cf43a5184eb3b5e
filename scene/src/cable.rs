//! A cable as a chain of capsules: scenes that nobody wants to write by hand.

use super::check::check;
use super::clip::{Clip, refuse_below};
use super::error::{Mistake, SceneError};
use super::{Block, Body, BodyShape, Contact, ContactRule, Integrator, Joint, JointKind, Nothing, Plane, Scene, ShapeKind, Time};
use pliant_math::rotation::normalized;
use std::f64::consts::PI;

/// Interval in which the rest of a joint follows by the part β of its bend in SILO's cable \[s\].
const FOLLOWS: f64 = 1.0 / 240.0;
/// Links of SILO's cable, its length \[m\], and the stiffness [N·m/rad] and damping [N·m·s/rad] of the drives at its joints.
const SILO: (usize, f64, f64, f64) = (18, 0.375, 1e-2, 1e-3);

/// A cable of n equal capsules, joined at their ends.
///
/// A joint between two links of length e = length/n stands for the bend over e: stiffness EI/e, damping c_b/e, and it creeps with the time
/// constant h₀/β of a rest that follows by the part β every h₀ = 1/240 s. A clamped end has a joint of 2 EI/e at the clamp, half a link's
/// bend, so that sag and frequencies converge with e². Mass is spread evenly along each link, a cylinder of the cable's radius.
///
/// One joint has one stiffness about all axes, so twist is as stiff as bending, GJ = EI; if `twist_stiffness` differs, a link hangs on a
/// hinge about its own axis and a universal joint, whose second axis must not turn by 90°.
///
/// The defaults are the cable of SILO (18 links, 0.375 m, radius 3 mm, 1e-2 N·m/rad and 1e-3 N·m·s/rad per joint, β = 0.7) at
/// 1200 kg/m³; EI and c_b are those of its joints, and stay when `links` or `length` change.
#[derive(Clone, Debug, PartialEq)]
pub struct Cable {
    /// Its name; links are `name_0`, `name_1`, …
    pub name: String,
    /// Number of links.
    pub links: usize,
    /// Length \[m\].
    pub length: f64,
    /// Radius \[m\].
    pub radius: f64,
    /// ρA [kg/m].
    pub linear_density: f64,
    /// EI [N·m²].
    pub bend_stiffness: f64,
    /// GJ [N·m²]; EI if left out.
    pub twist_stiffness: Option<f64>,
    /// c_b [N·m²·s], of bending and twist.
    pub bend_damping: f64,
    /// β: part of its bend that a joint forgets every 1/240 s [-]; 0 is elastic.
    pub plasticity: f64,
    /// Bend of a joint from which alone it forgets \[rad\]; any if left out.
    pub yield_angle: Option<f64>,
    /// Friction coefficient [-].
    pub friction: f64,
    /// Whether the first end is held; otherwise the cable is free.
    pub clamped: bool,
    /// Where the first end is \[m\].
    pub position: [f64; 3],
    /// Where the cable points from there, of any length [-].
    pub direction: [f64; 3],
}

impl Default for Cable {
    fn default() -> Self {
        let (links, length, stiffness, damping) = SILO;
        let (link, radius) = (length / links as f64, 0.003_f64);
        Self {
            name: "cable".to_owned(),
            links,
            length,
            radius,
            linear_density: Self::density_of(radius),
            bend_stiffness: stiffness * link,
            twist_stiffness: None,
            bend_damping: damping * link,
            plasticity: 0.7,
            yield_angle: None,
            friction: 0.5,
            clamped: false,
            position: [0.0, 0.0, 0.1],
            direction: [1.0, 0.0, 0.0],
        }
    }
}

/// A scene of a cable, clips, and a floor at that height [m] if there is one; Euler steps of 1/240 s, and a rest gap of 1 µm.
///
/// # Errors
/// A wrong number: place, mistake, likely cause and fix.
pub fn cable_scene(cable: &Cable, clips: &[Clip], floor: Option<f64>) -> Result<Scene, SceneError> {
    let body = cable.bodies()?;
    let mut block = Vec::new();
    for (k, clip) in clips.iter().enumerate() {
        block.extend(clip.boxes(&format!("clip[{k}]"))?);
    }
    let plane = floor.map(|height| Plane { name: "floor".to_owned(), height, friction: cable.friction, ..Plane::default() });
    // a clamped end reaches into its clamp
    let walls = block.iter().map(|b: &Block| &b.name).chain(plane.iter().map(|p: &Plane| &p.name));
    let ignored = |other: &String| ContactRule {
        between: [format!("{}_0", cable.name), other.clone()],
        ignore: true,
        ..ContactRule::default()
    };
    let pair = if cable.clamped { walls.map(ignored).collect() } else { Vec::new() };
    let scene = Scene::<Nothing> {
        time: Time { step: 1.0 / 240.0, duration: 1.0, integrator: Integrator::Euler },
        contact: Contact { rest_gap: 1e-6, pair, ..Contact::default() },
        plane: plane.into_iter().collect(),
        body,
        block,
        ..Scene::default()
    };
    check(&scene)?;
    Ok(scene)
}

impl Cable {
    /// ρA of a cable of that radius at 1200 kg/m³ [kg/m].
    pub fn density_of(radius: f64) -> f64 {
        1200.0 * PI * radius * radius
    }

    /// Description in a line.
    pub fn summary(&self) -> String {
        let held = if self.clamped { "clamped at its first end" } else { "free" };
        format!("A cable of {} links, {} m long, {} m thick, {held}.", self.links, self.length, 2.0 * self.radius)
    }

    /// Length of a link \[m\].
    pub fn link(&self) -> f64 {
        self.length / self.links as f64
    }

    /// Its links, each on the one before.
    ///
    /// # Errors
    /// Numbers that make no sense.
    pub fn bodies(&self) -> Result<Vec<Body>, SceneError> {
        self.check()?;
        let (e, r) = (self.link(), self.radius);
        let mass = self.linear_density * e;
        let (across, along) = (mass * (e * e / 12.0 + r * r / 4.0), 0.5 * mass * r * r);
        let capsule = BodyShape {
            kind: ShapeKind::Capsule,
            position: [0.0, 0.0, 0.5 * e],
            quaternion: [1.0, 0.0, 0.0, 0.0],
            radius: Some(r),
            half_length: Some(0.5 * e - r),
            half_extents: None,
            points: None,
            friction: Some(self.friction),
        };
        let link = |k: usize| Body {
            name: format!("{}_{k}", self.name),
            parent: k.checked_sub(1).map(|k| format!("{}_{k}", self.name)),
            position: if k == 0 { self.position } else { [0.0, 0.0, e] },
            quaternion: if k == 0 { from_z_to(self.direction) } else { [1.0, 0.0, 0.0, 0.0] },
            mass,
            center_of_mass: [0.0, 0.0, 0.5 * e],
            inertia: Some([across, across, along, 0.0, 0.0, 0.0]),
            joint: if k == 0 { self.base() } else { self.joints(k, e) },
            shape: vec![capsule.clone()],
            ..Body::default()
        };
        Ok((0..self.links).map(link).collect())
    }

    /// Joints of the first link.
    fn base(&self) -> Vec<Joint> {
        match self.clamped {
            true => self.joints(0, 0.5 * self.link()),
            false => vec![Joint { name: format!("{}_free", self.name), kind: JointKind::Free, ..Joint::default() }],
        }
    }

    /// The joints below link k, which stand for the bend over `span` \[m\].
    fn joints(&self, k: usize, span: f64) -> Vec<Joint> {
        let joint = |suffix: &str, kind, stiffness: f64| {
            let creeps = self.plasticity > 0.0 && stiffness > 0.0;
            Joint {
                name: format!("{}_{suffix}_{k}", self.name),
                kind,
                stiffness: stiffness / span,
                damping: self.bend_damping / span,
                plastic_time: creeps.then(|| FOLLOWS / self.plasticity),
                yield_at: self.yield_angle.filter(|_| creeps),
                ..Joint::default()
            }
        };
        match self.twist_stiffness.filter(|gj| *gj != self.bend_stiffness) {
            None => vec![joint("joint", JointKind::Ball, self.bend_stiffness)],
            Some(gj) => vec![
                Joint {
                    axis: [1.0, 0.0, 0.0],
                    second_axis: Some([0.0, 1.0, 0.0]),
                    ..joint("bend", JointKind::Universal, self.bend_stiffness)
                },
                joint("twist", JointKind::Revolute, gj),
            ],
        }
    }

    fn check(&self) -> Result<(), SceneError> {
        let at = |key: &str| format!("cable.{key}");
        let positive =
            [("length", self.length, "m"), ("radius", self.radius, "m"), ("linear_density", self.linear_density, "kg/m")];
        let others = [
            ("bend_stiffness", self.bend_stiffness, "N·m²"),
            ("twist_stiffness", self.twist_stiffness.unwrap_or(0.0), "N·m²"),
            ("bend_damping", self.bend_damping, "N·m²·s"),
            ("friction", self.friction, "-"),
        ];
        refuse_below(&at, &positive, &others)?;
        if self.links == 0 {
            return Err(SceneError::at(at("links"), Mistake::NotPositive { value: 0.0, unit: "-" }));
        }
        if self.link() <= 2.0 * self.radius {
            let mistake = Mistake::ShortLinks { links: self.links, link: self.link(), diameter: 2.0 * self.radius };
            return Err(SceneError::at(at("links"), mistake));
        }
        if !(0.0..=1.0).contains(&self.plasticity) {
            return Err(SceneError::at(at("plasticity"), Mistake::Range { value: self.plasticity, low: 0.0, high: 1.0 }));
        }
        if self.direction.iter().all(|x| *x == 0.0) {
            return Err(SceneError::at(at("direction"), Mistake::NoDirection));
        }
        Ok(())
    }
}

/// The shortest turn that takes z to a direction.
fn from_z_to(direction: [f64; 3]) -> [f64; 4] {
    let norm = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
    let [x, y, z] = direction.map(|x| x / norm);
    if z < -1.0 + 1e-12 {
        return [0.0, 1.0, 0.0, 0.0];
    }
    normalized(&[1.0 + z, -y, x, 0.0])
}
