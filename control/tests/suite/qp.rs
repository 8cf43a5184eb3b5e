//! The dual active-set method.

use crate::qp_cases::Case;
use faer::Mat;
use pliant_control::qp::{ActiveSet, Constraint, QpError};
use std::ops::Range;

/// Seeds looked at during development, and seeds that were run once when all was done.
const SEEDS: Range<u64> = 0..200;
const FRESH: Range<u64> = 30000..31000;

#[test]
fn conditions_of_optimality() {
    for seed in SEEDS.chain(FRESH) {
        let case = Case::random(seed, 5.0);
        let solution = ActiveSet::new().solve(&case.qp()).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let error = case.kkt_error(&solution);
        assert!(error < 1e-9, "seed {seed}: {error:e}");
    }
}

/// z within what Clarabel's gap of 1e-11 leaves of it: |z − z*|²_H is up to twice the error of the cost.
#[test]
fn agrees_with_clarabel() {
    for seed in SEEDS {
        let case = Case::random(seed, 2.0);
        let solution = ActiveSet::new().solve(&case.qp()).unwrap();
        let (z, cost) = case.oracle();
        let size = cost.abs() + 1.0;
        assert!((solution.cost - cost).abs() < 1e-9 * size, "seed {seed}: {} {cost}", solution.cost);
        let off = z.iter().zip(&solution.z).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
        let most = z.iter().fold(1.0, |most: f64, z| most.max(z.abs()));
        assert!(off < 1e-7 * most, "seed {seed}: {off:e}");
    }
}

/// A problem of many variables whose bounds nearly all act, where sets of bounds are guessed.
#[test]
fn many_bounds() {
    let n = 150;
    let h = Mat::from_fn(n, n, |i, j| if i == j { 1.3 } else { 0.9 / (1.0 + (i as f64 - j as f64).abs()) });
    let g: Vec<f64> = (0..n).map(|i| 20.0 * (0.7 * i as f64).sin()).collect();
    let (c, limits) = (Mat::from_fn(1, n, |_, _| 1.0), vec![-3.0]);
    let h = &h * h.transpose();
    let case = Case { h, g, lower: vec![-1.0; n], upper: vec![1.0; n], c, limits, weights: vec![f64::INFINITY] };
    let solution = ActiveSet::new().solve(&case.qp()).unwrap();
    assert!(case.kkt_error(&solution) < 1e-9);
    assert!(solution.bounds.iter().filter(|bound| **bound != 0.0).count() > n / 2);
}

/// One vertex with 30 rows through it, of which two would do, each row three times, scaled, and as an equation.
#[test]
fn degenerate_and_duplicate_rows() {
    let angle = |i: usize| 0.1 + 0.04 * (i / 3) as f64;
    let scale = |i: usize| [1.0, 1.0, 1e3][i % 3];
    let mut c = Mat::from_fn(92, 2, |i, j| scale(i) * if j == 0 { angle(i).cos() } else { angle(i).sin() });
    let vertex = [0.3, -0.7];
    for (row, sign) in [(90, 1.0), (91, -1.0)] {
        (c[(row, 0)], c[(row, 1)]) = (sign, -sign);
    }
    let limits: Vec<f64> = (0..92).map(|i| c[(i, 0)] * vertex[0] + c[(i, 1)] * vertex[1]).collect();
    let case = Case {
        h: Mat::identity(2, 2),
        g: vec![-5.0, -4.0],
        lower: vec![f64::NEG_INFINITY, -0.7],
        upper: vec![0.3, f64::INFINITY],
        c,
        limits,
        weights: vec![f64::INFINITY; 92],
    };
    let solution = ActiveSet::new().solve(&case.qp()).unwrap();
    assert!((solution.z[0] - 0.3).abs() < 1e-12 && (solution.z[1] + 0.7).abs() < 1e-12, "{:?}", solution.z);
    assert!(case.kkt_error(&solution) < 1e-12);
}

