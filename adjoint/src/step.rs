//! jvp and vjp of one step: the chain of its stages.

use crate::seeds::Seeds;
use crate::stage::{Context, InputBars, Memory, Tangents, move_along, pull_along, stage_cotangent, stage_tangent};
use pliant_engine::model::Model;
use pliant_engine::step::{SDIRK_GAMMA, StageKind, StageRecord, StepRecord};
use pliant_math::Input;

/// Tangents of (q, v, z): row-major, `nv × columns` for q and v, `ndz × columns` for z.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tangent {
    /// Position tangents.
    pub q: Vec<f64>,
    /// Velocity tangents.
    pub v: Vec<f64>,
    /// Tangents of internal variables.
    pub z: Vec<f64>,
}

/// Cotangents of (q, v, z): nv, nv and ndz numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cotangent {
    /// Cotangent of q.
    pub q: Vec<f64>,
    /// Cotangent of v.
    pub v: Vec<f64>,
    /// Cotangent of z.
    pub z: Vec<f64>,
}

impl Cotangent {
    /// Of the size of a state of `model`.
    pub(crate) fn zero(model: &Model) -> Self {
        Self { q: vec![0.0; model.nv()], v: vec![0.0; model.nv()], z: vec![0.0; model.ndz()] }
    }
}

/// Weight of (v₁ − v) in the reference velocity of sdirk2's second stage.
const RATIO: f64 = (1.0 - SDIRK_GAMMA) / SDIRK_GAMMA;

/// Pushes tangents through a step.
pub(crate) fn step_tangent(cx: Context, step: &StepRecord, x: &mut Tangent, seeds: &Seeds, memory: &mut Memory) {
    let m = seeds.columns;
    command_tangent(cx, step, x, seeds, memory);
    signal_tangent(cx, step, x, seeds, memory);
    for (link, stage) in &step.stages {
        match link {
            StageKind::Single => {
                if !x.z.is_empty() {
                    memory.keep(x);
                }
            }
            StageKind::SdirkFirst => {
                memory.keep(x);
                stage_tangent(cx, stage, &x.q, &x.v, seeds, memory);
                std::mem::swap(&mut x.v, &mut memory.v_next);
                continue;
            }
            StageKind::SdirkSecond => {
                // stage.h is γ h of the substep
                let lead = (1.0 - SDIRK_GAMMA) * stage.h / SDIRK_GAMMA;
                x.q.copy_from_slice(&memory.start[0]);
                move_along(cx, (&stage.transport.lead, &stage.transport.carry[2]), &mut x.q, &x.v, m, |_| lead);
                for (v1, v0) in x.v.iter_mut().zip(&memory.start[1]) {
                    *v1 = v0 + RATIO * (*v1 - v0);
                }
            }
        }
        stage_tangent(cx, stage, &x.q, &x.v, seeds, memory);
        move_positions(cx, stage, &mut x.q, &x.v, &memory.v_next, m, &mut memory.at);
        std::mem::swap(&mut x.v, &mut memory.v_next);
        move_memory(&stage.memory, seeds, x, memory);
    }
    let Memory { z_past, z_next, .. } = memory;
    z_past.clone_from(&x.z);
    z_next.clear();
    z_next.resize(x.z.len(), 0.0);
    // commands reach the motors' part of z themselves, not by way of the signals
    let tangents = Tangents { seeds, signals: &[], cmd: &[], q: &[], z: z_past, end: [&[], &[]] };
    replace_rows(&step.memory, &tangents, z_next, &mut x.z, m);
}

impl Memory {
    /// Keeps the tangents at the beginning of a substep.
    fn keep(&mut self, x: &Tangent) {
        for (kept, x) in self.start.iter_mut().chain([&mut self.z_past]).zip([&x.q, &x.v, &x.z]) {
            kept.clear();
            kept.extend_from_slice(x);
        }
    }
}

/// Tangents of the commands that motors receive.
fn signal_tangent(cx: Context, step: &StepRecord, x: &Tangent, seeds: &Seeds, memory: &mut Memory) {
    let m = seeds.columns;
    memory.signals.clear();
    if !step.signals.is_empty() {
        memory.signals.resize(cx.model.nu() * m, 0.0);
        let tangents = Tangents { seeds, signals: &[], cmd: &[], q: &[], z: &x.z, end: [&[], &[]] };
        for &(row, input, value) in &step.signals {
            tangents.add(input, value, &mut memory.signals[row * m..(row + 1) * m]);
        }
    }
}

