//! A dual active-set method (Goldfarb, Idnani 1983, Math. Program. 27; with the dual in the least-distance form of Arnström, Bemporad,
//! Axehill 2022, IEEE TAC 67), for rows with an upper limit of their multiplier.
//!
//! The dual, with M = L⁻¹ Aᵀ of all rows and y = Lᵀ z = −L⁻¹ g − M λ, is the maximum of −½ |y|² − bᵀ λ over 0 ≤ λ ≤ weight. Every row is
//! free (λ = 0), saturated (λ = weight: violated at its price) or works (it holds with equality). From multipliers in their range, at
//! which the working rows hold: the row that errs most (a free one violated, a saturated one that is not) changes its multiplier until it
//! holds and works, or is at the other end of its range; a working row whose multiplier meets an end of its range on the way leaves the
//! set there. Each entry increases the dual, so that no set comes back; rounding is held off by tolerances relative to each row.
//!
//! Violations of rows are computed for those that were violated when all were last looked at; all are when none of these is violated.

use super::hessian::Hessian;
use super::working::WorkingSet;
use super::{Constraint, Qp, QpError, QpSolution};
use crate::constants::ACTIVE_SET;
use crate::kernels::{dot, norm};
use faer::{ContiguousFwd, MatRef};

/// Where a row's multiplier is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum State {
    /// At 0.
    #[default]
    Free,
    /// The row holds with equality.
    Working,
    /// At its weight.
    Saturated,
}

/// The method with its memory; a problem of the size of the last one starts from its working set. Deterministic: the same problems in
/// the same order have the same solutions to the last bit.
#[derive(Clone, Debug, Default)]
pub struct ActiveSet {
    pub(super) n: usize,
    pub(super) m: usize,
    pub(super) hessian: Hessian,
    pub(super) working: WorkingSet,
    /// Of the bounds of a variable, then of the rows.
    pub(super) states: Vec<State>,
    /// The factor of the working set is not that of its numbers.
    pub(super) renumbered: bool,
    /// Rows, where the problem's do not lie contiguously.
    copied: Vec<f64>,
    pub(super) scratch: Scratch,
}

/// Vectors of n numbers, and candidates among the rows.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    /// L⁻¹ g.
    pub gradient: Vec<f64>,
    /// y = Lᵀ z.
    pub y: Vec<f64>,
    pub z: Vec<f64>,
    /// L⁻¹ a of the entering row.
    pub entering: Vec<f64>,
    pub a: Vec<f64>,
    pub b: Vec<f64>,
    pub c: Vec<f64>,
    pub candidates: Vec<Candidate>,
    /// Violated by rounding noise only, and dependent on the working rows.
    pub settled: Vec<Constraint>,
}

/// A row that was violated when all were last looked at.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    row: usize,
    /// About |L⁻¹ a|.
    norm: f64,
}

/// A constraint that errs, and by how much.
#[derive(Clone, Copy, Debug)]
pub(super) struct Violated {
    pub constraint: Constraint,
    pub by: f64,
    /// `by` relative to |L⁻¹ a|: the distance in y.
    pub score: f64,
}

impl ActiveSet {
    /// Without a working set.
    pub fn new() -> Self {
        Self::default()
    }

    /// Forgets the working set: the next problem starts from none.
    pub fn forget(&mut self) {
        self.working.clear(self.n);
        self.states.fill(State::Free);
    }

    /// # Errors
    /// Sizes that do not belong together, numbers that are not finite, negative weights, crossed bounds; a Hessian that is not positive
    /// definite; hard constraints that contradict each other; bad conditioning beyond what rounding allows. After an error the next
    /// problem starts from no working set.
    pub fn solve(&mut self, qp: &Qp<'_>) -> Result<QpSolution, QpError> {
        let result = self.attempt(qp);
        if result.is_err() {
            self.forget();
        }
        result
    }

    fn attempt(&mut self, qp: &Qp<'_>) -> Result<QpSolution, QpError> {
        qp.check()?;
        let (n, m) = (qp.n(), qp.m());
        if (self.n, self.m) != (n, m) {
            (self.n, self.m) = (n, m);
            self.working.clear(n);
            self.states.clear();
            self.states.resize(n + m, State::Free);
            self.scratch.resize(n);
        }
        let changed = self.hessian.refactor(qp.hessian)? || std::mem::take(&mut self.renumbered);
        let mut copied = std::mem::take(&mut self.copied);
        let rows = contiguous(qp.rows, &mut copied);
        let mut run = Run { qp, rows, solver: self, changes: 0, reach: 0.0 };
        let result = run.solve(changed);
        self.copied = copied;
        result
    }
}