/// Random problems with a hard row that contradicts a combination of hard rows and bounds with positive factors, by 1. The constraints
/// reported have no common point, and without any one of them they have; without the first, the least violation of it is as reported.
#[test]
fn contradictions_are_found() {
    let mut found = 0;
    for seed in SEEDS {
        let mut case = Case::random(seed, 2.0);
        let (n, m) = (case.g.len(), case.limits.len());
        let hard: Vec<usize> = (0..m).filter(|&i| case.weights[i].is_infinite()).take(3).collect();
        let bounds: Vec<usize> = (0..n).filter(|&j| case.upper[j].is_finite()).take(2).collect();
        if hard.is_empty() && bounds.is_empty() {
            continue;
        }
        let mut c = Mat::from_fn(m + 1, n, |i, j| if i < m { case.c[(i, j)] } else { 0.0 });
        let mut limit = -1.0;
        for (position, &i) in hard.iter().enumerate() {
            let factor = 1.0 + position as f64;
            (0..n).for_each(|j| c[(m, j)] -= factor * case.c[(i, j)]);
            limit -= factor * case.limits[i];
        }
        for &j in &bounds {
            c[(m, j)] -= 0.5;
            limit -= 0.5 * case.upper[j];
        }
        case.c = c;
        case.limits.push(limit);
        case.weights.push(f64::INFINITY);
        let Err(QpError::Infeasible { constraints, by }) = ActiveSet::new().solve(&case.qp()) else {
            panic!("seed {seed}: the contradiction was not found");
        };
        let only = |kept: &[Constraint]| {
            let mut part = case.clone();
            let keeps = |constraint| kept.contains(&constraint);
            for j in 0..n {
                part.lower[j] = if keeps(Constraint::Lower(j)) { part.lower[j] } else { f64::NEG_INFINITY };
                part.upper[j] = if keeps(Constraint::Upper(j)) { part.upper[j] } else { f64::INFINITY };
            }
            for i in 0..=m {
                part.limits[i] = if keeps(Constraint::Row(i)) { part.limits[i] } else { f64::INFINITY };
            }
            part
        };
        assert!(matches!(ActiveSet::new().solve(&only(&constraints).qp()), Err(QpError::Infeasible { .. })), "seed {seed}");
        for skipped in 0..constraints.len() {
            let mut kept = constraints.clone();
            kept.remove(skipped);
            assert!(ActiveSet::new().solve(&only(&kept).qp()).is_ok(), "seed {seed}: without {skipped} of {constraints:?}");
        }
        if let Constraint::Row(first) = constraints[0] {
            let mut soft = only(&constraints);
            soft.weights[first] = 1e7;
            let solution = ActiveSet::new().solve(&soft.qp()).unwrap();
            let value: f64 = (0..n).map(|j| soft.c[(first, j)] * solution.z[j]).sum();
            assert!((value - soft.limits[first] - by).abs() < 1e-6 * by, "seed {seed}: {by} {}", value - soft.limits[first]);
        }
        found += 1;
    }
    assert!(found > 150, "{found}");
}

/// At weights above the hard rows' multipliers soft rows hold exactly, with the same solution; at half of them they are violated at a
/// multiplier that is the weight.
#[test]
fn soft_rows_are_exact() {
    let (mut held, mut violated) = (0, 0);
    for seed in SEEDS {
        let mut case = Case::random(seed, 2.0);
        case.weights.fill(f64::INFINITY);
        let Ok(hard) = ActiveSet::new().solve(&case.qp()) else { continue };
        let most = hard.multipliers.iter().copied().fold(0.0, f64::max);
        if most < 1e-3 {
            continue;
        }
        let mut soft = case.clone();
        soft.weights.fill(1.5 * most);
        let solution = ActiveSet::new().solve(&soft.qp()).unwrap();
        let off = solution.z.iter().zip(&hard.z).fold(0.0, |off: f64, (a, b)| off.max((a - b).abs()));
        let size = hard.z.iter().fold(1.0, |size: f64, z| size.max(z.abs()));
        assert!(off < 1e-9 * size, "seed {seed}: {off:e}");
        assert!(case.kkt_error(&solution) < 1e-9, "seed {seed}: the hard problem's conditions");
        held += 1;
        soft.weights.fill(0.5 * most);
        let solution = ActiveSet::new().solve(&soft.qp()).unwrap();
        assert!(soft.kkt_error(&solution) < 1e-9);
        violated += solution.multipliers.iter().filter(|multiplier| **multiplier == 0.5 * most).count();
    }
    assert!(held > 70 && violated > 100, "{held} {violated}");
}

#[test]
fn warm_starts() {
    let (mut cold, mut warm) = (0, 0);
    for seed in SEEDS {
        let case = Case::random(seed, 2.0);
        let mut solver = ActiveSet::new();
        let first = solver.solve(&case.qp()).unwrap();
        let again = solver.solve(&case.qp()).unwrap();
        assert_eq!(again.iterations, 0, "seed {seed}: the working set fits");
        let mut moved = case.clone();
        moved.g.iter_mut().enumerate().for_each(|(j, g)| *g += 1e-2 * ((j % 3) as f64 - 1.0));
        moved.h[(0, 0)] *= 1.01;
        let from_last = solver.solve(&moved.qp()).unwrap();
        let from_none = ActiveSet::new().solve(&moved.qp()).unwrap();
        let size = first.z.iter().fold(1.0, |size: f64, z| size.max(z.abs()));
        for ((a, b), (c, d)) in first.z.iter().zip(&again.z).zip(from_last.z.iter().zip(&from_none.z)) {
            assert!((a - b).abs() < 1e-9 * size && (c - d).abs() < 1e-9 * size, "seed {seed}");
        }
        cold += from_none.iterations;
        warm += from_last.iterations;
    }
    assert!(10 * warm < cold, "{warm} {cold}");
}

