//! A and B of a step in which nothing but contacts of nodes depends on velocities, from the inverse of its matrix.
//!
//! By implicit Euler a step ends where forces are evaluated, so K knows already what positions do. With G = K⁻¹ (K has identity rows where
//! nodes are driven), D = σ M in free columns and 1 in driven ones, F_v = ∂f/∂v⁺ of contacts, their impulses eliminated, and S_a = 1 + ψ_a,
//! S_b = 1 + ψ_b, by which edges carry rods' axes along ([`Carry`](pliant_engine::rods::Carry)),
//! ```text
//! K = σ M − h f_q S_b − F_v,   ∂r/∂q = −f_q S_b S_a   in free rows, so that
//! ∂v⁺/∂v = G σ M (zero in driven columns),   ∂v⁺/∂q = (G (D − F_v) − 1) S_a/h,   ∂v⁺/∂v_cmd = the driven columns of G
//! ∂q⁺/∂v = h S_b ∂v⁺/∂v,                     ∂q⁺/∂q = S_b G (D − F_v) S_a
//! ```
//! The difference G (D − F_v) − 1 has to leave something: where nothing holds a node, steps are linearized the general way.

use crate::elastic::{is_held, keeps_nothing};
use crate::implicit::{Refinement, refinements, settled, worth_refining};
use crate::linearize::{Linearization, VECTOR};
use crate::stage::Context;
use pliant_engine::kinematics::Input;
use pliant_engine::step::{StageRecord, StepRecord};

/// Memory, kept from one step to the next.
#[derive(Clone, Debug, Default)]
pub(crate) struct Touching {
    /// K⁻¹, row-major, in rows of whole vectors.
    inverse: Vec<f64>,
    refinement: Refinement,
    /// D and the diagonal of ∂v⁺/∂v = G · diagonal.
    scale: Vec<f64>,
    by_velocity: Vec<f64>,
    /// ψ_a in the row of a twist.
    unit: Vec<f64>,
    /// F_v of contacts, node by node.
    damping: Vec<(usize, [[f64; 3]; 3])>,
}

/// The only stage of such a step, if this is one.
pub(crate) fn stage_of<'a>(cx: Context, step: &'a StepRecord) -> Option<&'a StageRecord> {
    let stage = keeps_nothing(cx, step)?;
    // (the inverse leaves out what contacts' residuals do)
    let fits = stage.undamped && stage.n_rows() == stage.v.len() && !stage.matrix.nodes.layout().is_sparse();
    (fits && is_held(cx, stage)).then_some(stage)
}

impl Touching {
    /// A and B; C is empty.
    pub fn linearize(&mut self, cx: Context, step: &StepRecord, stage: &StageRecord, nu: usize) -> Linearization {
        let n = stage.v.len();
        let of_mass = |factor: f64, other: f64| {
            let rows = cx.mass.iter().zip(cx.model.driven_rows());
            rows.map(move |(m, driven)| if *driven { other } else { factor * m })
        };
        self.scale.clear();
        self.scale.extend(of_mass(stage.inertia, 1.0));
        self.by_velocity.clear();
        self.by_velocity.extend(of_mass(stage.inertia * stage.scheme.momentum, 0.0));
        self.damping.clear();
        stage.visit_contact_damping(|node, block| self.damping.push((node, block)));
        let columns = n.next_multiple_of(VECTOR);
        stage.factor.inverse_of_nodes_in(columns, &mut self.inverse);
        let mut probe = self.scale.clone();
        probe.resize(stage.n_rows(), 0.0);
        if worth_refining(stage, probe) {
            self.refine(stage, columns);
        }
        let mut out = Linearization { a: self.by_state(stage, cx.model.n_nodes() * 3, columns), b: vec![0.0; 2 * n * nu], c: Vec::new() };
        self.by_command(step, stage.h, nu, &mut out);
        let end = &stage.carry[1];
        end.add_after(&mut out.a[..2 * n * n], 2 * n);
        end.add_after(&mut out.b[..n * nu], nu);
        out
    }

    /// X ← X + K⁻¹ (1 − K X).
    fn refine(&mut self, stage: &StageRecord, columns: usize) {
        let Refinement { defect, largest, .. } = &mut self.refinement;
        for _ in 0..refinements(stage) {
            defect.clear();
            defect.resize(self.inverse.len(), 0.0);
            (0..stage.v.len()).for_each(|k| defect[k * columns + k] = 1.0);
            stage.subtract_condensed(&self.inverse, defect, columns);
            stage.factor.solve_many(defect, columns);
            let done = settled(&self.inverse, defect, columns, largest);
            self.inverse.iter_mut().zip(&*defect).for_each(|(x, d)| *x += *d);
            if done {
                break;
            }
        }
    }

    /// A with the commands as they are and rods' axes not yet carried to the end.
    fn by_state(&mut self, stage: &StageRecord, first_twist: usize, columns: usize) -> Vec<f64> {
        let (n, h, begin) = (self.scale.len(), stage.h, &stage.carry[0]);
        let mut a = Vec::with_capacity(4 * n * n);
        for g in self.inverse.chunks_exact(columns) {
            let own = a.len();
            a.extend(g.iter().zip(&self.scale).map(|(g, s)| g * s));
            for (node, block) in &self.damping {
                let g = &g[3 * node..3 * node + 3];
                for (c, to) in a[own + 3 * node..][..3].iter_mut().enumerate() {
                    *to -= g[0] * block[0][c] + g[1] * block[1][c] + g[2] * block[2][c];
                }
            }
            begin.pull_before(&mut a[own..]);
            a.extend(g.iter().zip(&self.by_velocity).map(|(g, s)| h * (g * s)));
        }
        a.extend_from_within(..);
        let per_h = 1.0 / h;
        for (k, row) in a[2 * n * n..].chunks_exact_mut(2 * n).enumerate() {
            row[k] -= 1.0;
            if k >= first_twist {
                self.unit.clear();
                self.unit.resize(n, 0.0);
                self.unit[k] = 1.0;
                begin.pull_before(&mut self.unit);
                self.unit[k] = 0.0;
                row.iter_mut().zip(&self.unit).for_each(|(x, psi)| *x -= psi);
            }
            row.iter_mut().for_each(|x| *x *= per_h);
        }
        a
    }

    /// Adds what positions and controls do by way of the commands, axes not yet carried either.
    fn by_command(&self, step: &StepRecord, h: f64, nu: usize, out: &mut Linearization) {
        let n = self.scale.len();
        let columns = n.next_multiple_of(VECTOR);
        for &(row, input, value) in &step.command {
            let (to, width, column) = match input {
                Input::Q(k) => (&mut out.a, 2 * n, k),
                Input::U(k) => (&mut out.b, nu, k),
                Input::Z(_) | Input::Theta(_) | Input::QNext(_) | Input::VNext(_) | Input::Command(_) => continue,
            };
            for (i, g) in self.inverse.chunks_exact(columns).enumerate() {
                to[i * width + column] += h * (g[row] * value);
                to[(n + i) * width + column] += g[row] * value;
            }
        }
    }
}
