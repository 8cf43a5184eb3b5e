//! The working set: rows that hold with equality, and the triangular factor of them.
//!
//! With M = L⁻¹ A_Wᵀ, n × k, the factor R of M = Q R is kept, without Q: Qᵀ m = R⁻ᵀ Mᵀ m, corrected once more by the same equations
//! where digits cancel (corrected semi-normal equations; Björck 1987, Linear Algebra Appl. 88/89). A row that enters appends a column,
//! one that leaves is removed by rotations.

use super::Constraint;
use crate::constants::ACTIVE_SET;
use crate::kernels::{Columns, add_product, norm, solve_upper, transposed_product};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::{Accum, Mat, MatRef, Par};

#[derive(Clone, Copy, Debug)]
pub(super) struct Member {
    pub constraint: Constraint,
    pub multiplier: f64,
    /// |L⁻¹ a|.
    pub norm: f64,
}

#[derive(Clone, Debug, Default)]
pub(super) struct WorkingSet {
    n: usize,
    pub members: Vec<Member>,
    /// M, column-major.
    m: Vec<f64>,
    /// R, column-major with n numbers a column.
    r: Vec<f64>,
    /// A step's multipliers: R⁻¹ Qᵀ m.
    pub rates: Vec<f64>,
    /// Qᵀ m.
    head: Vec<f64>,
    /// The part of m orthogonal to M.
    pub rest: Vec<f64>,
    correction: Vec<f64>,
}

impl WorkingSet {
    /// Empties the set, for n variables.
    pub fn clear(&mut self, n: usize) {
        self.n = n;
        self.members.clear();
        for entries in [&mut self.m, &mut self.r] {
            entries.resize(n * n, 0.0);
        }
        for entries in [&mut self.rates, &mut self.head, &mut self.rest, &mut self.correction] {
            entries.resize(n, 0.0);
        }
    }

    pub fn len(&self) -> usize {
        self.members.len()
    }

