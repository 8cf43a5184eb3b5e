//! Output feedback: identities, tightenings by rows, policies, separation.

use faer::Mat;
use pliant_control::observer::{
    Blocks, JointResponses, Observer, ObserverError, OutputFeedbackTube, OutputPolicy, Responses, Sensing, Sharing,
    observer_responses,
};
use pliant_control::ocp::Ocp;
use pliant_control::tube::{
    Disturbance, ExactTube, Gains, RobustOptions, RowValues, Tube, TubeCost, TubeProblem, TubeSynthesis, robust,
};

use crate::problems::{box_rows, direction, generator, random, tube_cost, varying};
use crate::reference::Reference;

const NX: usize = 3;
const NU: usize = 2;
const NY: usize = 2;
const N: usize = 6;

struct Case {
    ocp: Ocp,
    disturbance: Disturbance,
    cost: TubeCost,
    sensing: Sensing,
}

fn case(seed: u64, delay: usize) -> Case {
    let mut ocp = varying(seed, NX, NU, N);
    let mut rng = generator(seed + 2000);
    for stage in &mut ocp.stages {
        stage.rows = box_rows(NX, NU, 0.9, 20.0);
        stage.rows.gu = random(&mut rng, 2 * NX, NU, 0.3);
        stage.lower = vec![-2.0; NU];
        stage.upper = vec![2.0; NU];
    }
    ocp.rows_final = box_rows(NX, NU, 0.5, 20.0);
    Case {
        ocp,
        disturbance: Disturbance::new((0..=N).map(|_| random(&mut rng, NX, NX, 0.05))),
        cost: tube_cost(NX, NU, 0.1, 0.05, 0.2),
        sensing: Sensing {
            c: (0..N).map(|_| random(&mut rng, NY, NX, 1.0)).collect(),
            f: (0..N).map(|_| random(&mut rng, NY, NY + 1, 0.02)).collect(),
            delay,
        },
    }
}

/// The tube of weights that the alternation has come to.
fn tube_of(case: &Case, sharing: Sharing) -> (OutputFeedbackTube, Tube, [Vec<Vec<f64>>; 2]) {
    let problem = TubeProblem::new(&case.ocp, &case.disturbance, &case.cost).unwrap();
    let synthesis = OutputFeedbackTube::new(&problem, case.sensing.clone(), sharing).unwrap();
    let options = RobustOptions { iterations: 4, ..RobustOptions::default() };
    let found = robust(&case.ocp, &case.disturbance, &case.cost, &mut Reference::default(), &synthesis, &options).unwrap();
    assert!(found.nominal.multipliers.iter().flatten().any(|mu| *mu > 1e-2), "no row is active");
    (synthesis, found.tube, [found.nominal.x, found.nominal.u])
}

/// A block matrix of (N + 1)² blocks of one size; blocks of another size (none, of arrivals before the first) stay zero.
fn assemble(blocks: &Blocks, rows: usize, columns: usize) -> Mat<f64> {
    let mut all = Mat::zeros(rows * (N + 1), columns * (N + 1));
    for (k, of_row) in blocks.iter().enumerate() {
        for (j, block) in of_row.iter().enumerate().filter(|(_, block)| block.ncols() == columns) {
            all.as_mut().submatrix_mut(k * rows, j * columns, rows, columns).copy_from(block);
        }
    }
    all
}

/// Blocks on the `below`-th subdiagonal.
fn subdiagonal(below: usize, blocks: &[&Mat<f64>]) -> Mat<f64> {
    let (rows, columns) = (blocks[0].nrows(), blocks[0].ncols());
    let mut all = Mat::zeros(rows * (N + 1), columns * (N + 1));
    for (k, block) in blocks.iter().enumerate().filter(|(k, _)| k + below <= N) {
        all.as_mut().submatrix_mut((k + below) * rows, k * columns, rows, columns).copy_from(block);
    }
    all
}

