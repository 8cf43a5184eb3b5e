//! A primal–dual interior-point method whose Newton systems are solved by a Riccati recursion.
//!
//! Mehrotra's predictor and corrector (1992, SIAM J. Optim. 2), one step length for states, inputs, slacks and multipliers, as strictly
//! convex quadratic costs ask (Rao, Wright, Rawlings 1998, J. Optim. Theory Appl. 99). It starts from the solution without inequalities.

mod infeasible;
mod polish;
mod recursion;
mod rows;

use super::{Ocp, OcpError, OcpSolution, OcpSolver};
use crate::constants::OCP;
use crate::kernels::largest;
use crate::ocp::products::add_to;
use recursion::{Recursion, Trajectory};
use rows::{Inequality, Kind, StageRows};

/// Solves problems by an interior-point method; every problem starts anew, only memory is kept.
///
/// Costs per iteration N (4 nx³ + 6 nx² nu + nu³/3) operations and those of the rows; mostly 6 to 15 iterations. Errors of the conditions of
/// optimality are at most 1e-8, relative to their terms, and 1e-10 where digits allow.
#[derive(Clone, Debug)]
pub struct Riccati {
    recursion: Recursion,
}

impl Riccati {
    /// Without memory.
    pub fn new() -> Self {
        Self { recursion: Recursion::new() }
    }
}

impl Default for Riccati {
    fn default() -> Self {
        Self::new()
    }
}

impl OcpSolver for Riccati {
    fn solve(&mut self, ocp: &Ocp) -> Result<OcpSolution, OcpError> {
        ocp.check()?;
        let mut run = Run::new(ocp, &mut self.recursion);
        match run.solve() {
            Ok(()) => Ok(run.solution()),
            Err(OcpError::IterationLimit { iterations, error }) => match infeasible::contradiction(ocp, &mut self.recursion) {
                Some(contradiction) => Err(contradiction),
                None => Err(OcpError::IterationLimit { iterations, error }),
            },
            Err(error) => Err(error),
        }
    }
}

/// A problem being solved.
struct Run<'a> {
    ocp: &'a Ocp,
    recursion: &'a mut Recursion,
    rows: Vec<StageRows>,
    /// States, inputs and multipliers of the dynamics.
    at: Trajectory,
    /// The Lagrangian's derivatives by them.
    residual: Trajectory,
    gradient: Trajectory,
    step: Trajectory,
    /// The best point so far, and its inequalities.
    kept: Trajectory,
    kept_rows: Vec<Vec<Inequality>>,
    iterations: usize,
}

/// Errors of the conditions of optimality.
#[derive(Clone, Copy, Debug)]
struct Errors {
    /// Largest of the conditions without complementarity, relative to its terms.
    linear: f64,
    /// Largest product of slack and multiplier, relative to the size of the cost's terms.
    complementary: f64,
}

impl Errors {
    fn largest(self) -> f64 {
        self.linear.max(self.complementary)
    }

    /// Sum relative to what is aimed at: of errors small enough the other one counts.
    fn weighed(self) -> f64 {
        self.linear.max(OCP.aimed) / OCP.aimed + self.complementary.max(OCP.complementary) / OCP.complementary
    }
}

impl<'a> Run<'a> {
    fn new(ocp: &'a Ocp, recursion: &'a mut Recursion) -> Self {
        let (n, nx, nu) = (ocp.stages.len(), ocp.nx(), ocp.nu());
        let rows = (0..=n).map(|k| StageRows::new(ocp, k)).collect();
        let zeros = Trajectory::zeros(n, nx, nu);
        Self {
            ocp,
            recursion,
            rows,
            residual: zeros.clone(),
            gradient: zeros.clone(),
            step: zeros.clone(),
            kept: zeros.clone(),
            at: zeros,
            kept_rows: vec![Vec::new(); n + 1],
            iterations: 0,
        }
    }

    /// Keeps the present point.
    fn keep(&mut self) {
        self.kept.copy_from(&self.at);
        self.kept_rows.iter_mut().zip(&self.rows).for_each(|(kept, rows)| kept.clone_from(&rows.list));
    }

