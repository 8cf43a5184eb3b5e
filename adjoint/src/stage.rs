//! Products with the partials of one stage's residual.
//!
//! ```text
//! ∂r/∂q_ref = −F_q T,   ∂r/∂v_ref = −σ M − h a0 F_q J − b0 F_v (without σ M where momentum is dropped),   ∂r/∂v_cmd = −1 (prescribed rows),   ∂r/∂(θ, u) by visiting
//! ```
//! F_q = ∂f/∂q̄ and F_v = ∂f/∂v̄ as recorded, zero in prescribed rows; T and J of [`TangentMaps`]. What a joint remembers adds ∂r/∂z and ∂r/∂q of the
//! (sub)step's beginning, by visiting too.

use crate::implicit::{Refinement, multiplier, root_tangent};
use crate::seeds::Seeds;
use pliant_engine::bodies::TangentMaps;
use pliant_engine::model::Model;
use pliant_engine::rods::TransportDerivative;
use pliant_engine::step::StageRecord;
use pliant_math::Input;

/// Arguments of a stage's derivative.
#[derive(Clone, Copy)]
pub(crate) struct Context<'a> {
    pub model: &'a Model,
    pub theta: &'a [f64],
    /// Of every row of nodes and twists.
    pub mass: &'a [f64],
}

/// Memory of the tangents of a step, kept from one to the next.
#[derive(Clone, Debug, Default)]
pub(crate) struct Memory {
    /// Tangents of the commanded velocities: only the rows of prescribed nodes mean anything.
    pub cmd: Vec<f64>,
    /// Result of [`stage_tangent`].
    pub v_next: Vec<f64>,
    /// The state before a substep, q then v.
    pub start: [Vec<f64>; 2],
    /// Tangents of the commands that motors receive, a row per control; empty if these are u.
    pub signals: Vec<f64>,
    /// Tangents of z at the beginning and at the end of a substep.
    pub z_past: Vec<f64>,
    pub z_next: Vec<f64>,
    /// Scratch.
    pub at: Vec<f64>,
    refinement: Refinement,
}

/// Puts the tangent of v⁺ (row-major, `seeds.columns` per row) into `memory.v_next`, for tangents of the reference state and of the
/// command in `memory.cmd`.
pub(crate) fn stage_tangent(cx: Context, stage: &StageRecord, q_dot: &[f64], v_dot: &[f64], seeds: &Seeds, memory: &mut Memory) {
    let m = seeds.columns;
    let scheme = &stage.scheme;
    let Memory { cmd, v_next: dr, at, refinement, start, signals, z_past, .. } = memory;
    dr.clear();
    dr.resize(stage.n_rows() * m, 0.0);
    let [carry, ..] = &stage.transport.carry;
    if scheme.free.a0 == 0.0 && stage.transport.middle.is_identity() && carry.is_empty() {
        stage.add_position_product(1.0, q_dot, dr, m);
    } else {
        let weight = |prescribed| stage.h * if prescribed { scheme.prescribed.a0 } else { scheme.free.a0 };
        at.clear();
        at.extend_from_slice(q_dot);
        move_along(cx, (&stage.transport.middle, carry), at, v_dot, m, weight);
        stage.add_position_product(1.0, at, dr, m);
    }
    if scheme.free.b0 != 0.0 {
        at.clear();
        at.resize(v_dot.len(), 0.0);
        add_weighted(at, v_dot, cx, m, |prescribed| if prescribed { scheme.prescribed.b0 } else { scheme.free.b0 });
        let n = cx.model.n_node_dofs() * m;
        at[n..].iter_mut().zip(&v_dot[n..]).for_each(|(o, v)| *o = scheme.free.b0 * v);
        stage.jacobians.dv.add_mul_many(-1.0, at, &mut dr[..v_dot.len()], m);
    }
    let inertia = stage.inertia * scheme.momentum;
    for (row, &prescribed) in cx.model.prescribed_rows().iter().enumerate() {
        let range = row * m..(row + 1) * m;
        let (from, weight) =
            if prescribed { (&cmd[range.clone()], 1.0) } else { (&v_dot[range.clone()], cx.mass[row] * inertia) };
        for (d, x) in dr[range].iter_mut().zip(from) {
            *d -= weight * x;
        }
    }
    let n = cx.model.n_node_dofs() * m;
    stage.jacobians.body_mass.add_mul_many(-inertia, &v_dot[n..], &mut dr[n..v_dot.len()], m);
    if seeds.has_theta() || cx.model.has_actuators() || cx.model.ndz() > 0 {
        let tangents = Tangents { seeds, signals, cmd, q: &start[0], z: z_past, end: [&[], &[]] };
        let mut visit = |row: usize, input, value| tangents.add(input, value, &mut dr[row * m..(row + 1) * m]);
        if seeds.has_theta() {
            stage.visit_inputs(cx.model, cx.theta, &mut visit);
        } else {
            stage.visit_signals(cx.model, cx.theta, &mut visit);
        }
    }
    for &(row, column, weight) in seeds.forces() {
        if !cx.model.prescribed_rows().get(row).is_some_and(|prescribed| *prescribed) {
            dr[row * m + column] -= weight;
        }
    }
    root_tangent(stage, dr, m, refinement);
    dr.truncate(v_dot.len());
}

