//! Both methods for problems of optimal control.

use crate::ocp_cases::{chain, random, rope};
use crate::ocp_checks::{difference, kkt_error, oracle};
use faer::Mat;
use pliant_control::ocp::{Condensed, Ocp, OcpConstraint, OcpError, OcpSolution, OcpSolver, Riccati, Rows, choose};
use std::ops::Range;

/// Seeds looked at during development.
const SEEDS: Range<u64> = 0..200;
/// Seeds that each were fresh once, and showed: iterations that cycled; inputs out of their bounds by rounding; hard rows that leave one
/// point, at which factors lose their digits.
const FORMERLY_FRESH: [Range<u64>; 3] = [5000..6000, 20000..21000, 30000..31000];
/// Seeds that were run once, when all was done.
const FRESH: Range<u64> = 40000..41000;

/// Solves by both methods and checks each one's conditions of optimality and that they agree.
fn both(name: &str, ocp: &Ocp) -> [OcpSolution; 2] {
    let solved = |method: &str, solver: &mut dyn OcpSolver| {
        let solution = solver.solve(ocp).unwrap_or_else(|error| panic!("{name}, {method}: {error}"));
        let error = kkt_error(ocp, &solution);
        assert!(error < 1e-8, "{name}, {method}: {error:e}");
        solution
    };
    let solutions = [solved("condensed", &mut Condensed::new()), solved("Riccati", &mut Riccati::new())];
    let off = difference(&solutions[0].u, &solutions[1].u).max(difference(&solutions[0].x, &solutions[1].x));
    assert!(off < 1e-7, "{name}: {off:e}");
    let [a, b] = [solutions[0].cost, solutions[1].cost];
    assert!((a - b).abs() < 1e-8 * (1.0 + a.abs()), "{name}: {a} {b}");
    solutions
}

#[test]
fn conditions_of_optimality_and_agreement() {
    for seed in SEEDS.chain(FORMERLY_FRESH.into_iter().flatten()).chain(FRESH) {
        both(&format!("seed {seed}"), &random(seed));
    }
}

#[test]
fn agree_with_clarabel() {
    for seed in SEEDS {
        let ocp = random(seed);
        let solution = Condensed::new().solve(&ocp).unwrap();
        let (u, cost) = oracle(&ocp);
        assert!((solution.cost - cost).abs() < 1e-9 * (1.0 + cost.abs()), "seed {seed}: {} {cost}", solution.cost);
        let off = difference(&solution.u, &u);
        assert!(off < 1e-5, "seed {seed}: {off:e}");
    }
}

/// As published nothing acts; with less room soft rows and bounds do.
#[test]
fn chain_of_masses() {
    for (masses, n) in [(2, 5), (2, 10), (2, 40), (5, 10), (5, 25), (8, 15)] {
        for seed in 0..3 {
            let [published, _] = both("chain", &chain(masses, n, 4.0, 4.0, f64::INFINITY, seed));
            assert!(published.violations.iter().flatten().all(|violation| *violation == 0.0));
            let ocp = chain(masses, n, 0.6, 0.5, 100.0, seed);
            let [tight, _] = both("tight chain", &ocp);
            let acting = |values: &[Vec<f64>]| values.iter().flatten().filter(|value| **value != 0.0).count();
            assert!(acting(&tight.bounds) > 0 && acting(&tight.multipliers) > 0);
            let (u, cost) = if n * masses <= 50 { oracle(&ocp) } else { continue };
            assert!((tight.cost - cost).abs() < 1e-8 * cost && difference(&tight.u, &u) < 1e-6);
        }
    }
}

#[test]
fn rope_between_grippers() {
    for rows in [0, 20] {
        both("rope", &rope(12, rows, 3));
    }
}

/// A long horizon of an unstable system: condensed, its responses would grow to 1e60.
#[test]
fn long_horizon() {
    let mut ocp = chain(1, 200, 4.0, 4.0, f64::INFINITY, 0);
    for stage in &mut ocp.stages {
        stage.a = Mat::from_fn(2, 2, |i, j| [[2.0, 0.1], [0.0, 1.5]][i][j]);
        stage.b = Mat::from_fn(2, 1, |i, _| [0.1, 1.0][i]);
        stage.lower.fill(f64::NEG_INFINITY);
        stage.upper.fill(f64::INFINITY);
        stage.rows.weights.fill(50.0);
    }
    let solution = Riccati::new().solve(&ocp).unwrap();
    assert!(kkt_error(&ocp, &solution) < 1e-8);
}

