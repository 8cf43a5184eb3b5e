//! jvp and vjp of a static equilibrium: the same theorem, K = −∂f/∂q at rest.

use crate::AdjointError;
use crate::rollout::check;
use crate::seeds::Seeds;
use crate::stage::{Context, Memory, stage_cotangent, stage_tangent};
use pliant_engine::equilibrium::Equilibrium;
use pliant_engine::kinematics::Input;

/// Tangents of the equilibrium positions for the directions in `seeds`, row-major `nq × columns`.
pub fn equilibrium_tangent(eq: &Equilibrium, seeds: &Seeds) -> Vec<f64> {
    let m = seeds.columns;
    let mass = eq.model.masses(&eq.theta);
    let cx = Context { model: &eq.model, theta: &eq.theta, mass: &mass };
    let zero = vec![0.0; eq.model.nq() * m];
    let mut q = zero.clone();
    for &(row, input, value) in &eq.placement {
        let columns = match input {
            Input::U(k) => seeds.u(k),
            Input::Theta(k) => seeds.theta(k),
            Input::Q(_) => &[],
        };
        columns.iter().for_each(|&(c, w)| q[row * m + c] += value * w);
    }
    let mut memory = Memory::default();
    memory.cmd.clone_from(&zero);
    stage_tangent(cx, &eq.record, &q, &zero, seeds, &mut memory);
    q.iter_mut().zip(&memory.v_next).for_each(|(q, s)| *q += s);
    q
}

/// Cotangents of (u, θ) from the cotangent `q_bar` of the equilibrium positions.
pub fn equilibrium_vjp(eq: &Equilibrium, q_bar: &[f64]) -> Result<(Vec<f64>, Vec<f64>), AdjointError> {
    check("q_bar", Some(q_bar.len()), eq.model.nq())?;
    let mass = eq.model.masses(&eq.theta);
    let cx = Context { model: &eq.model, theta: &eq.theta, mass: &mass };
    let (mut u, mut theta) = (vec![0.0; eq.model.nu()], vec![0.0; eq.model.n_params()]);
    let (mut reference, mut v, mut cmd) = (q_bar.to_vec(), vec![0.0; q_bar.len()], vec![0.0; q_bar.len()]);
    stage_cotangent(cx, &eq.record, q_bar, &mut reference, &mut v, &mut cmd, &mut theta);
    for &(row, input, value) in &eq.placement {
        match input {
            Input::U(k) => u[k] += value * reference[row],
            Input::Theta(k) => theta[k] += value * reference[row],
            Input::Q(_) => {}
        }
    }
    Ok((u, theta))
}