    /// Returns to the point kept.
    fn take_back(&mut self) {
        self.at.copy_from(&self.kept);
        self.kept_rows.iter().zip(&mut self.rows).for_each(|(kept, rows)| rows.list.clone_from(kept));
        self.evaluate();
    }

    fn solve(&mut self) -> Result<(), OcpError> {
        self.start()?;
        let (mut best, mut stalled) = (self.errors(), 0);
        self.keep();
        let mut polished_from = OCP.polished_from;
        while stalled < OCP.stalled && self.iterations < OCP.iterations {
            let near = best.linear <= OCP.accepted && best.complementary <= polished_from;
            if near {
                if self.polish() {
                    return Ok(());
                }
                polished_from = OCP.polished_again * best.complementary;
            }
            if best.linear <= OCP.aimed && best.complementary <= OCP.complementary {
                break;
            }
            // rounding errors of the last digits may leave a factor indefinite: no further digits can be had
            if self.iterate().is_err() {
                break;
            }
            let errors = self.errors();
            stalled += usize::from(best.linear <= OCP.accepted);
            if errors.weighed() < best.weighed() {
                (best, stalled) = (errors, 0);
                self.keep();
            }
        }
        self.take_back();
        if best.largest() <= OCP.accepted || self.polish() {
            return Ok(());
        }
        Err(OcpError::IterationLimit { iterations: self.iterations, error: best.largest() })
    }

    /// The solution without inequalities, and slacks and multipliers that fit it.
    fn start(&mut self) -> Result<(), OcpError> {
        self.at.x[0].copy_from_slice(&self.ocp.x0);
        for (k, stage) in self.ocp.stages.iter().enumerate() {
            self.rows[k].fixed.iter().for_each(|&j| self.at.u[k][j] = stage.lower[j]);
        }
        self.recursion.factor(self.ocp, &self.rows)?;
        self.evaluate();
        self.recursion.solve(self.ocp, &self.rows, &self.residual, &mut self.step);
        add(&mut self.at, 1.0, &self.step);
        self.evaluate();
        let list = || self.rows.iter().flat_map(|rows| &rows.list);
        let violation = list().map(|row| row.value - row.limit).fold(0.0, f64::max);
        let distance = list().map(|row| (row.value - row.limit).abs()).fold(0.0, f64::max);
        let least = violation.max(1e-2 * distance).max(1e-6);
        let slope = most(&self.at.dynamics).max(self.slope_of_inputs()).max(1e-6);
        for row in self.rows.iter_mut().flat_map(|rows| &mut rows.list) {
            row.start(least, OCP.start * least * slope);
        }
        self.evaluate();
        Ok(())
    }

    /// Largest |R u + r|.
    fn slope_of_inputs(&self) -> f64 {
        let of_stage = |(stage, u): (&super::Stage, &Vec<f64>)| {
            let mut slope = stage.r_linear.clone();
            add_to(&mut slope, 1.0, stage.r.as_ref(), u);
            largest(&slope)
        };
        self.ocp.stages.iter().zip(&self.at.u).map(of_stage).fold(0.0, f64::max)
    }

    fn iterate(&mut self) -> Result<(), OcpError> {
        self.iterations += 1;
        self.rows.iter_mut().for_each(StageRows::weigh);
        self.recursion.factor(self.ocp, &self.rows)?;
        let mu = self.mean_product(0.0);
        self.direction(0.0, false);
        let longest = self.longest();
        let centering = (self.mean_product(longest) / mu).powi(3);
        self.direction(centering * mu, true);
        // without a safeguard the corrector can cycle (Cartis 2009, Appl. Numer. Math. 59)
        let corrected = self.longest();
        if corrected < OCP.short || self.mean_product(corrected) > OCP.grown * mu {
            self.direction(OCP.centering * mu, false);
        }
        let part = self.least_product(mu, f64::min(1.0, OCP.boundary.max(1.0 - mu) * self.longest()));
        add(&mut self.at, part, &self.step);
        self.rows.iter_mut().flat_map(|rows| &mut rows.list).for_each(|row| row.advance(part));
        self.evaluate();
        Ok(())
    }

