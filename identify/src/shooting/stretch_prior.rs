//! Prior of an initial state from the stiffness of a rope or sheet, where the state is read off markers.
//!
//! Marker noise and chords across bent edges look like stretch. In a stiff rope the forces of that stretch dwarf all others and
//! blow the motion up within a step. So the prior of an initial state holds, besides the readings, that every edge is strained
//! no more than the own weight of its rope or sheet under a few times gravity would strain it:
//! ```text
//! q:  Σ |q − q_read|²/σ_q² + Σ_edges (ε/s)²,     v:  Σ |v − v_read|²/σ_v² + Σ_edges (ε̇/(s Ω))²
//! ```
//! Its mean is the minimum, its covariance the inverse curvature there (Gauss–Newton), q and v apart.

use super::constants::SHOOTING;
use super::extension::spans;
use crate::error::IdentifyError;
use nalgebra::{Cholesky, DMatrix, DVector, Vector3};
use pliant_engine::model::Model;

/// An edge between two nodes, at least one of them free.
struct StiffEdge {
    nodes: [usize; 2],
    rest: f64,
    /// Plausible strain [-].
    strain: f64,
}

/// A Gaussian over the free dofs of the positions or of the velocities: `mean + factor · z`, z standard normal.
pub(super) struct Prior {
    /// Mean, all nodes.
    pub mean: Vec<f64>,
    /// Lower triangular factor of the covariance over the free dofs.
    pub factor: DMatrix<f64>,
}

/// Prior of the positions from readings `q` with standard deviations `sigma` of the free dofs `dofs`.
pub(super) fn positions(model: &Model, theta: &[f64], q: &[f64], dofs: &[usize], sigma: &[f64]) -> Result<Prior, IdentifyError> {
    let edges = stiff_edges(model, theta);
    let mut mean = q.to_vec();
    for _ in 0..SHOOTING.mean_steps {
        let mut system = System::new(q.len(), dofs, sigma, |k| q[k] - mean[k]);
        for e in &edges {
            let t = between(&mean, e.nodes);
            let length = t.norm().max(1e-12);
            system.add_edge(e, &(t / (length * e.rest * e.strain)), -(length / e.rest - 1.0) / e.strain);
        }
        let (step, factor) = system.solve()?;
        dofs.iter().zip(step.iter()).for_each(|(&k, d)| mean[k] += d);
        if step.amax() < SHOOTING.mean_settled {
            return Ok(Prior { mean, factor });
        }
    }
    // not settled: the readings are far from any shape of this rope or sheet, and the last curvature has to do
    let mut system = System::new(q.len(), dofs, sigma, |_| 0.0);
    for e in &edges {
        let t = between(&mean, e.nodes);
        system.add_edge(e, &(t / (t.norm().max(1e-12) * e.rest * e.strain)), 0.0);
    }
    Ok(Prior { factor: system.solve()?.1, mean })
}

/// Prior of the velocities from readings `v`, for edges that point as in `q`.
pub(super) fn velocities(
    model: &Model,
    theta: &[f64],
    q: &[f64],
    v: &[f64],
    dofs: &[usize],
    sigma: &[f64],
) -> Result<Prior, IdentifyError> {
    let mut system = System::new(q.len(), dofs, sigma, |_| 0.0);
    for e in &stiff_edges(model, theta) {
        let t = between(q, e.nodes).normalize() / (e.rest * e.strain * SHOOTING.strain_rate);
        system.add_edge(e, &t, -t.dot(&between(v, e.nodes)));
    }
    let (step, factor) = system.solve()?;
    let mut mean = v.to_vec();
    dofs.iter().zip(step.iter()).for_each(|(&k, d)| mean[k] += d);
    Ok(Prior { mean, factor })
}

fn between(x: &[f64], [a, b]: [usize; 2]) -> Vector3<f64> {
    Vector3::new(x[3 * b] - x[3 * a], x[3 * b + 1] - x[3 * a + 1], x[3 * b + 2] - x[3 * a + 2])
}

fn stiff_edges(model: &Model, theta: &[f64]) -> Vec<StiffEdge> {
    let mass = model.masses(theta);
    let free = |nodes: &[usize; 2]| nodes.iter().any(|node| !model.prescribed()[*node]);
    let mut out = Vec::new();
    for span in spans(model, theta) {
        let weight = SHOOTING.strain_acceleration * span.nodes.map(|node| mass[node]).sum::<f64>();
        let strain = (weight / span.stiffness.max(f64::MIN_POSITIVE)).clamp(SHOOTING.strain_bounds.0, SHOOTING.strain_bounds.1);
        let edges = span.edges.into_iter().filter(|edge| free(&edge.nodes));
        out.extend(edges.map(|edge| StiffEdge { nodes: edge.nodes, rest: edge.rest, strain }));
    }
    out
}

/// Normal equations over the free dofs.
struct System {
    column: Vec<Option<usize>>,
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

impl System {
    fn new(n: usize, dofs: &[usize], sigma: &[f64], pull: impl Fn(usize) -> f64) -> Self {
        let mut column = vec![None; n];
        dofs.iter().enumerate().for_each(|(c, &k)| column[k] = Some(c));
        let matrix = DMatrix::from_diagonal(&DVector::from_iterator(dofs.len(), sigma.iter().map(|s| 1.0 / (s * s))));
        let right = DVector::from_iterator(dofs.len(), dofs.iter().zip(sigma).map(|(&k, s)| pull(k) / (s * s)));
        Self { column, matrix, right }
    }

    /// One row: slope · (x_b − x_a) = target.
    fn add_edge(&mut self, e: &StiffEdge, slope: &Vector3<f64>, target: f64) {
        let entries: Vec<(usize, f64)> = (0..6)
            .filter_map(|k| {
                let (end, axis) = (k / 3, k % 3);
                let sign = if end == 0 { -1.0 } else { 1.0 };
                self.column[3 * e.nodes[end] + axis].map(|c| (c, sign * slope[axis]))
            })
            .collect();
        for &(i, a) in &entries {
            self.right[i] += a * target;
            for &(j, b) in &entries {
                self.matrix[(i, j)] += a * b;
            }
        }
    }

    /// Solution, and a factor L of the covariance L Lᵀ = matrix⁻¹ in the directions of its axes.
    fn solve(self) -> Result<(DVector<f64>, DMatrix<f64>), IdentifyError> {
        let n = self.matrix.nrows();
        let singular = || IdentifyError::Input("an initial state cannot be read off the markers: they are not finite".to_owned());
        let lower = Cholesky::new(self.matrix).ok_or_else(singular)?;
        let step = lower.solve(&self.right);
        let factor = lower.l().transpose().solve_upper_triangular(&DMatrix::identity(n, n)).ok_or_else(singular)?;
        Ok((step, factor))
    }
}
