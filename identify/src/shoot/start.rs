//! Where a record starts: at rest, or at an unknown state with a prior from its first samples.

use super::plan::Plan;
use crate::error::IdentifyError;
use crate::log::Record;
use nalgebra::{DMatrix, DVector, Vector3};
use pliant_engine::equilibrium::{equilibrium, place_clamped};
use pliant_engine::state::State;

/// Samples of the local quadratic that gives positions and velocities at the start.
const SAMPLES: usize = 9;
/// Standard deviations of the prior of an observed node [m], [m/s].
const SEEN: (f64, f64) = (2e-3, 0.05);
/// Of a node between observed ones.
const UNSEEN: (f64, f64) = (1e-2, 0.3);

/// Initial state of a record: `x₀ = mean + spread · z` on the free dofs, z unknown with a standard normal prior.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StartState {
    /// Prior mean.
    pub mean: State,
    /// (dof of x = (q, v), prior standard deviation) per entry of z; empty at rest.
    pub spread: Vec<(usize, f64)>,
    /// Current estimate of z.
    pub z: Vec<f64>,
}

impl StartState {
    /// The current estimate of the state (before the clamped nodes are placed).
    pub fn state(&self) -> State {
        let mut x = self.mean.clone();
        let nq = x.q.len();
        for (&(dof, sigma), z) in self.spread.iter().zip(&self.z) {
            if dof < nq { x.q[dof] += sigma * z } else { x.v[dof - nq] += sigma * z }
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
        return Ok(StartState { mean: State { v: vec![0.0; rest.q.len()], q: rest.q }, ..StartState::default() });
    }
    let (mean, spread) = state_at(plan, record, 0)?;
    let z = vec![0.0; spread.len()];
    Ok(StartState { mean, spread, z })
}

/// The state at a sample of the record as the data have it, and the spread of what they do not fix: a quadratic through the
/// samples around it for each marker, the rest by interpolation.
pub fn state_at(plan: &Plan, record: &Record, sample: usize) -> Result<(State, Vec<(usize, f64)>), IdentifyError> {
    let model = &plan.model;
    let theta = &plan.scene_values.theta;
    let u = &record.inputs[sample];
    let rest = equilibrium(model, theta, model.initial_positions(), u);
    let shape = match rest {
        Ok(rest) => rest.q,
        Err(_) => {
            let placed = place_clamped(model, theta, u, model.initial_positions());
            placed.map_err(|e| IdentifyError::Simulation { record: record.name.clone(), source: e })?.0
        }
    };
    let (mut q, mut v) = (shape.clone(), vec![0.0; shape.len()]);
    let mut spread = Vec::new();
    for rope in model.ropes() {
        let known = known_nodes(plan, record, sample, rope.nodes.clone(), &shape);
        for node in rope.nodes.clone() {
            let (dq, dv, seen) = interpolate(&known, node);
            let sigma = if seen { SEEN } else { UNSEEN };
            for a in 0..3 {
                q[3 * node + a] = shape[3 * node + a] + dq[a];
                v[3 * node + a] = dv[a];
                if !model.driven()[node] {
                    spread.push((3 * node + a, sigma.0));
                    spread.push((shape.len() + 3 * node + a, sigma.1));
                }
            }
        }
    }
    Ok((State { q, v }, spread))
}

type Known = (usize, Vector3<f64>, Vector3<f64>, bool);

/// Nodes whose difference to `shape` and velocity are known: markers, and clamped nodes.
fn known_nodes(plan: &Plan, record: &Record, sample: usize, nodes: std::ops::Range<usize>, shape: &[f64]) -> Vec<Known> {
    let mut known: Vec<Known> = Vec::new();
    for (m, marker) in plan.markers.iter().enumerate().filter(|(_, m)| m.weight == 0.0 && nodes.contains(&m.node)) {
        if let Some((p, v)) = local_fit(record, m, sample) {
            let at = Vector3::new(shape[3 * marker.node], shape[3 * marker.node + 1], shape[3 * marker.node + 2]);
            known.push((marker.node, p - at, v, true));
        }
    }
    for node in nodes {
        if plan.model.driven()[node] && !known.iter().any(|k| k.0 == node) {
            known.push((node, Vector3::zeros(), Vector3::zeros(), false));
        }
    }
    known.sort_by_key(|k| k.0);
    known
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