    fn m(&self) -> Columns<'_> {
        Columns { data: &self.m, height: self.n, columns: self.len(), lower: false }
    }

    /// `y = Mᵀ x`.
    pub fn transposed_product(&self, x: &[f64], y: &mut [f64]) {
        transposed_product(self.m(), x, y);
    }

    /// `y += scale · M x`.
    pub fn add_product(&self, scale: f64, x: &[f64], y: &mut [f64]) {
        add_product(scale, self.m(), x, y);
    }

    /// `x ← R⁻ᵀ x`.
    pub fn solve_transposed(&self, x: &mut [f64]) {
        solve_upper(&self.r, self.n, true, x);
    }

    /// `x ← R⁻¹ x`.
    pub fn solve(&self, x: &mut [f64]) {
        solve_upper(&self.r, self.n, false, x);
    }

    /// Splits m into M · `rates` + `rest`; returns |rest|, 0 if m depends on the set.
    pub fn project(&mut self, m: &[f64]) -> f64 {
        let k = self.len();
        let size = norm(m);
        self.rest.copy_from_slice(m);
        self.rates.fill(0.0);
        self.head.fill(0.0);
        let mut left = size;
        for _ in 0..ACTIVE_SET.corrections {
            if k == 0 {
                break;
            }
            let (mut correction, mut rest) = (std::mem::take(&mut self.correction), std::mem::take(&mut self.rest));
            self.transposed_product(&rest, &mut correction);
            self.solve_transposed(&mut correction[..k]);
            add(&mut self.head[..k], &correction);
            self.solve(&mut correction[..k]);
            add(&mut self.rates[..k], &correction);
            self.add_product(-1.0, &correction, &mut rest);
            (self.correction, self.rest) = (correction, rest);
            let before = std::mem::replace(&mut left, norm(&self.rest));
            if left <= ACTIVE_SET.dependent * size || left > ACTIVE_SET.corrected * before {
                break;
            }
        }
        if k == self.n || left <= ACTIVE_SET.dependent * size { 0.0 } else { left }
    }

    /// Whether M's column at `place` is m.
    pub fn has(&self, place: usize, m: &[f64]) -> bool {
        self.m[place * self.n..][..self.n] == *m
    }

    /// Takes the set's rows anew, as many of them as are independent of those before; `transform` gives L⁻¹ a. Mᵀ M is factored at once;
    /// where that would leave too few digits, row by row. Returns those left out.
    pub fn rebuild(&mut self, mut transform: impl FnMut(Constraint, &mut [f64])) -> Vec<Constraint> {
        let (n, k) = (self.n, self.len());
        for (member, m) in self.members.iter_mut().zip(self.m.chunks_mut(n)) {
            transform(member.constraint, m);
            member.norm = norm(m);
        }
        if k == 0 || self.factor_at_once() {
            return Vec::new();
        }
        let (mut left_out, mut m) = (Vec::new(), vec![0.0; n]);
        for member in std::mem::take(&mut self.members) {
            transform(member.constraint, &mut m);
            let rest = self.project(&m);
            if rest > 0.0 {
                self.push(member.constraint, 0.0, &m, rest);
            } else {
                left_out.push(member.constraint);
            }
        }
        left_out
    }

    /// R by Cholesky's factorization of Mᵀ M; false if a row is too near to the others.
    fn factor_at_once(&mut self) -> bool {
        let (n, k) = (self.n, self.len());
        let m = MatRef::from_column_major_slice(&self.m[..n * k], n, k);
        let mut gram = Mat::<f64>::zeros(k, k);
        let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
        triangular::matmul(gram.as_mut(), lower, Accum::Replace, m.transpose(), full, m, full, 1.0, Par::Seq);
        let mut memory = MemBuffer::new(cholesky_in_place_scratch::<f64>(k, Par::Seq, Default::default()));
        let stack = MemStack::new(&mut memory);
        if cholesky_in_place(gram.as_mut(), Default::default(), Par::Seq, stack, Default::default()).is_err() {
            return false;
        }
        if (0..k).any(|j| gram[(j, j)] < ACTIVE_SET.at_once * self.members[j].norm) {
            return false;
        }
        for j in 0..k {
            for i in 0..=j {
                self.r[j * n + i] = gram[(j, i)];
            }
        }
        true
    }

    /// Appends the row m last given to [`WorkingSet::project`], and |rest|, not 0.
    pub fn push(&mut self, constraint: Constraint, multiplier: f64, m: &[f64], rest: f64) {
        let k = self.len();
        self.m[k * self.n..][..self.n].copy_from_slice(m);
        let column = &mut self.r[k * self.n..][..=k];
        column[..k].copy_from_slice(&self.head[..k]);
        column[k] = rest;
        self.members.push(Member { constraint, multiplier, norm: norm(m) });
    }

    /// Removes the member at `place`.
    pub fn remove(&mut self, place: usize) -> Member {
        let (n, k) = (self.n, self.len());
        self.m.copy_within((place + 1) * n..k * n, place * n);
        for j in place + 1..k {
            self.r.copy_within(j * n..j * n + j + 1, (j - 1) * n);
        }
        // the columns from `place` on have one entry below the diagonal
        for i in place..k - 1 {
            let (above, below) = (self.r[i * n + i], self.r[i * n + i + 1]);
            let length = above.hypot(below);
            let (c, s) = if length > 0.0 { (above / length, below / length) } else { (1.0, 0.0) };
            self.r[i * n + i] = length;
            for j in i + 1..k - 1 {
                let pair = &mut self.r[j * n + i..][..2];
                (pair[0], pair[1]) = (c * pair[0] + s * pair[1], c * pair[1] - s * pair[0]);
            }
        }
        self.members.remove(place)
    }
}

fn add(y: &mut [f64], x: &[f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += x;
    }
}
