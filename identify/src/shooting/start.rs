//! Where a record starts: at rest, or at an unknown state with a prior from its first samples.

use super::constants::SHOOTING;
use super::extension::spans;
use super::observed::MarkerPlace;
use super::plan::Plan;
use super::start_bodies::body_start;
use super::stretch_prior;
use crate::error::IdentifyError;
use crate::log::Record;
use crate::sensor::{BIAS, JointNumbers, SCALE};
use nalgebra::{DMatrix, DVector, Vector3};
use pliant_engine::equilibrium::{equilibrium, place_clamped};
use pliant_engine::model::Model;
use pliant_engine::rods::Following;
use pliant_engine::step::StepError;
use pliant_math::State;

/// Initial state of a record: `x₀ = mean ⊕ (L z + Σ_k B_k (b_k − b_k of the scene))` on the free dofs, z unknown with a standard normal prior, b_k
/// the zeros of the sensors that the mean was read from: what is read with another zero is another state, and no less likely.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StartState {
    /// Prior mean.
    pub mean: State,
    /// Free degrees of freedom; empty where nothing is unknown.
    pub dofs: Vec<usize>,
    /// L for the positions: the first half of z moves them [m, rad].
    pub position: DMatrix<f64>,
    /// L for the velocities: the second half of z [m/s, rad/s].
    pub velocity: DMatrix<f64>,
    /// Current estimate of z.
    pub z: Vec<f64>,
    /// B of each sensor at a joint.
    pub zeros: Vec<Zero>,
    /// Dependence of unobserved twists on those of the edges that grippers hold.
    pub following: Following,
}

/// How a record's first state follows the zero of a sensor at a joint that it was read from.
#[derive(Clone, Debug, PartialEq)]
pub struct Zero {
    /// Which of the experiment's sensors at joints.
    pub sensor: usize,
    /// Its zero in the scene [rad or m, or by s].
    pub scene: f64,
    /// Change of state per unit of its zero.
    pub change: Vec<f64>,
}

impl StartState {
    /// Whether nothing is unknown: the record starts at rest, or as given.
    pub fn is_fixed(&self) -> bool {
        self.dofs.is_empty()
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        2 * self.dofs.len()
    }

    /// The current estimate of the state (before the clamped nodes are placed), with sensors at joints of these values.
    pub fn state(&self, model: &Model, joints: &[JointNumbers]) -> State {
        model.displaced(&self.mean, &self.change(model, joints))
    }

    /// The change of state from the mean.
    pub(super) fn change(&self, model: &Model, joints: &[JointNumbers]) -> Vec<f64> {
        let (n, nv) = (self.dofs.len(), model.nv());
        let mut out = vec![0.0; model.ndx()];
        for (row, &dof) in self.dofs.iter().enumerate() {
            for c in 0..n {
                out[dof] += self.position[(row, c)] * self.z[c];
                out[nv + dof] += self.velocity[(row, c)] * self.z[n + c];
            }
        }
        for zero in &self.zeros {
            let off = joints[zero.sensor][BIAS] - zero.scene;
            out.iter_mut().zip(&zero.change).for_each(|(out, change)| *out += off * change);
        }
        out
    }
}

/// Prior of a record's initial state. At rest: the equilibrium, nothing unknown. Measured: a quadratic through each marker's
/// first samples; free nodes without a marker follow by carrying the difference to the equilibrium shape over,
/// with a wider prior.
pub fn initial_guess(plan: &Plan, record: &Record) -> Result<StartState, IdentifyError> {
    let model = &plan.model;
    if plan.at_rest {
        let rest = equilibrium(model, &plan.scene_values.theta, model.initial_positions(), &record.inputs[0]);
        let rest = rest.map_err(|e| IdentifyError::Simulation { record: record.name.clone(), source: e })?;
        return Ok(StartState { mean: rest.state(), ..StartState::default() });
    }
    state_at(plan, record, 0)
}