/// Rows, limits and weights change between problems of one size: the memory of the last one must not be taken for the next one.
#[test]
fn other_problems_of_the_same_size() {
    let mut solver = ActiveSet::new();
    let case = Case::random(17, 2.0);
    let (n, m) = (case.g.len(), case.limits.len());
    assert!(m > 0);
    for seed in SEEDS {
        let other = Case::random(seed, 2.0);
        let mut next = case.clone();
        let (rows, columns) = (other.c.nrows().min(m), other.c.ncols().min(n));
        for i in 0..rows {
            (0..columns).for_each(|j| next.c[(i, j)] = other.c[(i, j)]);
            next.limits[i] = if i % 7 == 0 { f64::INFINITY } else { other.limits[i] };
        }
        for (i, weight) in next.weights.iter_mut().enumerate() {
            *weight = [0.0, 0.3, 5.0, 40.0][(i + seed as usize) % 4];
        }
        if seed % 3 == 0 {
            next.lower.fill(f64::NEG_INFINITY);
        }
        let solution = solver.solve(&next.qp()).unwrap();
        let fresh = ActiveSet::new().solve(&next.qp()).unwrap();
        assert!(next.kkt_error(&solution) < 1e-9, "seed {seed}");
        let size = fresh.z.iter().fold(1.0, |size: f64, z| size.max(z.abs()));
        assert!(fresh.z.iter().zip(&solution.z).all(|(a, b)| (a - b).abs() < 1e-8 * size), "seed {seed}");
    }
}

#[test]
fn solutions_are_the_same_to_the_last_bit() {
    for seed in 0..20 {
        let case = Case::random(seed, 4.0);
        let (a, b) = (ActiveSet::new().solve(&case.qp()).unwrap(), ActiveSet::new().solve(&case.qp()).unwrap());
        assert!(a.z == b.z && a.multipliers == b.multipliers && a.cost == b.cost && a.iterations == b.iterations);
    }
}

#[test]
fn bad_input() {
    let case = Case {
        h: Mat::identity(2, 2),
        g: vec![1.0, 2.0],
        lower: vec![-1.0; 2],
        upper: vec![1.0; 2],
        c: Mat::from_fn(1, 2, |_, j| j as f64),
        limits: vec![1.0],
        weights: vec![1.0],
    };
    let error = |change: &dyn Fn(&mut Case)| {
        let mut bad = case.clone();
        change(&mut bad);
        ActiveSet::new().solve(&bad.qp()).unwrap_err()
    };
    let size = |array, of, found, expected| QpError::Size { array, of, found, expected };
    assert_eq!(error(&|case| case.g.push(0.0)), size("gradient", "entries", 3, 2));
    assert_eq!(error(&|case| case.h = Mat::zeros(2, 3)), size("hessian", "columns", 3, 2));
    assert_eq!(error(&|case| case.weights.clear()), size("weights", "entries", 0, 1));
    assert_eq!(error(&|case| case.limits.push(0.0)), size("rows", "rows", 1, 2));
    let places = |array, row, column, value| QpError::NotFinite { array, row, column, value };
    assert_eq!(error(&|case| case.c[(0, 1)] = f64::INFINITY), places("rows", 0, 1, f64::INFINITY));
    assert_eq!(error(&|case| case.h[(1, 0)] = f64::INFINITY), places("hessian", 1, 0, f64::INFINITY));
    assert_eq!(error(&|case| case.lower[1] = f64::INFINITY), places("lower", 1, 0, f64::INFINITY));
    assert_eq!(error(&|case| case.limits[0] = f64::NEG_INFINITY), places("limits", 0, 0, f64::NEG_INFINITY));
    assert!(matches!(error(&|case| case.g[1] = f64::NAN), QpError::NotFinite { array: "gradient", row: 1, .. }));
    assert_eq!(error(&|case| case.weights[0] = -1.0), QpError::NegativeWeight { row: 0, weight: -1.0 });
    assert_eq!(error(&|case| case.lower[1] = 2.0), QpError::CrossedBounds { variable: 1, lower: 2.0, upper: 1.0 });
    assert_eq!(error(&|case| case.h[(1, 1)] = 0.0), QpError::NotPositiveDefinite { pivot: 1 });
    // large numbers are no numbers that are not finite
    let mut large = case.clone();
    (large.c[(0, 1)], large.limits[0]) = (1e200, 1e200);
    assert!(ActiveSet::new().solve(&large.qp()).is_ok());
    // and after an error the solver goes on
    let mut solver = ActiveSet::new();
    let mut singular = case.clone();
    singular.h[(1, 1)] = 0.0;
    assert!(solver.solve(&singular.qp()).is_err());
    assert!(case.kkt_error(&solver.solve(&case.qp()).unwrap()) < 1e-12);
}

/// No variables, and no rows.
#[test]
fn nothing_to_decide() {
    let case = Case {
        h: Mat::new(),
        g: vec![],
        lower: vec![],
        upper: vec![],
        c: Mat::zeros(1, 0),
        limits: vec![1.0],
        weights: vec![1.0],
    };
    assert_eq!(ActiveSet::new().solve(&case.qp()).unwrap().cost, 0.0);
    let contradicted = Case { limits: vec![-1.0], weights: vec![f64::INFINITY], ..case };
    let expected = QpError::Infeasible { constraints: vec![Constraint::Row(0)], by: 1.0 };
    assert_eq!(ActiveSet::new().solve(&contradicted.qp()).unwrap_err(), expected);
}
