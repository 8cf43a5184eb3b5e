//! Responses, tightenings, policies of given multipliers.

use faer::Mat;
use pliant_control::ocp::{Ocp, Rows};
use pliant_control::tube::{
    Ball, Column, Disturbance, EllipsoidalTube, ExactTube, Gains, Reach, RowValues, Scaling, SharedGainTube, Tube, TubeError,
    TubePolicy, TubeProblem, TubeSynthesis,
};
use rand::RngExt;

use crate::problems::{box_rows, direction, generator, identity, invariant, random, tube_cost, varying};
use crate::reference::Reference;
use pliant_control::tube::{RobustOptions, robust};

const NX: usize = 4;
const NU: usize = 2;
const N: usize = 6;

/// Rows that bind states, inputs and both at once, so that cross terms matter.
fn problem_with_rows(seed: u64) -> (Ocp, Disturbance) {
    let mut ocp = varying(seed, NX, NU, N);
    let mut rng = generator(seed + 1000);
    for stage in &mut ocp.stages {
        stage.rows = Rows {
            gx: random(&mut rng, 3, NX, 1.0),
            gu: random(&mut rng, 3, NU, 1.0),
            limits: vec![0.35; 3],
            weights: vec![50.0; 3],
        };
        stage.lower = vec![-3.0; NU];
        stage.upper = vec![3.0; NU];
    }
    ocp.rows_final = box_rows(NX, NU, 1.5, 50.0);
    let disturbance = Disturbance::new((0..=N).map(|j| random(&mut rng, NX, if j % 2 == 0 { 2 } else { NX }, 0.05)));
    (ocp, disturbance)
}

/// The tube after two rounds of weights from the multipliers of the tightened problem.
fn weighted_tube(ocp: &Ocp, disturbance: &Disturbance, synthesis: &dyn TubeSynthesis) -> Tube {
    let options = RobustOptions { iterations: 3, ..RobustOptions::default() };
    let cost = tube_cost(NX, NU, 0.1, 0.01, 0.3);
    let solution = robust(ocp, disturbance, &cost, &mut Reference::default(), synthesis, &options).unwrap();
    let active = solution.nominal.multipliers.iter().flatten().filter(|mu| **mu > 1e-3).count();
    assert!(active > 1, "no row is active: the weights are not tested");
    solution.tube
}

fn columns(tube: &Tube) -> &[Column] {
    match &tube.reach {
        Reach::Columns(columns) => columns,
        _ => panic!("no columns"),
    }
}

/// States of the policy of a tube under disturbances, by simulation of the deviations.
fn simulate(ocp: &Ocp, disturbance: &Disturbance, gains: &Gains, w: &[Vec<f64>]) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let zero_x = vec![vec![0.0; NX]; ocp.stages.len() + 1];
    let zero_u = vec![vec![0.0; NU]; ocp.stages.len()];
    let mut policy = TubePolicy::new(ocp, &zero_x, &zero_u, gains.clone()).unwrap();
    let kick = |j: usize| -> Vec<f64> {
        let e = &disturbance.balls[j][0].columns;
        (0..NX).map(|r| (0..e.ncols()).map(|c| e[(r, c)] * w[j][c]).sum()).collect()
    };
    let (mut x, mut u) = (vec![kick(0)], Vec::new());
    for (k, stage) in ocp.stages.iter().enumerate() {
        u.push(policy.control(k, &x[k]).unwrap());
        let moved = |r: usize| {
            let a: f64 = (0..NX).map(|c| stage.a[(r, c)] * x[k][c]).sum();
            a + (0..NU).map(|c| stage.b[(r, c)] * u[k][c]).sum::<f64>()
        };
        x.push(kick(k + 1).iter().enumerate().map(|(r, kick)| kick + moved(r)).collect());
    }
    (x, u)
}

fn row_value(rows: &Rows, i: usize, x: &[f64], u: &[f64]) -> f64 {
    let of_u: f64 = u.iter().enumerate().map(|(c, u)| rows.gu[(i, c)] * u).sum();
    x.iter().enumerate().map(|(c, x)| rows.gx[(i, c)] * x).sum::<f64>() + of_u
}