/// The state at a sample of the record from the data, with its prior: a quadratic through the samples around it for each
/// marker, the rest by interpolation, reconciled with the strains that the stiffness of ropes and sheets allows.
pub fn state_at(plan: &Plan, record: &Record, sample: usize) -> Result<StartState, IdentifyError> {
    let model = &plan.model;
    let theta = &plan.scene_values.theta;
    let named = |e| IdentifyError::Simulation { record: record.name.clone(), source: e };
    let u = &record.inputs[sample];
    let shape = match equilibrium(model, theta, model.initial_positions(), u) {
        Ok(rest) if model.n_nodes() > 0 => rest.q,
        _ => {
            let start = model.initial_state();
            place_clamped(model, theta, u, [&start.q, &start.z[model.ndz()..]]).map_err(named)?.0
        }
    };
    let (mut q, mut v) = (shape.clone(), driven_velocities(plan, record, sample, &shape).map_err(named)?);
    let (mut dofs, mut sigma_q, mut sigma_v) = (Vec::new(), Vec::new(), Vec::new());
    for span in spans(model, theta) {
        let known = known_nodes(plan, record, sample, span.nodes.clone(), &shape, &v);
        let weights = span.weights(&known.iter().map(|k| k.node).collect::<Vec<_>>());
        for (node, parts) in span.nodes.zip(weights) {
            let dq: Vector3<f64> = parts.iter().map(|&(k, weight)| known[k].away * weight).sum();
            let dv: Vector3<f64> = parts.iter().map(|&(k, weight)| known[k].velocity * weight).sum();
            let seen = known.iter().any(|k| k.node == node && k.seen);
            let sigma = if seen { SHOOTING.seen } else { SHOOTING.unseen };
            for a in 0..3 {
                q[3 * node + a] = shape[3 * node + a] + dq[a];
                v[3 * node + a] = dv[a];
                if !model.prescribed()[node] {
                    dofs.push(3 * node + a);
                    sigma_q.push(sigma.0);
                    sigma_v.push(sigma.1);
                }
            }
        }
    }
    let by_q = stretch_prior::positions(model, theta, &q, &dofs, &sigma_q)?;
    let by_v = stretch_prior::velocities(model, theta, &by_q.mean, &v, &dofs, &sigma_v)?;
    let mut mean = State { q: by_q.mean, v: by_v.mean, z: model.initial_memory() };
    let bodies = body_start(plan, record, sample)?;
    let nodes = model.n_node_dofs();
    mean.q[nodes..].copy_from_slice(&bodies.q);
    mean.v[nodes..].copy_from_slice(&bodies.v);
    let following = turn_rods(model, theta, u, &mut mean).map_err(named)?;
    if plan.given {
        return Ok(StartState { mean, following, ..StartState::default() });
    }
    dofs.extend(nodes..model.nv());
    let z = vec![0.0; 2 * dofs.len()];
    let (position, velocity) = (beside(&by_q.factor, &bodies.position), beside(&by_v.factor, &bodies.velocity));
    let zeros = bodies.zeros.into_iter().map(|(sensor, q, v)| {
        let mut change = vec![0.0; model.ndx()];
        change[nodes..model.nv()].copy_from_slice(&q);
        change[model.nv() + nodes..2 * model.nv()].copy_from_slice(&v);
        Zero { sensor, scene: plan.scene_values.joints[sensor][BIAS], change }
    });
    Ok(StartState { mean, dofs, position, velocity, z, zeros: zeros.collect(), following })
}

/// Turns the edges of rods to where the grippers hold them, and evenly in between: markers do not show twist.
fn turn_rods(model: &Model, theta: &[f64], u: &[f64], x: &mut State) -> Result<Following, StepError> {
    let twists = 3 * model.n_nodes()..model.n_node_dofs();
    if twists.is_empty() {
        return Ok(Following::new());
    }
    x.q[twists.clone()].copy_from_slice(&model.initial_positions()[twists.clone()]);
    x.z[model.ndz()..].copy_from_slice(&model.frames_at(&x.q));
    let placed = place_clamped(model, theta, u, [&x.q, &x.z[model.ndz()..]])?.0;
    x.q[twists.clone()].copy_from_slice(&placed[twists]);
    let frames = x.z[model.ndz()..].to_vec();
    Ok(model.spread_twists(&mut x.q, &frames))
}

/// A block diagonal matrix.
fn beside(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let (n, m) = (a.nrows(), b.nrows());
    let mut out = DMatrix::zeros(n + m, n + m);
    out.view_mut((0, 0), (n, n)).copy_from(a);
    out.view_mut((n, n), (m, m)).copy_from(b);
    out
}