/// The second of two problems differs in one array only: nothing of the first may stay.
#[test]
fn every_array_counts() {
    type Change = fn(&mut Ocp);
    let changes: [(&str, Change); 14] = [
        ("x0", |ocp| ocp.x0[0] += 0.5),
        ("a", |ocp| ocp.stages[1].a[(0, 0)] += 0.5),
        ("b", |ocp| ocp.stages[1].b[(0, 0)] += 0.5),
        ("d", |ocp| ocp.stages[1].d[0] += 0.5),
        ("q", |ocp| ocp.stages[1].q[(0, 0)] += 0.5),
        ("s", |ocp| ocp.stages[1].s[(0, 0)] += 0.1),
        ("r", |ocp| ocp.stages[1].r[(0, 0)] += 0.5),
        ("q_linear", |ocp| ocp.stages[1].q_linear[0] += 0.5),
        ("r_linear", |ocp| ocp.stages[1].r_linear[0] += 0.5),
        ("q_final", |ocp| ocp.q_final[(0, 0)] += 0.5),
        ("q_final_linear", |ocp| ocp.q_final_linear[0] += 0.5),
        ("gx", |ocp| ocp.stages[2].rows.gx[(0, 0)] += 0.5),
        ("limits", |ocp| ocp.stages[2].rows.limits[0] -= 0.2),
        ("bounds", |ocp| ocp.stages[1].upper[0] = -0.3),
    ];
    let mut ocp = chain(2, 5, 0.3, 0.4, 100.0, 1);
    ocp.stages.iter_mut().for_each(|stage| stage.s[(0, 1)] = 0.1);
    for (name, change) in changes {
        let mut changed = ocp.clone();
        change(&mut changed);
        let (mut condensed, mut riccati) = (Condensed::new(), Riccati::new());
        let before = condensed.solve(&ocp).unwrap();
        riccati.solve(&ocp).unwrap();
        let after = [condensed.solve(&changed).unwrap(), riccati.solve(&changed).unwrap()];
        let fresh = Condensed::new().solve(&changed).unwrap();
        assert!((before.cost - fresh.cost).abs() > 1e-6, "{name} changes nothing");
        for after in after {
            assert!(difference(&after.u, &fresh.u) < 1e-9 && (after.cost - fresh.cost).abs() < 1e-9, "{name}");
        }
    }
}

/// A plan is solved anew from the next state, as the first stage has passed: counts fall, most if the working set is shifted with time, and
/// solutions are those of a solver without memory.
#[test]
fn warm_starts() {
    let ocp = chain(5, 20, 0.6, 0.5, 100.0, 2);
    let [mut shifted, mut kept] = [Condensed::new(), Condensed::new()];
    let mut solution = shifted.solve(&ocp).unwrap();
    kept.solve(&ocp).unwrap();
    assert_eq!(kept.solve(&ocp).unwrap().iterations, 0);
    let mut counts = [0; 3];
    let mut moved = ocp.clone();
    for _ in 0..10 {
        moved.x0 = solution.x[1].clone();
        shifted.shift();
        let solutions = [&mut shifted, &mut kept, &mut Condensed::new()].map(|solver| solver.solve(&moved).unwrap());
        for (count, other) in counts.iter_mut().zip(&solutions) {
            assert!(difference(&solutions[2].u, &other.u) < 1e-9);
            *count += other.iterations;
        }
        solution = solutions[0].clone();
    }
    let [of_shifted, of_kept, of_fresh] = counts;
    assert!(2 * of_shifted < of_kept && of_kept < of_fresh, "{counts:?}");
}

/// Inputs whose bounds coincide, rows of no price, rows without a limit.
#[test]
fn fixed_inputs_and_idle_rows() {
    let mut ocp = chain(2, 6, 0.5, 0.8, 30.0, 4);
    (ocp.stages[2].lower[1], ocp.stages[2].upper[1]) = (0.25, 0.25);
    (ocp.stages[0].lower[0], ocp.stages[0].upper[0]) = (-0.1, -0.1);
    ocp.stages[3].rows.weights[1] = 0.0;
    ocp.stages[3].rows.limits[2] = f64::INFINITY;
    for solution in both("fixed", &ocp) {
        assert!(solution.u[2][1] == 0.25 && solution.u[0][0] == -0.1);
        assert!(solution.multipliers[3][1] == 0.0 && solution.multipliers[3][2] == 0.0);
    }
}

