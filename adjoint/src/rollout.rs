//! jvp and vjp of a rollout.

use crate::AdjointError;
use crate::linearization::Linearization;
use crate::linearize::{Linearizer, linearize};
use crate::seeds::Seeds;
use crate::stage::{Context, Memory};
use crate::step::{Cotangent, Tangent, step_cotangent, step_tangent};
use crate::tangent::TangentStepper;
use pliant_engine::rollout::Rollout;

/// Cotangents of everything a rollout starts from.
#[derive(Clone, Debug, PartialEq)]
pub struct RolloutCotangent {
    /// Of a change of x₀ = (q, v, z), 2 nv + nz entries: for a ball, of a turn in its body's axes.
    pub x0: Vec<f64>,
    /// Of each control row.
    pub u: Vec<Vec<f64>>,
    /// Of θ, in SI units of each entry.
    pub theta: Vec<f64>,
}

/// Tangents of x₀ … x_T for directions `x0_dot` (2 nv + nz), `u_dot` (T rows) and `theta_dot`; `None` is zero. Row 0 is `x0_dot`.
///
/// # Errors
/// A rollout without records or with checkpoints, or arguments of another size.
pub fn rollout_jvp(
    rollout: &Rollout,
    x0_dot: Option<&[f64]>,
    u_dot: Option<&[Vec<f64>]>,
    theta_dot: Option<&[f64]>,
) -> Result<Vec<Vec<f64>>, AdjointError> {
    need_records(rollout)?;
    if rollout.checkpoints.is_some() {
        return Err(AdjointError::Checkpointed);
    }
    let model = &rollout.model;
    let nv = model.nv();
    check("x0_dot", x0_dot.map(<[f64]>::len), model.ndx())?;
    check("theta_dot", theta_dot.map(<[f64]>::len), model.n_params())?;
    check("u_dot", u_dot.map(<[Vec<f64>]>::len), rollout.records.len())?;
    let mass = model.row_masses(&rollout.theta);
    let cx = Context { model, theta: &rollout.theta, mass: &mass };
    let mut seeds = Seeds::none(1, model.nu(), model.n_params());
    for (k, &weight) in theta_dot.unwrap_or(&[]).iter().enumerate().filter(|(_, w)| **w != 0.0) {
        seeds.add_theta(k, 0, weight);
    }
    let zero = vec![0.0; model.ndx()];
    let x0_dot = x0_dot.unwrap_or(&zero);
    let (q, (v, z)) = (&x0_dot[..nv], x0_dot[nv..].split_at(nv));
    let mut x = Tangent { q: q.to_vec(), v: v.to_vec(), z: z.to_vec() };
    let (mut out, mut memory) = (vec![x0_dot.to_vec()], Memory::default());
    for (k, record) in rollout.records.iter().enumerate() {
        if let Some(u_dot) = u_dot {
            check("u_dot row", Some(u_dot[k].len()), model.nu())?;
            seeds.clear_u();
            u_dot[k].iter().enumerate().for_each(|(c, &w)| seeds.add_u(c, 0, w));
        }
        step_tangent(cx, record, &mut x, &seeds, &mut memory);
        out.push([x.q.as_slice(), x.v.as_slice(), x.z.as_slice()].concat());
    }
    Ok(out)
}

/// Pulls cotangents `x_bar` of x₀ … x_T (T + 1 rows of 2 nv + nz) back to x₀, u and θ.
///
/// Parts between checkpoints are simulated again from the same states and warm starts, hence solve the same systems: the result is
/// bitwise that of stored records.
///
/// # Errors
/// A rollout without records, or arguments of another size.
pub fn rollout_vjp(rollout: &Rollout, x_bar: &[Vec<f64>]) -> Result<RolloutCotangent, AdjointError> {
    need_records(rollout)?;
    check("x_bar", Some(x_bar.len()), rollout.controls.len() + 1)?;
    let model = &rollout.model;
    let mut out = RolloutCotangent {
        x0: Vec::new(),
        u: vec![vec![0.0; model.nu()]; rollout.controls.len()],
        theta: vec![0.0; model.n_params()],
    };
    let mut x = Cotangent::zero(model);
    if rollout.checkpoints.is_none() {
        pull_back(rollout, 0, x_bar, &mut x, &mut out)?;
    } else {
        for s in (0..rollout.n_segments()).rev() {
            let (first, segment) = rollout.segment(s)?;
            pull_back(&segment, first, x_bar, &mut x, &mut out)?;
        }
    }
    add(&mut x, &x_bar[0])?;
    out.x0 = [x.q, x.v, x.z].concat();
    Ok(out)
}

/// A, B and C of step `k`: row-major, x = (q, v, z).
///
/// # Errors
/// A rollout without a record of that step.
pub fn rollout_linearize(rollout: &Rollout, k: usize) -> Result<Linearization, AdjointError> {
    match rollout.records.get(k) {
        Some(record) => Ok(linearize(&rollout.model, &rollout.theta, record, true)),
        None if rollout.checkpoints.is_some() => Err(AdjointError::Checkpointed),
        None => Err(AdjointError::NoRecords),
    }
}

