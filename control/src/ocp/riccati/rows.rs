//! The inequalities of a stage with their slacks and multipliers.
//!
//! A hard row g w ≤ c of w = (x, u) has a slack s = c − g w > 0 and a multiplier λ > 0. A soft one is g w − σ + s = c with a violation
//! σ > 0 at the price weight: the multiplier of σ ≥ 0 is ν = weight − λ > 0, and λ stays below the weight. Both slacks are eliminated
//! from Newton's equations
//!
//! ```text
//! g dw − dσ + ds = −(g w − σ + s − c),   s dλ + λ ds = t_s,   σ dν + ν dσ = t_σ,   dν = −dλ
//! ⇒ dλ = D (g dw + ρ),   1/D = s/λ + σ/ν,   ρ = (g w − σ + s − c) + t_s/λ − t_σ/ν
//! ```
//! (hard: without the terms of σ), which adds gᵀ D g to the stage's Hessian and D ρ gᵀ to its gradient.

use crate::constants::OCP;
use crate::ocp::products::multiply;
use crate::ocp::{Ocp, Rows};
use faer::{Accum, Mat};

/// Which inequality.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    /// sign · u_j ≤ limit.
    Bound { input: usize, sign: f64 },
    /// A row.
    Row(usize),
}

/// How a row is taken at the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// λ = 0.
    Free,
    /// g w = c.
    Held,
    /// λ = weight.
    Priced,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Inequality {
    pub kind: Kind,
    pub limit: f64,
    pub weight: f64,
    pub phase: Phase,
    pub s: f64,
    pub lambda: f64,
    pub sigma: f64,
    pub nu: f64,
    /// g w.
    pub value: f64,
    /// Targets of s λ and σ ν less their values.
    target_s: f64,
    target_sigma: f64,
    /// D.
    d: f64,
    rho: f64,
    /// The last step.
    pub ds: f64,
    pub dlambda: f64,
    pub dsigma: f64,
}

/// A stage's inequalities.
#[derive(Clone, Debug, Default)]
pub(super) struct StageRows {
    pub list: Vec<Inequality>,
    /// Inputs whose bounds coincide: they are no unknowns.
    pub fixed: Vec<usize>,
    /// Entries of rows that are not zero, of x then of u, row behind row; where each row starts.
    entries: Vec<(usize, f64)>,
    starts: Vec<usize>,
    nx: usize,
    dense: bool,
}

impl StageRows {
    /// Those of stage k. Rows without a limit or a price are left out.
    pub fn new(ocp: &Ocp, k: usize) -> Self {
        let (rows, nx) = (ocp.rows(k), ocp.nx());
        let nu = if k < ocp.stages.len() { ocp.nu() } else { 0 };
        let mut this = Self { nx, ..Self::default() };
        if let Some(stage) = ocp.stages.get(k) {
            for input in 0..nu {
                let (lower, upper) = (stage.lower[input], stage.upper[input]);
                if lower == upper {
                    this.fixed.push(input);
                    continue;
                }
                let bounds = [(-1.0, -lower), (1.0, upper)].into_iter().filter(|(_, limit)| limit.is_finite());
                this.list.extend(bounds.map(|(sign, limit)| Inequality::new(Kind::Bound { input, sign }, limit, f64::INFINITY)));
            }
        }
        this.starts.push(0);
        for i in 0..rows.len() {
            let of_x = (0..nx).map(|j| (j, rows.gx[(i, j)]));
            let of_u = (0..nu).map(|j| (nx + j, rows.gu[(i, j)]));
            this.entries.extend(of_x.chain(of_u).filter(|(_, entry)| *entry != 0.0));
            this.starts.push(this.entries.len());
            if rows.limits[i].is_finite() && rows.weights[i] > 0.0 {
                this.list.push(Inequality::new(Kind::Row(i), rows.limits[i], rows.weights[i]));
            }
        }
        this.dense = this.entries.len() as f64 > OCP.dense_rows * (rows.len() * (nx + nu)) as f64;
        this
    }

    fn entries(&self, row: usize) -> &[(usize, f64)] {
        &self.entries[self.starts[row]..self.starts[row + 1]]
    }

    /// g w.
    fn value_of(&self, kind: Kind, x: &[f64], u: &[f64]) -> f64 {
        match kind {
            Kind::Bound { input, sign } => sign * u[input],
            Kind::Row(row) => {
                let at = |j: usize| if j < self.nx { x[j] } else { u[j - self.nx] };
                self.entries(row).iter().map(|(j, entry)| entry * at(*j)).sum()
            }
        }
    }

    /// `(gx, gu) += factor · g`.
    fn add_row(&self, kind: Kind, factor: f64, gx: &mut [f64], gu: &mut [f64]) {
        match kind {
            Kind::Bound { input, sign } => gu[input] += factor * sign,
            Kind::Row(row) => {
                for &(j, entry) in self.entries(row) {
                    let at = if j < self.nx { &mut gx[j] } else { &mut gu[j - self.nx] };
                    *at += factor * entry;
                }
            }
        }
    }

