//! jvp and vjp of one step: the chain of its stages.

use crate::seeds::Seeds;
use crate::stage::{Context, InputBars, Memory, move_along, pull_along, stage_cotangent, stage_tangent};
use pliant_engine::kinematics::Input;
use pliant_engine::step::{Link, SDIRK_GAMMA, StageRecord, StepRecord};

/// Tangents of (q, v): row-major `nv × columns` each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tangent {
    /// Position tangents.
    pub q: Vec<f64>,
    /// Velocity tangents.
    pub v: Vec<f64>,
}

/// Cotangents of (q, v), nv each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cotangent {
    /// Cotangent of q.
    pub q: Vec<f64>,
    /// Cotangent of v.
    pub v: Vec<f64>,
}

/// Weight of (v₁ − v) in the reference velocity of sdirk2's second stage.
const RATIO: f64 = (1.0 - SDIRK_GAMMA) / SDIRK_GAMMA;

/// Pushes tangents through a step.
pub(crate) fn step_tangent(cx: Context, step: &StepRecord, x: &mut Tangent, seeds: &Seeds, memory: &mut Memory) {
    let m = seeds.columns;
    command_tangent(cx, step, x, seeds, memory);
    for (link, stage) in &step.stages {
        match link {
            Link::Single => {}
            Link::SdirkFirst => {
                for (kept, x) in memory.start.iter_mut().zip([&x.q, &x.v]) {
                    kept.clear();
                    kept.extend_from_slice(x);
                }
                stage_tangent(cx, stage, &x.q, &x.v, seeds, memory);
                std::mem::swap(&mut x.v, &mut memory.v_next);
                continue;
            }
            Link::SdirkSecond => {
                // stage.h is γ h of the substep
                let lead = (1.0 - SDIRK_GAMMA) * stage.h / SDIRK_GAMMA;
                x.q.copy_from_slice(&memory.start[0]);
                move_along(cx, &stage.lead, &mut x.q, &x.v, m, |_| lead);
                for (v1, v0) in x.v.iter_mut().zip(&memory.start[1]) {
                    *v1 = v0 + RATIO * (*v1 - v0);
                }
            }
        }
        stage_tangent(cx, stage, &x.q, &x.v, seeds, memory);
        move_positions(cx, stage, &mut x.q, &x.v, &memory.v_next, m, &mut memory.at);
        std::mem::swap(&mut x.v, &mut memory.v_next);
    }
}

/// Tangents of the commanded velocities into the driven rows of `memory.cmd`.
fn command_tangent(cx: Context, step: &StepRecord, x: &Tangent, seeds: &Seeds, memory: &mut Memory) {
    let m = seeds.columns;
    let cmd = &mut memory.cmd;
    cmd.resize(x.q.len(), 0.0);
    for (node, _) in cx.model.driven().iter().enumerate().filter(|(_, driven)| **driven) {
        cmd[3 * node * m..3 * (node + 1) * m].fill(0.0);
    }
    for &(row, input, value) in &step.command {
        let out = &mut cmd[row * m..(row + 1) * m];
        match input {
            Input::Q(k) => out.iter_mut().zip(&x.q[k * m..(k + 1) * m]).for_each(|(o, q)| *o += value * q),
            Input::U(k) => seeds.u(k).iter().for_each(|&(c, w)| out[c] += value * w),
            Input::Theta(k) => seeds.theta(k).iter().for_each(|&(c, w)| out[c] += value * w),
        }
    }
}

/// q⁺ = q ⊕ h (d0 v + d1 v⁺).
fn move_positions(cx: Context, stage: &StageRecord, q: &mut [f64], v: &[f64], v_next: &[f64], m: usize, moved: &mut Vec<f64>) {
    let (free, driven) = (&stage.scheme.free, &stage.scheme.driven);
    moved.clear();
    moved.extend(v.iter().zip(v_next).map(|(v, next)| free.d0 * v + free.d1 * next));
    if free.d0 != driven.d0 {
        for (node, _) in cx.model.driven().iter().enumerate().filter(|(_, d)| **d) {
            for k in 3 * node * m..3 * (node + 1) * m {
                moved[k] = driven.d0 * v[k] + driven.d1 * v_next[k];
            }
        }
    }
    move_along(cx, &stage.end, q, moved, m, |_| stage.h);
}