/// Largest excess over the tightenings of any row or input.
fn excess(ocp: &Ocp, h: &RowValues, x: &[Vec<f64>], u: &[Vec<f64>]) -> f64 {
    let mut worst = f64::NEG_INFINITY;
    for k in 0..=N {
        let rows = ocp.stages.get(k).map_or(&ocp.rows_final, |stage| &stage.rows);
        let u = u.get(k).map_or(&[][..], Vec::as_slice);
        for i in 0..rows.len() {
            worst = worst.max(row_value(rows, i, &x[k], u) - h.rows(k)[i]);
        }
        for (u, h) in u.iter().zip(h.inputs(k)) {
            worst = worst.max(u.abs() - h);
        }
    }
    worst
}

#[test]
fn responses_are_achievable() {
    let (ocp, disturbance) = problem_with_rows(1);
    let exact = weighted_tube(&ocp, &disturbance, &ExactTube);
    assert!(exact.gains.first_shared() > 0);
    for tube in [exact, weighted_tube(&ocp, &disturbance, &SharedGainTube)] {
        for (j, column) in columns(&tube).iter().enumerate() {
            assert_eq!(column.x[0], disturbance.balls[j][0].columns);
            for (k, stage) in ocp.stages.iter().enumerate().skip(j) {
                let residual = &column.x[k + 1 - j] - &stage.a * &column.x[k - j] - &stage.b * &column.u[k - j];
                assert!(residual.norm_max() < 1e-12);
                let answered = &column.u[k - j] - tube.gains.get(k, j) * &column.x[k - j];
                assert!(answered.norm_max() < 1e-12);
            }
        }
    }
}

#[test]
fn trajectories_stay_within_and_the_worst_one_touches() {
    let (ocp, disturbance) = problem_with_rows(2);
    for synthesis in [&ExactTube as &dyn TubeSynthesis, &SharedGainTube] {
        let tube = weighted_tube(&ocp, &disturbance, synthesis);
        let mut rng = generator(20);
        let sizes: Vec<usize> = disturbance.balls.iter().map(|balls| balls[0].columns.ncols()).collect();
        for sample in 0..2000 {
            let w: Vec<Vec<f64>> = match sample {
                // vertices: one axis, its sign alternating or not
                0..16 => (0..=N)
                    .map(|j| {
                        let sign =
                            if sample / 8 == 1 && j % 2 == 1 { -1.0 } else { 1.0 } * if sample % 2 == 0 { 1.0 } else { -1.0 };
                        (0..sizes[j]).map(|i| if i == (sample / 2) % sizes[j] { sign } else { 0.0 }).collect()
                    })
                    .collect(),
                _ => sizes.iter().map(|&n| direction(&mut rng, n)).collect(),
            };
            let (x, u) = simulate(&ocp, &disturbance, &tube.gains, &w);
            assert!(excess(&ocp, &tube.tightenings, &x, &u) < 1e-12);
        }
        let k = N - 2;
        let rows = &ocp.stages[k].rows;
        for i in 0..rows.len() {
            let worst: Vec<Vec<f64>> = (0..=N)
                .map(|j| {
                    if j > k {
                        return vec![0.0; sizes[j]];
                    }
                    let column = &columns(&tube)[j];
                    let row = &rows.gx * &column.x[k - j] + &rows.gu * &column.u[k - j];
                    let norm = (0..sizes[j]).map(|c| row[(i, c)].powi(2)).sum::<f64>().sqrt();
                    (0..sizes[j]).map(|c| row[(i, c)] / norm).collect()
                })
                .collect();
            let (x, u) = simulate(&ocp, &disturbance, &tube.gains, &worst);
            let gap = row_value(rows, i, &x[k], &u[k]) - tube.tightenings.rows(k)[i];
            assert!(gap.abs() < 1e-10, "row {i} misses its tightening by {gap}");
        }
    }
}

