//! Random quadratic programs, their conditions of optimality, and Clarabel's solution of them.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus};
use faer::Mat;
use pliant_control::qp::{Qp, QpSolution};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// A problem that owns its numbers.
#[derive(Clone, Debug)]
pub struct Case {
    pub h: Mat<f64>,
    pub g: Vec<f64>,
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    pub c: Mat<f64>,
    pub limits: Vec<f64>,
    pub weights: Vec<f64>,
}

impl Case {
    pub fn qp(&self) -> Qp<'_> {
        Qp {
            hessian: self.h.as_ref(),
            gradient: &self.g,
            lower: &self.lower,
            upper: &self.upper,
            rows: self.c.as_ref(),
            limits: &self.limits,
            weights: &self.weights,
        }
    }

    /// Up to 40 variables and 60 rows: dense and sparse, hard and soft, duplicates and multiples of others, many through one point, of
    /// which the hard ones admit at least that point. The Hessian's least eigenvalues are about 10^−`digits` at worst.
    pub fn random(seed: u64, digits: f64) -> Self {
        let mut rng = Pcg64::seed_from_u64(seed);
        let (n, m) = (rng.random_range(1..=40), rng.random_range(0..=60));
        let floor = 10f64.powf(rng.random_range(-digits..0.0));
        let rank = rng.random_range(1..=n);
        let root = Mat::from_fn(rank, n, |_, _| rng.random_range(-1.0..1.0));
        let h = root.transpose() * &root + Mat::<f64>::identity(n, n) * faer::Scale(floor);
        let g = (0..n).map(|_| rng.random_range(-3.0..3.0)).collect();
        let inside: Vec<f64> = (0..n).map(|_| rng.random_range(-1.0..1.0)).collect();
        let bounded = rng.random_range(0.0..1.0);
        let mut bound = |sign: f64, at: f64| match rng.random_range(0.0..1.0) < bounded {
            true => at + sign * f64::max(0.0, rng.random_range(-0.2..1.0)),
            false => sign * f64::INFINITY,
        };
        let lower = inside.iter().map(|at| bound(-1.0, *at)).collect();
        let upper = inside.iter().map(|at| bound(1.0, *at)).collect();
        let mut c = Mat::zeros(m, n);
        let (density, soft) = (rng.random_range(0.1..1.0), rng.random_range(0.0..1.0));
        let (mut limits, mut weights) = (vec![0.0; m], vec![f64::INFINITY; m]);
        for i in 0..m {
            let (copied, factor) = (rng.random_range(0..=i), [-1.0, 1.0, 2.5][rng.random_range(0..3)]);
            let copies = copied < i && rng.random_range(0.0..1.0) < 0.2;
            let mut value = 0.0;
            for j in 0..n {
                c[(i, j)] = match copies {
                    true => factor * c[(copied, j)],
                    false if rng.random_range(0.0..1.0) < density => rng.random_range(-1.0..1.0),
                    false => 0.0,
                };
                value += c[(i, j)] * inside[j];
            }
            limits[i] = value + f64::max(0.0, rng.random_range(-0.5..1.0));
            if rng.random_range(0.0..1.0) < soft {
                weights[i] = 10f64.powf(rng.random_range(-2.0..3.0));
                limits[i] = value + rng.random_range(-1.0..1.0);
            }
        }
        Self { h, g, lower, upper, c, limits, weights }
    }

    /// Largest error of the conditions of optimality, each relative to the size of its terms.
    pub fn kkt_error(&self, solution: &QpSolution) -> f64 {
        let QpSolution { z, bounds, multipliers, .. } = solution;
        let n = z.len();
        let (mut error, mut scale, mut worst): (f64, f64, f64) = (0.0, 0.0, 0.0);
        for j in 0..n {
            let product: f64 = (0..n).map(|i| self.h[(i, j)] * z[i]).sum();
            let rows: f64 = multipliers.iter().enumerate().map(|(i, l)| l * self.c[(i, j)]).sum();
            worst = worst.max((product + self.g[j] + bounds[j] + rows).abs());
            scale = [product, self.g[j], bounds[j], rows].iter().fold(scale, |scale, term| scale.max(term.abs()));
            error = error.max(self.lower[j] - z[j]).max(z[j] - self.upper[j]);
            if (bounds[j] < 0.0 && z[j] != self.lower[j]) || (bounds[j] > 0.0 && z[j] != self.upper[j]) {
                error = f64::INFINITY;
            }
        }
        error = error.max(worst / scale);
        for (i, (&limit, &weight)) in self.limits.iter().zip(&self.weights).enumerate() {
            let terms: Vec<f64> = (0..n).map(|j| self.c[(i, j)] * z[j]).collect();
            let size = terms.iter().map(|t| t.abs()).sum::<f64>() + limit.abs();
            let above = (terms.iter().sum::<f64>() - limit) / size.max(f64::MIN_POSITIVE);
            if !(0.0..=weight).contains(&multipliers[i]) {
                error = f64::INFINITY;
            }
            if multipliers[i] < weight {
                error = error.max(above);
            }
            if multipliers[i] > 0.0 {
                error = error.max(-above);
            }
        }
        error
    }

    /// Clarabel's z and cost, soft rows by slack variables.
    pub fn oracle(&self) -> (Vec<f64>, f64) {
        let n = self.g.len();
        let soft: Vec<usize> = (0..self.limits.len()).filter(|&i| self.weights[i].is_finite()).collect();
        let total = n + soft.len();
        let mut p = vec![vec![0.0; total]; total];
        for (i, row) in p.iter_mut().enumerate().take(n) {
            (i..n).for_each(|j| row[j] = self.h[(i, j)]);
        }
        let gradient: Vec<f64> = self.g.iter().copied().chain(soft.iter().map(|&i| self.weights[i])).collect();
        let (mut a, mut b): (Vec<Vec<f64>>, Vec<f64>) = (Vec::new(), Vec::new());
        let mut add = |entries: Vec<(usize, f64)>, limit: f64| {
            let mut row = vec![0.0; total];
            entries.into_iter().for_each(|(j, entry)| row[j] = entry);
            a.push(row);
            b.push(limit);
        };
        for j in 0..n {
            if self.lower[j].is_finite() {
                add(vec![(j, -1.0)], -self.lower[j]);
            }
            if self.upper[j].is_finite() {
                add(vec![(j, 1.0)], self.upper[j]);
            }
        }
        for i in 0..self.limits.len() {
            let slack = soft.iter().position(|&s| s == i).map(|s| (n + s, -1.0));
            add((0..n).map(|j| (j, self.c[(i, j)])).chain(slack).collect(), self.limits[i]);
        }
        for s in 0..soft.len() {
            add(vec![(n + s, -1.0)], 0.0);
        }
        let (p, a) = (CscMatrix::from(&p), if a.is_empty() { CscMatrix::zeros((0, total)) } else { CscMatrix::from(&a) });
        let settings = DefaultSettings { verbose: false, ..tight() };
        let mut solver = DefaultSolver::new(&p, &gradient, &a, &b, &[NonnegativeConeT(b.len())], settings).unwrap();
        solver.solve();
        let status = solver.solution.status;
        assert!(matches!(status, SolverStatus::Solved | SolverStatus::AlmostSolved), "{status:?}");
        (solver.solution.x[..n].to_vec(), solver.solution.obj_val)
    }
}

/// Clarabel's settings at the digits it can reach.
pub fn tight() -> DefaultSettings<f64> {
    DefaultSettings { tol_gap_abs: 1e-11, tol_gap_rel: 1e-11, tol_feas: 1e-11, max_iter: 100, ..Default::default() }
}
