//! Clarabel as the reference solver of nominal problems.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use faer::Mat;
use pliant_control::ocp::{Ocp, OcpError, OcpSolution, OcpSolver, Rows};

/// A cone program in the making: min ½ xᵀPx + qᵀx, b − A x in a product of cones.
#[derive(Default)]
pub struct Program {
    pub p: Vec<(usize, usize, f64)>,
    pub q: Vec<f64>,
    pub a: Vec<(usize, usize, f64)>,
    pub b: Vec<f64>,
    pub cones: Vec<SupportedConeT<f64>>,
}

impl Program {
    /// New variables; returns the first's number.
    pub fn variables(&mut self, count: usize) -> usize {
        let first = self.q.len();
        self.q.resize(first + count, 0.0);
        first
    }

    /// Adds ½ [x; …]ᵀ H [x; …] for a symmetric block on the diagonal.
    pub fn add_hessian(&mut self, first: usize, h: &Mat<f64>) {
        for c in 0..h.ncols() {
            for r in 0..=c {
                self.p.push((first + r, first + c, h[(r, c)]));
            }
        }
    }

    /// A row b − Σ a x of the cone that is named last.
    pub fn row(&mut self, entries: impl IntoIterator<Item = (usize, f64)>, b: f64) {
        let r = self.b.len();
        self.a.extend(entries.into_iter().filter(|(_, a)| *a != 0.0).map(|(c, a)| (r, c, a)));
        self.b.push(b);
    }

    /// Solves to Clarabel's accuracy of `tolerance`; primal and dual.
    pub fn solve(self, tolerance: f64) -> (Vec<f64>, Vec<f64>, u32) {
        let n = self.q.len();
        let csc = |rows: usize, entries: Vec<(usize, usize, f64)>| {
            let (i, (j, v)): (Vec<_>, (Vec<_>, Vec<_>)) = entries.into_iter().map(|(i, j, v)| (i, (j, v))).unzip();
            CscMatrix::new_from_triplets(rows, n, i, j, v)
        };
        let settings = DefaultSettings {
            verbose: false,
            tol_gap_abs: tolerance,
            tol_gap_rel: tolerance,
            tol_feas: tolerance,
            ..DefaultSettings::default()
        };
        let (p, a) = (csc(n, self.p), csc(self.b.len(), self.a));
        let mut solver = DefaultSolver::new(&p, &self.q, &a, &self.b, &self.cones, settings).unwrap();
        solver.solve();
        let solution = solver.solution;
        assert!(matches!(solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved), "{:?}", solution.status);
        (solution.x, solution.z, solution.iterations)
    }
}

/// Where the variables of a nominal problem stand.
pub struct Layout {
    pub x: Vec<usize>,
    pub u: Vec<usize>,
}

impl Layout {
    /// Variables, cost and dynamics.
    pub fn new(program: &mut Program, ocp: &Ocp) -> Self {
        let nx = ocp.x0.len();
        let mut layout = Self { x: Vec::new(), u: Vec::new() };
        for stage in &ocp.stages {
            layout.x.push(program.variables(nx));
            layout.u.push(program.variables(stage.b.ncols()));
        }
        layout.x.push(program.variables(nx));
        let linear = |q: &mut [f64], first: usize, values: &[f64]| q[first..first + values.len()].copy_from_slice(values);
        for (k, stage) in ocp.stages.iter().enumerate() {
            program.add_hessian(layout.x[k], &stage.q);
            program.add_hessian(layout.u[k], &stage.r);
            for c in 0..stage.s.ncols() {
                for r in 0..stage.s.nrows() {
                    program.p.push((layout.x[k] + c, layout.u[k] + r, stage.s[(r, c)]));
                }
            }
            linear(&mut program.q, layout.x[k], &stage.q_linear);
            linear(&mut program.q, layout.u[k], &stage.r_linear);
        }
        let last = layout.x[ocp.stages.len()];
        program.add_hessian(last, &ocp.q_final);
        linear(&mut program.q, last, &ocp.q_final_linear);
        let before = program.b.len();
        for (i, x) in ocp.x0.iter().enumerate() {
            program.row([(layout.x[0] + i, 1.0)], *x);
        }
        for (k, stage) in ocp.stages.iter().enumerate() {
            for r in 0..nx {
                let a = (0..nx).map(|c| (layout.x[k] + c, -stage.a[(r, c)]));
                let b = (0..stage.b.ncols()).map(|c| (layout.u[k] + c, -stage.b[(r, c)]));
                program.row(a.chain(b).chain([(layout.x[k + 1] + r, 1.0)]), stage.d[r]);
            }
        }
        program.cones.push(SupportedConeT::ZeroConeT(program.b.len() - before));
        layout
    }

