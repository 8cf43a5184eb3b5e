//! Conformal bounds: coverage, refusals, what they say.

use faer::Mat;
use pliant_control::conformal::{ConformalError, Coverage, conformal_bound, scaled_score, score};
use rand::RngExt;
use rand_pcg::Pcg64;

use crate::problems::generator;

const HORIZON: usize = 8;

/// Scores of a run whose transitions depend on each other: a common factor of heavy tail, a state that grows.
fn run(rng: &mut Pcg64) -> Vec<f64> {
    let factor = rng.random_range(0.0_f64..1.0).powi(-1).sqrt();
    (0..HORIZON).map(|t| factor * (1.0 + 0.1 * t as f64) * rng.random_range(0.0..1.0)).collect()
}

/// Bounds of a binomial share within ± z standard errors.
fn interval(p: f64, count: usize, z: f64) -> (f64, f64) {
    let width = z * (p * (1.0 - p) / count as f64).sqrt();
    (p - width, p + width)
}

#[test]
fn trajectories_are_covered_as_often_as_stated() {
    let (repetitions, calibration, delta) = (500, 79, 0.1);
    let mut rng = generator(100);
    let mut covered = 0;
    for _ in 0..repetitions {
        let runs: Vec<Vec<f64>> = (0..calibration).map(|_| run(&mut rng)).collect();
        let bound = conformal_bound(&runs, delta, HORIZON, Coverage::Trajectory, false).unwrap();
        assert_eq!(bound.rank, 72);
        covered += usize::from(run(&mut rng).iter().all(|s| *s <= bound.radius));
    }
    // scores without ties are covered with exactly r/(n + 1) = 0.9; three standard errors are exceeded once in 370 seeds
    let (low, high) = interval(72.0 / 80.0, repetitions, 3.0);
    let share = covered as f64 / repetitions as f64;
    assert!((low..=high).contains(&share), "{share} outside [{low}, {high}]");
}

#[test]
fn independent_transitions_are_covered_by_the_union_bound() {
    let (repetitions, delta) = (500, 0.2);
    let mut rng = generator(101);
    let mut covered = 0;
    for _ in 0..repetitions {
        let transitions: Vec<Vec<f64>> = (0..79).map(|_| vec![rng.random_range(0.0..1.0)]).collect();
        let bound = conformal_bound(&transitions, delta, HORIZON, Coverage::Transitions, false).unwrap();
        covered += usize::from((0..HORIZON).all(|_| rng.random_range(0.0..1.0) <= bound.radius));
    }
    // at least 1 − δ, and at most what 8 independent steps under the second-largest of 79 scores have: E[q⁸] = 78/80 · 79/81 … < 0.86
    let share = covered as f64 / repetitions as f64;
    let exact = (0..HORIZON).fold(1.0, |p, t| p * (78 + t) as f64 / (80 + t) as f64);
    let (low, high) = interval(exact, repetitions, 3.0);
    assert!((low..=high).contains(&share) && share > 1.0 - delta - 3.0 * 0.018, "{share} outside [{low}, {high}]");
}

#[test]
fn too_few_scores_are_refused_with_the_number_needed() {
    let constant = |count: usize| vec![vec![1.0; 20]; count];
    for (delta, horizon, coverage, needed) in [
        (0.05, 20, Coverage::Trajectory, 19),
        (0.1, 20, Coverage::Trajectory, 9),
        (0.05, 20, Coverage::Transitions, 399),
        (0.1, 20, Coverage::Transitions, 199),
        (0.1, 10, Coverage::Transitions, 99),
    ] {
        let runs = |count: usize| match coverage {
            Coverage::Trajectory => constant(count),
            Coverage::Transitions => vec![vec![1.0]; count],
        };
        let refused = conformal_bound(&runs(needed - 1), delta, horizon, coverage, false);
        assert_eq!(refused, Err(ConformalError::TooFew { given: needed - 1, needed, delta, horizon, coverage }));
        let bound = conformal_bound(&runs(needed), delta, horizon, coverage, false).unwrap();
        assert_eq!(bound.rank, needed);
    }
    assert!(matches!(conformal_bound(&[], 0.1, 5, Coverage::Trajectory, false), Err(ConformalError::TooFew { given: 0, .. })));
}

#[test]
fn inputs_are_checked() {
    let runs = vec![vec![0.1, 0.2, 0.3]; 30];
    let bound = |runs: &[Vec<f64>], delta, horizon| conformal_bound(runs, delta, horizon, Coverage::Trajectory, false);
    assert_eq!(bound(&runs, 0.1, 4), Err(ConformalError::Short { run: 0, length: 3, horizon: 4 }));
    assert!(matches!(bound(&runs, 0.0, 3), Err(ConformalError::Level { .. })));
    assert!(matches!(bound(&runs, 0.1, 0), Err(ConformalError::Level { .. })));
    let mut wrong = runs.clone();
    wrong[7][1] = f64::NAN;
    assert!(matches!(bound(&wrong, 0.1, 3), Err(ConformalError::Score { run: 7, transition: 1, .. })));
    // transitions beyond the horizon do not count
    let mut longer = runs;
    longer.iter_mut().for_each(|run| run.push(5.0));
    assert_eq!(bound(&longer, 0.1, 3).unwrap().radius, 0.3);
}

#[test]
fn scales_make_the_radius_depend_on_the_state() {
    let l = Mat::from_fn(2, 2, |r, c| [[2.0, 0.0], [1.0, 0.5]][r][c]);
    let w = [0.6, -0.8];
    let residual = [2.0 * w[0], w[0] + 0.5 * w[1]];
    assert!((scaled_score(&residual, &l).unwrap() - 1.0).abs() < 1e-15);
    assert!((score(&residual) - 1.2_f64.hypot(0.2)).abs() < 1e-15);
    let upper = Mat::from_fn(2, 2, |r, c| [[2.0, 0.1], [1.0, 0.5]][r][c]);
    assert!(matches!(scaled_score(&residual, &upper), Err(ConformalError::Scale { row: 0, column: 1, .. })));
    let singular = Mat::from_fn(2, 2, |r, c| [[2.0, 0.0], [1.0, 0.0]][r][c]);
    assert!(matches!(scaled_score(&residual, &singular), Err(ConformalError::Scale { row: 1, column: 1, .. })));
    assert!(matches!(scaled_score(&[1.0], &l), Err(ConformalError::Scale { size: 1, .. })));

    let bound = conformal_bound(&vec![vec![3.0]; 9], 0.1, 1, Coverage::Trajectory, true).unwrap();
    assert_eq!(bound.scaled_columns(&l), Mat::from_fn(2, 2, |r, c| 3.0 * l[(r, c)]));
    assert_eq!(bound.columns(2)[(1, 1)], 3.0);
    let statement = bound.statement();
    for part in ["0.9", "all 1 errors", "score 9 of 9 runs", "exchangeable", "L(x, u)"] {
        assert!(statement.contains(part), "{statement}");
    }
}
