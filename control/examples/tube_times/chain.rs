//! A chain of masses between springs and dampers, as in fast-SLS (arXiv 2401.13762): times beside the published ones, measured by its
//! authors in MATLAB on an Apple M1.

use std::time::Instant;

use faer::Mat;
use pliant_control::ocp::{Ocp, OcpError, OcpSolution, OcpSolver};
use pliant_control::tube::{Disturbance, ExactTube, RobustOptions, robust};
use rand::RngExt;

use super::problems::{box_rows, generator, identity, invariant, tube_cost};
use super::reference::Reference;

/// (N, published s) at nx = 20, nu = 10.
const HORIZONS: [(usize, f64); 8] =
    [(1, 0.0145), (11, 0.0178), (21, 0.0242), (31, 0.0416), (41, 0.0652), (51, 0.0939), (61, 0.1305), (71, 0.1703)];
/// (nx, published s) at N = 10, nu = nx/2.
const STATES: [(usize, f64); 7] =
    [(22, 0.0138), (42, 0.0383), (62, 0.0886), (82, 0.2255), (102, 0.3293), (122, 0.5215), (142, 0.7687)];
/// A limit at which rows are active, unlike at the published 4.
const TIGHT: f64 = 2.2;
/// Random x₀ of each size; the paper has 30.
const SAMPLES: usize = 5;

/// Exact discretization of ẋ = A x + B u over dt with constant u.
fn zero_order_hold(a: &Mat<f64>, b: &Mat<f64>, dt: f64) -> (Mat<f64>, Mat<f64>) {
    let (nx, n) = (a.nrows(), a.nrows() + b.ncols());
    let halvings = 6;
    let scaled = dt / f64::from(1 << halvings);
    let m = Mat::from_fn(n, n, |r, c| match (r < nx, c < nx) {
        (true, true) => scaled * a[(r, c)],
        (true, false) => scaled * b[(r, c - nx)],
        _ => 0.0,
    });
    let (mut sum, mut term) = (identity(n, 1.0), identity(n, 1.0));
    for power in 1..=14 {
        term = faer::Scale(1.0 / f64::from(power)) * (&term * &m);
        sum += &term;
    }
    for _ in 0..halvings {
        sum = &sum * &sum;
    }
    (sum.submatrix(0, 0, nx, nx).to_owned(), sum.submatrix(0, nx, nx, b.ncols()).to_owned())
}

/// m = 1 kg, k = 10 N/m, d = 2 N s/m, an input on each mass, the first mass tied to the ground; dt = 0.1 s.
fn chain(masses: usize, horizon: usize, x0: Vec<f64>, limit: f64) -> Ocp {
    let nx = 2 * masses;
    let mut a = Mat::zeros(nx, nx);
    for i in 0..masses {
        a[(2 * i, 2 * i + 1)] = 1.0;
        for (other, exists) in [(i.wrapping_sub(1), true), (i + 1, i + 1 < masses)] {
            if exists {
                a[(2 * i + 1, 2 * i)] -= 10.0;
                a[(2 * i + 1, 2 * i + 1)] -= 2.0;
                if other < masses {
                    a[(2 * i + 1, 2 * other)] += 10.0;
                    a[(2 * i + 1, 2 * other + 1)] += 2.0;
                }
            }
        }
    }
    let b = Mat::from_fn(nx, masses, |r, c| if r == 2 * c + 1 { 1.0 } else { 0.0 });
    let (a, b) = zero_order_hold(&a, &b, 0.1);
    // the paper's costs are without ½
    let mut ocp = invariant(&a, &b, horizon, x0, [6.0, 2.0, 6.0], 4.0);
    for stage in &mut ocp.stages[1..] {
        stage.rows = box_rows(nx, masses, limit, 1e4);
    }
    ocp.rows_final = box_rows(nx, masses, limit, 1e4);
    ocp
}

/// Clarabel with the time it takes.
#[derive(Default)]
pub struct Timed {
    solver: Reference,
    pub seconds: f64,
}

impl OcpSolver for Timed {
    fn solve(&mut self, ocp: &Ocp) -> Result<OcpSolution, OcpError> {
        let started = Instant::now();
        let solution = self.solver.solve(ocp);
        self.seconds += started.elapsed().as_secs_f64();
        solution
    }
}

fn row(masses: usize, horizon: usize, limit: f64, published: Option<f64>) {
    let nx = 2 * masses;
    let cost = tube_cost(nx, masses, 1e-3, 1e-3, 1e-3);
    let disturbance = Disturbance::new((0..=horizon).map(|j| identity(nx, if j == 0 { 0.0 } else { 0.1 })));
    let mut rng = generator(5);
    let (mut tubes, mut nominal, mut iterations, mut certified, mut active) = (0.0, 0.0, 0, 0, 0);
    for _ in 0..SAMPLES {
        let x0 = (0..nx).map(|_| rng.random_range(-1.0..1.0)).collect();
        let ocp = chain(masses, horizon, x0, limit);
        let mut solver = Timed::default();
        let started = Instant::now();
        match robust(&ocp, &disturbance, &cost, &mut solver, &ExactTube, &RobustOptions::default()) {
            Ok(found) => {
                let all = started.elapsed().as_secs_f64();
                nominal += solver.seconds / SAMPLES as f64;
                tubes += (all - solver.seconds) / SAMPLES as f64;
                iterations += found.iterations;
                certified += usize::from(found.is_certified());
                active += found.nominal.multipliers.iter().flatten().filter(|mu| **mu > 1e-3).count();
            }
            Err(error) => println!("nx = {nx}, N = {horizon}: {error}"),
        }
    }
    let iterations = iterations as f64 / SAMPLES as f64;
    println!(
        "{nx:5} {horizon:5} {:10.1} {:10.1} {iterations:6.1} {certified:4}/{SAMPLES} {:8.1} {:>12}",
        tubes * 1e3,
        nominal * 1e3,
        active as f64 / SAMPLES as f64,
        published.map_or(String::new(), |published| format!("{:.1}", published * 1e3)),
    );
}

pub fn run() {
    println!("chain of masses, to convergence (1e-6), mean of {SAMPLES} x0; ms, all threads of the machine");
    println!("   nx     N      tubes    nominal   its  certif.   active  published (all)");
    for (horizon, published) in HORIZONS {
        row(10, horizon, 4.0, Some(published));
    }
    for (nx, published) in STATES {
        row(nx / 2, 10, 4.0, Some(published));
    }
    println!("the same with |x| ≤ {TIGHT}: rows are active");
    for horizon in [11, 31, 71] {
        row(10, horizon, TIGHT, None);
    }
    for nx in [22, 62] {
        row(nx / 2, 10, TIGHT, None);
    }
}
