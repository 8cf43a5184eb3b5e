//! Problems of optimal control: random ones, a chain of masses, one of the size of a rope held by two grippers.

use faer::{Mat, Scale};
use pliant_control::ocp::{Ocp, Rows, Stage};
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64;

fn matrix(rows: usize, columns: usize, rng: &mut impl Rng, size: f64) -> Mat<f64> {
    Mat::from_fn(rows, columns, |_, _| size * rng.random_range(-1.0..1.0))
}

fn vector(length: usize, rng: &mut impl Rng, size: f64) -> Vec<f64> {
    (0..length).map(|_| size * rng.random_range(-1.0..1.0)).collect()
}

/// A x + B u + d.
fn next(stage: &Stage, x: &[f64], u: &[f64]) -> Vec<f64> {
    let of = |m: &Mat<f64>, v: &[f64], i: usize| (0..v.len()).map(|j| m[(i, j)] * v[j]).sum::<f64>();
    (0..x.len()).map(|i| of(&stage.a, x, i) + of(&stage.b, u, i) + stage.d[i]).collect()
}

/// Up to 12 stages, 8 states and 4 inputs, time-varying; rows of states and inputs, hard and soft, of which the hard ones admit at least
/// the trajectory of one sequence of inputs. No rows at the first stage where `x0` decides.
pub fn random(seed: u64) -> Ocp {
    let mut rng = Pcg64::seed_from_u64(seed);
    let (n, nx, nu) = (rng.random_range(1..=12), rng.random_range(1..=8), rng.random_range(1..=4));
    let (soft, bounded) = (rng.random_range(0.0..1.0), rng.random_range(0.0..1.0));
    let x0 = vector(nx, &mut rng, 2.0);
    let mut x = x0.clone();
    let mut stages = Vec::new();
    for k in 0..n {
        let root = matrix(rng.random_range(1..=nx + nu), nx + nu, &mut rng, 1.0);
        let weight = root.transpose() * &root;
        let reference = vector(nu, &mut rng, 1.0);
        let mut bound = |sign: f64, at: f64| match rng.random_range(0.0..1.0) < bounded {
            true => at + sign * f64::max(0.0, rng.random_range(-0.2..1.0)),
            false => sign * f64::INFINITY,
        };
        let lower = reference.iter().map(|at| bound(-1.0, *at)).collect();
        let upper = reference.iter().map(|at| bound(1.0, *at)).collect();
        let rows = match k {
            0 => Rows::none(nx, nu),
            _ => random_rows(&x, &reference, soft, &mut rng),
        };
        let stage = Stage {
            a: matrix(nx, nx, &mut rng, 1.5 / (nx as f64).sqrt()),
            b: matrix(nx, nu, &mut rng, 1.0),
            d: vector(nx, &mut rng, 0.3),
            q: weight.as_ref().submatrix(0, 0, nx, nx).to_owned(),
            s: weight.as_ref().submatrix(nx, 0, nu, nx).to_owned(),
            r: weight.as_ref().submatrix(nx, nx, nu, nu) + Mat::<f64>::identity(nu, nu) * Scale(0.1),
            q_linear: vector(nx, &mut rng, 1.0),
            r_linear: vector(nu, &mut rng, 1.0),
            lower,
            upper,
            rows,
        };
        x = next(&stage, &x, &reference);
        stages.push(stage);
    }
    let root = matrix(nx, nx, &mut rng, 1.0);
    let rows_final = random_rows(&x, &[], soft, &mut rng);
    Ocp { x0, stages, q_final: root.transpose() * &root, q_final_linear: vector(nx, &mut rng, 1.0), rows_final }
}

fn random_rows(x: &[f64], u: &[f64], soft: f64, rng: &mut impl Rng) -> Rows {
    let m = rng.random_range(0..=4);
    let (gx, gu) = (matrix(m, x.len(), rng, 1.0), matrix(m, u.len(), rng, 1.0));
    let (mut limits, mut weights) = (Vec::new(), Vec::new());
    for i in 0..m {
        let of_x: f64 = (0..x.len()).map(|j| gx[(i, j)] * x[j]).sum();
        let value = of_x + (0..u.len()).map(|j| gu[(i, j)] * u[j]).sum::<f64>();
        let is_soft = rng.random_range(0.0..1.0) < soft;
        limits.push(value + if is_soft { rng.random_range(-1.0..1.0) } else { f64::max(0.0, rng.random_range(-0.5..1.0)) });
        weights.push(if is_soft { 10f64.powf(rng.random_range(-2.0..3.0)) } else { f64::INFINITY });
    }
    Rows { gx, gu, limits, weights }
}

/// exp(M t) by its series, of M t halved until it is small.
fn exponential(m: &Mat<f64>, t: f64) -> Mat<f64> {
    let halvings = 12;
    let small = m * Scale(t / f64::powi(2.0, halvings));
    let mut sum = Mat::<f64>::identity(m.nrows(), m.nrows());
    let mut term = sum.clone();
    for order in 1..10 {
        term = &term * &small * Scale(1.0 / order as f64);
        sum += &term;
    }
    for _ in 0..halvings {
        sum = &sum * &sum;
    }
    sum
}