/// Moves the tangents of the joints' history variables to the end of a substep, where `x` stands but for z.
fn move_memory(partials: &[(usize, Input, f64)], seeds: &Seeds, x: &mut Tangent, memory: &mut Memory) {
    let Memory { start, signals, z_past, z_next, .. } = memory;
    z_next.clear();
    z_next.resize(x.z.len(), 0.0);
    let tangents = Tangents { seeds, signals, cmd: &[], q: &start[0], z: z_past, end: [&x.q, &x.v] };
    replace_rows(partials, &tangents, z_next, &mut x.z, seeds.columns);
}

/// Replaces the rows of `z` that `partials` speaks of; `next` is zero.
fn replace_rows(partials: &[(usize, Input, f64)], tangents: &Tangents, next: &mut [f64], z: &mut [f64], m: usize) {
    for &(row, input, value) in partials {
        tangents.add(input, value, &mut next[row * m..(row + 1) * m]);
    }
    for &(row, ..) in partials {
        z[row * m..(row + 1) * m].copy_from_slice(&next[row * m..(row + 1) * m]);
    }
}

/// Tangents of the commanded velocities into the prescribed rows of `memory.cmd`.
fn command_tangent(cx: Context, step: &StepRecord, x: &Tangent, seeds: &Seeds, memory: &mut Memory) {
    let m = seeds.columns;
    let cmd = &mut memory.cmd;
    cmd.resize(x.q.len(), 0.0);
    for (row, _) in cx.model.prescribed_rows().iter().enumerate().filter(|(_, prescribed)| **prescribed) {
        cmd[row * m..(row + 1) * m].fill(0.0);
    }
    for &(row, input, value) in &step.command {
        let out = &mut cmd[row * m..(row + 1) * m];
        match input {
            Input::Q(k) => out.iter_mut().zip(&x.q[k * m..(k + 1) * m]).for_each(|(o, q)| *o += value * q),
            Input::U(k) => seeds.u(k).iter().for_each(|&(c, w)| out[c] += value * w),
            Input::Theta(k) => seeds.theta(k).iter().for_each(|&(c, w)| out[c] += value * w),
            Input::Z(_) | Input::QNext(_) | Input::VNext(_) | Input::Command(_) => {}
        }
    }
}

/// q⁺ = q ⊕ h (d0 v + d1 v⁺).
fn move_positions(cx: Context, stage: &StageRecord, q: &mut [f64], v: &[f64], v_next: &[f64], m: usize, moved: &mut Vec<f64>) {
    let (free, prescribed) = (&stage.scheme.free, &stage.scheme.prescribed);
    moved.clear();
    moved.extend(v.iter().zip(v_next).map(|(v, next)| free.d0 * v + free.d1 * next));
    if free.d0 != prescribed.d0 {
        for (row, _) in cx.model.prescribed_rows().iter().enumerate().filter(|(_, d)| **d) {
            for k in row * m..(row + 1) * m {
                moved[k] = prescribed.d0 * v[k] + prescribed.d1 * v_next[k];
            }
        }
    }
    move_along(cx, (&stage.transport.end, &stage.transport.carry[1]), q, moved, m, |_| stage.h);
}