/// Pulls the cotangent of the state after a step back to the state before it; adds to the cotangents of u and θ.
pub(crate) fn step_cotangent(cx: Context, step: &StepRecord, x: &mut Cotangent, u_bar: &mut [f64], theta_bar: &mut [f64]) {
    let mut cmd_bar = vec![0.0; x.q.len()];
    let mut first_v_bar = Vec::new();
    let mut start_v_bar = Vec::new();
    for (link, stage) in step.stages.iter().rev() {
        if *link == Link::SdirkFirst {
            // only v₁ leaves the first stage; q and v of the substep's start were used by the second stage directly
            let mut v_bar = std::mem::take(&mut start_v_bar);
            let mut inputs = InputBars { cmd: &mut cmd_bar, u: u_bar, theta: theta_bar };
            stage_cotangent(cx, stage, &first_v_bar, &mut x.q, &mut v_bar, &mut inputs);
            x.v = v_bar;
            continue;
        }
        let (y_bar, mut v_bar) = end_cotangent(cx, stage, x);
        let mut inputs = InputBars { cmd: &mut cmd_bar, u: u_bar, theta: theta_bar };
        stage_cotangent(cx, stage, &y_bar, &mut x.q, &mut v_bar, &mut inputs);
        if *link == Link::SdirkSecond {
            let lead = (1.0 - SDIRK_GAMMA) * stage.h / SDIRK_GAMMA;
            first_v_bar = x.q.iter().zip(&v_bar).map(|(q, v)| lead * q + RATIO * v).collect();
            pull_lead(cx, stage, &mut x.q, &mut first_v_bar, &v_bar, lead);
            start_v_bar = v_bar.iter().map(|v| (1.0 - RATIO) * v).collect();
        } else {
            x.v = v_bar;
        }
    }
    for &(row, input, value) in &step.command {
        let contribution = value * cmd_bar[row];
        match input {
            Input::Q(k) => x.q[k] += contribution,
            Input::U(k) => u_bar[k] += contribution,
            Input::Theta(k) => theta_bar[k] += contribution,
        }
    }
}

/// The bodies' part of the way from the substep's start to the second stage of sdirk2.
fn pull_lead(cx: Context, stage: &StageRecord, q_bar: &mut [f64], first_v_bar: &mut [f64], v_bar: &[f64], lead: f64) {
    let n = cx.model.n_node_dofs();
    (n..v_bar.len()).for_each(|k| first_v_bar[k] = RATIO * v_bar[k]);
    pull_along(cx, &stage.lead, q_bar, first_v_bar, lead);
}

/// Cotangent of v⁺ and of the reference velocity from those of (q⁺, v⁺); that of q⁺ becomes that of q.
fn end_cotangent(cx: Context, stage: &StageRecord, x: &mut Cotangent) -> (Vec<f64>, Vec<f64>) {
    let (mut y_bar, mut v_bar) = (x.v.clone(), vec![0.0; x.v.len()]);
    for (node, &driven) in cx.model.driven().iter().enumerate() {
        let w = if driven { &stage.scheme.driven } else { &stage.scheme.free };
        for k in 3 * node..3 * node + 3 {
            y_bar[k] += stage.h * w.d1 * x.q[k];
            v_bar[k] += stage.h * w.d0 * x.q[k];
        }
    }
    let (n, w) = (cx.model.n_node_dofs(), &stage.scheme.free);
    let mut moved = vec![0.0; x.q.len()];
    pull_along(cx, &stage.end, &mut x.q, &mut moved, stage.h);
    for k in n..moved.len() {
        y_bar[k] += w.d1 * moved[k];
        v_bar[k] += w.d0 * moved[k];
    }
    (y_bar, v_bar)
}
