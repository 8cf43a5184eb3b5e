//! Times of the quadratic programs and of both methods for optimal control, on one thread: for each problem the median of repeated
//! solves, from no working set (cold), with the last one's after a change of the vectors (warm), and changes or iterations.

#![allow(clippy::unwrap_used)]

#[allow(dead_code)] // the suite's random problems
#[path = "../tests/suite/ocp_cases.rs"]
mod ocp_cases;

use faer::{Mat, Scale};
use pliant_control::ocp::{Condensed, Ocp, OcpSolver, Riccati};
use pliant_control::qp::{ActiveSet, Qp};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::time::Instant;

/// Median of the times [ms], after one call that is not counted.
fn median(times: usize, mut run: impl FnMut()) -> f64 {
    run();
    let mut all: Vec<f64> = (0..times)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    all.sort_by(f64::total_cmp);
    all[times / 2]
}

/// A condensed-like Hessian of condition about 1e3, bounds of which a third works, `m` rows of which few do.
fn dense(n: usize, m: usize) {
    let mut rng = Pcg64::seed_from_u64(7);
    let root = Mat::from_fn(n, n, |_, _| rng.random_range(-1.0..1.0));
    let h = root.transpose() * &root * Scale(1.0 / n as f64) + Mat::<f64>::identity(n, n) * Scale(1e-2);
    let g: Vec<f64> = (0..n).map(|_| rng.random_range(-1.0..1.0)).collect();
    let other: Vec<f64> = g.iter().map(|g| g + rng.random_range(-0.05..0.05)).collect();
    let transposed = Mat::from_fn(n, m, |_, _| rng.random_range(-1.0..1.0));
    let (lower, upper) = (vec![-1.0; n], vec![1.0; n]);
    let limits: Vec<f64> = (0..m).map(|_| rng.random_range(8.0..20.0) * (n as f64 / 160.0).sqrt()).collect();
    let weights: Vec<f64> = (0..m).map(|i| if i % 2 == 0 { 10.0 } else { f64::INFINITY }).collect();
    let mut shifted = h.clone();
    shifted[(0, 0)] += 1e-9;
    let qp = |hessian: usize, gradient: usize| Qp {
        hessian: [&h, &shifted][hessian].as_ref(),
        gradient: [&g, &other][gradient],
        lower: &lower,
        upper: &upper,
        rows: transposed.transpose(),
        limits: &limits,
        weights: &weights,
    };
    let mut solver = ActiveSet::new();
    let (mut turn, mut changes, mut active) = (0, 0, (0, 0));
    let cold = median(21, || {
        turn += 1;
        solver.forget();
        let solution = solver.solve(&qp(turn % 2, 0)).unwrap();
        changes = solution.iterations;
        let count = |values: &[f64]| values.iter().filter(|value| **value != 0.0).count();
        active = (count(&solution.bounds), count(&solution.multipliers));
    });
    let mut moved = 0;
    let warm = median(21, || {
        turn += 1;
        moved = solver.solve(&qp(turn % 2, turn % 2)).unwrap().iterations;
    });
    let same = median(21, || {
        solver.solve(&qp(0, 0)).unwrap();
    });
    println!(
        "dense n {n:3}, {m:4} rows: cold {cold:7.3} ms ({changes} changes; {} bounds, {} rows act), moved {warm:7.3} ms ({moved}), same {same:7.3} ms",
        active.0, active.1
    );
}

fn ocp(name: &str, ocp: &Ocp) {
    let mut changed = ocp.clone();
    changed.x0.iter_mut().enumerate().for_each(|(i, x)| *x += 1e-3 * ((i % 3) as f64 - 1.0));
    changed.stages[0].a[(0, 0)] += 1e-9;
    let mut moved = changed.clone();
    moved.x0.iter_mut().enumerate().for_each(|(i, x)| *x += 1e-3 * ((i % 5) as f64 - 2.0));
    let (mut changes, mut turn) = (0, 0);
    let mut solver = Condensed::new();
    let cold = median(7, || {
        turn += 1;
        solver.forget();
        changes = solver.solve([ocp, &changed][turn % 2]).unwrap().iterations;
    });
    let mut of_warm = 0;
    let warm = median(11, || {
        turn += 1;
        of_warm = solver.solve([ocp, &changed][turn % 2]).unwrap().iterations;
    });
    let vectors = median(11, || {
        turn += 1;
        solver.solve([&moved, &changed][turn % 2]).unwrap();
    });
    let mut riccati = Riccati::new();
    let mut iterations = 0;
    let interior = median(7, || iterations = riccati.solve(ocp).unwrap().iterations);
    println!(
        "{name}: condensed cold {cold:8.3} ms ({changes}), warm {warm:8.3} ms ({of_warm}), vectors only {vectors:8.3} ms; Riccati {interior:8.3} ms ({iterations})"
    );
}

/// All, or those of the group named: `dense`, `rope` or `chain`.
fn main() {
    let only = std::env::args().nth(1);
    let runs = |group: &str| only.as_deref().is_none_or(|only| only == group);
    faer::set_global_parallelism(faer::Par::Seq);
    if runs("dense") {
        for (n, m) in [(80, 0), (120, 0), (160, 0), (240, 0), (80, 400), (120, 400), (160, 400), (240, 1300)] {
            dense(n, m);
        }
    }
    if runs("rope") {
        for (n, rows) in [(20, 0), (20, 20), (20, 65), (40, 20), (60, 20)] {
            ocp(&format!("rope nx 69 nu 8 N {n}, {rows:2} rows a stage"), &ocp_cases::rope(n, rows, 1));
        }
    }
    if runs("chain") {
        for (masses, stages) in [(2, &[10, 25, 50, 100, 200, 400][..]), (5, &[10, 20, 50, 100, 200]), (10, &[5, 10, 20, 50, 100])]
        {
            for &n in stages {
                let problem = ocp_cases::chain(masses, n, 0.8, 1.0, 100.0, 1);
                ocp(&format!("chain nx {:2} nu {masses:2} N {n:3}", 2 * masses), &problem);
            }
        }
    }
}
