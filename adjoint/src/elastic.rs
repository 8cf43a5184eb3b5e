//! A and B of a step of elastic forces, from the inverse of its matrix.
//!
//! By implicit Euler the free rows are r = σ M (v⁺ − v) − f(q + h v⁺), so K = σ M − h ∂f/∂q̄: what positions do needs no solves of its own.
//! With G = K⁻¹ (K has identity rows where nodes are driven), s = σ m in free columns and 1 in driven ones,
//! ```text
//! ∂v⁺/∂v = G σ M (zero in driven columns),   ∂v⁺/∂q = (G s − 1)/h,   ∂v⁺/∂v_cmd = the driven columns of G,   q⁺ = q + h v⁺
//! ```
//! The difference G s − 1 has to leave something: where nothing holds a node, steps are linearized the general way.

use crate::implicit::{Refinement, worth_refining};
use crate::linearization::Linearization;
use crate::stage::Context;
use pliant_engine::step::{EULER, Link, StageRecord, StepRecord};
use pliant_math::Input;

/// Least h² × stiffness over mass of a node: the digits that the difference may cost.
const HELD: f64 = 1e-2;

/// Memory, kept from one step to the next.
#[derive(Clone, Debug, Default)]
pub(crate) struct Elastic {
    /// K⁻¹, row-major.
    inverse: Vec<f64>,
    refinement: Refinement,
    /// s of every column, and that of ∂v⁺/∂v.
    scale: Vec<f64>,
    by_velocity: Vec<f64>,
}

/// The only stage of such a step, if this is one.
pub(crate) fn stage_of<'a>(cx: Context, step: &'a StepRecord) -> Option<&'a StageRecord> {
    let stage = keeps_nothing(cx, step)?;
    (stage.elastic && is_held(cx, stage)).then_some(stage)
}

/// The same where nothing at all is remembered.
pub(crate) fn euler_stage<'a>(cx: Context, step: &'a StepRecord) -> Option<&'a StageRecord> {
    keeps_nothing(cx, step).filter(|_| cx.model.nz() == 0)
}

/// Adds to A and B what positions and controls do by way of the commands, from G = ∂v⁺/∂v_cmd, row-major.
pub(crate) fn add_commands(g: &[f64], step: &StepRecord, h: f64, [n, nu]: [usize; 2], out: &mut Linearization) {
    for &(row, input, value) in &step.command {
        let (to, width, column) = match input {
            Input::Q(k) => (&mut out.a, 2 * n, k),
            Input::U(k) => (&mut out.b, nu, k),
            Input::Z(_) | Input::Theta(_) | Input::QNext(_) | Input::VNext(_) | Input::Command(_) => continue,
        };
        for (i, g) in g.chunks_exact(n).enumerate() {
            to[i * width + column] += h * (g[row] * value);
            to[(n + i) * width + column] += g[row] * value;
        }
    }
}

/// The only stage of a step by implicit Euler in which nothing but rods' axes is remembered.
pub(crate) fn keeps_nothing<'a>(cx: Context, step: &'a StepRecord) -> Option<&'a StageRecord> {
    let [(Link::Single, stage)] = step.stages.as_slice() else { return None };
    let weights = stage.scheme.free == EULER.free && stage.scheme.driven == EULER.driven;
    let remembers = cx.model.ndz() > 0 || cx.model.has_actuators() || !stage.grasps.is_empty();
    (weights && !remembers).then_some(stage)
}

/// Whether something holds every free node, and every edge that may turn about itself.
pub(crate) fn is_held(cx: Context, stage: &StageRecord) -> bool {
    let (driven, nodes) = (cx.model.driven_rows(), 3 * cx.model.n_nodes());
    let holds = |rows: std::ops::Range<usize>, inertia: f64| {
        rows.into_iter().any(|k| stage.jacobians.matrix.nodes.get(k, k) >= (1.0 + HELD) * inertia)
    };
    let inertia = |row: usize| cx.mass[row] * stage.inertia;
    (0..nodes).step_by(3).filter(|row| !driven[*row]).all(|row| holds(row..row + 3, inertia(row)))
        && (nodes..stage.v.len()).filter(|row| !driven[*row]).all(|row| holds(row..row + 1, inertia(row)))
}

impl Elastic {
    /// A and B; C is empty.
    pub fn linearize(&mut self, cx: Context, step: &StepRecord, stage: &StageRecord, nu: usize) -> Linearization {
        let (n, driven) = (stage.v.len(), cx.model.driven_rows());
        stage.jacobians.factor.inverse_of_nodes(&mut self.inverse);
        if worth_refining(stage, vec![1.0; n]) {
            self.refine(stage);
        }
        let of_mass = |factor: f64, other: f64| {
            let rows = cx.mass.iter().zip(driven);
            rows.map(move |(m, driven)| if *driven { other } else { factor * m })
        };
        self.scale.clear();
        self.scale.extend(of_mass(stage.inertia, 1.0));
        self.by_velocity.clear();
        self.by_velocity.extend(of_mass(stage.inertia * stage.scheme.momentum, 0.0));
        let mut out = Linearization { a: self.by_state(stage.h), b: vec![0.0; 2 * n * nu], c: Vec::new() };
        add_commands(&self.inverse, step, stage.h, [n, nu], &mut out);
        out
    }

    /// X ← X + X (1 − K X).
    fn refine(&mut self, stage: &StageRecord) {
        let n = stage.v.len();
        let defect = &mut self.refinement.defect;
        defect.clear();
        defect.resize(n * n, 0.0);
        (0..n).for_each(|k| defect[k * n + k] = 1.0);
        stage.subtract_system(&self.inverse, defect, n);
        stage.solve_velocities(defect, n);
        self.inverse.iter_mut().zip(defect).for_each(|(x, d)| *x += *d);
    }

    /// A with the commands as they are.
    fn by_state(&self, h: f64) -> Vec<f64> {
        let n = self.scale.len();
        let mut a = Vec::with_capacity(4 * n * n);
        let rows = || self.inverse.chunks_exact(n);
        for g in rows() {
            a.extend(g.iter().zip(&self.scale).map(|(g, s)| g * s));
            a.extend(g.iter().zip(&self.by_velocity).map(|(g, s)| h * (g * s)));
        }
        let per_h = 1.0 / h;
        for (i, g) in rows().enumerate() {
            let own = a.len() + i;
            a.extend(g.iter().zip(&self.scale).map(|(g, s)| g * s * per_h));
            a[own] = (g[i] * self.scale[i] - 1.0) * per_h;
            a.extend(g.iter().zip(&self.by_velocity).map(|(g, s)| g * s));
        }
        a
    }
}
