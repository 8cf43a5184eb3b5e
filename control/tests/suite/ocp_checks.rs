//! Conditions of optimality of a problem of optimal control, and Clarabel's solution with states and slacks as unknowns.

use crate::qp_cases::tight;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus, ZeroConeT};
use faer::Mat;
use pliant_control::ocp::{Ocp, OcpSolution, Rows};

/// `y += A x`.
fn add(y: &mut [f64], a: &Mat<f64>, x: &[f64]) {
    for (i, y) in y.iter_mut().enumerate() {
        *y += x.iter().enumerate().map(|(j, x)| a[(i, j)] * x).sum::<f64>();
    }
}

fn add_transposed(y: &mut [f64], a: &Mat<f64>, x: &[f64]) {
    add(y, &a.transpose().to_owned(), x);
}

fn rows(ocp: &Ocp, k: usize) -> &Rows {
    ocp.stages.get(k).map_or(&ocp.rows_final, |stage| &stage.rows)
}

/// Largest error of the conditions of optimality, relative to the largest multiplier, state or slope; complementarity as slack times
/// multiplier.
pub fn kkt_error(ocp: &Ocp, solution: &OcpSolution) -> f64 {
    let n = ocp.stages.len();
    let OcpSolution { x, u, multipliers, bounds, .. } = solution;
    let most = |vectors: &[Vec<f64>]| vectors.iter().flatten().fold(0.0, |most: f64, value| most.max(value.abs()));
    let states = most(x).max(most(u));
    let mut pi = ocp.q_final_linear.clone();
    add(&mut pi, &ocp.q_final, &x[n]);
    add_transposed(&mut pi, &ocp.rows_final.gx, &multipliers[n]);
    let (mut worst, mut slope, mut error): (f64, f64, f64) = (0.0, most(multipliers).max(most(bounds)), 0.0);
    for (k, stage) in ocp.stages.iter().enumerate().rev() {
        let mut gu = stage.r_linear.clone();
        add(&mut gu, &stage.s, &x[k]);
        add(&mut gu, &stage.r, &u[k]);
        add_transposed(&mut gu, &stage.rows.gu, &multipliers[k]);
        slope = gu.iter().chain(&pi).fold(slope, |most, value| most.max(value.abs()));
        add_transposed(&mut gu, &stage.b, &pi);
        gu.iter().zip(&bounds[k]).for_each(|(gu, bound)| worst = worst.max((gu + bound).abs()));
        let mut next = stage.d.clone();
        add(&mut next, &stage.a, &x[k]);
        add(&mut next, &stage.b, &u[k]);
        next.iter().zip(&x[k + 1]).for_each(|(next, x)| error = error.max((next - x).abs() / states));
        let mut before = stage.q_linear.clone();
        add(&mut before, &stage.q, &x[k]);
        add_transposed(&mut before, &stage.s, &u[k]);
        add_transposed(&mut before, &stage.a, &pi);
        add_transposed(&mut before, &stage.rows.gx, &multipliers[k]);
        pi = before;
        for (j, u) in u[k].iter().enumerate() {
            assert!((stage.lower[j]..=stage.upper[j]).contains(u));
            let slack = if bounds[k][j] < 0.0 { u - stage.lower[j] } else { stage.upper[j] - u };
            if bounds[k][j] != 0.0 {
                error = error.max(slack.min(slack * bounds[k][j].abs() / slope) / states);
            }
        }
    }
    for k in 0..=n {
        let rows = rows(ocp, k);
        let mut excess: Vec<f64> = rows.limits.iter().map(|limit| -limit).collect();
        add(&mut excess, &rows.gx, &x[k]);
        if k < n {
            add(&mut excess, &rows.gu, &u[k]);
        }
        for (i, excess) in excess.iter().enumerate() {
            let (multiplier, weight) = (multipliers[k][i], rows.weights[i]);
            assert!((0.0..=weight).contains(&multiplier));
            assert!((solution.violations[k][i] - excess.max(0.0)).abs() <= 1e-12 * (states + rows.limits[i].abs()));
            let size = states + rows.limits[i].abs();
            let below = if *excess < 0.0 { multiplier } else { (weight - multiplier).min(1e3 * slope) };
            error = error.max(excess.abs().min(excess.abs() * below / slope) / size);
        }
    }
    error.max(worst / slope)
}