/// A, B and, if its buffer is given, C of all steps, written one after another into the caller's memory: T × (2 nv + nz)², T × (2 nv + nz)
/// × nu, T × (2 nv + nz) × n_params numbers, row-major.
///
/// # Errors
/// A rollout without records or with checkpoints, buffers of another size.
pub fn rollout_jacobians(rollout: &Rollout, a: &mut [f64], b: &mut [f64], c: Option<&mut [f64]>) -> Result<(), AdjointError> {
    need_records(rollout)?;
    if rollout.checkpoints.is_some() {
        return Err(AdjointError::Checkpointed);
    }
    let (model, steps) = (&rollout.model, rollout.records.len());
    let (ndx, nu, np) = (model.ndx(), model.nu(), model.n_params());
    check("a", Some(a.len()), steps * ndx * ndx)?;
    check("b", Some(b.len()), steps * ndx * nu)?;
    check("c", c.as_ref().map(|c| c.len()), steps * ndx * np)?;
    let mut linearizer = Linearizer::new(model, &rollout.theta, c.is_some());
    let mut c = c;
    for (k, record) in rollout.records.iter().enumerate() {
        let of_step = linearizer.linearize(record);
        a[k * ndx * ndx..][..ndx * ndx].copy_from_slice(&of_step.a);
        b[k * ndx * nu..][..ndx * nu].copy_from_slice(&of_step.b);
        if let Some(c) = &mut c {
            c[k * ndx * np..][..ndx * np].copy_from_slice(&of_step.c);
        }
    }
    Ok(())
}

/// Tangents of x₀ … x_T along `columns` directions at once: row-major (2 nv + nz) × columns each. `x0_dot` (2 nv + nz, columns), `u_dot` (T
/// rows of nu × columns), `theta_dot` (n_params, columns), row-major; `None` is zero.
///
/// # Errors
/// As [`rollout_jvp`].
pub fn rollout_jvp_columns(
    rollout: &Rollout,
    columns: usize,
    x0_dot: Option<&[f64]>,
    u_dot: Option<&[Vec<f64>]>,
    theta_dot: Option<&[f64]>,
) -> Result<Vec<Vec<f64>>, AdjointError> {
    need_records(rollout)?;
    if rollout.checkpoints.is_some() {
        return Err(AdjointError::Checkpointed);
    }
    let model = &rollout.model;
    let (nv, ndx, nu, np) = (model.nv(), model.ndx(), model.nu(), model.n_params());
    check("x0_dot", x0_dot.map(<[f64]>::len), ndx * columns)?;
    check("theta_dot", theta_dot.map(<[f64]>::len), np * columns)?;
    check("u_dot", u_dot.map(<[Vec<f64>]>::len), rollout.records.len())?;
    let mut seeds = Seeds::none(columns, nu, np);
    for (k, &weight) in theta_dot.unwrap_or(&[]).iter().enumerate().filter(|(_, w)| **w != 0.0) {
        seeds.add_theta(k / columns, k % columns, weight);
    }
    let mut tangent = TangentStepper::new(model, &rollout.theta, seeds);
    if let Some(x0_dot) = x0_dot {
        let (q, rest) = x0_dot.split_at(nv * columns);
        let (v, z) = rest.split_at(nv * columns);
        tangent.x.q.copy_from_slice(q);
        tangent.x.v.copy_from_slice(v);
        tangent.x.z.copy_from_slice(z);
    }
    let all = |tangent: &TangentStepper| [tangent.x.q.as_slice(), tangent.x.v.as_slice(), tangent.x.z.as_slice()].concat();
    let mut out = vec![all(&tangent)];
    for (k, record) in rollout.records.iter().enumerate() {
        tangent.seeds.clear_u();
        if let Some(u_dot) = u_dot {
            check("u_dot row", Some(u_dot[k].len()), nu * columns)?;
            let nonzero = u_dot[k].iter().enumerate().filter(|(_, w)| **w != 0.0);
            nonzero.for_each(|(c, &w)| tangent.seeds.add_u(c / columns, c % columns, w));
        }
        tangent.step(record);
        out.push(all(&tangent));
    }
    Ok(out)
}

/// Pulls back through the records of `rollout`, which are steps `first` … of the whole; `x_bar` and `out` are of the whole.
fn pull_back(
    rollout: &Rollout,
    first: usize,
    x_bar: &[Vec<f64>],
    x: &mut Cotangent,
    out: &mut RolloutCotangent,
) -> Result<(), AdjointError> {
    let mass = rollout.model.row_masses(&rollout.theta);
    let cx = Context { model: &rollout.model, theta: &rollout.theta, mass: &mass };
    for (k, record) in rollout.records.iter().enumerate().rev() {
        add(x, &x_bar[first + k + 1])?;
        step_cotangent(cx, record, x, &mut out.u[first + k], &mut out.theta);
    }
    Ok(())
}

fn add(x: &mut Cotangent, x_bar: &[f64]) -> Result<(), AdjointError> {
    check("x_bar row", Some(x_bar.len()), 2 * x.q.len() + x.z.len())?;
    let (q, rest) = x_bar.split_at(x.q.len());
    let (v, z) = rest.split_at(x.v.len());
    x.z.iter_mut().zip(z).for_each(|(a, b)| *a += b);
    x.q.iter_mut().zip(q).for_each(|(a, b)| *a += b);
    x.v.iter_mut().zip(v).for_each(|(a, b)| *a += b);
    Ok(())
}

fn need_records(rollout: &Rollout) -> Result<(), AdjointError> {
    if rollout.records.len() == rollout.controls.len() || rollout.checkpoints.is_some() {
        Ok(())
    } else {
        Err(AdjointError::NoRecords)
    }
}

pub(crate) fn check(what: &'static str, got: Option<usize>, expected: usize) -> Result<(), AdjointError> {
    match got {
        Some(got) if got != expected => Err(AdjointError::Size { what, got, expected }),
        _ => Ok(()),
    }
}
