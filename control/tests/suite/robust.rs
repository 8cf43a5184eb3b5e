//! The alternation of nominal problem and responses.

use clarabel::solver::SupportedConeT;
use faer::Mat;
use pliant_control::ocp::{Ocp, Rows};
use pliant_control::tube::{
    Ball, Constraint, Disturbance, EllipsoidalTube, ExactTube, RobustOptions, Scaling, SharedGainTube, TubeCost, TubeError,
    TubeSynthesis, robust,
};

use crate::problems::{box_rows, generator, identity, invariant, random, tube_cost, varying};
use crate::reference::{Layout, Program, Reference, cost_of, rows_of};

/// The joint problem as one second-order cone program: variables z, v, X[k,j] = Φ_x E, U[k,j] = Φ_u E, bounds t of norms, slacks.
struct Joint {
    cost: f64,
    x: Vec<Vec<f64>>,
    u: Vec<Vec<f64>>,
    /// Σ_j t of every row and input.
    tightenings: Vec<Vec<f64>>,
}

fn joint(ocp: &Ocp, disturbance: &Disturbance, cost: &TubeCost) -> Joint {
    let (nx, nu, horizon) = (ocp.x0.len(), ocp.stages[0].b.ncols(), ocp.stages.len());
    let mut program = Program::default();
    let layout = Layout::new(&mut program, ocp);
    let sizes: Vec<usize> = disturbance.balls.iter().map(|balls| balls[0].columns.ncols()).collect();
    // column c of X[k,j] begins at x[j][k − j] + c nx
    let (mut x, mut u) = (Vec::new(), Vec::new());
    for j in 0..=horizon {
        let of_x: Vec<usize> = (j..=horizon).map(|_| program.variables(nx * sizes[j])).collect();
        let of_u: Vec<usize> = (j..horizon).map(|_| program.variables(nu * sizes[j])).collect();
        for c in 0..sizes[j] {
            for k in j..=horizon {
                let q = if k < horizon { &cost.q } else { &cost.q_final };
                program.add_hessian(of_x[k - j] + c * nx, &(faer::Scale(2.0) * q));
            }
            for first in &of_u {
                program.add_hessian(first + c * nu, &(faer::Scale(2.0) * &cost.r));
            }
        }
        let before = program.b.len();
        for c in 0..sizes[j] {
            for r in 0..nx {
                program.row([(of_x[0] + c * nx + r, 1.0)], disturbance.balls[j][0].columns[(r, c)]);
                for k in j..horizon {
                    let stage = &ocp.stages[k];
                    let a = (0..nx).map(|p| (of_x[k - j] + c * nx + p, -stage.a[(r, p)]));
                    let b = (0..nu).map(|p| (of_u[k - j] + c * nu + p, -stage.b[(r, p)]));
                    program.row(a.chain(b).chain([(of_x[k + 1 - j] + c * nx + r, 1.0)]), 0.0);
                }
            }
        }
        program.cones.push(SupportedConeT::ZeroConeT(program.b.len() - before));
        x.push(of_x);
        u.push(of_u);
    }
    let mut bounds: Vec<Vec<Vec<usize>>> = Vec::new();
    let mut limits = Vec::new();
    for k in 0..=horizon {
        let rows = rows_of(ocp, k);
        let inputs = if k < horizon { nu } else { 0 };
        let mut of_stage = Vec::new();
        for i in 0..rows.len() + inputs {
            let g_x = |c: usize| if i < rows.len() { rows.gx[(i, c)] } else { 0.0 };
            let g_u = |c: usize| match i.checked_sub(rows.len()) {
                None if k < horizon => rows.gu[(i, c)],
                None => 0.0,
                Some(input) => f64::from(u8::from(input == c)),
            };
            let mut of_row = Vec::new();
            for j in 0..=k {
                let t = program.variables(1);
                program.row([(t, -1.0)], 0.0);
                for c in 0..sizes[j] {
                    let states = (0..nx).map(|p| (x[j][k - j] + c * nx + p, -g_x(p)));
                    let answers = (0..inputs).map(|p| (u[j][k - j] + c * nu + p, -g_u(p)));
                    program.row(states.chain(answers), 0.0);
                }
                program.cones.push(SupportedConeT::SecondOrderConeT(1 + sizes[j]));
                of_row.push(t);
            }
            let tightening = of_row.iter().map(|&t| (t, 1.0));
            if i < rows.len() {
                let mut entries: Vec<(usize, f64)> = layout.row(rows, k, i).into_iter().chain(tightening).collect();
                if rows.weights[i].is_finite() {
                    let slack = program.variables(1);
                    program.q[slack] = rows.weights[i];
                    limits.push((vec![(slack, -1.0)], 0.0));
                    entries.push((slack, -1.0));
                }
                limits.push((entries, rows.limits[i]));
            } else {
                let input = i - rows.len();
                for (sign, bound) in [(1.0, ocp.stages[k].upper[input]), (-1.0, -ocp.stages[k].lower[input])] {
                    if bound.is_finite() {
                        limits.push((tightening.clone().chain([(layout.u[k] + input, sign)]).collect(), bound));
                    }
                }
            }
            of_stage.push(of_row);
        }
        bounds.push(of_stage);
    }
    let before = program.b.len();
    for (entries, bound) in limits {
        program.row(entries, bound);
    }
    program.cones.push(SupportedConeT::NonnegativeConeT(program.b.len() - before));
    let (p, q) = (program.p.clone(), program.q.clone());
    let (primal, ..) = program.solve(1e-9);
    let of_pair = |(i, j, v): &(usize, usize, f64)| v * primal[*i] * primal[*j] * if i == j { 0.5 } else { 1.0 };
    let value = p.iter().map(of_pair).sum::<f64>() + q.iter().zip(&primal).map(|(q, x)| q * x).sum::<f64>();
    let part = |first: usize, count: usize| primal[first..first + count].to_vec();
    Joint {
        cost: value,
        x: layout.x.iter().map(|&first| part(first, nx)).collect(),
        u: layout.u.iter().map(|&first| part(first, nu)).collect(),
        tightenings: bounds.iter().map(|s| s.iter().map(|row| row.iter().map(|&t| primal[t]).sum()).collect()).collect(),
    }
}