#[test]
fn the_four_identities_hold() {
    for delay in [0, 1, 2, 4] {
        let case = case(10, delay);
        let (synthesis, tube, _) = tube_of(&case, Sharing::PerColumn);
        assert!(tube.gains.first_shared() > 0);
        let problem = TubeProblem::new(&case.ocp, &case.disturbance, &case.cost).unwrap();
        let all = Responses::new(&problem, &case.sensing, &synthesis.observer, &tube.gains);
        let (xx, xy) = (assemble(&all.xx, NX, NX), assemble(&all.xy, NX, NY));
        let (ux, uy) = (assemble(&all.ux, NU, NX), assemble(&all.uy, NU, NY));
        let unit = Mat::<f64>::identity(xx.nrows(), xx.nrows());
        let m = &unit - subdiagonal(1, &case.ocp.stages.iter().map(|stage| &stage.a).collect::<Vec<_>>());
        let z_b = subdiagonal(1, &case.ocp.stages.iter().map(|stage| &stage.b).collect::<Vec<_>>());
        let z_c = subdiagonal(delay, &case.sensing.c.iter().collect::<Vec<_>>());
        assert!((&m * &xx - &z_b * &ux - &unit).norm_max() < 1e-12);
        assert!((&m * &xy - &z_b * &uy).norm_max() < 1e-12);
        assert!((&xx * &m - &xy * &z_c - &unit).norm_max() < 1e-12);
        assert!((&ux * &m - &uy * &z_c).norm_max() < 1e-12);
        let (xo, yo) = observer_responses(&problem, &case.sensing, &synthesis.observer);
        assert!((assemble(&xo, NX, NX) * &m - assemble(&yo, NX, NY) * &z_c - &unit).norm_max() < 1e-12);
        assert!(uy.norm_max() > 1e-2);
    }
}

/// Tightenings from whole blocks.
fn block_tightenings(case: &Case, all: &Responses) -> Vec<Vec<f64>> {
    let sums = |g_x: &Mat<f64>, g_u: Option<&Mat<f64>>, k: usize| -> Vec<f64> {
        let mut sums = vec![0.0; g_x.nrows()];
        let mut count = |x: &Mat<f64>, u: Option<&Mat<f64>>, by: &Mat<f64>| {
            let mut row = g_x * x;
            if let (Some(g_u), Some(u)) = (g_u, u) {
                row += g_u * u;
            }
            let row = row * by;
            for (i, sum) in sums.iter_mut().enumerate() {
                *sum += (0..row.ncols()).map(|c| row[(i, c)].powi(2)).sum::<f64>().sqrt();
            }
        };
        for j in 0..=k {
            count(&all.xx[k][j], all.ux.get(k).map(|u| &u[j]), &case.disturbance.balls[j][0].columns);
            if let Some(f) = j.checked_sub(case.sensing.delay).and_then(|i| case.sensing.f.get(i)) {
                count(&all.xy[k][j], all.uy.get(k).map(|u| &u[j]), f);
            }
        }
        sums
    };
    let stage = |k: usize| match case.ocp.stages.get(k) {
        Some(stage) => {
            let mut values = sums(&stage.rows.gx, Some(&stage.rows.gu), k);
            values.extend(sums(&Mat::zeros(NU, NX), Some(&Mat::identity(NU, NU)), k));
            values
        }
        None => sums(&case.ocp.rows_final.gx, None, k),
    };
    (0..=N).map(stage).collect()
}

fn assert_same(values: &RowValues, expected: &[Vec<f64>]) {
    for (k, expected) in expected.iter().enumerate() {
        for (a, b) in values.rows(k).iter().chain(values.inputs(k)).zip(expected) {
            assert!((a - b).abs() < 1e-12 * (1.0 + b), "stage {k}: {a} against {b}");
        }
    }
}