    /// The step to products of slack and multiplier that are `mu`, less the products of the last step's changes if `correct`.
    fn direction(&mut self, mu: f64, correct: bool) {
        self.gradient.copy_from(&self.residual);
        let Trajectory { x, u, .. } = &mut self.gradient;
        for (k, (rows, x)) in self.rows.iter_mut().zip(x).enumerate() {
            rows.add_gradient(mu, correct, x, u.get_mut(k).map_or(&mut [], |u| u));
        }
        self.recursion.solve(self.ocp, &self.rows, &self.gradient, &mut self.step);
        for (k, (rows, dx)) in self.rows.iter_mut().zip(&self.step.x).enumerate() {
            rows.take_up(dx, self.step.u.get(k).map_or(&[], |du| du));
        }
    }

    /// Of the parts of the step up to `most`, the one of the least mean product, a parabola, if at `most` it would have grown; `most` if
    /// it falls nowhere.
    fn least_product(&self, mu: f64, most: f64) -> f64 {
        let (half, whole) = (self.mean_product(0.5 * most), self.mean_product(most));
        let curvature = 2.0 * (whole - 2.0 * half + mu);
        let slope = whole - mu - curvature;
        if whole > OCP.grown * mu && slope < 0.0 { most * (-0.5 * slope / curvature).clamp(OCP.short, 1.0) } else { most }
    }

    fn longest(&self) -> f64 {
        self.rows.iter().flat_map(|rows| &rows.list).map(Inequality::longest).fold(1.0, f64::min)
    }

    /// Mean of s λ and σ ν after a part of the step; 0 without inequalities.
    fn mean_product(&self, part: f64) -> f64 {
        let products = self.rows.iter().flat_map(|rows| &rows.list).map(|row| row.products(part));
        let (sum, count) = products.fold((0.0, 0), |(sum, count), (product, of_row)| (sum + product, count + of_row));
        sum / count.max(1) as f64
    }

    /// The residuals at the present point.
    fn evaluate(&mut self) {
        let (at, residual) = (&self.at, &mut self.residual);
        let n = self.ocp.stages.len();
        for (k, rows) in self.rows.iter_mut().enumerate() {
            rows.evaluate(&at.x[k], at.u.get(k).map_or(&[], |u| u));
        }
        for (k, stage) in self.ocp.stages.iter().enumerate() {
            let (gx, gu, gap) = (&mut residual.x[k], &mut residual.u[k], &mut residual.dynamics[k]);
            gx.copy_from_slice(&stage.q_linear);
            add_to(gx, 1.0, stage.q.as_ref(), &at.x[k]);
            add_to(gx, 1.0, stage.s.transpose(), &at.u[k]);
            add_to(gx, 1.0, stage.a.transpose(), &at.dynamics[k]);
            gu.copy_from_slice(&stage.r_linear);
            add_to(gu, 1.0, stage.r.as_ref(), &at.u[k]);
            add_to(gu, 1.0, stage.s.as_ref(), &at.x[k]);
            add_to(gu, 1.0, stage.b.transpose(), &at.dynamics[k]);
            self.rows[k].add_multipliers(gx, gu);
            gap.copy_from_slice(&stage.d);
            add_to(gap, 1.0, stage.a.as_ref(), &at.x[k]);
            add_to(gap, 1.0, stage.b.as_ref(), &at.u[k]);
            gap.iter_mut().zip(&at.x[k + 1]).for_each(|(gap, x)| *gap -= x);
        }
        residual.x[n].copy_from_slice(&self.ocp.q_final_linear);
        add_to(&mut residual.x[n], 1.0, self.ocp.q_final.as_ref(), &at.x[n]);
        self.rows[n].add_multipliers(&mut residual.x[n], &mut []);
        for k in 1..=n {
            residual.x[k].iter_mut().zip(&at.dynamics[k - 1]).for_each(|(gx, pi)| *gx -= pi);
        }
    }

