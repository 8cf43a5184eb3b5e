//! The last digits: the problem of the rows that hold, as equations.
//!
//! Near the solution a row's multiplier or its slack is small. With the rows that hold as equations, the free ones left out and those at
//! their price at the weight, the solution is found by the method of multipliers: dλ = D (g (w + dw) − c) at a constant weight D, one
//! factorization and some solves. Errors that interior points leave, proportional to the root of μ where a multiplier and its slack vanish
//! both, and the rounding errors of weights that grow with 1/μ are gone; complementarity is exact. It counts if all conditions of
//! optimality are met.

use super::Run;
use super::rows::{Inequality, Phase};
use crate::constants::OCP;
use crate::kernels::largest;

impl Run<'_> {
    /// From the point kept, solves for the rows that seem to hold; whether the result is a solution. If not, the point is again that kept.
    pub(super) fn polish(&mut self) -> bool {
        self.take_back();
        let (states, slopes) = (self.size_of_states(), self.size_of_slopes());
        for row in self.rows.iter_mut().flat_map(|rows| &mut rows.list) {
            row.decide(states, slopes);
        }
        let weight = OCP.polish_weight * slopes / states;
        let mut solved = false;
        for guess in 0..OCP.guesses {
            if guess > 0 {
                self.rows.iter_mut().flat_map(|rows| &mut rows.list).for_each(Inequality::decide_again);
            }
            solved = self.solve_equations(weight);
            if solved {
                break;
            }
        }
        if !solved {
            self.take_back();
            return false;
        }
        self.rows.iter_mut().flat_map(|rows| &mut rows.list).for_each(Inequality::clamp);
        true
    }

    /// Whether the rows that hold, with those that are free or priced, are a solution.
    fn solve_equations(&mut self, weight: f64) -> bool {
        self.rows.iter_mut().for_each(|rows| rows.weigh_held(weight));
        if self.recursion.factor(self.ocp, &self.rows).is_err() {
            return false;
        }
        self.evaluate();
        let mut error = f64::INFINITY;
        for _ in 0..OCP.polish_steps {
            self.step_of_equations();
            let last = std::mem::replace(&mut error, self.error_of_equations());
            // no further digits
            if error < OCP.polished * OCP.aimed || error > 0.5 * last {
                break;
            }
        }
        error <= OCP.aimed
    }

    fn step_of_equations(&mut self) {
        let n = self.ocp.stages.len();
        self.gradient.copy_from(&self.residual);
        for k in 0..=n {
            let (x, u) = (&mut self.gradient.x[k], self.gradient.u.get_mut(k));
            self.rows[k].add_held(x, u.map_or(&mut [], |u| u));
        }
        self.recursion.solve(self.ocp, &self.rows, &self.gradient, &mut self.step);
        for k in 0..=n {
            self.rows[k].take_up_held(&self.step.x[k], self.step.u.get(k).map_or(&[], |u| u));
        }
        super::add(&mut self.at, 1.0, &self.step);
        self.evaluate();
    }

    /// Largest error of the conditions of optimality, relative to their terms.
    fn error_of_equations(&self) -> f64 {
        let (states, slopes) = (self.size_of_states(), self.size_of_slopes());
        let of_rows = self.rows.iter().flat_map(|rows| &rows.list).map(|row| {
            let excess = (row.value - row.limit) / (row.limit.abs().max(row.value.abs()) + states);
            match row.phase {
                Phase::Free => excess,
                Phase::Held => excess.abs().max(-row.lambda / slopes).max((row.lambda - row.weight) / slopes),
                Phase::Priced => -excess,
            }
        });
        let dynamics = self.residual.dynamics.iter().map(|gap| largest(gap)).fold(0.0, f64::max) / states;
        let error = of_rows.fold(dynamics.max(self.stationarity() / slopes), f64::max);
        // maxima pass over numbers that are none
        if self.at.x.iter().flatten().all(|x| x.is_finite()) { error } else { f64::INFINITY }
    }
}