#[test]
fn rows_alone_give_the_tightenings_of_whole_blocks() {
    let kinds = [(0, Sharing::PerColumn), (1, Sharing::PerColumn), (3, Sharing::PerColumn)];
    for (delay, sharing) in kinds.into_iter().chain([0, 1, 2].map(|delay| (delay, Sharing::Shared))) {
        let case = case(12, delay);
        let (synthesis, tube, _) = tube_of(&case, sharing);
        let problem = TubeProblem::new(&case.ocp, &case.disturbance, &case.cost).unwrap();
        let all = Responses::new(&problem, &case.sensing, &synthesis.observer, &tube.gains);
        let expected = block_tightenings(&case, &all);
        assert_same(&tube.tightenings, &expected);
        if sharing == Sharing::Shared {
            let joint = JointResponses::new(&problem, &case.sensing, &synthesis.observer, &tube.gains);
            assert_same(&joint.tightenings, &expected);
        }
    }
}

fn times(a: &Mat<f64>, x: &[f64]) -> Vec<f64> {
    (0..a.nrows()).map(|r| x.iter().enumerate().map(|(c, x)| a[(r, c)] * x).sum()).collect()
}

fn add(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}

struct Draw {
    w: Vec<Vec<f64>>,
    e: Vec<Vec<f64>>,
}

/// Closed loop of the policy with the dynamics: states, inputs, measurements by time measured.
fn simulate(case: &Case, policy: &mut OutputPolicy, draw: &Draw) -> [Vec<Vec<f64>>; 3] {
    let kick = |j: usize| times(&case.disturbance.balls[j][0].columns, &draw.w[j]);
    let mut x = vec![add(&case.ocp.x0, &kick(0))];
    let (mut u, mut y) = (Vec::new(), Vec::<Vec<f64>>::new());
    for (k, stage) in case.ocp.stages.iter().enumerate() {
        y.push(add(&times(&case.sensing.c[k], &x[k]), &times(&case.sensing.f[k], &draw.e[k])));
        let measured = k.checked_sub(case.sensing.delay).map(|i| y[i].as_slice());
        u.push(policy.control(k, measured).unwrap());
        let moved = add(&times(&stage.a, &x[k]), &times(&stage.b, &u[k]));
        x.push(add(&add(&moved, &stage.d), &kick(k + 1)));
    }
    [x, u, y]
}

fn draw(seed: u64) -> Draw {
    let mut rng = generator(seed);
    Draw { w: (0..=N).map(|_| direction(&mut rng, NX)).collect(), e: (0..N).map(|_| direction(&mut rng, NY + 1)).collect() }
}

