//! Full Jacobians of a step.

use crate::seeds::Seeds;
use crate::stage::Context;
use crate::step::{Tangent, step_tangent};
use pliant_engine::model::Model;
use pliant_engine::step::StepRecord;

/// Jacobians of x⁺ = F(x, u, θ), row-major, x = (q, v).
#[derive(Clone, Debug, PartialEq)]
pub struct Linearization {
    /// A = ∂x⁺/∂x, nx × nx.
    pub a: Vec<f64>,
    /// B = ∂x⁺/∂u, nx × nu.
    pub b: Vec<f64>,
    /// C = ∂x⁺/∂θ, nx × n_params.
    pub c: Vec<f64>,
}

/// A and B, and C for all of θ if `with_theta` (else empty), from the factorization of the step.
pub fn linearize(model: &Model, theta: &[f64], step: &StepRecord, with_theta: bool) -> Linearization {
    let (nq, nu) = (model.nq(), model.nu());
    let np = if with_theta { model.n_params() } else { 0 };
    let (nx, m) = (2 * nq, 2 * nq + nu + np);
    let mut seeds = Seeds::none(m, nu, model.n_params());
    (0..nu).for_each(|k| seeds.add_u(k, nx + k, 1.0));
    (0..np).for_each(|k| seeds.add_theta(k, nx + nu + k, 1.0));
    let mut x = Tangent { q: vec![0.0; nq * m], v: vec![0.0; nq * m] };
    for k in 0..nq {
        x.q[k * m + k] = 1.0;
        x.v[k * m + nq + k] = 1.0;
    }
    let mass = model.masses(theta);
    step_tangent(Context { model, theta, mass: &mass }, step, &mut x, &seeds);
    let rows = || x.q.chunks_exact(m).chain(x.v.chunks_exact(m));
    let part = |from: usize, to: usize| rows().flat_map(|r| r[from..to].iter().copied()).collect();
    Linearization { a: part(0, nx), b: part(nx, nx + nu), c: part(nx + nu, m) }
}
