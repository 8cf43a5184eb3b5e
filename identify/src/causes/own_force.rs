//! A force that the scene writes as a formula and that the simulation lacks: its parameters that are zero there.
//!
//! Somebody has an idea what is missing and writes it into the scene (`[[force]]`) with a size of zero, as c = 0 in "-c*v*abs(q)". Such
//! parameters are the unknowns: with all of them zero nothing changes, and each has a derivative. The others are numbers of its shape,
//! like n in "a*sin(n*q)", which mean nothing while the sizes are zero; they are freed once there is a size, if the data determine them. A
//! force none of whose parameters is zero is a part of the scene and no candidate.
//!
//! Nobody knows the unit of a parameter, so its typical size is taken from what it does: at the places and speeds of the logs it makes an
//! acceleration of 0.1 rad/s² or m/s² at a joint, or a tenth of the weight of what it acts on.

use super::{Cause, Situation, joint_inertia};
use crate::log::JointQuantity;
use crate::unknown::Unknown;
use pliant_engine::bodies::JointKind;
use pliant_engine::model::{Acts, OwnForce};
use pliant_math::rotation::logarithm;

/// Typical acceleration of a joint [rad/s² or m/s²].
const TYPICAL: f64 = 0.1;
/// Typical force on nodes, over their weight [-].
const OF_WEIGHT: f64 = 0.1;
/// Speeds at which slopes are looked at, in a typical speed: along every axis, at rest, and in between, both ways.
const SPEEDS: [[f64; 3]; 6] =
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [0.5, -0.4, 0.3], [-0.6, 0.5, -0.7]];
/// Places of the logs around which is looked, by a unit [rad or m] and parts of it.
const FEW_PLACES: usize = 20;
/// Most readings of an encoder that slopes are looked at.
const MOST_READINGS: usize = 200;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    at.plan.model.own_forces().iter().filter_map(|force| cause(at, force)).collect()
}

fn cause(at: &Situation, force: &OwnForce) -> Option<Cause> {
    let (params, scene) = (at.plan.model.params(), &at.plan.scene_values.theta);
    let sizes: Vec<usize> = (0..force.params.len()).filter(|&k| scene[force.params[k]] == 0.0).collect();
    if sizes.is_empty() {
        return None;
    }
    let shape = Cause {
        object: Some(force.name.clone()),
        meaning: "the force that the scene writes as a formula, with a size of zero, is there",
        excitation: "move through the places and speeds at which its formula differs most from a constant, a spring and a damper",
        ..Cause::default()
    };
    let slopes = slopes(at, force);
    let of = |k: usize, scale: f64| Unknown::of_theta(&at.plan.model, &params.info(force.params[k]).path, scale);
    let unit = typical_force(at, force);
    let unknowns: Vec<Unknown> = sizes.iter().filter(|&&k| slopes[k] > 0.0).filter_map(|&k| of(k, unit / slopes[k])).collect();
    if unknowns.is_empty() {
        let why = "its formula changes with no parameter that is zero, at any place and speed near the logs: of a product of parameters give \
                   all but one a value";
        return Some(Cause { untestable: Some(why.to_owned()), ..shape });
    }
    let others = (0..force.params.len()).filter(|k| !sizes.contains(k));
    let afterwards = others.filter_map(|k| of(k, scene[force.params[k]].abs())).collect();
    Some(Cause { unknowns, afterwards, ..shape })
}

/// Root mean square of |∂f/∂p| over places and speeds of the logs, of each parameter; of one that does nothing there, over places around
/// them; 0 of one that does nothing there either.
fn slopes(at: &Situation, force: &OwnForce) -> Vec<f64> {
    let places = places(at, force);
    let around = places
        .iter()
        .take(FEW_PLACES)
        .flat_map(|(place, speed)| SPEEDS.map(|pattern| (place.iter().zip(pattern).map(|(x, by)| x + by).collect(), *speed)));
    let beyond = mean_slopes(at, force, around.collect());
    let slopes = mean_slopes(at, force, places);
    slopes.iter().zip(beyond).map(|(slope, beyond)| if *slope > 0.0 { *slope } else { beyond }).collect()
}

fn mean_slopes(at: &Situation, force: &OwnForce, places: Vec<(Vec<f64>, f64)>) -> Vec<f64> {
    let (mut sums, mut count) = (vec![0.0; force.params.len()], 0.0);
    for (place, speed) in places {
        for pattern in SPEEDS {
            let mut variables = place.clone();
            variables.extend(pattern.iter().take(place.len()).map(|part| part * speed));
            let slopes = force.slopes(&variables, &at.plan.scene_values.theta);
            if slopes.iter().all(|slope| slope.is_finite()) {
                sums.iter_mut().zip(&slopes).for_each(|(sum, slope)| *sum += slope * slope);
                count += 1.0;
            }
        }
    }
    sums.iter().map(|sum| (sum / f64::max(count, 1.0)).sqrt()).collect()
}

/// Positions that the formulas see in the logs, and a typical speed there: of a joint those that its encoder reads, else where records
/// begin.
fn places(at: &Situation, force: &OwnForce) -> Vec<(Vec<f64>, f64)> {
    let (plan, model) = (at.plan, &at.plan.model);
    let starts = || plan.fitted.iter().map(|rec| rec.start.mean.q.as_slice());
    match &force.acts {
        Acts::Nodes { nodes, .. } => {
            starts().flat_map(|q| nodes.iter().map(|node| (q[3 * node..3 * node + 3].to_vec(), 1.0))).collect()
        }
        Acts::Joint(joint) => {
            let (joint, first) = (&model.tree().joints()[*joint], model.n_node_dofs());
            let k = first + joint.q;
            if joint.kind == JointKind::Ball {
                return starts().map(|q| (logarithm(&[q[k], q[k + 1], q[k + 2], q[k + 3]]).as_slice().to_vec(), 1.0)).collect();
            }
            let speed = at.typical_speed(&joint.name);
            let read = plan.joints.iter().position(|p| p.joint == joint.name && p.quantity == JointQuantity::Position);
            let Some(channel) = read else { return starts().map(|q| (vec![q[k]], speed)).collect() };
            let all: Vec<f64> = plan.fitted.iter().flat_map(|rec| &rec.record.joints).map(|row| row[channel]).collect();
            let every = all.len().div_ceil(MOST_READINGS).max(1);
            all.iter().step_by(every).filter(|q| q.is_finite()).map(|q| (vec![*q], speed)).collect()
        }
    }
}

/// A force of typical size [N·m, N, N/m or N/m²].
fn typical_force(at: &Situation, force: &OwnForce) -> f64 {
    let (model, theta) = (&at.plan.model, &at.plan.scene_values.theta);
    match (&force.acts, force.mass(model, theta)) {
        (Acts::Joint(joint), _) => {
            TYPICAL * joint_inertia(model, &model.tree().joints()[*joint].name).filter(|inertia| *inertia > 0.0).unwrap_or(1.0)
        }
        (Acts::Nodes { .. }, mass) => OF_WEIGHT * mass.unwrap_or(1.0) * at.value("gravity.magnitude").max(1.0),
    }
}