    /// Takes over the values at (x, u).
    pub fn evaluate(&mut self, x: &[f64], u: &[f64]) {
        for i in 0..self.list.len() {
            self.list[i].value = self.value_of(self.list[i].kind, x, u);
        }
    }

    /// `(gx, gu) += Gᵀ λ`.
    pub fn add_multipliers(&self, gx: &mut [f64], gu: &mut [f64]) {
        self.list.iter().for_each(|row| self.add_row(row.kind, row.lambda, gx, gu));
    }

    /// Sets the targets of s λ and σ ν to `mu`, less the products of the last step's changes if `correct`, and adds D ρ gᵀ.
    pub fn add_gradient(&mut self, mu: f64, correct: bool, gx: &mut [f64], gu: &mut [f64]) {
        for row in &mut self.list {
            let last = if correct { (row.ds * row.dlambda, -row.dsigma * row.dlambda) } else { (0.0, 0.0) };
            row.target_s = mu - row.s * row.lambda - last.0;
            row.d = row.s / row.lambda;
            row.rho = row.gap() + row.target_s / row.lambda;
            if row.is_soft() {
                row.target_sigma = mu - row.sigma * row.nu - last.1;
                row.d += row.sigma / row.nu;
                row.rho -= row.target_sigma / row.nu;
            }
            row.d = row.d.recip();
        }
        self.list.iter().for_each(|row| self.add_row(row.kind, row.d * row.rho, gx, gu));
    }

    /// D of the rows as they are, for the Hessian.
    pub fn weigh(&mut self) {
        for row in &mut self.list {
            row.d = (row.s / row.lambda + if row.is_soft() { row.sigma / row.nu } else { 0.0 }).recip();
        }
    }

    /// The steps of slacks and multipliers that belong to (dx, du).
    pub fn take_up(&mut self, dx: &[f64], du: &[f64]) {
        for i in 0..self.list.len() {
            let value = self.value_of(self.list[i].kind, dx, du);
            let row = &mut self.list[i];
            row.dlambda = row.d * (value + row.rho);
            row.ds = (row.target_s - row.s * row.dlambda) / row.lambda;
            row.dsigma = if row.is_soft() { (row.target_sigma + row.sigma * row.dlambda) / row.nu } else { 0.0 };
        }
    }

    /// D = weight / |g|² of rows that hold, and no other.
    pub fn weigh_held(&mut self, weight: f64) {
        for i in 0..self.list.len() {
            let squares = match self.list[i].kind {
                Kind::Bound { .. } => 1.0,
                Kind::Row(row) => self.entries(row).iter().map(|(_, entry)| entry * entry).sum(),
            };
            let held = self.list[i].phase == Phase::Held && squares > 0.0;
            self.list[i].d = if held { weight / squares } else { 0.0 };
        }
    }

    /// `(gx, gu) += D (g w − c) gᵀ`.
    pub fn add_held(&mut self, gx: &mut [f64], gu: &mut [f64]) {
        self.list.iter_mut().for_each(|row| row.rho = row.value - row.limit);
        self.list.iter().for_each(|row| self.add_row(row.kind, row.d * row.rho, gx, gu));
    }

    /// `λ += D (g (w + dw) − c)`.
    pub fn take_up_held(&mut self, dx: &[f64], du: &[f64]) {
        for i in 0..self.list.len() {
            let value = self.value_of(self.list[i].kind, dx, du);
            let row = &mut self.list[i];
            row.lambda += row.d * (value + row.rho);
        }
    }

    /// `p += G_xᵀ D G_x`.
    pub fn add_states(&self, rows: &Rows, p: &mut Mat<f64>) {
        if self.dense {
            let weighed = self.weighed(&rows.gx);
            return multiply(p.as_mut(), Accum::Add, rows.gx.transpose(), weighed.as_ref());
        }
        self.add_pairs(|i, j, product| {
            if i < self.nx && j < self.nx {
                p[(i, j)] += product;
            }
        });
    }

    /// `s += G_uᵀ D G_x` and `r += G_uᵀ D G_u`, bounds included.
    pub fn add_inputs(&self, rows: &Rows, s: &mut Mat<f64>, r: &mut Mat<f64>) {
        for row in &self.list {
            if let Kind::Bound { input, .. } = row.kind {
                r[(input, input)] += row.d;
            }
        }
        if self.dense {
            let (of_x, of_u) = (self.weighed(&rows.gx), self.weighed(&rows.gu));
            multiply(s.as_mut(), Accum::Add, rows.gu.transpose(), of_x.as_ref());
            return multiply(r.as_mut(), Accum::Add, rows.gu.transpose(), of_u.as_ref());
        }
        self.add_pairs(|i, j, product| match (i.checked_sub(self.nx), j.checked_sub(self.nx)) {
            (Some(i), Some(j)) => r[(i, j)] += product,
            (Some(i), None) => s[(i, j)] += product,
            _ => {}
        });
    }