#[test]
fn the_policy_is_what_responses_predict() {
    let kinds = [0, 1, 2, 4].map(|delay| (delay, Sharing::PerColumn));
    for (delay, sharing) in kinds.into_iter().chain([(2, Sharing::Shared)]) {
        let case = case(12, delay);
        let (synthesis, tube, [z, v]) = tube_of(&case, sharing);
        let problem = TubeProblem::new(&case.ocp, &case.disturbance, &case.cost).unwrap();
        let all = Responses::new(&problem, &case.sensing, &synthesis.observer, &tube.gains);
        let (gains, sensing) = (tube.gains.clone(), case.sensing.clone());
        let mut policy = OutputPolicy::new(&case.ocp, [&z, &v], gains, sensing, &synthesis.observer).unwrap();
        let draw = draw(120);
        let [x, u, y] = simulate(&case, &mut policy, &draw);
        let predicted = |states: &Blocks, noises: &Blocks, k: usize| {
            let mut sum = vec![0.0; states[k][0].nrows()];
            for j in 0..=k {
                sum = add(&sum, &times(&states[k][j], &times(&case.disturbance.balls[j][0].columns, &draw.w[j])));
                if let Some(s) = j.checked_sub(delay).filter(|s| *s < N) {
                    sum = add(&sum, &times(&noises[k][j], &times(&case.sensing.f[s], &draw.e[s])));
                }
            }
            sum
        };
        for k in 0..=N {
            for (a, b) in x[k].iter().zip(add(&z[k], &predicted(&all.xx, &all.xy, k))) {
                assert!((a - b).abs() < 1e-10);
            }
        }
        for k in 0..N {
            for (a, b) in u[k].iter().zip(add(&v[k], &predicted(&all.ux, &all.uy, k))) {
                assert!((a - b).abs() < 1e-10);
            }
        }
        // the controller of the responses themselves: ξ_k = −(P_xy y)_k − Σ_{j<k} P_xx ξ_j, δu = P_ux ξ + P_uy y
        let deviation = |i: usize| add(&y[i], &times(&case.sensing.c[i], &z[i].iter().map(|z| -z).collect::<Vec<_>>()));
        let mut xi: Vec<Vec<f64>> = Vec::new();
        for k in 0..N {
            let (mut of_x, mut of_u) = (vec![0.0; NX], v[k].clone());
            for j in 0..=k {
                if let Some(i) = j.checked_sub(delay) {
                    of_x = add(&of_x, &times(&all.xy[k][j], &deviation(i)));
                    of_u = add(&of_u, &times(&all.uy[k][j], &deviation(i)));
                }
                if j < k {
                    of_x = add(&of_x, &times(&all.xx[k][j], &xi[j]));
                }
            }
            xi.push(of_x.iter().map(|x| -x).collect());
            for (j, xi) in xi.iter().enumerate() {
                of_u = add(&of_u, &times(&all.ux[k][j], xi));
            }
            for (a, b) in of_u.iter().zip(&u[k]) {
                assert!((a - b).abs() < 1e-10, "stage {k}: {a} against {b}");
            }
        }
        policy.reset();
        assert_eq!(simulate(&case, &mut policy, &draw)[1], u);
        let refused = policy.control(N, None);
        assert!(matches!(refused, Err(ObserverError::Tube(_))));
    }
}

#[test]
fn output_feedback_stays_within_its_tightenings() {
    let case = case(13, 2);
    let (synthesis, tube, [z, v]) = tube_of(&case, Sharing::PerColumn);
    let (gains, sensing) = (tube.gains.clone(), case.sensing.clone());
    let mut policy = OutputPolicy::new(&case.ocp, [&z, &v], gains, sensing, &synthesis.observer).unwrap();
    let excess = |x: &[Vec<f64>], u: &[Vec<f64>], k: usize, i: usize| {
        let rows = &case.ocp.stages[k].rows;
        let of = |g: &Mat<f64>, a: &[f64], b: &[f64]| (0..a.len()).map(|c| g[(i, c)] * (a[c] - b[c])).sum::<f64>();
        of(&rows.gx, &x[k], &z[k]) + of(&rows.gu, &u[k], &v[k]) - tube.tightenings.rows(k)[i]
    };
    let mut closest = f64::NEG_INFINITY;
    for seed in 0..1000 {
        let [x, u, _] = simulate(&case, &mut policy, &draw(1300 + seed));
        policy.reset();
        for k in 0..N {
            for i in 0..2 * NX {
                closest = closest.max(excess(&x, &u, k, i));
            }
        }
    }
    assert!(closest < 1e-12);

    // the worst case of one row touches
    let problem = TubeProblem::new(&case.ocp, &case.disturbance, &case.cost).unwrap();
    let all = Responses::new(&problem, &case.sensing, &synthesis.observer, &tube.gains);
    let (k, i) = (N - 1, 1);
    let rows = &case.ocp.stages[k].rows;
    let unit = |x: &Mat<f64>, u: &Mat<f64>, by: &Mat<f64>| {
        let row = (&rows.gx * x + &rows.gu * u) * by;
        let norm = (0..row.ncols()).map(|c| row[(i, c)].powi(2)).sum::<f64>().sqrt();
        (0..row.ncols()).map(|c| row[(i, c)] / norm.max(1e-300)).collect::<Vec<f64>>()
    };
    let mut worst = Draw { w: vec![vec![0.0; NX]; N + 1], e: vec![vec![0.0; NY + 1]; N] };
    for j in 0..=k {
        worst.w[j] = unit(&all.xx[k][j], &all.ux[k][j], &case.disturbance.balls[j][0].columns);
        if let Some(s) = j.checked_sub(2) {
            worst.e[s] = unit(&all.xy[k][j], &all.uy[k][j], &case.sensing.f[s]);
        }
    }
    let [x, u, _] = simulate(&case, &mut policy, &worst);
    assert!(excess(&x, &u, k, i).abs() < 1e-10, "misses by {}", excess(&x, &u, k, i));
}

