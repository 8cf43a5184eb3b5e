//! Products with the partials of one stage's residual.
//!
//! ```text
//! ∂r/∂q_ref = −F_q,   ∂r/∂v_ref = −σ M − h a0 F_q − b0 F_v,   ∂r/∂v_cmd = −1 (driven rows),   ∂r/∂θ by visiting
//! ```
//! F_q = ∂f/∂q̄ and F_v = ∂f/∂v̄ as recorded, zero in driven rows.

use crate::implicit::{Refinement, multiplier, root_tangent};
use crate::seeds::Seeds;
use pliant_engine::model::Model;
use pliant_engine::step::StageRecord;

/// What a stage is differentiated with.
#[derive(Clone, Copy)]
pub(crate) struct Context<'a> {
    pub model: &'a Model,
    pub theta: &'a [f64],
    pub mass: &'a [f64],
}

/// Memory of the tangents of a step, kept from one to the next.
#[derive(Clone, Debug, Default)]
pub(crate) struct Memory {
    /// Tangents of the commanded velocities: only the rows of driven nodes mean anything.
    pub cmd: Vec<f64>,
    /// What [`stage_tangent`] made.
    pub v_next: Vec<f64>,
    /// The state before a substep, q then v.
    pub start: [Vec<f64>; 2],
    at: Vec<f64>,
    refinement: Refinement,
}

/// Puts the tangent of v⁺ (row-major, `seeds.columns` per row) into `memory.v_next`, for tangents of the reference state and of the
/// command in `memory.cmd`.
pub(crate) fn stage_tangent(cx: Context, stage: &StageRecord, q_dot: &[f64], v_dot: &[f64], seeds: &Seeds, memory: &mut Memory) {
    let m = seeds.columns;
    let scheme = &stage.scheme;
    let Memory { cmd, v_next: dr, at, refinement, .. } = memory;
    dr.clear();
    dr.resize(q_dot.len(), 0.0);
    if scheme.free.a0 == 0.0 {
        stage.dq.add_mul_many(-1.0, q_dot, dr, m);
    } else {
        let weight = |driven| stage.h * if driven { scheme.driven.a0 } else { scheme.free.a0 };
        at.clear();
        at.extend_from_slice(q_dot);
        add_weighted(at, v_dot, cx, m, weight);
        stage.dq.add_mul_many(-1.0, at, dr, m);
    }
    if scheme.free.b0 != 0.0 {
        at.clear();
        at.resize(v_dot.len(), 0.0);
        add_weighted(at, v_dot, cx, m, |driven| if driven { scheme.driven.b0 } else { scheme.free.b0 });
        stage.dv.add_mul_many(-1.0, at, dr, m);
    }
    for (node, &driven) in cx.model.driven().iter().enumerate() {
        let range = 3 * node * m..3 * (node + 1) * m;
        let (from, weight) =
            if driven { (&cmd[range.clone()], 1.0) } else { (&v_dot[range.clone()], cx.mass[node] * stage.inertia) };
        for (d, x) in dr[range].iter_mut().zip(from) {
            *d -= weight * x;
        }
    }
    if seeds.has_theta() {
        stage.visit_theta(cx.model, cx.theta, &mut |row, param, value| {
            for &(column, weight) in seeds.theta(param) {
                dr[row * m + column] += value * weight;
            }
        });
    }
    root_tangent(stage, dr, m, refinement);
}

fn add_weighted(out: &mut [f64], v: &[f64], cx: Context, m: usize, weight: impl Fn(bool) -> f64) {
    for (node, &driven) in cx.model.driven().iter().enumerate() {
        let range = 3 * node * m..3 * (node + 1) * m;
        let w = weight(driven);
        out[range.clone()].iter_mut().zip(&v[range]).for_each(|(o, v)| *o += w * v);
    }
}

/// Pulls the cotangent `y_bar` of v⁺ back: adds to the cotangents of the reference state, the command and θ.
pub(crate) fn stage_cotangent(
    cx: Context,
    stage: &StageRecord,
    y_bar: &[f64],
    q_bar: &mut [f64],
    v_bar: &mut [f64],
    cmd_bar: &mut [f64],
    theta_bar: &mut [f64],
) {
    let lambda = multiplier(stage, y_bar);
    let mut through_q = vec![0.0; lambda.len()];
    stage.dq.add_mul_transpose(-1.0, &lambda, &mut through_q);
    let mut through_v = vec![0.0; lambda.len()];
    if stage.scheme.free.b0 != 0.0 {
        stage.dv.add_mul_transpose(-1.0, &lambda, &mut through_v);
    }
    for (node, &driven) in cx.model.driven().iter().enumerate() {
        let w = if driven { &stage.scheme.driven } else { &stage.scheme.free };
        for k in 3 * node..3 * node + 3 {
            q_bar[k] += through_q[k];
            v_bar[k] += stage.h * w.a0 * through_q[k] + w.b0 * through_v[k];
            if driven {
                cmd_bar[k] -= lambda[k];
            } else {
                v_bar[k] -= cx.mass[node] * stage.inertia * lambda[k];
            }
        }
    }
    stage.visit_theta(cx.model, cx.theta, &mut |row, param, value| theta_bar[param] += value * lambda[row]);
}