    fn errors(&self) -> Errors {
        let (states, slopes) = (self.size_of_states(), self.size_of_slopes());
        let list = self.rows.iter().flat_map(|rows| &rows.list);
        let gap = list.map(|row| row.gap().abs() / (row.limit.abs().max(row.value.abs()) + states)).fold(0.0, f64::max);
        let linear = (self.stationarity() / slopes).max(most(&self.residual.dynamics) / states).max(gap);
        let products = self.rows.iter().flat_map(|rows| &rows.list).map(Inequality::largest_product);
        let complementary = products.fold(0.0, f64::max) / (slopes * states);
        // a number that is none is the largest error of all, which maxima pass over
        let sound = self.at.x.iter().flatten().all(|x| x.is_finite());
        Errors { linear: if sound { linear } else { f64::INFINITY }, complementary }
    }

    /// Largest state or input.
    fn size_of_states(&self) -> f64 {
        most(&self.at.x).max(most(&self.at.u)).max(f64::MIN_POSITIVE)
    }

    /// Largest multiplier, or slope of the cost of inputs.
    fn size_of_slopes(&self) -> f64 {
        let multipliers = self.rows.iter().flat_map(|rows| &rows.list).map(|row| row.lambda).fold(0.0, f64::max);
        most(&self.at.dynamics).max(self.slope_of_inputs()).max(multipliers).max(f64::MIN_POSITIVE)
    }

    /// Largest derivative of the Lagrangian by a state or input that is an unknown.
    fn stationarity(&self) -> f64 {
        most(&self.residual.x[1..]).max(self.residual_of_inputs())
    }

    fn residual_of_inputs(&self) -> f64 {
        let free = |k: usize, j: usize| !self.rows[k].fixed.contains(&j);
        let of_stage = |(k, residual): (usize, &Vec<f64>)| {
            residual.iter().enumerate().filter(|(j, _)| free(k, *j)).map(|(_, r)| r.abs()).fold(0.0, f64::max)
        };
        self.residual.u.iter().enumerate().map(of_stage).fold(0.0, f64::max)
    }

    fn solution(&self) -> OcpSolution {
        let (ocp, n) = (self.ocp, self.ocp.stages.len());
        let mut multipliers: Vec<Vec<f64>> = (0..=n).map(|k| vec![0.0; ocp.rows(k).len()]).collect();
        let mut bounds = vec![vec![0.0; ocp.nu()]; n];
        let mut u = self.at.u.clone();
        for (k, rows) in self.rows.iter().enumerate() {
            for row in &rows.list {
                match row.kind {
                    Kind::Bound { input, sign } => bounds[k][input] += sign * row.lambda,
                    Kind::Row(i) => multipliers[k][i] = row.lambda.min(row.weight),
                }
            }
            // those of fixed inputs take up what the others leave
            rows.fixed.iter().for_each(|&j| bounds[k][j] = -self.residual.u[k][j]);
        }
        for (stage, u) in ocp.stages.iter().zip(&mut u) {
            u.iter_mut().enumerate().for_each(|(j, u)| *u = u.clamp(stage.lower[j], stage.upper[j]));
        }
        let x = self.at.x.clone();
        let violations = ocp.violations(&x, &u);
        let cost = ocp.cost(&x, &u, &violations);
        OcpSolution { x, u, multipliers, bounds, violations, cost, iterations: self.iterations }
    }
}

fn most(vectors: &[Vec<f64>]) -> f64 {
    vectors.iter().map(|vector| largest(vector)).fold(0.0, f64::max)
}

/// `at += part · step`.
fn add(at: &mut Trajectory, part: f64, step: &Trajectory) {
    let pairs = [(&mut at.x, &step.x), (&mut at.u, &step.u), (&mut at.dynamics, &step.dynamics)];
    for (at, step) in pairs.into_iter().flat_map(|(at, step)| at.iter_mut().zip(step)) {
        at.iter_mut().zip(step).for_each(|(at, step)| *at += part * step);
    }
}
