//! The library of causes: a file per cause, and its row in [`LIBRARY`].
//!
//! A cause says its meaning, which unknowns it frees, when it cannot be tested, and which experiment would excite it. Everything else
//! (name, derivatives, tests, refits) is common.

mod actuator_delay;
mod actuator_lag;
mod air;
mod anisotropic_bending;
mod armature;
mod asymmetric_friction;
mod bend_friction;
mod bend_stiffening;
mod center_of_mass;
mod clamp_roll;
mod clamp_roll_by_direction;
mod clamp_roll_by_position;
mod cloth_mass;
mod cogging_torque;
mod contact_friction;
mod coulomb_friction;
mod cubic_stiffness;
mod drive_damping;
mod drive_stiffness;
mod edge_lengths;
mod encoder_bias;
mod encoder_drift;
mod encoder_scale;
mod extensibility;
mod frame_rotation;
mod gravity_magnitude;
mod gravity_tilt;
mod gripper_offset;
mod ground_height;
mod internal_damping;
mod intrinsic_curvature;
mod intrinsic_twist;
mod joint_plasticity;
mod joint_stiffness;
mod length_scale;
mod linear_drag;
mod link_inertia;
mod link_mass;
mod load_friction;
mod marker_offset;
mod mass_distribution;
mod membrane_damping;
mod own_force;
mod payload;
mod pieces;
mod quadratic_damping;
mod quadratic_drag;
mod rod_creep;
mod rod_plasticity;
mod rods;
mod saturation;
mod sensor_bias;
mod sensor_delay;
mod spans;
mod stribeck;
mod time_offset;
mod tip_mass;
mod torque_gain;
mod torque_offset;
mod twist_stiffness;
mod uneven_curvature;
mod uneven_stiffness;
mod viscous_friction;
mod wind;

use crate::form::Variable;
use crate::log::JointQuantity;
use crate::sensor::JOINT_ENTRIES;
use crate::shooting::{JointPlace, Plan};
use crate::unknown::{Probe, Unknown, Values};
use pliant_engine::model::Model;

/// A possible cause of what a simulation gets wrong.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cause {
    /// Name.
    pub name: &'static str,
    /// The gripper, joint, body or actuator it is about, where each has a cause of this name.
    pub object: Option<String>,
    /// Its meaning, in a sentence.
    pub meaning: &'static str,
    /// Unknowns that it frees; empty where it cannot be tested.
    pub unknowns: Vec<Unknown>,
    /// Why it cannot be tested.
    pub untestable: Option<String>,
    /// The experiment that would show it best.
    pub excitation: &'static str,
    /// Points of the nuisance grid, each a list of (entry of θ, value): values of parameters that nothing determines while the cause has
    /// no size. The cause is tested at each point, the best one counts, and its p is multiplied by their number.
    pub nuisance_grid: Vec<Vec<(usize, f64)>>,
    /// Causes that would move the readings in exactly the same way, and so are no candidates beside this one.
    pub equivalents: Vec<&'static str>,
    /// Unmeasured parameters that matter only once this cause has a size; a search for causes that act together frees them with it.
    pub companions: Vec<Unknown>,
    /// Parameters of its nuisance grid: a search frees them as well once the cause has a size, which gives them a meaning.
    pub afterwards: Vec<Unknown>,
    /// Values of θ that a refit begins from, one set per entry, with the companions if there are any: angles have several places where a fit may end.
    pub starts: Vec<Vec<(usize, f64)>>,
    /// The variable of its joint, or of a rope's bending, that its force is a function of.
    pub variable: Option<Variable>,
    /// The cause that this one adds detail to.
    pub above: Option<&'static str>,
    /// The cause that this one is at a limit of its own shape, or with all its numbers alike; where its shape gains nothing significant, that
    /// one stands.
    pub becomes: Option<&'static str>,
}

impl Cause {
    /// The starts of a refit with these companions beside it; none where it begins as it is. Where a cause has companions, its starts are theirs.
    pub(crate) fn starts_beside(&self, beside: &[Unknown]) -> Option<&Vec<Vec<(usize, f64)>>> {
        let own = !self.starts.is_empty() && (self.companions.is_empty() || !beside.is_empty());
        own.then_some(&self.starts)
    }

    /// Name and object, which tell it from all others: `gripper_offset (left)`.
    pub fn title(&self) -> String {
        title(self.name, self.object.as_deref())
    }

    /// Whether the other is a limit of it.
    pub(crate) fn may_be(&self, other: &Self) -> bool {
        self.becomes == Some(other.name) && self.object == other.object
    }

    /// Whether it means nothing without the other.
    pub(crate) fn rests_on(&self, other: &Self) -> bool {
        self.above == Some(other.name) && self.object == other.object
    }
}