/// Box rows of states that the nominal optimum runs along, and rows that bind x and u together.
fn tight_problem(seed: u64, nx: usize, nu: usize, horizon: usize) -> (Ocp, Disturbance) {
    let mut ocp = varying(seed, nx, nu, horizon);
    let mut rng = generator(seed + 500);
    for stage in &mut ocp.stages {
        let mixed =
            Rows { gx: random(&mut rng, 1, nx, 1.0), gu: random(&mut rng, 1, nu, 1.0), limits: vec![0.4], weights: vec![100.0] };
        stage.rows = mixed;
        stage.lower = vec![-1.2; nu];
        stage.upper = vec![1.0; nu];
    }
    ocp.rows_final = box_rows(nx, nu, 0.6, 100.0);
    let disturbance = Disturbance::new((0..=horizon).map(|_| identity(nx, 0.03) + random(&mut rng, nx, nx, 0.02)));
    (ocp, disturbance)
}

#[test]
fn exact_tubes_solve_the_joint_problem() {
    for (seed, nx, nu, horizon) in [(1, 2, 1, 4), (2, 3, 2, 5), (3, 4, 2, 6), (4, 4, 1, 6), (8, 2, 2, 6)] {
        let (ocp, disturbance) = tight_problem(seed, nx, nu, horizon);
        let cost = tube_cost(nx, nu, 0.05, 0.01, 0.1);
        let options = RobustOptions { iterations: 200, tolerance: 1e-7, ..RobustOptions::default() };
        let found = robust(&ocp, &disturbance, &cost, &mut Reference::default(), &ExactTube, &options).unwrap();
        let reference = joint(&ocp, &disturbance, &cost);
        let active = found.nominal.multipliers.iter().chain(&found.nominal.bounds).flatten().filter(|mu| mu.abs() > 1e-2).count();
        assert!(active > 0, "seed {seed}: no constraint is active");
        let relative = found.cost() / reference.cost - 1.0;
        assert!(found.converged, "seed {seed}: not after {} iterations", found.iterations);
        assert!(relative.abs() < 1e-4, "seed {seed}: {} against {}", found.cost(), reference.cost);
        assert!((found.nominal.cost - cost_of(&ocp, &found.nominal.x, &found.nominal.u)) >= -1e-9);
        for (a, b) in found.nominal.x.iter().chain(&found.nominal.u).zip(reference.x.iter().chain(&reference.u)) {
            for (a, b) in a.iter().zip(b) {
                assert!((a - b).abs() < 1e-4, "seed {seed}: {a} against {b}");
            }
        }
        // where a constraint is active its tightening is determined
        for k in 0..=horizon {
            for (i, mu) in found.nominal.multipliers[k].iter().enumerate().filter(|(_, mu)| **mu > 1e-2) {
                let h = found.tube.tightenings.rows(k)[i];
                assert!(
                    (h - reference.tightenings[k][i]).abs() < 1e-4,
                    "seed {seed}, μ {mu}: {h} against {}",
                    reference.tightenings[k][i]
                );
            }
        }
    }
}

