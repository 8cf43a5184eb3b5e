//! The dual active-set method.

use crate::qp_cases::Case;
use pliant_control::qp::ActiveSet;

#[test]
fn conditions_of_optimality() {
    let mut worst = (0.0, 0);
    for seed in 0..200 {
        let case = Case::random(seed, 5.0);
        let solution = ActiveSet::new().solve(&case.qp()).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let error = case.kkt_error(&solution);
        if error > worst.0 {
            worst = (error, seed);
        }
    }
    println!("worst {worst:?}");
    assert!(worst.0 < 1e-9, "{worst:?}");
}

/// z within what Clarabel's gap of 1e-11 leaves of it: |z − z*|²_H is up to twice the error of the cost.
#[test]
fn agrees_with_clarabel() {
    for seed in 0..200 {
        let case = Case::random(seed, 2.0);
        let solution = ActiveSet::new().solve(&case.qp()).unwrap();
        let (z, cost) = case.oracle();
        let size = cost.abs() + 1.0;
        assert!((solution.cost - cost).abs() < 1e-8 * size, "seed {seed}: {} {cost}", solution.cost);
        let off = z.iter().zip(&solution.z).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
        let most = z.iter().fold(1.0, |most: f64, z| most.max(z.abs()));
        println!("{:e} {:e}", (solution.cost - cost).abs() / size, off / most);
    }
}