/// Pulls the cotangent of the state after a step back to the state before it; adds to the cotangents of u and θ.
pub(crate) fn step_cotangent(cx: Context, step: &StepRecord, x: &mut Cotangent, u_bar: &mut [f64], theta_bar: &mut [f64]) {
    let mut cmd_bar = vec![0.0; x.q.len()];
    let mut first_v_bar = Vec::new();
    let mut start_v_bar = Vec::new();
    let mut signal_bar = vec![0.0; u_bar.len()];
    let mut past_bar = vec![0.0; x.q.len()];
    let late = take_rows(&step.memory, &mut x.z);
    pull_memory(&step.memory, &late, &mut InputBars { cmd: &mut [], u: u_bar, theta: theta_bar, q: &mut [], z: &mut x.z }, None);
    for (link, stage) in step.stages.iter().rev() {
        if *link == StageKind::SdirkFirst {
            // only v₁ leaves the first stage; q and v of the substep's start were used by the second stage directly
            let mut v_bar = std::mem::take(&mut start_v_bar);
            let (q, z) = (&mut past_bar, &mut x.z);
            let mut inputs = InputBars { cmd: &mut cmd_bar, u: &mut signal_bar, theta: theta_bar, q, z };
            stage_cotangent(cx, stage, &first_v_bar, &mut x.q, &mut v_bar, &mut inputs);
            x.v = v_bar;
            add_taken(&mut x.q, &mut past_bar);
            continue;
        }
        let late = take_rows(&stage.memory, &mut x.z);
        let mut inputs = InputBars { cmd: &mut [], u: &mut signal_bar, theta: theta_bar, q: &mut past_bar, z: &mut x.z };
        pull_memory(&stage.memory, &late, &mut inputs, Some([&mut x.q, &mut x.v]));
        let (y_bar, mut v_bar) = end_cotangent(cx, stage, x);
        let (q, z) = (&mut past_bar, &mut x.z);
        let mut inputs = InputBars { cmd: &mut cmd_bar, u: &mut signal_bar, theta: theta_bar, q, z };
        stage_cotangent(cx, stage, &y_bar, &mut x.q, &mut v_bar, &mut inputs);
        if *link == StageKind::SdirkSecond {
            let lead = (1.0 - SDIRK_GAMMA) * stage.h / SDIRK_GAMMA;
            first_v_bar = v_bar.iter().map(|v| RATIO * v).collect();
            pull_along(cx, (&stage.transport.lead, &stage.transport.carry[2]), &mut x.q, &mut first_v_bar, lead, |_| lead);
            start_v_bar = v_bar.iter().map(|v| (1.0 - RATIO) * v).collect();
        } else {
            x.v = v_bar;
            add_taken(&mut x.q, &mut past_bar);
        }
    }
    if step.signals.is_empty() {
        add_taken(u_bar, &mut signal_bar);
    }
    let mut inputs = InputBars { cmd: &mut [], u: u_bar, theta: theta_bar, q: &mut [], z: &mut x.z };
    step.signals.iter().for_each(|&(row, input, value)| inputs.add(input, value * signal_bar[row], None));
    for &(row, input, value) in &step.command {
        let contribution = value * cmd_bar[row];
        match input {
            Input::Q(k) => x.q[k] += contribution,
            Input::U(k) => u_bar[k] += contribution,
            Input::Theta(k) => theta_bar[k] += contribution,
            Input::Z(_) | Input::QNext(_) | Input::VNext(_) | Input::Command(_) => {}
        }
    }
}

/// Takes the cotangents of the rows of z⁺ in `partials`, and leaves zero: those that z gets in return belong to the beginning.
fn take_rows(partials: &[(usize, Input, f64)], z: &mut [f64]) -> Vec<f64> {
    let taken = if partials.is_empty() { Vec::new() } else { z.to_vec() };
    partials.iter().for_each(|&(row, ..)| z[row] = 0.0);
    taken
}

/// Pulls the cotangents `late` of z⁺ back to its arguments.
fn pull_memory(partials: &[(usize, Input, f64)], late: &[f64], inputs: &mut InputBars, end: Option<[&mut [f64]; 2]>) {
    let mut end = end;
    for &(row, input, value) in partials {
        inputs.add(input, value * late[row], end.as_mut().map(|[q, v]| [&mut **q, &mut **v]));
    }
}

/// `x += y`, and y is zero.
fn add_taken(x: &mut [f64], y: &mut [f64]) {
    for (x, y) in x.iter_mut().zip(y) {
        *x += std::mem::take(y);
    }
}

/// Cotangent of v⁺ and of the reference velocity from those of (q⁺, v⁺); that of q⁺ becomes that of q.
fn end_cotangent(cx: Context, stage: &StageRecord, x: &mut Cotangent) -> (Vec<f64>, Vec<f64>) {
    let (mut y_bar, mut v_bar) = (x.v.clone(), vec![0.0; x.v.len()]);
    let mut moved = vec![0.0; x.q.len()];
    pull_along(cx, (&stage.transport.end, &stage.transport.carry[1]), &mut x.q, &mut moved, stage.h, |_| stage.h);
    for (k, moved) in moved.iter().enumerate() {
        let prescribed = cx.model.prescribed_rows().get(k).is_some_and(|prescribed| *prescribed);
        let w = if prescribed { &stage.scheme.prescribed } else { &stage.scheme.free };
        y_bar[k] += w.d1 * moved;
        v_bar[k] += w.d0 * moved;
    }
    (y_bar, v_bar)
}