impl Scratch {
    fn resize(&mut self, n: usize) {
        for vector in [&mut self.gradient, &mut self.y, &mut self.z, &mut self.entering, &mut self.a, &mut self.b, &mut self.c] {
            vector.resize(n, 0.0);
        }
        self.candidates.clear();
    }
}

/// C, each row contiguous.
#[derive(Clone, Copy)]
enum RowsRef<'a> {
    /// Cᵀ as given.
    Given(MatRef<'a, f64, usize, usize, ContiguousFwd>),
    /// Row behind row, each of so many numbers.
    Copied(&'a [f64], usize),
}

fn contiguous<'a>(rows: MatRef<'a, f64>, copied: &'a mut Vec<f64>) -> RowsRef<'a> {
    let transposed = rows.transpose();
    if let Some(columns) = transposed.try_as_col_major() {
        return RowsRef::Given(columns);
    }
    let (n, m) = (transposed.nrows(), transposed.ncols());
    copied.resize(n * m, 0.0);
    for i in 0..m {
        for j in 0..n {
            copied[i * n + j] = rows[(i, j)];
        }
    }
    RowsRef::Copied(copied, n)
}

/// One problem being solved.
pub(super) struct Run<'a> {
    pub qp: &'a Qp<'a>,
    rows: RowsRef<'a>,
    pub solver: &'a mut ActiveSet,
    pub changes: usize,
    /// Largest |y| since y was last refined: rounding errors of y are proportional to it, not to |y|, which may be far smaller than the
    /// |L⁻¹ g| it starts from.
    pub reach: f64,
}

impl<'a> Run<'a> {
    fn solve(&mut self, changed: bool) -> Result<QpSolution, QpError> {
        let Scratch { gradient, .. } = &mut self.solver.scratch;
        self.solver.hessian.forward(self.qp.gradient, gradient);
        self.reach = norm(gradient);
        self.warm_start(changed);
        let limit = 100 + ACTIVE_SET.changes * (self.solver.n + self.solver.m);
        loop {
            while let Some(violated) = self.most_violated() {
                self.enter(violated)?;
                if self.changes > limit {
                    return Err(QpError::IterationLimit { changes: self.changes });
                }
            }
            if self.refine() {
                return Ok(self.solution());
            }
            // each round counts, so that rounds end as well
            self.changes += 1;
        }
    }