/// Where the optimum leaves the tightened problem barely feasible, its multipliers jump from about 5 to the rows' price of 100, and the
/// optimum's are between: convergence is slow, and the best pair of nominal trajectory and tube comes back.
#[test]
fn barely_feasible_problems_are_certified_near_the_optimum() {
    let (ocp, disturbance) = tight_problem(9, 3, 1, 5);
    let cost = tube_cost(3, 1, 0.05, 0.01, 0.1);
    let reference = joint(&ocp, &disturbance, &cost);
    let excess = |iterations: usize| {
        let options = RobustOptions { iterations, ..RobustOptions::default() };
        let found = robust(&ocp, &disturbance, &cost, &mut Reference::default(), &ExactTube, &options).unwrap();
        assert!(found.is_certified(), "{:?}", found.violations);
        found.cost() / reference.cost - 1.0
    };
    let (few, many) = (excess(30), excess(200));
    assert!(-1e-7 < many && many < few && few < 0.03 && many < 0.003, "{few} {many}");
}

#[test]
fn cheaper_tubes_cost_more_and_hold_too() {
    let (ocp, disturbance) = tight_problem(3, 4, 2, 6);
    let cost = tube_cost(4, 2, 0.05, 0.01, 0.1);
    let options = RobustOptions { iterations: 60, ..RobustOptions::default() };
    let solve = |synthesis: &dyn TubeSynthesis| {
        robust(&ocp, &disturbance, &cost, &mut Reference::default(), synthesis, &options).unwrap()
    };
    let exact = solve(&ExactTube);
    let shared = solve(&SharedGainTube);
    let ellipsoid = solve(&EllipsoidalTube { scaling: Scaling::Bound });
    assert!(exact.cost() < shared.cost() && shared.cost() < ellipsoid.cost());
    for solution in [&exact, &shared, &ellipsoid] {
        assert!(solution.is_certified(), "{:?}", solution.violations);
    }
}

