//! Where the method starts.
//!
//! From the last working set: the multipliers at which it holds are computed at once; rows whose multiplier is out of its range leave,
//! until none does. Without one, bounds are guessed.

use super::Constraint;
use super::active_set::{ActiveSet, Run, Scratch, State};
use super::working::Member;
use crate::constants::ACTIVE_SET;
use crate::kernels::norm;

impl ActiveSet {
    /// Numbers the working set's constraints anew, for a next problem whose variables and rows have moved; those without a new number
    /// leave it. Numbers have to differ, and to be below n or m.
    pub(crate) fn renumber(&mut self, new: impl Fn(Constraint) -> Option<Constraint>) {
        let (n, m) = (self.n, self.m);
        let saturated: Vec<usize> = (0..m).filter(|row| self.states[n + row] == State::Saturated).collect();
        self.states.fill(State::Free);
        for row in saturated {
            if let Some(Constraint::Row(row)) = new(Constraint::Row(row)) {
                self.states[n + row] = State::Saturated;
            }
        }
        self.working.members.retain_mut(|member| new(member.constraint).map(|new| member.constraint = new).is_some());
        for member in &self.working.members {
            let place = match member.constraint {
                Constraint::Lower(j) | Constraint::Upper(j) => j,
                Constraint::Row(row) => n + row,
            };
            self.states[place] = State::Working;
        }
        self.renumbered = true;
    }
}

impl Run<'_> {
    /// Takes up the last working set, and its factor if neither the Hessian nor the set's rows changed.
    pub fn warm_start(&mut self, changed: bool) {
        for row in 0..self.solver.m {
            let place = self.solver.n + row;
            if self.solver.states[place] == State::Saturated && !(self.qp.weights[row] + self.qp.limits[row]).is_finite() {
                self.solver.states[place] = State::Free;
            }
        }
        for place in (0..self.solver.working.len()).rev() {
            let constraint = self.solver.working.members[place].constraint;
            if self.limit(constraint) == f64::INFINITY || self.weight(constraint) == 0.0 {
                self.solver.working.remove(place);
                self.set_state(constraint, State::Free);
            }
        }
        if self.solver.states.iter().all(|state| *state == State::Free) {
            self.guess_bounds();
        } else if changed || self.rows_changed() {
            self.rebuild();
        }
        self.solver.scratch.candidates.clear();
        self.solver.scratch.settled.clear();
        loop {
            self.hold();
            if !self.release_out_of_range(0.0) {
                break;
            }
        }
    }

    /// Factors the set anew.
    fn rebuild(&mut self) {
        let mut working = std::mem::take(&mut self.solver.working);
        let left_out = working.rebuild(|constraint, m| self.transform(constraint, m));
        self.solver.working = working;
        left_out.into_iter().for_each(|constraint| self.set_state(constraint, State::Free));
    }

    /// A first working set of bounds, if many are violated: all that are enter together, those of negative multipliers leave together, some
    /// times (Hintermüller, Ito, Kunisch 2003, SIAM J. Optim. 13). A set is factored at once for the work of a few single changes.
    fn guess_bounds(&mut self) {
        for _ in 0..ACTIVE_SET.guesses {
            self.hold();
            let z = &mut self.solver.scratch.z;
            self.solver.hessian.backward(&self.solver.scratch.y, z);
            let outside = |j: &usize| self.qp.lower[*j] > z[*j] || z[*j] > self.qp.upper[*j];
            let free = |j: &usize| self.solver.states[*j] == State::Free;
            let entering: Vec<usize> = (0..self.solver.n).filter(free).filter(outside).collect();
            if entering.len() < ACTIVE_SET.guessed {
                return;
            }
            let ActiveSet { working, states, scratch: Scratch { z, .. }, .. } = &mut *self.solver;
            self.changes += entering.len() + working.len();
            working.members.retain(|member| member.multiplier >= 0.0);
            self.changes -= working.len();
            working.members.extend(entering.into_iter().map(|j| {
                let constraint = if z[j] < self.qp.lower[j] { Constraint::Lower(j) } else { Constraint::Upper(j) };
                Member { constraint, multiplier: 0.0, norm: 0.0 }
            }));
            states.fill(State::Free);
            working.members.iter().for_each(|member| match member.constraint {
                Constraint::Lower(j) | Constraint::Upper(j) => states[j] = State::Working,
                Constraint::Row(_) => {}
            });
            self.rebuild();
        }
    }

    /// Whether a row of the set is another one than that of the last problem, at the same Hessian.
    fn rows_changed(&mut self) -> bool {
        let mut m = std::mem::take(&mut self.solver.scratch.entering);
        let mut rows = self.solver.working.members.iter().map(|member| member.constraint).enumerate();
        let changed = rows.any(|(place, constraint)| {
            matches!(constraint, Constraint::Row(_)) && {
                self.transform(constraint, &mut m);
                !self.solver.working.has(place, &m)
            }
        });
        self.solver.scratch.entering = m;
        changed
    }

    /// Computes the multipliers at which the working rows hold, and y.
    pub fn hold(&mut self) {
        let (mut y, mut sum) = (std::mem::take(&mut self.solver.scratch.y), std::mem::take(&mut self.solver.scratch.a));
        sum.copy_from_slice(self.qp.gradient);
        for row in 0..self.solver.m {
            if self.solver.states[self.solver.n + row] == State::Saturated {
                self.add_row(Constraint::Row(row), self.qp.weights[row], &mut sum);
            }
        }
        self.solver.hessian.forward(&sum, &mut y);
        self.reach = self.reach.max(norm(&y));
        y.iter_mut().for_each(|y| *y = -*y);
        let working = &self.solver.working;
        let k = working.len();
        working.transposed_product(&y, &mut sum);
        for (sum, member) in sum.iter_mut().zip(&working.members) {
            *sum -= self.limit(member.constraint);
        }
        working.solve_transposed(&mut sum[..k]);
        working.solve(&mut sum[..k]);
        working.add_product(-1.0, &sum, &mut y);
        for (member, multiplier) in self.solver.working.members.iter_mut().zip(&sum) {
            member.multiplier = *multiplier;
        }
        (self.solver.scratch.y, self.solver.scratch.a) = (y, sum);
    }

    /// Lets working rows go whose multipliers are out of their range by more than `slack`; whether any was.
    pub fn release_out_of_range(&mut self, slack: f64) -> bool {
        let before = self.solver.working.len();
        for place in (0..before).rev() {
            let member = self.solver.working.members[place];
            let state = match member.multiplier {
                low if low < -slack => State::Free,
                high if high > self.weight(member.constraint) + slack => State::Saturated,
                _ => continue,
            };
            self.solver.working.remove(place);
            self.set_state(member.constraint, state);
            self.changes += 1;
        }
        self.solver.working.len() < before
    }
}