    fn weighed(&self, g: &Mat<f64>) -> Mat<f64> {
        let mut weights = vec![0.0; g.nrows()];
        for row in &self.list {
            if let Kind::Row(i) = row.kind {
                weights[i] = row.d;
            }
        }
        Mat::from_fn(g.nrows(), g.ncols(), |i, j| weights[i] * g[(i, j)])
    }

    fn add_pairs(&self, mut add: impl FnMut(usize, usize, f64)) {
        for row in &self.list {
            if let Kind::Row(number) = row.kind {
                for &(j, right) in self.entries(number) {
                    let weighed = row.d * right;
                    self.entries(number).iter().for_each(|&(i, left)| add(i, j, left * weighed));
                }
            }
        }
    }
}

impl Inequality {
    fn new(kind: Kind, limit: f64, weight: f64) -> Self {
        Self {
            kind,
            limit,
            weight,
            phase: Phase::Held,
            s: 0.0,
            lambda: 0.0,
            sigma: 0.0,
            nu: 0.0,
            value: 0.0,
            target_s: 0.0,
            target_sigma: 0.0,
            d: 0.0,
            rho: 0.0,
            ds: 0.0,
            dlambda: 0.0,
            dsigma: 0.0,
        }
    }

    pub fn is_soft(&self) -> bool {
        self.weight.is_finite()
    }

    /// g w − σ + s − c.
    pub fn gap(&self) -> f64 {
        self.value - self.sigma + self.s - self.limit
    }

    /// Sets slacks and multipliers at which their products are `mu`: a hard row's slack is at least `least`; a soft row has the gap 0,
    /// by the root of s − σ = mu/λ − mu/(weight − λ) = c − g w.
    pub fn start(&mut self, least: f64, mu: f64) {
        let distance = self.limit - self.value;
        if self.is_soft() {
            let priced = distance * self.weight;
            self.lambda = 2.0 * mu * self.weight / (priced + 2.0 * mu + priced.hypot(2.0 * mu));
            self.nu = 2.0 * mu * self.weight / (-priced + 2.0 * mu + priced.hypot(2.0 * mu));
            (self.s, self.sigma) = (mu / self.lambda, mu / self.nu);
        } else {
            self.s = distance.max(least);
            self.lambda = mu / self.s;
        }
    }

    /// Takes a row for what its slack and multiplier say, relative to the sizes of states and slopes.
    pub fn decide(&mut self, states: f64, slopes: f64) {
        let small = |slack: f64, multiplier: f64| slack * slopes < multiplier * states;
        self.enter(match (small(self.s, self.lambda), !self.is_soft() || small(self.sigma, self.nu)) {
            (false, _) => Phase::Free,
            (true, true) => Phase::Held,
            (true, false) => Phase::Priced,
        });
    }

    /// Takes a row for what the equations showed: a free row that is violated, or a priced one that is not, holds; one that holds with a
    /// multiplier out of its range is free or priced.
    pub fn decide_again(&mut self) {
        let excess = self.value - self.limit;
        let phase = match self.phase {
            Phase::Free if excess > 0.0 => Phase::Held,
            Phase::Priced if excess < 0.0 => Phase::Held,
            Phase::Held if self.lambda < 0.0 => Phase::Free,
            Phase::Held if self.lambda > self.weight => Phase::Priced,
            phase => phase,
        };
        self.enter(phase);
    }

    fn enter(&mut self, phase: Phase) {
        self.phase = phase;
        match phase {
            Phase::Free => self.lambda = 0.0,
            Phase::Held => {}
            Phase::Priced => self.lambda = self.weight,
        }
    }

    /// Takes what rounding errors put the multiplier out of its range by back.
    pub fn clamp(&mut self) {
        self.lambda = self.lambda.clamp(0.0, self.weight);
    }

    /// The part of the last step at which a slack or multiplier vanishes.
    pub fn longest(&self) -> f64 {
        let to_zero = |value: f64, change: f64| if change < 0.0 { -value / change } else { f64::INFINITY };
        let hard = to_zero(self.s, self.ds).min(to_zero(self.lambda, self.dlambda));
        if self.is_soft() { hard.min(to_zero(self.sigma, self.dsigma)).min(to_zero(self.nu, -self.dlambda)) } else { hard }
    }

    /// The larger of s λ and σ ν.
    pub fn largest_product(&self) -> f64 {
        f64::max(self.s * self.lambda, self.sigma * self.nu)
    }

    /// Sum of the products s λ and σ ν after a part of the last step, and their number.
    pub fn products(&self, part: f64) -> (f64, usize) {
        let lambda = self.lambda + part * self.dlambda;
        let hard = (self.s + part * self.ds) * lambda;
        if self.is_soft() {
            return (hard + (self.sigma + part * self.dsigma) * (self.nu - part * self.dlambda), 2);
        }
        (hard, 1)
    }

    /// Takes a part of the last step.
    pub fn advance(&mut self, part: f64) {
        self.s += part * self.ds;
        self.lambda += part * self.dlambda;
        if self.is_soft() {
            self.sigma += part * self.dsigma;
            self.nu -= part * self.dlambda;
        }
    }
}