/// Velocities of the clamped nodes from the inputs at the next sample (or the one before); zero elsewhere.
fn driven_velocities(plan: &Plan, record: &Record, sample: usize, shape: &[f64]) -> Result<Vec<f64>, StepError> {
    let mut v = vec![0.0; plan.model.nv()];
    let other = if sample + 1 < record.inputs.len() { sample + 1 } else { sample.saturating_sub(1) };
    let dt = record.time[other] - record.time[sample];
    if dt == 0.0 {
        return Ok(v);
    }
    let frames = plan.model.frames_at(shape);
    let place = |k: usize| place_clamped(&plan.model, &plan.scene_values.theta, &record.inputs[k], [shape, &frames]);
    let (here, there) = (place(sample)?.0, place(other)?.0);
    for (node, _) in plan.model.prescribed().iter().enumerate().filter(|(_, d)| **d) {
        (3 * node..3 * node + 3).for_each(|k| v[k] = (there[k] - here[k]) / dt);
    }
    Ok(v)
}

/// A node whose place is known.
struct Known {
    node: usize,
    /// Its difference to the shape \[m\].
    away: Vector3<f64>,
    /// Its velocity [m/s].
    velocity: Vector3<f64>,
    /// By a marker.
    seen: bool,
}

/// Nodes whose difference to `shape` and velocity are known: markers, and clamped nodes.
fn known_nodes(
    plan: &Plan,
    record: &Record,
    sample: usize,
    nodes: std::ops::Range<usize>,
    shape: &[f64],
    v: &[f64],
) -> Vec<Known> {
    let mut known: Vec<Known> = Vec::new();
    let on_nodes = plan.markers.iter().map(MarkerPlace::nodes).enumerate().filter_map(|(m, pair)| Some((m, pair?)));
    for (m, marker) in on_nodes.filter(|(_, m)| m.weight == 0.0 && nodes.contains(&m.node)) {
        if let Some((p, v)) = marker_at(plan, record, m, sample) {
            let at = Vector3::new(shape[3 * marker.node], shape[3 * marker.node + 1], shape[3 * marker.node + 2]);
            known.push(Known { node: marker.node, away: p - at, velocity: v, seen: true });
        }
    }
    for node in nodes {
        if plan.model.prescribed()[node] && !known.iter().any(|k| k.node == node) {
            let velocity = Vector3::new(v[3 * node], v[3 * node + 1], v[3 * node + 2]);
            known.push(Known { node, away: Vector3::zeros(), velocity, seen: false });
        }
    }
    known
}

/// Position and velocity of a point that is read at `p` with velocity `v`, by the known errors of the sensor.
fn located(plan: &Plan, p: Vector3<f64>, v: Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let sensor = &plan.scene_values.sensor;
    let v = sensor.locate_direction(v).0 / sensor.0[SCALE];
    (sensor.locate(p).0 + v * sensor.time_offset(), v)
}

/// Position and velocity of a marker at a sample, by the known errors of the sensor.
pub(super) fn marker_at(plan: &Plan, record: &Record, marker: usize, sample: usize) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let seen = |t: usize| record.markers[t][marker].iter().all(|x| x.is_finite());
    let along = |a: usize| local_fit(record, sample, |t| if seen(t) { record.markers[t][marker][a] } else { f64::NAN });
    let (x, y, z) = (along(0)?, along(1)?, along(2)?);
    Some(located(plan, Vector3::new(x.value, y.value, z.value), Vector3::new(x.slope, y.slope, z.slope)))
}

/// A quadratic through the samples around one.
pub(super) struct LocalFit {
    pub value: f64,
    pub slope: f64,
    /// Root mean square of its residual.
    pub residual: f64,
    /// Half the time it spans \[s\].
    pub half_window: f64,
}

/// By least squares; none where too few samples are finite.
pub(super) fn local_fit(record: &Record, sample: usize, read: impl Fn(usize) -> f64) -> Option<LocalFit> {
    let first = sample.saturating_sub(SHOOTING.samples / 2).min(record.time.len().saturating_sub(SHOOTING.samples));
    let samples: Vec<(f64, f64)> = (first..record.time.len().min(first + SHOOTING.samples))
        .map(|k| (record.time[k] - record.time[sample], read(k)))
        .filter(|(_, x)| x.is_finite())
        .collect();
    if samples.len() < SHOOTING.fewest_samples {
        return None;
    }
    let a = DMatrix::from_fn(samples.len(), 3, |i, j| samples[i].0.powi(j as i32));
    let b = DVector::from_fn(samples.len(), |i, _| samples[i].1);
    let x = a.clone().svd(true, true).solve(&b, SHOOTING.singular).ok()?;
    let left = (&a * &x - &b).norm_squared() / (samples.len() - 3) as f64;
    let half_window = 0.5 * (samples[samples.len() - 1].0 - samples[0].0);
    Some(LocalFit { value: x[0], slope: x[1], residual: left.sqrt(), half_window })
}