/// Tangents of everything that an [`Input`] can be, a row each.
pub(crate) struct Tangents<'a> {
    pub seeds: &'a Seeds,
    /// Of the commands that motors receive; empty for the controls themselves.
    pub signals: &'a [f64],
    /// Of the commanded velocities.
    pub cmd: &'a [f64],
    /// Of q and z at the beginning of the (sub)step.
    pub q: &'a [f64],
    pub z: &'a [f64],
    /// Of (q, v) at its end.
    pub end: [&'a [f64]; 2],
}

impl Tangents<'_> {
    /// `out += value · tangent`.
    pub fn add(&self, input: Input, value: f64, out: &mut [f64]) {
        let m = out.len();
        let sparse = match input {
            Input::Theta(k) => self.seeds.theta(k),
            Input::U(k) if self.signals.is_empty() => self.seeds.u(k),
            _ => {
                let (rows, k) = match input {
                    Input::U(k) => (self.signals, k),
                    Input::Q(k) => (self.q, k),
                    Input::Z(k) => (self.z, k),
                    Input::QNext(k) => (self.end[0], k),
                    Input::VNext(k) => (self.end[1], k),
                    Input::Command(k) => (self.cmd, k),
                    Input::Theta(_) => return,
                };
                out.iter_mut().zip(&rows[k * m..(k + 1) * m]).for_each(|(o, x)| *o += value * x);
                return;
            }
        };
        sparse.iter().for_each(|&(column, weight)| out[column] += value * weight);
    }
}

/// Tangent maps of bodies and transport derivatives of rods' axes over a way.
pub(crate) type Way<'a> = (&'a TangentMaps, &'a TransportDerivative);

/// `x ← T x + J (weight v)`: how a displacement moves on, for nodes with weights of their own.
pub(crate) fn move_along(cx: Context, (turns, carry): Way, x: &mut [f64], v: &[f64], m: usize, weight: impl Fn(bool) -> f64) {
    let n = cx.model.n_node_dofs() * m;
    carry.add_before(x, m);
    turns.transport(&mut x[n..], m);
    let free = weight(false);
    if free != 0.0 {
        if turns.is_identity() {
            x[n..].iter_mut().zip(&v[n..]).for_each(|(x, v)| *x += free * v);
        } else {
            let mut moved: Vec<f64> = v[n..].iter().map(|v| free * v).collect();
            turns.jacobian(&mut moved, m);
            x[n..].iter_mut().zip(&moved).for_each(|(x, v)| *x += v);
        }
    }
    add_weighted(x, v, cx, m, weight);
    carry.add_after(x, m);
}

/// Transposed [`move_along`] for one column: adds `weight Jᵀ x` to `v` and replaces `x` by Tᵀ x. `of_nodes` is the weight of nodes and
/// twists.
pub(crate) fn pull_along(
    cx: Context,
    (turns, carry): Way,
    x: &mut [f64],
    v: &mut [f64],
    weight: f64,
    of_nodes: impl Fn(bool) -> f64,
) {
    let n = cx.model.n_node_dofs();
    carry.pull_after(x);
    for (row, &prescribed) in cx.model.prescribed_rows().iter().enumerate() {
        v[row] += of_nodes(prescribed) * x[row];
    }
    carry.pull_before(x);
    if weight != 0.0 {
        let mut moved = x[n..].to_vec();
        turns.jacobian_transpose(&mut moved);
        v[n..].iter_mut().zip(&moved).for_each(|(v, x)| *v += weight * x);
    }
    turns.transport_transpose(&mut x[n..]);
}