/// Clarabel's inputs and cost.
pub fn oracle(ocp: &Ocp) -> (Vec<Vec<f64>>, f64) {
    let (n, nx, nu) = (ocp.stages.len(), ocp.nx(), ocp.nu());
    let slacks: Vec<(usize, usize)> = (0..=n)
        .flat_map(|k| (0..rows(ocp, k).len()).map(move |i| (k, i)))
        .filter(|(k, i)| rows(ocp, *k).weights[*i].is_finite())
        .collect();
    let (at_u, at_slack) = ((n + 1) * nx, (n + 1) * nx + n * nu);
    let total = at_slack + slacks.len();
    let (mut p, mut linear) = (vec![vec![0.0; total]; total], vec![0.0; total]);
    for k in 0..=n {
        let stage = ocp.stages.get(k);
        let (q, q_linear) = stage.map_or((&ocp.q_final, &ocp.q_final_linear), |stage| (&stage.q, &stage.q_linear));
        for j in 0..nx {
            linear[k * nx + j] = q_linear[j];
            (0..=j).for_each(|i| p[k * nx + i][k * nx + j] = q[(i, j)]);
        }
        if let Some(stage) = stage {
            for j in 0..nu {
                let column = at_u + k * nu + j;
                linear[column] = stage.r_linear[j];
                (0..=j).for_each(|i| p[at_u + k * nu + i][column] = stage.r[(i, j)]);
                (0..nx).for_each(|i| p[k * nx + i][column] = stage.s[(j, i)]);
            }
        }
    }
    slacks.iter().enumerate().for_each(|(s, (k, i))| linear[at_slack + s] = rows(ocp, *k).weights[*i]);
    let (mut a, mut b) = (Vec::new(), Vec::new());
    let mut push = |entries: Vec<(usize, f64)>, limit: f64| {
        let mut row = vec![0.0; total];
        entries.into_iter().for_each(|(j, entry)| row[j] += entry);
        a.push(row);
        b.push(limit);
    };
    (0..nx).for_each(|i| push(vec![(i, 1.0)], ocp.x0[i]));
    for (k, stage) in ocp.stages.iter().enumerate() {
        for i in 0..nx {
            let of_x = (0..nx).map(|j| (k * nx + j, -stage.a[(i, j)]));
            let of_u = (0..nu).map(|j| (at_u + k * nu + j, -stage.b[(i, j)]));
            push(of_x.chain(of_u).chain([((k + 1) * nx + i, 1.0)]).collect(), stage.d[i]);
        }
    }
    for (k, stage) in ocp.stages.iter().enumerate() {
        for j in 0..nu {
            let bounds = [(-1.0, -stage.lower[j]), (1.0, stage.upper[j])];
            bounds
                .into_iter()
                .filter(|bound| bound.1.is_finite())
                .for_each(|(sign, limit)| push(vec![(at_u + k * nu + j, sign)], limit));
        }
    }
    for k in 0..=n {
        let rows = rows(ocp, k);
        for i in 0..rows.len() {
            let of_x = (0..nx).map(|j| (k * nx + j, rows.gx[(i, j)]));
            let of_u = (0..if k < n { nu } else { 0 }).map(|j| (at_u + k * nu + j, rows.gu[(i, j)]));
            let slack = slacks.iter().position(|s| *s == (k, i)).map(|s| (at_slack + s, -1.0));
            push(of_x.chain(of_u).chain(slack).collect(), rows.limits[i]);
        }
    }
    (0..slacks.len()).for_each(|s| push(vec![(at_slack + s, -1.0)], 0.0));
    let equations = (n + 1) * nx;
    let cones = [ZeroConeT(equations), NonnegativeConeT(b.len() - equations)];
    let settings = DefaultSettings { verbose: false, ..tight() };
    let mut solver = DefaultSolver::new(&CscMatrix::from(&p), &linear, &CscMatrix::from(&a), &b, &cones, settings).unwrap();
    solver.solve();
    let status = solver.solution.status;
    assert!(matches!(status, SolverStatus::Solved | SolverStatus::AlmostSolved), "{status:?}");
    (solver.solution.x[at_u..at_slack].chunks(nu).map(<[f64]>::to_vec).collect(), solver.solution.obj_val)
}

/// Largest difference of inputs, relative to the largest input or 1.
pub fn difference(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    let (most, off) = pairs.fold((1.0, 0.0), |(most, off): (f64, f64), (a, b)| (most.max(a.abs()), off.max((a - b).abs())));
    off / most
}
