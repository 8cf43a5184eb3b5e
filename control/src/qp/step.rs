//! A violated row enters the working set.

use super::active_set::{Run, State, Violated};
use super::working::Member;
use super::{Constraint, QpError};
use crate::constants::ACTIVE_SET;
use crate::kernels::norm;

/// Ends of a step.
enum Blocked {
    /// The row holds.
    Holds,
    /// Its multiplier is at the other end of its range.
    Through,
    /// A working row's multiplier is at an end of its range.
    Member(usize, State),
}

/// The row that enters.
struct Entering {
    constraint: Constraint,
    /// 1 from multiplier 0 upwards, −1 from the weight downwards.
    sign: f64,
    /// The way its multiplier went so far.
    moved: f64,
    /// Violation that remains.
    by: f64,
    /// |L⁻¹ a|.
    norm: f64,
}

impl Run<'_> {
    /// Changes the multiplier of a row that errs until the row holds, or until the multiplier is at the other end of its range.
    ///
    /// In a step t of the multiplier the working rows' change by −t · rates and y by −t · rest, with L⁻¹ a = M · rates + rest: the working
    /// rows go on to hold.
    ///
    /// # Errors
    /// The row is hard, depends on the working ones, and contradicts them.
    pub fn enter(&mut self, violated: Violated) -> Result<(), QpError> {
        let mut m = std::mem::take(&mut self.solver.scratch.entering);
        self.transform(violated.constraint, &mut m);
        let sign = if self.state(violated.constraint) == State::Saturated { -1.0 } else { 1.0 };
        let mut row = Entering { constraint: violated.constraint, sign, moved: 0.0, by: violated.by, norm: norm(&m) };
        let result = loop {
            self.changes += 1;
            let rest = self.solver.working.project(&m);
            let (step, blocked) = self.longest_step(&row, rest);
            if step == f64::INFINITY {
                break self.contradicted(&row);
            }
            self.take(&mut row, step, rest);
            match blocked {
                Blocked::Member(place, state) => {
                    let member = self.solver.working.remove(place);
                    self.set_state(member.constraint, state);
                }
                Blocked::Holds => {
                    let multiplier = if sign > 0.0 { row.moved } else { self.weight(row.constraint) - row.moved };
                    self.solver.working.push(row.constraint, multiplier, &m, rest);
                    self.set_state(row.constraint, State::Working);
                    break Ok(());
                }
                Blocked::Through => {
                    self.set_state(row.constraint, if sign > 0.0 { State::Saturated } else { State::Free });
                    break Ok(());
                }
            }
        };
        self.solver.scratch.entering = m;
        result
    }

    /// The step up to what blocks it first; infinite if nothing does.
    fn longest_step(&self, row: &Entering, rest: f64) -> (f64, Blocked) {
        let working = &self.solver.working;
        let (mut step, mut blocked) = (self.weight(row.constraint) - row.moved, Blocked::Through);
        if rest > 0.0 && row.by / (rest * rest) <= step {
            (step, blocked) = (row.by / (rest * rest), Blocked::Holds);
        }
        let mut largest = 0.0;
        for (place, (member, rate)) in working.members.iter().zip(&working.rates).enumerate() {
            let (rate, size) = (-row.sign * rate, rate.abs() * member.norm);
            if size <= ACTIVE_SET.rate * row.norm {
                continue;
            }
            let (room, state) = if rate < 0.0 {
                (member.multiplier, State::Free)
            } else {
                (self.weight(member.constraint) - member.multiplier, State::Saturated)
            };
            let longest = room.max(0.0) / rate.abs();
            // of rows that block together the one with the largest rate leaves: what is left is farthest from dependent
            if longest < step || (longest == step && size > largest) {
                (step, blocked, largest) = (longest, Blocked::Member(place, state), size);
            }
        }
        (step, blocked)
    }

    fn take(&mut self, row: &mut Entering, step: f64, rest: f64) {
        let solver = &mut *self.solver;
        let change = -row.sign * step;
        for (member, rate) in solver.working.members.iter_mut().zip(&solver.working.rates) {
            member.multiplier += change * rate;
        }
        for (y, rest) in solver.scratch.y.iter_mut().zip(&solver.working.rest) {
            *y += change * rest;
        }
        row.moved += step;
        row.by -= step * rest * rest;
    }

    /// A hard row that depends on working ones whose multipliers grow without limit: a = Σ rates · a_i with rates ≤ 0, hence
    /// aᵀ z ≥ Σ rates · b_i, which is above b by as much as the row is violated now.
    ///
    /// # Errors
    /// The violation is more than rounding noise; else the row counts as satisfied.
    fn contradicted(&mut self, row: &Entering) -> Result<(), QpError> {
        if row.by <= ACTIVE_SET.contradiction * (self.limit(row.constraint).abs() + row.norm * self.reach) {
            self.solver.scratch.settled.push(row.constraint);
            return Ok(());
        }
        let working = &self.solver.working;
        let part = |(member, rate): (&Member, &f64)| {
            (rate.abs() * member.norm > ACTIVE_SET.rate * row.norm).then_some(member.constraint)
        };
        let others = working.members.iter().zip(&working.rates).filter_map(part);
        Err(QpError::Infeasible { constraints: std::iter::once(row.constraint).chain(others).collect(), by: row.by })
    }
}
