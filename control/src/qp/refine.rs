//! The solution of a working set, refined with residuals in the problem's own numbers.

use super::Constraint;
use super::active_set::{Run, State};
use crate::constants::ACTIVE_SET;
use crate::kernels::{largest, norm};

impl Run<'_> {
    /// Refines z and the multipliers of the working rows by the conditions
    ///
    /// ```text
    /// [H  A_Wᵀ] [dz]     [−(H z + g + A_Wᵀ λ_W + A_Sᵀ weight_S)]
    /// [A_W   0] [dλ]  =  [b_W − A_W z                          ]
    /// ```
    /// and puts variables whose bound works on it. Whether it is a solution: no multiplier out of its range, no row violated. If not, rows
    /// out of range have left the working set.
    pub fn refine(&mut self) -> bool {
        let mut scratch = std::mem::take(&mut self.solver.scratch);
        let (residual, p, t) = (&mut scratch.a, &mut scratch.b, &mut scratch.c);
        let (y, z) = (&mut scratch.y, &mut scratch.z);
        let mut last = f64::INFINITY;
        let mut scale = 0.0;
        for _ in 0..ACTIVE_SET.refinements {
            scale = self.residual(z, residual);
            let working = &self.solver.working;
            let k = working.len();
            self.solver.hessian.forward(residual, p);
            working.transposed_product(p, t);
            let mut off = largest(residual) / scale.max(f64::MIN_POSITIVE);
            for (t, member) in t.iter_mut().zip(&working.members) {
                let (limit, value) = (self.limit(member.constraint), self.value(member.constraint, z));
                off = off.max((limit - value).abs() / (limit.abs() + member.norm * norm(y)).max(f64::MIN_POSITIVE));
                *t -= limit - value;
            }
            // rounding errors of the residuals: no further digits
            if off < 4.0 * f64::EPSILON || off > 0.5 * last {
                break;
            }
            last = off;
            working.solve_transposed(&mut t[..k]);
            working.solve(&mut t[..k]);
            working.add_product(-1.0, t, p);
            y.iter_mut().zip(&*p).for_each(|(y, p)| *y += p);
            self.solver.hessian.backward(p, residual);
            z.iter_mut().zip(&*residual).for_each(|(z, dz)| *z += dz);
            self.solver.working.members.iter_mut().zip(&*t).for_each(|(member, t)| member.multiplier += t);
        }
        for member in &self.solver.working.members {
            match member.constraint {
                Constraint::Lower(j) => z[j] = self.qp.lower[j],
                Constraint::Upper(j) => z[j] = self.qp.upper[j],
                Constraint::Row(_) => {}
            }
        }
        // others may be out of theirs by the tolerance
        for (z, (lower, upper)) in z.iter_mut().zip(self.qp.lower.iter().zip(self.qp.upper)) {
            *z = z.clamp(*lower, *upper);
        }
        self.solver.scratch = scratch;
        if self.release_out_of_range(ACTIVE_SET.sign * scale) {
            self.hold();
            return false;
        }
        for place in 0..self.solver.working.len() {
            let weight = self.weight(self.solver.working.members[place].constraint);
            let multiplier = &mut self.solver.working.members[place].multiplier;
            *multiplier = multiplier.clamp(0.0, weight);
        }
        self.holds()
    }

    /// −(H z + g + A_Wᵀ λ_W + A_Sᵀ weight_S); returns the size of its largest term.
    fn residual(&self, z: &[f64], residual: &mut [f64]) -> f64 {
        self.solver.hessian.product(z, residual);
        let mut scale = largest(residual).max(largest(self.qp.gradient));
        residual.iter_mut().zip(self.qp.gradient).for_each(|(r, g)| *r = -*r - g);
        for row in 0..self.solver.m {
            if self.solver.states[self.solver.n + row] == State::Saturated {
                self.add_row(Constraint::Row(row), -self.qp.weights[row], residual);
            }
        }
        for member in &self.solver.working.members {
            self.add_row(member.constraint, -member.multiplier, residual);
            scale = scale.max(member.multiplier.abs());
        }
        scale
    }

    /// Whether no constraint errs at the present z by more than some times the tolerance.
    fn holds(&mut self) -> bool {
        self.reach = norm(&self.solver.scratch.y);
        let (bound, row) = (self.most_violated_bound(), self.most_violated_of_all());
        bound.into_iter().chain(row).all(|violated| {
            let norm = violated.by / violated.score;
            violated.by <= ACTIVE_SET.refined * self.tolerance(violated.constraint, norm)
        })
    }
}