#[test]
fn soft_rows_that_cannot_hold_are_not_certified() {
    let a = Mat::from_fn(2, 2, |r, c| [[1.0, 0.1], [0.0, 1.0]][r][c]);
    let b = Mat::from_fn(2, 1, |r, _| [0.0, 0.1][r]);
    let mut ocp = invariant(&a, &b, 5, vec![0.0, 0.0], [1.0, 1.0, 1.0], 10.0);
    ocp.rows_final = box_rows(2, 1, 0.05, 10.0);
    let disturbance = Disturbance::new((0..=5).map(|_| identity(2, 0.08)));
    let cost = tube_cost(2, 1, 1.0, 1.0, 1.0);
    let found = robust(&ocp, &disturbance, &cost, &mut Reference::default(), &ExactTube, &RobustOptions::default()).unwrap();
    assert!(!found.is_certified());
    let lacking = found.violations.iter().find(|v| v.stage == 5 && v.constraint == Constraint::Row(0)).unwrap();
    let expected = found.nominal.x[5][0] + found.tube.tightenings.rows(5)[0] - 0.05;
    assert!((lacking.amount - expected).abs() < 1e-12 && lacking.amount > 0.03);

    // hard, no policy keeps the last disturbance, of width 2 · 0.08, within 2 · 0.05
    ocp.rows_final.weights = vec![f64::INFINITY; 4];
    match robust(&ocp, &disturbance, &cost, &mut Reference::default(), &ExactTube, &RobustOptions::default()) {
        Err(TubeError::Impossible { stage: 5, constraint: Constraint::Row(0), needed, room, any_policy: true }) => {
            assert!((needed - 0.16).abs() < 1e-15 && (room - 0.1).abs() < 1e-15);
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn initial_uncertainty_beyond_a_hard_row_is_impossible() {
    let mut ocp = varying(7, 3, 1, 3);
    ocp.stages[0].rows = box_rows(3, 1, 1.1, f64::INFINITY);
    ocp.x0 = vec![1.0, 0.0, 0.0];
    let disturbance = Disturbance::new((0..=3).map(|_| identity(3, 0.15)));
    let cost = tube_cost(3, 1, 1.0, 1.0, 1.0);
    match robust(&ocp, &disturbance, &cost, &mut Reference::default(), &ExactTube, &RobustOptions::default()) {
        Err(TubeError::Impossible { stage: 0, constraint: Constraint::Row(0), needed, room, any_policy: true }) => {
            assert!((needed - 0.15).abs() < 1e-15 && (room - 0.1).abs() < 1e-12);
        }
        other => panic!("{other:?}"),
    }
}

/// The optimal response without bounds needs more input than there is; it gives way until it fits.
#[test]
fn responses_fit_between_the_bounds_of_inputs() {
    let (a, b) = (identity(2, 1.0), identity(2, 1.0));
    let disturbance = Disturbance::new((0..=4).map(|_| identity(2, 0.1)));
    let cost = tube_cost(2, 2, 1.0, 0.01, 1.0);
    let options = RobustOptions { iterations: 100, ..RobustOptions::default() };
    let solve = |bound: f64| {
        let ocp = invariant(&a, &b, 4, vec![0.0, 0.0], [1.0, 0.01, 1.0], bound);
        let found = robust(&ocp, &disturbance, &cost, &mut Reference::default(), &ExactTube, &options).unwrap();
        assert!(found.is_certified(), "{:?}", found.violations);
        (found, joint(&ocp, &disturbance, &cost))
    };
    let (free, _) = solve(f64::INFINITY);
    assert!(free.tube.tightenings.inputs(1).iter().all(|h| *h > 0.09));
    let (fitted, reference) = solve(0.06);
    assert!(fitted.tube.tightenings.inputs(1).iter().all(|h| *h <= 0.06 && *h > 0.055));
    // a share of the room is kept for the nominal problem, hence not the optimum itself
    let relative = fitted.cost() / reference.cost - 1.0;
    assert!((-1e-6..0.02).contains(&relative), "{relative}");
}

/// An unstable state between hard rows, and inputs too weak to keep it there: more of one is less of the other.
#[test]
fn inputs_too_weak_for_hard_rows_are_impossible() {
    let mut ocp = invariant(&identity(1, 1.5), &identity(1, 1.0), 4, vec![0.0], [1.0, 1.0, 1.0], 0.05);
    ocp.rows_final = box_rows(1, 1, 0.3, f64::INFINITY);
    let disturbance = Disturbance::new((0..=4).map(|_| identity(1, 0.1)));
    let cost = tube_cost(1, 1, 1.0, 1.0, 1.0);
    match robust(&ocp, &disturbance, &cost, &mut Reference::default(), &ExactTube, &RobustOptions::default()) {
        Err(TubeError::Impossible { needed, room, any_policy: false, .. }) => assert!(needed > 1.1 * room, "{needed} in {room}"),
        other => panic!("{other:?}"),
    }
    ocp.stages.iter_mut().for_each(|stage| (stage.lower, stage.upper) = (vec![-0.5], vec![0.5]));
    let found = robust(&ocp, &disturbance, &cost, &mut Reference::default(), &ExactTube, &RobustOptions::default()).unwrap();
    assert!(found.is_certified());
}

/// Soft rows that cannot hold ask for more input than there is: the tube keeps to the inputs' bounds and reports the rows.
#[test]
fn hard_bounds_come_before_soft_rows() {
    let mut ocp = invariant(&identity(2, 1.2), &identity(2, 1.0), 6, vec![0.3, -0.3], [1.0, 0.01, 1.0], 0.15);
    for stage in &mut ocp.stages[1..] {
        stage.rows = box_rows(2, 2, 0.11, 1e4);
    }
    ocp.rows_final = box_rows(2, 2, 0.11, 1e4);
    let disturbance = Disturbance::new((0..=6).map(|_| identity(2, 0.1)));
    let cost = tube_cost(2, 2, 1e-3, 1e-3, 1e-3);
    let found = robust(&ocp, &disturbance, &cost, &mut Reference::default(), &ExactTube, &RobustOptions::default()).unwrap();
    assert!(found.violations.iter().any(|violation| matches!(violation.constraint, Constraint::Row(_))));
    assert!(!found.violations.iter().any(|violation| matches!(violation.constraint, Constraint::Input(_))));
}

/// A shift of the disturbance is met by the nominal trajectory.
#[test]
fn the_nominal_trajectory_meets_the_centre() {
    let mut ocp = varying(9, 2, 1, 4);
    ocp.rows_final = box_rows(2, 1, 0.5, 100.0);
    let cost = tube_cost(2, 1, 0.1, 0.1, 0.1);
    let shift = vec![0.05, -0.02];
    let ball = |shift: Vec<f64>| Ball { columns: identity(2, 0.02), shift };
    let shifted = Disturbance { balls: (0..=4).map(|_| vec![ball(shift.clone())]).collect() };
    let plain = Disturbance { balls: (0..=4).map(|_| vec![ball(Vec::new())]).collect() };
    let options = RobustOptions::default();
    let by_ball = robust(&ocp, &shifted, &cost, &mut Reference::default(), &ExactTube, &options).unwrap();
    for (x, shift) in ocp.x0.iter_mut().zip(&shift) {
        *x += shift;
    }
    for stage in &mut ocp.stages {
        for (d, shift) in stage.d.iter_mut().zip(&shift) {
            *d += shift;
        }
    }
    let by_hand = robust(&ocp, &plain, &cost, &mut Reference::default(), &ExactTube, &options).unwrap();
    assert_eq!(by_ball.nominal.x, by_hand.nominal.x);
    assert_eq!(by_ball.tube.tightenings, by_hand.tube.tightenings);
}