/// Of the nodes: `out += weight v`.
fn add_weighted(out: &mut [f64], v: &[f64], cx: Context, m: usize, weight: impl Fn(bool) -> f64) {
    for (row, &prescribed) in cx.model.prescribed_rows().iter().enumerate() {
        let range = row * m..(row + 1) * m;
        let w = weight(prescribed);
        out[range.clone()].iter_mut().zip(&v[range]).for_each(|(o, v)| *o += w * v);
    }
}

/// Cotangents of a stage's inputs beside its reference state; they accumulate.
pub(crate) struct InputBars<'a> {
    /// Of the commanded velocities.
    pub cmd: &'a mut [f64],
    /// Of the commands that motors receive.
    pub u: &'a mut [f64],
    /// Of θ.
    pub theta: &'a mut [f64],
    /// Of q and z at the beginning of the (sub)step.
    pub q: &'a mut [f64],
    pub z: &'a mut [f64],
}

impl InputBars<'_> {
    /// Adds to the cotangent of an input; those of the (sub)step's end go to `end`, (q, v).
    pub fn add(&mut self, input: Input, value: f64, end: Option<[&mut [f64]; 2]>) {
        match (input, end) {
            (Input::Theta(k), _) => self.theta[k] += value,
            (Input::U(k), _) => self.u[k] += value,
            (Input::Q(k), _) => self.q[k] += value,
            (Input::Z(k), _) => self.z[k] += value,
            (Input::Command(k), _) => self.cmd[k] += value,
            (Input::QNext(k), Some([q, _])) => q[k] += value,
            (Input::VNext(k), Some([_, v])) => v[k] += value,
            (Input::QNext(_) | Input::VNext(_), None) => {}
        }
    }
}

/// Pulls the cotangent `y_bar` of v⁺ back: adds to the cotangents of the reference state, the command and θ.
pub(crate) fn stage_cotangent(
    cx: Context,
    stage: &StageRecord,
    y_bar: &[f64],
    q_bar: &mut [f64],
    v_bar: &mut [f64],
    inputs: &mut InputBars,
) {
    let lambda = multiplier(stage, y_bar);
    let nv = stage.v.len();
    let mut through_q = vec![0.0; nv];
    stage.add_position_transpose(1.0, &lambda, &mut through_q);
    let mut through_v = vec![0.0; nv];
    if stage.scheme.free.b0 != 0.0 {
        stage.jacobians.dv.add_mul_transpose(-1.0, &lambda[..nv], &mut through_v);
    }
    let n = cx.model.n_node_dofs();
    let w = &stage.scheme.free;
    let inertia = stage.inertia * stage.scheme.momentum;
    stage.jacobians.body_mass.add_mul_transpose(-inertia, &lambda[n..nv], &mut v_bar[n..]);
    (n..nv).for_each(|k| v_bar[k] += w.b0 * through_v[k]);
    let of_nodes = |prescribed| stage.h * if prescribed { stage.scheme.prescribed.a0 } else { stage.scheme.free.a0 };
    pull_along(cx, (&stage.transport.middle, &stage.transport.carry[0]), &mut through_q, v_bar, stage.h * w.a0, of_nodes);
    (0..nv).for_each(|k| q_bar[k] += through_q[k]);
    for (k, &prescribed) in cx.model.prescribed_rows().iter().enumerate() {
        let w = if prescribed { &stage.scheme.prescribed } else { &stage.scheme.free };
        v_bar[k] += w.b0 * through_v[k];
        if prescribed {
            inputs.cmd[k] -= lambda[k];
        } else {
            v_bar[k] -= cx.mass[k] * inertia * lambda[k];
        }
    }
    stage.pull_inputs(cx.model, cx.theta, &lambda, &mut |input, value| inputs.add(input, value, None));
}
