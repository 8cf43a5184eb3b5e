//! A and B of a step in which nothing but contacts of nodes depends on velocities, from the rows of its system's inverse.
//!
//! By implicit Euler a step ends where forces are evaluated, so its matrix knows already what positions do. With M the system whose
//! contacts are not condensed, [G H] the rows of M⁻¹ that are velocities (M has identity rows where nodes are driven), D = σ M in free
//! columns and 1 in driven ones, F_v = ∂F/∂v⁺ of contacts' residuals, positions as they are, and S_a = 1 + ψ_a, S_b = 1 + ψ_b, by which
//! edges carry rods' axes along ([`Carry`](pliant_engine::rods::Carry)),
//! ```text
//! ∂(r, F)/∂q = (M's columns of velocities − [D; F_v]) S_a/h, so that
//! ∂v⁺/∂v = G σ M (zero in driven columns),   ∂v⁺/∂q = (G D + H F_v − 1) S_a/h,   ∂v⁺/∂v_cmd = the driven columns of G
//! ∂q⁺/∂v = h S_b ∂v⁺/∂v,                     ∂q⁺/∂q = S_b (G D + H F_v) S_a
//! ```
//! Rows of M⁻¹ are columns of M⁻ᵀ, and refined as such: H has a contact's stiffness in its numbers, and would keep nine digits of what it is
//! if it were made of G. The difference G D + H F_v − 1 has to leave something: where nothing holds a node, steps are linearized the general
//! way.

use crate::elastic::{is_held, keeps_nothing};
use crate::implicit::{Refinement, refinements, settled, worth_refining};
use crate::linearization::{Linearization, VECTOR};
use crate::stage::Context;
use pliant_engine::rods::Carry;
use pliant_engine::step::{StageRecord, StepRecord};
use pliant_math::Input;

/// Memory, kept from one step to the next.
#[derive(Clone, Debug, Default)]
pub(crate) struct Touching {
    /// [G H]ᵀ, row-major, in rows of whole vectors.
    inverse: Vec<f64>,
    refinement: Refinement,
    /// D, and that of ∂v⁺/∂v.
    scale: Vec<f64>,
    by_velocity: Vec<f64>,
    /// F_v, contact by contact, with the first row of its node and its own first row.
    rates: Vec<(usize, usize, [[f64; 3]; 4])>,
    /// ((G D + H F_v) S_a)ᵀ, likewise.
    moved: Vec<f64>,
    /// ψ_a of one edge, in its nodes' columns.
    carried: Vec<f64>,
}

/// The only stage of such a step of ropes and rods, if this is one: sheets have `whole`, or solve for each column.
pub(crate) fn stage_of<'a>(cx: Context, step: &'a StepRecord) -> Option<&'a StageRecord> {
    let stage = keeps_nothing(cx, step)?;
    let fits = stage.undamped && cx.model.cloths().is_empty() && !stage.jacobians.matrix.nodes.layout().is_sparse();
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
        self.rates.clear();
        stage.visit_contact_rates(|node, row, m| {
            self.rates.push((node, row, std::array::from_fn(|a| std::array::from_fn(|c| m[(a, c)]))));
        });
        let columns = n.next_multiple_of(VECTOR);
        stage.transposed_inverse(columns, &mut self.inverse);
        // what contacts' residuals do is always made anew
        if !self.rates.is_empty() || worth_refining(stage, self.scale.clone()) {
            self.refine(stage, columns);
        }
        let mut out = Linearization { a: self.by_state(stage, columns), b: vec![0.0; 2 * n * nu], c: Vec::new() };
        self.move_rates(stage, 3 * cx.model.n_nodes(), &mut out.a);
        self.by_command(step, stage.h, nu, &mut out);
        let end = &stage.transport.carry[1];
        end.add_after(&mut out.a[..2 * n * n], 2 * n);
        end.add_after(&mut out.b[..n * nu], nu);
        out
    }

    /// X ← X + M⁻ᵀ ([1; 0] − Mᵀ X).
    fn refine(&mut self, stage: &StageRecord, columns: usize) {
        let Refinement { defect, largest, .. } = &mut self.refinement;
        let split = stage.v.len() * columns;
        for _ in 0..refinements(stage) {
            defect.clear();
            defect.resize(self.inverse.len(), 0.0);
            (0..stage.v.len()).for_each(|k| defect[k * columns + k] = 1.0);
            stage.subtract_system_transpose_many(&self.inverse, defect, columns);
            stage.solve_system_transpose_many(defect, columns);
            let ([g, h], [dg, dh]) = ([&self.inverse[..split], &self.inverse[split..]], [&defect[..split], &defect[split..]]);
            let done = settled(g, dg, columns, largest) && settled(h, dh, columns, largest);
            self.inverse.iter_mut().zip(&*defect).for_each(|(x, d)| *x += *d);
            if done {
                break;
            }
        }
    }

    /// Rows of positions, with the commands as they are and rods' axes not yet carried to the end; and room for those of velocities.
    fn by_state(&mut self, stage: &StageRecord, columns: usize) -> Vec<f64> {
        let (n, h) = (self.scale.len(), stage.h);
        let g = &self.inverse[..n * columns];
        self.moved.clear();
        for (g, s) in g.chunks_exact(columns).zip(&self.scale) {
            self.moved.extend(g.iter().map(|g| g * s));
        }
        for (node, row, rates) in &self.rates {
            let rows = &self.inverse[row * columns..(row + 4) * columns];
            for (c, to) in self.moved[node * columns..(node + 3) * columns].chunks_exact_mut(columns).enumerate() {
                for (rates, row) in rates.iter().zip(rows.chunks_exact(columns)) {
                    let factor = rates[c];
                    to.iter_mut().zip(row).for_each(|(x, h)| *x += factor * h);
                }
            }
        }
        stage.transport.carry[0].pull_before_many(&mut self.moved, columns);
        let mut a = Vec::with_capacity(4 * n * n);
        for i in 0..n {
            a.extend(self.moved.chunks_exact(columns).map(|row| row[i]));
            a.extend(g.chunks_exact(columns).zip(&self.by_velocity).map(|(row, s)| h * (row[i] * s)));
        }
        a
    }

    /// Rows of velocities, from those of positions.
    fn move_rates(&mut self, stage: &StageRecord, first_twist: usize, a: &mut Vec<f64>) {
        let (n, per_h, begin) = (self.scale.len(), 1.0 / stage.h, &stage.transport.carry[0]);
        a.extend_from_within(..);
        for (k, row) in a[2 * n * n..].chunks_exact_mut(2 * n).enumerate() {
            row[k] -= 1.0;
            if k >= first_twist {
                self.carry_unit(begin, k);
                row.iter_mut().zip(&self.carried).for_each(|(x, psi)| *x -= psi);
            }
            row.iter_mut().for_each(|x| *x *= per_h);
        }
    }

    /// Row `k` of ψ_a.
    fn carry_unit(&mut self, begin: &Carry, k: usize) {
        self.carried.clear();
        self.carried.resize(self.scale.len(), 0.0);
        self.carried[k] = 1.0;
        begin.pull_before(&mut self.carried);
        self.carried[k] = 0.0;
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
            for (i, g) in self.inverse[row * columns..][..n].iter().enumerate() {
                to[i * width + column] += h * (g * value);
                to[(n + i) * width + column] += g * value;
            }
        }
    }
}