/// A cause's name, and the object it is about.
pub(crate) fn title(name: &str, object: Option<&str>) -> String {
    object.map_or(name.to_owned(), |object| format!("{name} ({object})"))
}

/// Context a cause is proposed in.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// The experiment.
    pub plan: &'a Plan,
    /// Values of the current fit.
    pub values: &'a Values,
    /// Paths that are free already.
    pub free: &'a [Unknown],
    /// Whether causes are sought that act together ([`Cause::companions`]): what contains another one is then looked at beside it.
    pub together: bool,
}

impl Situation<'_> {
    /// An entry of θ with a typical size of its change.
    fn theta(&self, pattern: &str, scale: f64) -> Option<Unknown> {
        Unknown::of_theta(&self.plan.model, pattern, scale)
    }

    /// Value of a parameter by path.
    fn value(&self, path: &str) -> f64 {
        self.plan.model.params().find(path).map_or(0.0, |k| self.values.theta[k])
    }

    /// A cause of this shape for every joint that has such a quantity. Its typical size is `size` times the joint's inertia.
    fn per_joint(&self, quantity: &str, size: f64, shape: &Cause) -> Vec<Cause> {
        self.per_joint_of(quantity, shape, |inertia| size * inertia)
    }

    /// The same with a typical size of the joint's inertia [kg·m² or kg].
    fn per_joint_of(&self, quantity: &str, shape: &Cause, size: impl Fn(f64) -> f64) -> Vec<Cause> {
        let joints = self.plan.model.params().infos().iter().filter_map(|info| info.path.strip_suffix(".armature"));
        let one = |joint: &str| {
            let inertia = joint_inertia(&self.plan.model, joint)?;
            let unknown = self.theta(&format!("{joint}.{quantity}"), size(inertia))?;
            let unknowns = self.testable(vec![probed(self.plan, unknown)], shape);
            Some(Cause { object: Some(joint.to_owned()), unknowns, ..shape.clone() })
        };
        joints.filter_map(one).collect()
    }

    /// A cause of this shape for every actuator that has such a quantity.
    fn per_actuator(&self, quantity: &str, scale: f64, shape: &Cause) -> Vec<Cause> {
        let one = |name: &str| {
            let unknown = self.theta(&format!("{name}.{quantity}"), scale)?;
            let unknowns = self.testable(vec![unknown], shape);
            Some(Cause { object: Some(name.to_owned()), unknowns, ..shape.clone() })
        };
        self.actuators().into_iter().filter_map(one).collect()
    }

    /// A cause of this shape for every drive that has such a gain, unless it is zero; a tenth of the gain is its typical size.
    fn per_drive_gain(&self, gain: &str, shape: &Cause) -> Vec<Cause> {
        let one = |name: &str| {
            let path = format!("{name}.{gain}");
            let size = self.value(&path);
            let unknown = self.theta(&path, 0.1 * size).filter(|_| size > 0.0)?;
            Some(Cause { object: Some(name.to_owned()), unknowns: vec![unknown], ..shape.clone() })
        };
        self.actuators().into_iter().filter_map(one).collect()
    }

    /// A cause of this shape for the mass of each of these bodies; its distribution in space stays.
    fn per_mass<'a>(&self, bodies: impl Iterator<Item = &'a String>, shape: &Cause) -> Vec<Cause> {
        let one = |body: &String| {
            let unknown = self.theta(&format!("{body}.mass"), 0.1)?;
            Some(Cause { object: Some(body.clone()), unknowns: vec![unknown], ..shape.clone() })
        };
        bodies.filter_map(one).collect()
    }

    /// A cause of this shape for every path with this end; its object is what comes before.
    fn per_path(&self, end: &str, scale: f64, shape: &Cause) -> Vec<Cause> {
        let objects = self.plan.model.params().infos().iter().filter_map(|info| info.path.strip_suffix(end));
        let one = |object: &str| {
            let unknown = self.theta(&format!("{object}{end}"), scale)?;
            Some(Cause { object: Some(object.to_owned()), unknowns: vec![unknown], ..shape.clone() })
        };
        objects.filter_map(one).collect()
    }

    /// Unknowns that a cause of this shape frees: none if it cannot be tested.
    fn testable(&self, unknowns: Vec<Unknown>, shape: &Cause) -> Vec<Unknown> {
        if shape.untestable.is_some() { Vec::new() } else { unknowns }
    }

    /// Names of the actuators, in the order of their controls.
    fn actuators(&self) -> Vec<&str> {
        self.plan.model.params().infos().iter().filter_map(|info| info.path.strip_suffix(".gear")).collect()
    }

    /// Whether an actuator is a position drive.
    fn holds_position(&self, actuator: &str) -> bool {
        self.plan.model.params().find(&format!("{actuator}.stiffness")).is_some()
    }

    /// Largest distance of a joint from its spring's rest that an encoder reads [rad or m]; 1 where none does.
    fn largest_deflection(&self, joint: &str) -> f64 {
        let read = |p: &JointPlace| p.joint == joint && p.quantity == JointQuantity::Position;
        let Some(k) = self.plan.joints.iter().position(read) else { return 1.0 };
        let rest = self.value(&format!("{joint}.rest"));
        let all = self.plan.fitted.iter().flat_map(|rec| &rec.record.joints).map(|row| (row[k] - rest).abs());
        all.filter(|x| x.is_finite()).fold(0.0, f64::max).max(1e-6)
    }

    /// A cause of this shape for every sensor of joints' positions, freeing one of its numbers.
    fn per_encoder(&self, entry: usize, scale: f64, bounds: (f64, f64), shape: &Cause) -> Vec<Cause> {
        let encoders = self.plan.joints.iter().enumerate().filter(|(_, j)| j.quantity == JointQuantity::Position);
        let one = |(k, place): (usize, &JointPlace)| {
            let path = format!("{}.position_{}", place.joint, JOINT_ENTRIES[entry]);
            let unit = [place.unit, "-", "s", place.quantity.rate_unit(place.unit == "m")][entry];
            let unknown = Unknown::of_joint(path, unit, (k, entry), scale, bounds);
            Cause { object: Some(place.joint.clone()), unknowns: vec![unknown], ..shape.clone() }
        };
        encoders.map(one).collect()
    }

    /// Root mean square speed of a joint that an encoder reads [rad/s or m/s]; 1 where none does.
    fn typical_speed(&self, joint: &str) -> f64 {
        let plan = self.plan;
        let read = |p: &JointPlace| p.joint == joint && p.quantity == JointQuantity::Position;
        let Some(k) = plan.joints.iter().position(read) else { return 1.0 };
        let (mut sum, mut count) = (0.0, 0.0);
        for rec in &plan.fitted {
            for (y, t) in rec.record.joints.windows(SPACED).zip(rec.record.time.windows(SPACED)) {
                let speed = (y[SPACED - 1][k] - y[0][k]) / (t[SPACED - 1] - t[0]);
                if speed.is_finite() {
                    (sum, count) = (sum + speed * speed, count + 1.0);
                }
            }
        }
        if sum > 0.0 { (sum / f64::max(count, 1.0)).sqrt() } else { 1.0 }
    }

    /// Whether anything drives the joints.
    fn has_actuators(&self) -> bool {
        self.plan.model.has_actuators()
    }
}