/// Σ |Q^{1/2} P_x|² + |R^{1/2} P_u|² over disturbances and noises, of responses simulated one unit vector at a time.
fn quadratic_cost(case: &Case, mut control: impl FnMut(&[Vec<f64>], &[Vec<f64>], usize) -> Vec<f64>) -> f64 {
    let mut total = 0.0;
    let sources = (0..=N).flat_map(|j| (0..NX).map(move |c| (true, j, c)));
    let noises = (0..N).flat_map(|s| (0..=NY).map(move |c| (false, s, c)));
    for (is_disturbance, time, column) in sources.chain(noises) {
        let entry = |e: &Mat<f64>| (0..e.nrows()).map(|r| e[(r, column)]).collect::<Vec<f64>>();
        let kick = |j: usize| match is_disturbance && j == time {
            true => entry(&case.disturbance.balls[j][0].columns),
            false => vec![0.0; NX],
        };
        let mut x = vec![kick(0)];
        let (mut u, mut y): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
        for (k, stage) in case.ocp.stages.iter().enumerate() {
            let noise = if !is_disturbance && k == time { entry(&case.sensing.f[k]) } else { vec![0.0; NY] };
            y.push(add(&times(&case.sensing.c[k], &x[k]), &noise));
            u.push(control(&y, &u, k));
            x.push(add(&add(&times(&stage.a, &x[k]), &times(&stage.b, &u[k])), &kick(k + 1)));
            total += form(&case.cost.q, &x[k]) + form(&case.cost.r, &u[k]);
        }
        total += form(&case.cost.q_final, &x[N]);
    }
    total
}

fn form(w: &Mat<f64>, x: &[f64]) -> f64 {
    times(w, x).iter().zip(x).map(|(a, b)| a * b).sum()
}

/// With weights that do not depend on the column, observer and feedback are the optimum over all causal output feedback. Any such
/// controller is ours plus Q times the innovations, and the cost is a convex quadratic in Q: its derivative at Q = 0 is half the
/// difference of the costs at ±1, exactly, for each entry.
#[test]
fn separation_makes_the_lqg_optimum() {
    for delay in [0, 1, 2] {
        let case = case(14, delay);
        let problem = TubeProblem::new(&case.ocp, &case.disturbance, &case.cost).unwrap();
        let synthesis = OutputFeedbackTube::new(&problem, case.sensing.clone(), Sharing::PerColumn).unwrap();
        let tube = synthesis.synthesize(&problem, &RowValues::zeros(&case.ocp), None).unwrap();
        let (gains, observer) = (&tube.gains, &synthesis.observer);
        let cost_of = |gains: &Gains, observer: &Observer, q: Option<(usize, usize, usize, usize, f64)>| {
            quadratic_cost(&case, |y, u, k| {
                let mut estimate = vec![0.0; NX];
                let mut innovations = Vec::new();
                for i in 0..=k {
                    if i + delay <= k {
                        let expected = times(&case.sensing.c[i], &estimate);
                        let innovation: Vec<f64> = y[i].iter().zip(expected).map(|(y, expected)| y - expected).collect();
                        let correction = times(&observer.gains[i], &innovation);
                        estimate.iter_mut().zip(correction).for_each(|(x, c)| *x -= c);
                        innovations.push(innovation);
                    }
                    if i < k {
                        let stage = &case.ocp.stages[i];
                        estimate = add(&times(&stage.a, &estimate), &times(&stage.b, &u[i]));
                    }
                }
                let mut input = times(gains.get(k, k), &estimate);
                if let Some((stage, row, time, column, size)) = q
                    && stage == k
                {
                    input[row] += size * innovations[time][column];
                }
                input
            })
        };
        let optimum = cost_of(gains, observer, None);
        let mut curvature: f64 = 0.0;
        for stage in delay..N {
            for (row, time, column) in
                (0..NU).flat_map(|r| (0..=stage - delay).flat_map(move |t| (0..NY).map(move |c| (r, t, c))))
            {
                let at = |size: f64| cost_of(gains, observer, Some((stage, row, time, column, size)));
                let (minus, plus) = (at(-1.0), at(1.0));
                assert!((plus - minus).abs() < 1e-11 * optimum.max(plus), "delay {delay}, stage {stage}: {}", plus - minus);
                assert!(plus > optimum);
                curvature = curvature.max(plus / optimum - 1.0);
            }
        }
        assert!(curvature > 1e-3);
        // the derivative is seen: of another gain it is not zero
        let other = Gains::shared((0..N).map(|k| faer::Scale(0.9) * gains.get(k, k)).collect());
        let slope = |size: f64| cost_of(&other, observer, Some((N - 1, 0, 0, 0, size)));
        assert!((slope(1.0) - slope(-1.0)).abs() > 1e-8 * optimum);
    }
}