#[test]
fn the_policy_is_what_responses_predict() {
    let (ocp, disturbance) = problem_with_rows(3);
    let tube = weighted_tube(&ocp, &disturbance, &ExactTube);
    let mut rng = generator(30);
    let w: Vec<Vec<f64>> = disturbance.balls.iter().map(|balls| direction(&mut rng, balls[0].columns.ncols())).collect();
    let (x, u) = simulate(&ocp, &disturbance, &tube.gains, &w);
    for k in 0..N {
        for r in 0..NU {
            let of_column = |j: usize| w[j].iter().enumerate().map(|(c, w)| columns(&tube)[j].u[k - j][(r, c)] * w).sum::<f64>();
            assert!((u[k][r] - (0..=k).map(of_column).sum::<f64>()).abs() < 1e-10);
        }
        for r in 0..NX {
            let of_column = |j: usize| w[j].iter().enumerate().map(|(c, w)| columns(&tube)[j].x[k - j][(r, c)] * w).sum::<f64>();
            assert!((x[k][r] - (0..=k).map(of_column).sum::<f64>()).abs() < 1e-10);
        }
    }
    let mut policy = TubePolicy::new(&ocp, &x, &u, tube.gains).unwrap();
    let refused = policy.control(1, &x[1]);
    assert!(matches!(refused, Err(TubeError::Order { asked: 1, next: 0, .. })));
    assert_eq!(policy.control(0, &x[0]).unwrap(), u[0]);
}

#[test]
fn feedback_narrows_the_open_loop_tube() {
    let (ocp, disturbance) = problem_with_rows(4);
    let cost = tube_cost(NX, NU, 1.0, 0.01, 1.0);
    let problem = TubeProblem::new(&ocp, &disturbance, &cost).unwrap();
    let open = Tube::of_gains(&problem, Gains::shared(vec![Mat::zeros(NU, NX); N]));
    let closed = ExactTube.synthesize(&problem, &RowValues::zeros(&ocp), None).unwrap();
    assert!(closed.cost.unwrap() < 0.5 * open.cost.unwrap());
    for (open, closed) in open.tightenings.rows(N).iter().zip(closed.tightenings.rows(N)) {
        assert!(closed < open);
    }
}

#[test]
fn an_ellipsoid_contains_the_exact_tube_of_its_gains() {
    let (ocp, disturbance) = problem_with_rows(15);
    let cost = tube_cost(NX, NU, 0.1, 0.01, 0.3);
    let problem = TubeProblem::new(&ocp, &disturbance, &cost).unwrap();
    let ellipsoid = weighted_tube(&ocp, &disturbance, &EllipsoidalTube { scaling: Scaling::Bound });
    let exact = Tube::of_gains(&problem, ellipsoid.gains.clone());
    assert!((exact.cost.unwrap() - ellipsoid.cost.unwrap()).abs() < 1e-12 * exact.cost.unwrap());
    let mut strict = 0;
    for k in 0..=N {
        let pairs = |of: &RowValues| [of.rows(k), of.inputs(k)].concat();
        for (exact, upper) in pairs(&exact.tightenings).into_iter().zip(pairs(&ellipsoid.tightenings)) {
            // rounding under a root, where a row is answered entirely
            assert!(exact <= upper + 1e-9);
            assert!(upper <= ((k + 1) as f64).sqrt() * exact + 1e-9); // √n norm₂ ≤ √n norm₁
            strict += usize::from(exact < 0.99 * upper);
        }
    }
    assert!(strict > 10);
    // of one ball the two are the same
    let single = ellipsoid.tightenings.inputs(0).iter().zip(exact.tightenings.inputs(0));
    assert!(single.map(|(a, b)| (a - b).abs()).sum::<f64>() < 1e-12);
}

#[test]
fn few_columns_give_what_columns_of_zeros_give() {
    let (ocp, disturbance) = problem_with_rows(6);
    let padded = Disturbance::new(disturbance.balls.iter().map(|balls| {
        let e = &balls[0].columns;
        Mat::from_fn(NX, NX, |r, c| if c < e.ncols() { e[(r, c)] } else { 0.0 })
    }));
    for synthesis in [&ExactTube as &dyn TubeSynthesis, &SharedGainTube, &EllipsoidalTube { scaling: Scaling::Bound }] {
        let few = weighted_tube(&ocp, &disturbance, synthesis);
        let many = weighted_tube(&ocp, &padded, synthesis);
        for k in 0..=N {
            for (a, b) in few.tightenings.rows(k).iter().zip(many.tightenings.rows(k)) {
                assert!((a - b).abs() < 1e-10 * b);
            }
        }
    }
}