/// x₁ = x₀ + u with |u| ≤ 1 from 5 cannot be below 2: by 2, because of the lower bound.
#[test]
fn contradictions_are_found() {
    let mut ocp = chain(1, 3, 4.0, 1.0, f64::INFINITY, 0);
    ocp.x0 = vec![5.0, 0.0];
    ocp.rows_final = Rows::none(2, 0);
    for stage in &mut ocp.stages {
        stage.a = Mat::identity(2, 2);
        stage.b = Mat::from_fn(2, 1, |i, _| [1.0, 0.0][i]);
        stage.rows = Rows::none(2, 1);
    }
    ocp.stages[1].rows = Rows {
        gx: Mat::from_fn(1, 2, |_, j| [1.0, 0.0][j]),
        gu: Mat::zeros(1, 1),
        limits: vec![2.0],
        weights: vec![f64::INFINITY],
    };
    let expected = [OcpConstraint::Row { stage: 1, row: 0 }, OcpConstraint::Lower { stage: 0, input: 0 }];
    for solver in [&mut Condensed::new() as &mut dyn OcpSolver, &mut Riccati::new()] {
        let Err(OcpError::Infeasible { constraints, by }) = solver.solve(&ocp) else { panic!("not found") };
        assert_eq!(constraints, expected);
        assert!((by - 2.0).abs() < 1e-6, "{by}");
        let mut soft = ocp.clone();
        soft.stages[1].rows.weights[0] = 1e3;
        let solution = solver.solve(&soft).unwrap();
        assert!((solution.violations[1][0] - 2.0).abs() < 1e-9 && solution.multipliers[1][0] == 1e3);
    }
}

#[test]
fn bad_input() {
    let ocp = chain(2, 3, 1.0, 1.0, 10.0, 0);
    let error = |change: &dyn Fn(&mut Ocp)| {
        let mut bad = ocp.clone();
        change(&mut bad);
        let [a, b] = [Condensed::new().solve(&bad).unwrap_err(), Riccati::new().solve(&bad).unwrap_err()];
        assert_eq!(a, b);
        a
    };
    let size = |array, stage, found, expected| OcpError::Size { array, stage, found, expected };
    assert_eq!(error(&|ocp| ocp.stages.clear()), OcpError::Empty { stages: 0, inputs: 0 });
    assert_eq!(error(&|ocp| ocp.stages[1].a = Mat::zeros(4, 3)), size("a", 1, (4, 3), (4, 4)));
    assert_eq!(error(&|ocp| ocp.stages[2].b = Mat::zeros(4, 1)), size("b", 2, (4, 1), (4, 2)));
    assert_eq!(error(&|ocp| ocp.stages[1].upper.truncate(1)), size("upper", 1, (1, 1), (2, 1)));
    assert_eq!(error(&|ocp| ocp.stages[1].rows.weights.truncate(3)), size("weights", 1, (3, 1), (8, 1)));
    assert_eq!(error(&|ocp| ocp.rows_final.gx = Mat::zeros(7, 4)), size("gx", 3, (7, 4), (8, 4)));
    let infinite = OcpError::NotFinite { array: "q", stage: 1, row: 2, column: 3, value: f64::INFINITY };
    assert_eq!(error(&|ocp| ocp.stages[1].q[(2, 3)] = f64::INFINITY), infinite);
    let weight = OcpError::NegativeWeight { stage: 3, row: 5, weight: -2.0 };
    assert_eq!(error(&|ocp| ocp.rows_final.weights[5] = -2.0), weight);
    let crossed = OcpError::CrossedBounds { stage: 1, input: 1, lower: 3.0, upper: 1.0 };
    assert_eq!(error(&|ocp| ocp.stages[1].lower[1] = 3.0), crossed);
    // the last input acts on nothing that costs
    let flat = |ocp: &mut Ocp| {
        ocp.stages[2].r[(1, 1)] = 0.0;
        ocp.stages[2].b.as_mut().col_mut(1).fill(0.0);
    };
    assert_eq!(error(&flat), OcpError::NotConvex { stage: 2, input: 1 });
}

/// The choice depends on sizes alone, and both methods stand behind it.
#[test]
fn choice() {
    let count = |ocp: &Ocp| choose(ocp.stages.len(), ocp.nx(), ocp.nu()).solve(ocp).unwrap().iterations;
    let (short, long) = (chain(2, 10, 0.6, 0.5, 100.0, 1), chain(2, 400, 0.6, 0.5, 100.0, 1));
    assert_eq!(count(&short), Condensed::new().solve(&short).unwrap().iterations);
    assert_eq!(count(&long), Riccati::new().solve(&long).unwrap().iterations);
}