/// A chain of masses between two walls (as in the numerical example of Leeman et al. 2024, fast-SLS): m = 1, stiffness 10, damping 2,
/// forces on all masses, sampled at 0.1; |x| ≤ `most_x`, |u| ≤ `most_u` (4 and 4, hard, there; with less they act, and
/// need a `weight`), Q = 3 I, R = I, Q_N = Q;
/// x_0 uniform in [−1, 1].
pub fn chain(masses: usize, n: usize, most_x: f64, most_u: f64, weight: f64, seed: u64) -> Ocp {
    let (nx, nu) = (2 * masses, masses);
    let mut continuous = Mat::zeros(nx + nu, nx + nu);
    for i in 0..masses {
        continuous[(i, masses + i)] = 1.0;
        continuous[(masses + i, nx + i)] = 1.0;
        for (offset, factor) in [(0, 10.0), (masses, 2.0)] {
            continuous[(masses + i, offset + i)] -= 2.0 * factor;
            if i > 0 {
                continuous[(masses + i, offset + i - 1)] += factor;
            }
            if i + 1 < masses {
                continuous[(masses + i, offset + i + 1)] += factor;
            }
        }
    }
    let sampled = exponential(&continuous, 0.1);
    let both = |m: usize| Mat::from_fn(2 * m, m, |i, j| if i / 2 == j { [1.0, -1.0][i % 2] } else { 0.0 });
    let box_rows = |nu: usize| Rows {
        gx: both(nx),
        gu: Mat::zeros(2 * nx, nu),
        limits: vec![most_x; 2 * nx],
        weights: vec![weight; 2 * nx],
    };
    let stage = |k: usize| Stage {
        a: sampled.as_ref().submatrix(0, 0, nx, nx).to_owned(),
        b: sampled.as_ref().submatrix(0, nx, nx, nu).to_owned(),
        d: vec![0.0; nx],
        q: Mat::<f64>::identity(nx, nx) * Scale(3.0),
        s: Mat::zeros(nu, nx),
        r: Mat::identity(nu, nu),
        q_linear: vec![0.0; nx],
        r_linear: vec![0.0; nu],
        lower: vec![-most_u; nu],
        upper: vec![most_u; nu],
        rows: if k == 0 { Rows::none(nx, nu) } else { box_rows(nu) },
    };
    Ocp {
        x0: vector(nx, &mut Pcg64::seed_from_u64(seed), 1.0),
        stages: (0..n).map(stage).collect(),
        q_final: Mat::<f64>::identity(nx, nx) * Scale(3.0),
        q_final_linear: vec![0.0; nx],
        rows_final: box_rows(0),
    }
}

/// Of the size of a rope of 21 nodes held by two grippers: 69 states (nodes, grippers), 8 velocities, of which the last two do little;
/// a diffusing rope drawn along by its grippers towards a goal, bounds on all inputs, `rows` soft rows a stage that keep nodes above the
/// ground.
pub fn rope(n: usize, rows: usize, seed: u64) -> Ocp {
    let mut rng = Pcg64::seed_from_u64(seed);
    let (nodes, nx, nu): (usize, usize, usize) = (21, 69, 8);
    let stage = |rng: &mut Pcg64| {
        let mut a = Mat::<f64>::identity(nx, nx);
        let mut b = Mat::zeros(nx, nu);
        for axis in 0..3 {
            for i in 0..nodes {
                let row = 3 * i + axis;
                for (j, weight) in [(i.wrapping_sub(1), 0.3), (i + 1, 0.3)] {
                    if j < nodes {
                        a[(row, 3 * j + axis)] += weight;
                        a[(row, row)] -= weight;
                    }
                }
                let gripper = if i < nodes / 2 { 0 } else { 1 };
                if i == 1 || i == nodes - 3 {
                    a[(row, 63 + 3 * gripper + axis)] += 0.35;
                    a[(row, row)] -= 0.35;
                }
            }
            for gripper in 0..2 {
                b[(63 + 3 * gripper + axis, 3 * gripper + axis)] = 0.02;
                b[(3 * (1 + gripper * (nodes - 4)) + axis, 6 + gripper)] = 1e-3;
            }
        }
        let noise = matrix(nx, nx, rng, 1e-3);
        let r = Mat::from_fn(nu, nu, |i, j| if i == j { 0.1 } else { 0.0 });
        let weight = |i: usize| if i < 63 { 1.0 } else { 1e-3 };
        Stage {
            a: a + noise,
            b,
            d: vector(nx, rng, 1e-3),
            q: Mat::from_fn(nx, nx, |i, j| if i == j { weight(i) } else { 0.0 }),
            s: Mat::zeros(nu, nx),
            r,
            q_linear: (0..nx).map(|i| -weight(i) * (0.02 + 0.05 * (i as f64 / 69.0))).collect(),
            r_linear: vec![0.0; nu],
            lower: vec![-0.2; nu],
            upper: vec![0.2; nu],
            rows: Rows {
                gx: Mat::from_fn(rows, nx, |i, j| if j == 3 * (i % nodes) + i / nodes { -1.0 } else { 0.0 }),
                gu: Mat::zeros(rows, nu),
                limits: (0..rows).map(|_| rng.random_range(-0.005..0.05)).collect(),
                weights: vec![50.0; rows],
            },
        }
    };
    let stages: Vec<Stage> = (0..n).map(|_| stage(&mut rng)).collect();
    let (q_final, q_final_linear) = (stages[0].q.clone(), stages[0].q_linear.clone());
    Ocp { x0: vector(nx, &mut rng, 0.03), stages, q_final, q_final_linear, rows_final: Rows::none(nx, 0) }
}