/// Inertia of a joint as the scene begins, all other joints held [kg·m² or kg]; the first axis' of a universal one.
fn joint_inertia(model: &Model, joint: &str) -> Option<f64> {
    let tree = model.tree();
    let nv = tree.nv();
    let l = tree.joint_parts(joint).map(|k| tree.joints()[k].v).next()?;
    Some(model.mass_matrix(model.initial_positions(), model.params().values())[l * nv + l])
}

/// Samples between the two that a typical speed is taken from, so that noise counts little.
const SPACED: usize = 9;

/// Acceleration that friction is probed with [rad/s² or m/s²], and that a fit of it begins with.
const PROBED: Probe = Probe { small: 1e-4, start: 0.1 };

/// Part of a joint's load that friction which grows with it is probed with, and that a fit of it begins with [-].
const PROBED_LOAD: Probe = Probe { small: 1e-4, start: 0.02 };

/// Why what happens between a command and a motor's torque cannot be tested, if it cannot.
fn unread(at: &Situation) -> Option<String> {
    let torque = |place: &JointPlace| place.quantity == JointQuantity::Torque;
    at.plan
        .joints
        .iter()
        .any(torque)
        .then(|| "the model of a torque sensor reads what is commanded, without what the motor makes of it".to_owned())
}

/// With a probe, if the unknown's law is silent at zero: dry friction, which has no derivative there.
pub(crate) fn probed(plan: &Plan, unknown: Unknown) -> Unknown {
    if unknown.path.ends_with(".load_friction") {
        return unknown.probed(PROBED_LOAD);
    }
    let joint = [".friction", ".friction_backward", ".stiction"].iter().find_map(|end| unknown.path.strip_suffix(end));
    match joint.and_then(|joint| joint_inertia(&plan.model, joint)) {
        Some(inertia) => unknown.probed(Probe { small: PROBED.small * inertia, start: PROBED.start * inertia }),
        None => unknown,
    }
}

/// A row of the library.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Name of the causes that `propose` returns.
    pub name: &'static str,
    /// The causes of this name in a situation: one, one per object, or none.
    propose: fn(&Situation) -> Vec<Cause>,
}

const fn row(name: &'static str, propose: fn(&Situation) -> Vec<Cause>) -> Row {
    Row { name, propose }
}

