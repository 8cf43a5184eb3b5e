//! Where a record starts: at rest, or at an unknown state with a prior from its first samples.

use super::plan::Plan;
use super::stretch_prior;
use crate::error::IdentifyError;
use crate::log::Record;
use crate::sensor::SCALE;
use nalgebra::{DMatrix, DVector, Vector3};
use pliant_engine::equilibrium::{equilibrium, place_clamped};
use pliant_engine::state::State;
use pliant_engine::step::StepError;

/// Samples of the local quadratic that gives positions and velocities at the start.
const SAMPLES: usize = 9;
/// Standard deviations of the prior of an observed node \[m\], [m/s].
const SEEN: (f64, f64) = (2e-3, 0.05);
/// Of a node between observed ones.
const UNSEEN: (f64, f64) = (1e-2, 0.3);

/// Initial state of a record: `x₀ = mean + L z` on the free dofs, z unknown with a standard normal prior.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StartState {
    /// Prior mean.
    pub mean: State,
    /// Free dofs of q (and of v); empty where nothing is unknown.
    pub dofs: Vec<usize>,
    /// L for the positions: the first half of z moves them \[m\].
    pub position: DMatrix<f64>,
    /// L for the velocities: the second half of z [m/s].
    pub velocity: DMatrix<f64>,
    /// Current estimate of z.
    pub z: Vec<f64>,
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

    /// The current estimate of the state (before the clamped nodes are placed).
    pub fn state(&self) -> State {
        let mut x = self.mean.clone();
        let n = self.dofs.len();
        for (row, &dof) in self.dofs.iter().enumerate() {
            for c in 0..n {
                x.q[dof] += self.position[(row, c)] * self.z[c];
                x.v[dof] += self.velocity[(row, c)] * self.z[n + c];
            }
        }
        x
    }
}

/// Prior of a record's initial state. At rest: the equilibrium, nothing unknown. Measured: a quadratic through each marker's
/// first samples; free nodes without a marker follow by carrying the difference to the equilibrium shape over, linearly
/// along the rope, with a wider prior.
pub fn initial_guess(plan: &Plan, record: &Record) -> Result<StartState, IdentifyError> {
    let model = &plan.model;
    if plan.at_rest {
        let rest = equilibrium(model, &plan.scene_values.theta, model.initial_positions(), &record.inputs[0]);
        let rest = rest.map_err(|e| IdentifyError::Simulation { record: record.name.clone(), source: e })?;
        return Ok(StartState {
            mean: State { v: vec![0.0; rest.q.len()], q: rest.q, z: model.initial_memory() },
            ..StartState::default()
        });
    }
    state_at(plan, record, 0)
}

/// The state at a sample of the record as the data have it, with its prior: a quadratic through the samples around it for each
/// marker, the rest by interpolation, reconciled with what the ropes' stiffness allows.
pub fn state_at(plan: &Plan, record: &Record, sample: usize) -> Result<StartState, IdentifyError> {
    let model = &plan.model;
    let theta = &plan.scene_values.theta;
    let named = |e| IdentifyError::Simulation { record: record.name.clone(), source: e };
    let u = &record.inputs[sample];
    let shape = match equilibrium(model, theta, model.initial_positions(), u) {
        Ok(rest) => rest.q,
        Err(_) => place_clamped(model, theta, u, model.initial_positions()).map_err(named)?.0,
    };
    let (mut q, mut v) = (shape.clone(), driven_velocities(plan, record, sample, &shape).map_err(named)?);
    let (mut dofs, mut sigma_q, mut sigma_v) = (Vec::new(), Vec::new(), Vec::new());
    for rope in model.ropes() {
        let known = known_nodes(plan, record, sample, rope.nodes.clone(), &shape, &v);
        for node in rope.nodes.clone() {
            let (dq, dv, seen) = interpolate(&known, node);
            let sigma = if seen { SEEN } else { UNSEEN };
            for a in 0..3 {
                q[3 * node + a] = shape[3 * node + a] + dq[a];
                v[3 * node + a] = dv[a];
                if !model.driven()[node] {
                    dofs.push(3 * node + a);
                    sigma_q.push(sigma.0);
                    sigma_v.push(sigma.1);
                }
            }
        }
    }
    let by_q = stretch_prior::positions(model, theta, &q, &dofs, &sigma_q)?;
    let by_v = stretch_prior::velocities(model, theta, &by_q.mean, &v, &dofs, &sigma_v)?;
    if plan.given {
        return Ok(StartState { mean: State { q: by_q.mean, v: by_v.mean, z: model.initial_memory() }, ..StartState::default() });
    }
    let z = vec![0.0; 2 * dofs.len()];
    Ok(StartState {
        mean: State { q: by_q.mean, v: by_v.mean, z: model.initial_memory() },
        dofs,
        position: by_q.factor,
        velocity: by_v.factor,
        z,
    })
}