    /// The row's coefficients.
    pub fn row(&self, row: usize) -> &'a [f64] {
        match self.rows {
            RowsRef::Given(columns) => columns.col(row).as_slice(),
            RowsRef::Copied(rows, n) => &rows[row * n..(row + 1) * n],
        }
    }

    pub fn weight(&self, constraint: Constraint) -> f64 {
        match constraint {
            Constraint::Row(row) => self.qp.weights[row],
            _ => f64::INFINITY,
        }
    }

    /// The right-hand side b of aᵀ z ≤ b.
    pub fn limit(&self, constraint: Constraint) -> f64 {
        match constraint {
            Constraint::Lower(j) => -self.qp.lower[j],
            Constraint::Upper(j) => self.qp.upper[j],
            Constraint::Row(row) => self.qp.limits[row],
        }
    }

    /// aᵀ z.
    pub fn value(&self, constraint: Constraint, z: &[f64]) -> f64 {
        match constraint {
            Constraint::Lower(j) => -z[j],
            Constraint::Upper(j) => z[j],
            Constraint::Row(row) => dot(self.row(row), z),
        }
    }

    /// `y += scale · a`.
    pub fn add_row(&self, constraint: Constraint, scale: f64, y: &mut [f64]) {
        match constraint {
            Constraint::Lower(j) => y[j] -= scale,
            Constraint::Upper(j) => y[j] += scale,
            Constraint::Row(row) => {
                for (y, a) in y.iter_mut().zip(self.row(row)) {
                    *y += scale * a;
                }
            }
        }
    }

    /// `y = L⁻¹ a`.
    pub fn transform(&self, constraint: Constraint, y: &mut [f64]) {
        match constraint {
            Constraint::Lower(j) => self.solver.hessian.column(j, -1.0, y),
            Constraint::Upper(j) => self.solver.hessian.column(j, 1.0, y),
            Constraint::Row(row) => self.solver.hessian.forward(self.row(row), y),
        }
    }

    fn place(&self, constraint: Constraint) -> usize {
        match constraint {
            Constraint::Lower(j) | Constraint::Upper(j) => j,
            Constraint::Row(row) => self.solver.n + row,
        }
    }

    pub fn state(&self, constraint: Constraint) -> State {
        self.solver.states[self.place(constraint)]
    }

    pub fn set_state(&mut self, constraint: Constraint, state: State) {
        let place = self.place(constraint);
        self.solver.states[place] = state;
    }

    /// The violated constraint farthest away in y = Lᵀ z, at the z of the present y.
    fn most_violated(&mut self) -> Option<Violated> {
        let Scratch { y, z, .. } = &mut self.solver.scratch;
        self.solver.hessian.backward(y, z);
        self.reach = self.reach.max(norm(y));
        let mut most = self.most_violated_bound();
        let candidates = std::mem::take(&mut self.solver.scratch.candidates);
        for candidate in &candidates {
            most = farther(most, self.violated_row(candidate.row, Some(candidate.norm)).map(|found| found.0));
        }
        self.solver.scratch.candidates = candidates;
        most.or_else(|| self.most_violated_of_all())
    }

    pub fn most_violated_bound(&self) -> Option<Violated> {
        let z = &self.solver.scratch.z;
        let mut most = None;
        for (j, z) in z.iter().enumerate() {
            let (below, above) = (self.qp.lower[j] - z, z - self.qp.upper[j]);
            if (below > 0.0 || above > 0.0) && self.solver.states[j] == State::Free {
                let (constraint, by) = if below > 0.0 { (Constraint::Lower(j), below) } else { (Constraint::Upper(j), above) };
                let norm = self.solver.hessian.norm(j);
                if by > self.tolerance(constraint, norm) && !self.solver.scratch.settled.contains(&constraint) {
                    most = farther(most, Some(Violated { constraint, by, score: by / norm }));
                }
            }
        }
        most
    }

    /// The same of the rows, all of which are looked at; those violated become candidates.
    pub fn most_violated_of_all(&mut self) -> Option<Violated> {
        let mut candidates = std::mem::take(&mut self.solver.scratch.candidates);
        candidates.clear();
        let mut most = None;
        for row in 0..self.solver.m {
            if let Some((violated, norm)) = self.violated_row(row, None) {
                candidates.push(Candidate { row, norm });
                most = farther(most, Some(violated));
            }
        }
        self.solver.scratch.candidates = candidates;
        most
    }

    /// The row if it errs, and about |L⁻¹ a|, computed if it is not known.
    fn violated_row(&self, row: usize, norm: Option<f64>) -> Option<(Violated, f64)> {
        let sign = match self.solver.states[self.solver.n + row] {
            State::Free if self.qp.weights[row] > 0.0 => 1.0,
            State::Saturated => -1.0,
            _ => return None,
        };
        let a = self.row(row);
        let by = sign * (dot(a, &self.solver.scratch.z) - self.qp.limits[row]);
        if by <= 0.0 {
            return None;
        }
        let norm = norm.unwrap_or_else(|| self.solver.hessian.estimated_norm(a));
        let constraint = Constraint::Row(row);
        let errs = by > self.tolerance(constraint, norm) && !self.solver.scratch.settled.contains(&constraint);
        // a row of zeros is at any distance: it comes first
        errs.then(|| (Violated { constraint, by, score: by / norm }, norm))
    }

    /// Violation that is rounding noise.
    pub fn tolerance(&self, constraint: Constraint, norm: f64) -> f64 {
        ACTIVE_SET.noise * norm * self.reach + ACTIVE_SET.feasible * self.limit(constraint).abs()
    }

    fn solution(&self) -> QpSolution {
        let mut solution = QpSolution {
            z: self.solver.scratch.z.clone(),
            bounds: vec![0.0; self.solver.n],
            multipliers: vec![0.0; self.solver.m],
            cost: 0.0,
            iterations: self.changes,
        };
        for row in 0..self.solver.m {
            if self.solver.states[self.solver.n + row] == State::Saturated {
                solution.multipliers[row] = self.qp.weights[row];
            }
        }
        for member in &self.solver.working.members {
            match member.constraint {
                Constraint::Lower(j) => solution.bounds[j] = -member.multiplier,
                Constraint::Upper(j) => solution.bounds[j] = member.multiplier,
                Constraint::Row(row) => solution.multipliers[row] = member.multiplier,
            }
        }
        let mut product = vec![0.0; self.solver.n];
        self.solver.hessian.product(&solution.z, &mut product);
        solution.cost = 0.5 * dot(&product, &solution.z) + dot(self.qp.gradient, &solution.z);
        for (row, (weight, limit)) in self.qp.weights.iter().zip(self.qp.limits).enumerate() {
            if weight.is_finite() {
                solution.cost += weight * (dot(self.row(row), &solution.z) - limit).max(0.0);
            }
        }
        solution
    }
}

fn farther(most: Option<Violated>, other: Option<Violated>) -> Option<Violated> {
    match (most, other) {
        (Some(most), Some(other)) if other.score > most.score => Some(other),
        (most, other) => most.or(other),
    }
}