#[test]
fn results_do_not_depend_on_threads() {
    let (ocp, disturbance) = problem_with_rows(3);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| weighted_tube(&ocp, &disturbance, &ExactTube))
    };
    let (one, three) = (with(1), with(3));
    assert_eq!(one.tightenings, three.tightenings);
    assert_eq!(one.cost, three.cost);
}

#[test]
fn balls_of_one_time_add_and_shifts_move_the_centre() {
    let (mut ocp, _) = problem_with_rows(8);
    let mut rng = generator(80);
    let shift: Vec<f64> = (0..NX).map(|_| rng.random_range(-0.1..0.1)).collect();
    let (first, second) = (random(&mut rng, NX, 2, 0.05), random(&mut rng, NX, 1, 0.05));
    let single = |e: &Mat<f64>| Disturbance::new((0..=N).map(|_| e.clone()));
    let mut both = single(&first);
    for balls in &mut both.balls {
        balls.push(Ball { columns: second.clone(), shift: shift.clone() });
    }
    let cost = tube_cost(NX, NU, 1.0, 0.1, 1.0);
    let gains = {
        let problem = TubeProblem::new(&ocp, &both, &cost).unwrap();
        ExactTube.synthesize(&problem, &RowValues::zeros(&ocp), None).unwrap().gains
    };
    let tightenings = |disturbance: &Disturbance| {
        Tube::of_gains(&TubeProblem::new(&ocp, disturbance, &cost).unwrap(), gains.clone()).tightenings
    };
    let (sum, a, b) = (tightenings(&both), tightenings(&single(&first)), tightenings(&single(&second)));
    for k in 0..=N {
        for (i, sum) in sum.rows(k).iter().enumerate() {
            assert!((sum - a.rows(k)[i] - b.rows(k)[i]).abs() < 1e-14);
        }
    }

    // nominal rows get + g Φ shift: simulated through the policy about the trajectory without shifts
    let problem = TubeProblem::new(&ocp, &both, &cost).unwrap();
    let shifts = Tube::of_gains(&problem, gains.clone()).shifts(&problem);
    let centres = Disturbance::new((0..=N).map(|_| Mat::from_fn(NX, 1, |r, _| shift[r])));
    let (x, u) = simulate(&ocp, &centres, &gains, &vec![vec![1.0]; N + 1]);
    for (k, stage) in ocp.stages.iter().enumerate() {
        for (i, of_rows) in shifts.rows(k).iter().enumerate() {
            assert!((of_rows - row_value(&stage.rows, i, &x[k], &u[k])).abs() < 1e-12);
        }
    }

    // and through the dynamics about the centre: states of both descriptions are the same
    let centred = both.recentre(&ocp);
    for (a, b) in centred.x0.iter().zip(&ocp.x0).zip(&shift).map(|((a, b), s)| (a - b, s)) {
        assert!((a - b).abs() < 1e-15);
    }
    ocp.x0 = vec![0.0; NX];
    let roll = |ocp: &Ocp, u: &[Vec<f64>]| {
        let mut x = ocp.x0.clone();
        for (stage, u) in ocp.stages.iter().zip(u) {
            let next = |r: usize| {
                let of_u: f64 = (0..NU).map(|c| stage.b[(r, c)] * u[c]).sum();
                (0..NX).map(|c| stage.a[(r, c)] * x[c]).sum::<f64>() + of_u + stage.d[r]
            };
            x = (0..NX).map(next).collect();
        }
        x
    };
    let (through_centre, without) = (roll(&both.recentre(&ocp), &u), roll(&ocp, &vec![vec![0.0; NU]; N]));
    for r in 0..NX {
        assert!((through_centre[r] - without[r] - x[N][r]).abs() < 1e-12);
    }
}

