//! Both methods for problems of optimal control.

use crate::ocp_cases::random;
use crate::ocp_checks::{difference, kkt_error, oracle};
use pliant_control::ocp::{Condensed, OcpSolver, Riccati};

#[test]
fn conditions_of_optimality_and_agreement() {
    let mut iters = 0;
    for seed in 0..200 {
        let ocp = random(seed);
        let condensed = Condensed::new().solve(&ocp).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let riccati = Riccati::new().solve(&ocp);
        let riccati = match riccati {
            Ok(r) => r,
            Err(error) => {
                println!("FAIL seed {seed}: {error}");
                continue;
            }
        };
        iters = iters.max(riccati.iterations);
        let (a, b, c) = (kkt_error(&ocp, &condensed), kkt_error(&ocp, &riccati), difference(&condensed.u, &riccati.u));
        println!("ocp {seed} {a:e} {b:e} {c:e} it {}", riccati.iterations);
    }
    println!("max its {iters}");
}

#[test]
fn agree_with_clarabel() {
    for seed in 0..200 {
        let ocp = random(seed);
        let condensed = Condensed::new().solve(&ocp).unwrap();
        let (u, cost) = oracle(&ocp);
        println!("clar {seed} {:e} {:e}", (condensed.cost - cost).abs() / (1.0 + cost.abs()), difference(&condensed.u, &u));
    }
}

#[test]
fn dbg() {
    let seed: u64 = std::env::var("SEED").unwrap().parse().unwrap();
    Riccati::new().solve(&random(seed)).unwrap();
}