    /// Entries of row i of the rows of stage k.
    pub fn row(&self, rows: &Rows, k: usize, i: usize) -> Vec<(usize, f64)> {
        let of_x = (0..rows.gx.ncols()).map(|c| (self.x[k] + c, rows.gx[(i, c)]));
        let of_u = (0..rows.gu.ncols()).filter(|_| k < self.u.len()).map(|c| (self.u[k] + c, rows.gu[(i, c)]));
        of_x.chain(of_u).collect()
    }
}

pub fn rows_of(ocp: &Ocp, k: usize) -> &Rows {
    ocp.stages.get(k).map_or(&ocp.rows_final, |stage| &stage.rows)
}

/// Value of a problem's cost without prices.
pub fn cost_of(ocp: &Ocp, x: &[Vec<f64>], u: &[Vec<f64>]) -> f64 {
    let form = |a: &[f64], m: &Mat<f64>, b: &[f64]| -> f64 {
        (0..m.nrows()).flat_map(|r| (0..m.ncols()).map(move |c| (r, c))).map(|(r, c)| a[r] * m[(r, c)] * b[c]).sum()
    };
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let stages = ocp.stages.iter().zip(x.iter().zip(u)).map(|(s, (x, u))| {
        0.5 * form(x, &s.q, x) + form(u, &s.s, x) + 0.5 * form(u, &s.r, u) + dot(&s.q_linear, x) + dot(&s.r_linear, u)
    });
    let last = &x[ocp.stages.len()];
    stages.sum::<f64>() + 0.5 * form(last, &ocp.q_final, last) + dot(&ocp.q_final_linear, last)
}

/// Nominal problems by Clarabel, from scratch each time.
#[derive(Default)]
pub struct Reference {
    /// Problems solved.
    pub solves: usize,
}

impl OcpSolver for Reference {
    fn solve(&mut self, ocp: &Ocp) -> Result<OcpSolution, OcpError> {
        self.solves += 1;
        let mut program = Program::default();
        let layout = Layout::new(&mut program, ocp);
        let horizon = ocp.stages.len();
        let first_row = program.b.len();
        let mut slacks = Vec::new();
        for k in 0..=horizon {
            let rows = rows_of(ocp, k);
            for i in 0..rows.len() {
                let mut entries = layout.row(rows, k, i);
                if rows.weights[i].is_finite() {
                    let slack = program.variables(1);
                    program.q[slack] = rows.weights[i];
                    entries.push((slack, -1.0));
                    slacks.push(slack);
                }
                program.row(entries, rows.limits[i]);
            }
        }
        let mut bounded = Vec::new();
        for (k, stage) in ocp.stages.iter().enumerate() {
            for i in 0..stage.b.ncols() {
                for (sign, bound) in [(1.0, stage.upper[i]), (-1.0, -stage.lower[i])] {
                    if bound.is_finite() {
                        program.row([(layout.u[k] + i, sign)], bound);
                        bounded.push((k, i, sign));
                    }
                }
            }
        }
        for &slack in &slacks {
            program.row([(slack, -1.0)], 0.0);
        }
        program.cones.push(SupportedConeT::NonnegativeConeT(program.b.len() - first_row));
        let (primal, dual, iterations) = program.solve(1e-9);
        let part = |first: usize, count: usize| primal[first..first + count].to_vec();
        let x: Vec<_> = layout.x.iter().map(|&first| part(first, ocp.x0.len())).collect();
        let u: Vec<_> = layout.u.iter().zip(&ocp.stages).map(|(&first, stage)| part(first, stage.b.ncols())).collect();
        let mut dual = dual[first_row..].iter().copied();
        let mut slack = slacks.iter().map(|&slack| primal[slack].max(0.0));
        let (mut multipliers, mut violations, mut cost) = (Vec::new(), Vec::new(), cost_of(ocp, &x, &u));
        for k in 0..=horizon {
            let rows = rows_of(ocp, k);
            multipliers.push(dual.by_ref().take(rows.len()).collect());
            let of_row = |weight: &f64| if weight.is_finite() { slack.next().unwrap() } else { 0.0 };
            let of_stage: Vec<f64> = rows.weights.iter().map(of_row).collect();
            let prices = of_stage.iter().zip(&rows.weights).filter(|(_, w)| w.is_finite()).map(|(v, w)| v * w);
            cost += prices.sum::<f64>();
            violations.push(of_stage);
        }
        let mut bounds: Vec<_> = u.iter().map(|u| vec![0.0; u.len()]).collect();
        for (k, i, sign) in bounded {
            bounds[k][i] += sign * dual.next().unwrap();
        }
        Ok(OcpSolution { x, u, multipliers, bounds, violations, cost, iterations: iterations as usize })
    }
}