/// P1: a linear pusher of closed form. States (actuator, object), force λ of the smoothed complementarity λ gap = κ at the end of the step.
#[test]
fn smoothing_of_the_linear_pusher_is_enclosed() {
    let (stiffness, mass, width, dt, kappa) = (1.0, 0.01, 0.1, 0.02, 1e-3);
    let (actuator, object) = (0.0, 0.2);
    let compliance = dt * dt / mass + 1.0 / stiffness;
    let cost = tube_cost(2, 1, 1.0, 1.0, 1.0);
    let (mut nearest, mut farthest): (f64, f64) = (2.0, 1.0);
    for n in 0..=400 {
        let u = -0.1 + 0.4 * n as f64 / 400.0;
        let gap: f64 = object - u - width;
        let root = (gap * gap + 4.0 * compliance * kappa).sqrt();
        let smoothed = (root - gap) / (2.0 * compliance);
        let rigid = (-gap / compliance).max(0.0);
        let after = |force: f64| [u - force / stiffness, object + force * dt * dt / mass];
        let (smooth, exact) = (after(smoothed), after(rigid));
        // −P⁻¹ Jᵀ (dλ/dκ) κ with J = (−1, 1)
        let column = Mat::from_fn(2, 1, |r, _| if r == 0 { 1.0 / stiffness } else { -dt * dt / mass } * kappa / root);
        let w = (exact[0] - smooth[0]) / column[(0, 0)];
        assert!((1.0..=2.0 + 1e-12).contains(&w), "w = {w} at u = {u}");
        assert!((exact[1] - smooth[1] - w * column[(1, 0)]).abs() < 1e-15);
        (nearest, farthest) = (nearest.min(w), farthest.max(w));

        let mut ocp = invariant(&identity(2, 0.0), &Mat::zeros(2, 1), 1, vec![actuator, object], [1.0, 1.0, 1.0], f64::INFINITY);
        ocp.stages[0].d = smooth.to_vec();
        ocp.rows_final = box_rows(2, 1, 1.0, f64::INFINITY);
        let disturbance = Disturbance { balls: vec![Vec::new(), vec![Ball::of_smoothing(&column)]] };
        let problem = TubeProblem::new(&ocp, &disturbance, &cost).unwrap();
        let h = ExactTube.synthesize(&problem, &RowValues::zeros(&ocp), None).unwrap().tightenings;
        let centre = &disturbance.recentre(&ocp).stages[0].d;
        for r in 0..2 {
            assert!((h.rows(1)[r] - 0.5 * column[(r, 0)].abs()).abs() < 1e-15);
            assert!((exact[r] - centre[r]).abs() <= h.rows(1)[r] * (1.0 + 1e-9));
        }
    }
    // the enclosure is used to its ends: towards 1 far from contact, 2 at grazing
    assert!(nearest < 1.06 && farthest > 2.0 - 1e-2, "w in [{nearest}, {farthest}]");
}

#[test]
fn sizes_and_numbers_are_checked() {
    let (ocp, disturbance) = problem_with_rows(9);
    let cost = tube_cost(NX, NU, 1.0, 1.0, 1.0);
    let mut short = disturbance.clone();
    short.balls.pop();
    assert!(matches!(TubeProblem::new(&ocp, &short, &cost), Err(TubeError::Size { what: "times of E", .. })));
    let mut wrong = disturbance.clone();
    wrong.balls[2][0].columns = Mat::zeros(NX + 1, 1);
    assert!(matches!(TubeProblem::new(&ocp, &wrong, &cost), Err(TubeError::Size { what: "E", stage: 2, rows: 5, .. })));
    wrong.balls[2][0].columns = Mat::from_fn(NX, 1, |_, _| f64::NAN);
    assert!(matches!(TubeProblem::new(&ocp, &wrong, &cost), Err(TubeError::NotFinite { what: "E", stage: 2 })));
    let flat = tube_cost(NX, NU, 0.0, 0.0, 0.0);
    let problem = TubeProblem::new(&ocp, &disturbance, &flat).unwrap();
    let refused = ExactTube.synthesize(&problem, &RowValues::zeros(&ocp), None);
    assert!(matches!(refused, Err(TubeError::Indefinite { stage, .. }) if stage == N - 1));
}