/// A delay widens tubes; a measurement without noise of what is known changes nothing, and one of all states makes it state feedback.
#[test]
fn delays_cost_and_exact_measurements_are_state_feedback() {
    let width = |delay: usize| {
        let case = case(15, delay);
        let problem = TubeProblem::new(&case.ocp, &case.disturbance, &case.cost).unwrap();
        let synthesis = OutputFeedbackTube::new(&problem, case.sensing.clone(), Sharing::Shared).unwrap();
        let gains = synthesis.synthesize(&problem, &RowValues::zeros(&case.ocp), None).unwrap().gains;
        let joint = JointResponses::new(&problem, &case.sensing, &synthesis.observer, &gains);
        let squares = |m: &Mat<f64>| m.squared_norm_l2();
        joint.disturbances.iter().chain(&joint.noises).map(|column| column.x.iter().map(squares).sum::<f64>()).sum::<f64>()
    };
    assert!(width(0) < width(1) && width(1) < width(2) && width(2) < width(4));

    let mut case = case(15, 0);
    case.sensing.f = vec![Mat::zeros(NY, 1); N];
    case.disturbance.balls[0][0].columns = Mat::zeros(NX, 1);
    let problem = TubeProblem::new(&case.ocp, &case.disturbance, &case.cost).unwrap();
    let observer = Observer::new(&problem, &case.sensing).unwrap();
    assert!(observer.gains[0].norm_max() == 0.0 && observer.gains[1].norm_max() > 0.1);

    // three exact measurements of three states, one of them twice
    let all = random(&mut generator(16), 4, NX, 1.0);
    case.sensing.c = vec![all; N];
    case.sensing.f = vec![Mat::zeros(4, 1); N];
    let problem = TubeProblem::new(&case.ocp, &case.disturbance, &case.cost).unwrap();
    let synthesis = OutputFeedbackTube::new(&problem, case.sensing.clone(), Sharing::PerColumn).unwrap();
    let tube = synthesis.synthesize(&problem, &RowValues::zeros(&case.ocp), None).unwrap();
    let by_state = ExactTube.synthesize(&problem, &RowValues::zeros(&case.ocp), None).unwrap();
    for k in 0..=N {
        let pairs = tube.tightenings.rows(k).iter().zip(by_state.tightenings.rows(k));
        let inputs = tube.tightenings.inputs(k).iter().zip(by_state.tightenings.inputs(k));
        assert!(pairs.chain(inputs).all(|(a, b)| (a - b).abs() < 1e-10), "stage {k}");
    }
}
