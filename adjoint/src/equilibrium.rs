//! jvp and vjp of a static equilibrium: the same theorem, K = −∂f/∂q at rest.

use crate::AdjointError;
use crate::rollout::check;
use crate::seeds::Seeds;
use crate::stage::{Context, InputBars, Memory, Tangents, move_along, pull_along, stage_cotangent, stage_tangent};
use pliant_engine::equilibrium::Equilibrium;
use pliant_math::Input;

/// Tangent of the equilibrium positions (nv) along `u_dot` (nu) and `theta_dot`; `None` is zero.
///
/// # Errors
/// Arguments of another size.
pub fn equilibrium_jvp(eq: &Equilibrium, u_dot: Option<&[f64]>, theta_dot: Option<&[f64]>) -> Result<Vec<f64>, AdjointError> {
    check("u_dot", u_dot.map(<[f64]>::len), eq.model.nu())?;
    check("theta_dot", theta_dot.map(<[f64]>::len), eq.model.n_params())?;
    let mut seeds = Seeds::none(1, eq.model.nu(), eq.model.n_params());
    u_dot.unwrap_or(&[]).iter().enumerate().for_each(|(k, &w)| seeds.add_u(k, 0, w));
    theta_dot.unwrap_or(&[]).iter().enumerate().for_each(|(k, &w)| seeds.add_theta(k, 0, w));
    Ok(equilibrium_jvp_columns(eq, &seeds))
}

/// As [`equilibrium_jvp`], for many directions at once: those in `seeds`, row-major `nv × columns`.
pub fn equilibrium_jvp_columns(eq: &Equilibrium, seeds: &Seeds) -> Vec<f64> {
    let m = seeds.columns;
    let mass = eq.model.row_masses(&eq.theta);
    let cx = Context { model: &eq.model, theta: &eq.theta, mass: &mass };
    let zero = vec![0.0; eq.model.nv() * m];
    let mut q = zero.clone();
    for &(row, input, value) in &eq.placement {
        let columns = match input {
            Input::U(k) => seeds.u(k),
            Input::Theta(k) => seeds.theta(k),
            _ => &[],
        };
        columns.iter().for_each(|&(c, w)| q[row * m + c] += value * w);
    }
    let mut memory = Memory::default();
    memory.cmd.clone_from(&zero);
    // the initial state is fixed: history variables do not move
    memory.start[0].clone_from(&zero);
    memory.z_past.resize(eq.model.ndz() * m, 0.0);
    memory.signals.resize(eq.model.nu() * m, 0.0);
    let tangents = Tangents { seeds, signals: &[], cmd: &[], q: &[], z: &[], end: [&[], &[]] };
    for &(row, input, value) in &eq.signals {
        tangents.add(input, value, &mut memory.signals[row * m..(row + 1) * m]);
    }
    stage_tangent(cx, &eq.record, &q, &zero, seeds, &mut memory);
    move_along(cx, (&eq.record.transport.end, &eq.record.transport.carry[1]), &mut q, &memory.v_next, m, |_| 1.0);
    q
}

/// Cotangents of (u, θ) from the cotangent `q_bar` (nv) of the equilibrium positions.
///
/// # Errors
/// A cotangent of another size.
pub fn equilibrium_vjp(eq: &Equilibrium, q_bar: &[f64]) -> Result<(Vec<f64>, Vec<f64>), AdjointError> {
    check("q_bar", Some(q_bar.len()), eq.model.nv())?;
    let mass = eq.model.row_masses(&eq.theta);
    let cx = Context { model: &eq.model, theta: &eq.theta, mass: &mass };
    let (mut u, mut theta) = (vec![0.0; eq.model.nu()], vec![0.0; eq.model.n_params()]);
    let (mut reference, mut v, mut cmd) = (q_bar.to_vec(), vec![0.0; q_bar.len()], vec![0.0; q_bar.len()]);
    // the root is a displacement d with q = q_ref ⊕ d
    let mut y_bar = vec![0.0; q_bar.len()];
    pull_along(cx, (&eq.record.transport.end, &eq.record.transport.carry[1]), &mut reference, &mut y_bar, 1.0, |_| 1.0);
    let (mut past, mut z, mut signals) = (vec![0.0; q_bar.len()], vec![0.0; eq.model.ndz()], vec![0.0; u.len()]);
    let mut inputs = InputBars { cmd: &mut cmd, u: &mut signals, theta: &mut theta, q: &mut past, z: &mut z };
    stage_cotangent(cx, &eq.record, &y_bar, &mut reference, &mut v, &mut inputs);
    for &(row, input, value) in &eq.signals {
        if let Input::U(k) = input {
            u[k] += value * signals[row];
        }
    }
    for &(row, input, value) in &eq.placement {
        match input {
            Input::U(k) => u[k] += value * reference[row],
            Input::Theta(k) => theta[k] += value * reference[row],
            _ => {}
        }
    }
    Ok((u, theta))
}