/// Velocities of the clamped nodes from the inputs at the next sample (or the one before); zero elsewhere.
fn driven_velocities(plan: &Plan, record: &Record, sample: usize, shape: &[f64]) -> Result<Vec<f64>, StepError> {
    let mut v = vec![0.0; shape.len()];
    let other = if sample + 1 < record.inputs.len() { sample + 1 } else { sample.saturating_sub(1) };
    let dt = record.time[other] - record.time[sample];
    if dt == 0.0 {
        return Ok(v);
    }
    let place = |k: usize| place_clamped(&plan.model, &plan.scene_values.theta, &record.inputs[k], shape);
    let (here, there) = (place(sample)?.0, place(other)?.0);
    for (node, _) in plan.model.driven().iter().enumerate().filter(|(_, d)| **d) {
        (3 * node..3 * node + 3).for_each(|k| v[k] = (there[k] - here[k]) / dt);
    }
    Ok(v)
}

type Known = (usize, Vector3<f64>, Vector3<f64>, bool);

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
    for (m, marker) in plan.markers.iter().enumerate().filter(|(_, m)| m.weight == 0.0 && nodes.contains(&m.node)) {
        if let Some((p, v)) = local_fit(record, m, sample) {
            let (p, v) = located(plan, p, v);
            let at = Vector3::new(shape[3 * marker.node], shape[3 * marker.node + 1], shape[3 * marker.node + 2]);
            known.push((marker.node, p - at, v, true));
        }
    }
    for node in nodes {
        if plan.model.driven()[node] && !known.iter().any(|k| k.0 == node) {
            let speed = Vector3::new(v[3 * node], v[3 * node + 1], v[3 * node + 2]);
            known.push((node, Vector3::zeros(), speed, false));
        }
    }
    known.sort_by_key(|k| k.0);
    known
}

/// Position and velocity of what is read as moving by `p` with `v`, by what is known of the sensor beforehand.
fn located(plan: &Plan, p: Vector3<f64>, v: Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let sensor = &plan.scene_values.sensor;
    let v = sensor.locate_direction(v).0 / sensor.0[SCALE];
    (sensor.locate(p).0 + v * sensor.time_offset(), v)
}

fn interpolate(known: &[Known], node: usize) -> (Vector3<f64>, Vector3<f64>, bool) {
    let after = known.iter().position(|k| k.0 >= node);
    match after {
        Some(k) if known[k].0 == node => (known[k].1, known[k].2, known[k].3),
        Some(0) => (known[0].1, known[0].2, false),
        Some(k) => {
            let (a, b) = (&known[k - 1], &known[k]);
            let t = (node - a.0) as f64 / (b.0 - a.0) as f64;
            (a.1.lerp(&b.1, t), a.2.lerp(&b.2, t), false)
        }
        None => known.last().map_or((Vector3::zeros(), Vector3::zeros(), false), |k| (k.1, k.2, false)),
    }
}

/// Position and velocity at a sample by a least-squares quadratic through a marker's samples around it.
fn local_fit(record: &Record, marker: usize, sample: usize) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let first = sample.saturating_sub(SAMPLES / 2).min(record.time.len().saturating_sub(SAMPLES));
    let samples: Vec<(f64, [f64; 3])> = (first..record.time.len().min(first + SAMPLES))
        .map(|k| (record.time[k] - record.time[sample], record.markers[k][marker]))
        .filter(|(_, p)| p.iter().all(|x| x.is_finite()))
        .collect();
    if samples.len() < 4 {
        return None;
    }
    let a = DMatrix::from_fn(samples.len(), 3, |i, j| samples[i].0.powi(j as i32));
    let fit = |axis: usize| {
        let b = DVector::from_fn(samples.len(), |i, _| samples[i].1[axis]);
        a.clone().svd(true, true).solve(&b, 1e-12).ok()
    };
    let (x, y, z) = (fit(0)?, fit(1)?, fit(2)?);
    Some((Vector3::new(x[0], y[0], z[0]), Vector3::new(x[1], y[1], z[1])))
}