/// All causes, in the order in which a diagnosis lists them.
pub const LIBRARY: &[Row] = &[
    row("linear_drag", linear_drag::causes),
    row("quadratic_drag", quadratic_drag::causes),
    row("wind", wind::causes),
    row("gravity_tilt", gravity_tilt::causes),
    row("gravity_magnitude", gravity_magnitude::causes),
    row("extensibility", extensibility::causes),
    row("internal_damping", internal_damping::causes),
    row("membrane_damping", membrane_damping::causes),
    row("cloth_mass", cloth_mass::causes),
    row("tip_mass", tip_mass::causes),
    row("edge_lengths", edge_lengths::causes),
    row("intrinsic_curvature", intrinsic_curvature::causes),
    row("intrinsic_twist", intrinsic_twist::causes),
    row("uneven_curvature", uneven_curvature::causes),
    row("uneven_stiffness", uneven_stiffness::causes),
    row("anisotropic_bending", anisotropic_bending::causes),
    row("twist_stiffness", twist_stiffness::causes),
    row("bend_stiffening", bend_stiffening::causes),
    row("clamp_roll", clamp_roll::causes),
    row("clamp_roll_by_direction", clamp_roll_by_direction::causes),
    row("clamp_roll_by_position", clamp_roll_by_position::causes),
    row("mass_distribution", mass_distribution::causes),
    row("marker_offset", marker_offset::causes),
    row("rod_creep", rod_creep::causes),
    row("rod_plasticity", rod_plasticity::causes),
    row("bend_friction", bend_friction::causes),
    row("gripper_offset", gripper_offset::causes),
    row("viscous_friction", viscous_friction::causes),
    row("quadratic_damping", quadratic_damping::causes),
    row("coulomb_friction", coulomb_friction::causes),
    row("stribeck", stribeck::causes),
    row("asymmetric_friction", asymmetric_friction::causes),
    row("load_friction", load_friction::causes),
    row("joint_stiffness", joint_stiffness::causes),
    row("cubic_stiffness", cubic_stiffness::causes),
    row("joint_plasticity", joint_plasticity::causes),
    row("cogging_torque", cogging_torque::causes),
    row("own_force", own_force::causes),
    row("payload", payload::causes),
    row("link_mass", link_mass::causes),
    row("link_inertia", link_inertia::causes),
    row("center_of_mass", center_of_mass::causes),
    row("armature", armature::causes),
    row("torque_gain", torque_gain::causes),
    row("drive_stiffness", drive_stiffness::causes),
    row("drive_damping", drive_damping::causes),
    row("torque_offset", torque_offset::causes),
    row("actuator_delay", actuator_delay::causes),
    row("actuator_lag", actuator_lag::causes),
    row("saturation", saturation::causes),
    row("encoder_bias", encoder_bias::causes),
    row("encoder_scale", encoder_scale::causes),
    row("encoder_drift", encoder_drift::causes),
    row("sensor_delay", sensor_delay::causes),
    row("ground_height", ground_height::causes),
    row("contact_friction", contact_friction::causes),
    row("sensor_bias", sensor_bias::causes),
    row("frame_rotation", frame_rotation::causes),
    row("length_scale", length_scale::causes),
    row("time_offset", time_offset::causes),
];

/// Names of all causes.
pub fn names() -> impl Iterator<Item = &'static str> {
    LIBRARY.iter().map(|row| row.name)
}

/// The library as it stands in this situation. A cause whose unknowns are all free already is left out.
pub fn library(at: &Situation) -> Vec<Cause> {
    let of_row = |row: &'static Row| (row.propose)(at).into_iter().map(|cause| Cause { name: row.name, ..cause });
    let mut causes: Vec<Cause> = LIBRARY.iter().flat_map(of_row).collect();
    let is_free = |u: &Unknown| at.free.iter().any(|f| f.target.same(&u.target) && at.plan.only_followers(f, u));
    for cause in &mut causes {
        cause.unknowns.retain(|u| !is_free(u));
        let with_free = at.free.iter().chain(&cause.unknowns).cloned().collect();
        cause.unknowns = at.plan.tied(with_free).split_off(at.free.len());
    }
    causes.retain(|c| !c.unknowns.is_empty() || c.untestable.is_some());
    causes
}

#[cfg(test)]
mod tests {
    use super::LIBRARY;

    #[test]
    fn every_name_is_there_once_and_in_the_guide() {
        let guide = include_str!("../../../docs/diagnosis.md");
        for (k, row) in LIBRARY.iter().enumerate() {
            assert!(LIBRARY[..k].iter().all(|other| other.name != row.name), "{} twice", row.name);
            assert!(guide.contains(&format!("`{}`", row.name)), "docs/diagnosis.md lacks {}", row.name);
        }
    }
}
