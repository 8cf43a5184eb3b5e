//! Problems that tests and timings share.

use faer::Mat;
use pliant_control::ocp::{Ocp, Rows, Stage};
use pliant_control::tube::TubeCost;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

pub fn identity(n: usize, scale: f64) -> Mat<f64> {
    Mat::from_fn(n, n, |r, c| if r == c { scale } else { 0.0 })
}

pub fn random(rng: &mut Pcg64, rows: usize, columns: usize, scale: f64) -> Mat<f64> {
    Mat::from_fn(rows, columns, |_, _| scale * rng.random_range(-1.0..1.0))
}

pub fn generator(seed: u64) -> Pcg64 {
    Pcg64::seed_from_u64(seed)
}

/// |x_i| ≤ limit for all states.
pub fn box_rows(nx: usize, nu: usize, limit: f64, weight: f64) -> Rows {
    Rows {
        gx: Mat::from_fn(2 * nx, nx, |r, c| if r % nx == c { if r < nx { 1.0 } else { -1.0 } } else { 0.0 }),
        gu: Mat::zeros(2 * nx, nu),
        limits: vec![limit; 2 * nx],
        weights: vec![weight; 2 * nx],
    }
}

/// The same matrices at every stage, cost ½ xᵀ q x + ½ uᵀ r u.
pub fn invariant(a: &Mat<f64>, b: &Mat<f64>, horizon: usize, x0: Vec<f64>, [q, r, q_final]: [f64; 3], bound: f64) -> Ocp {
    let (nx, nu) = (a.nrows(), b.ncols());
    let stage = Stage {
        a: a.clone(),
        b: b.clone(),
        d: vec![0.0; nx],
        q: identity(nx, q),
        s: Mat::zeros(nu, nx),
        r: identity(nu, r),
        q_linear: vec![0.0; nx],
        r_linear: vec![0.0; nu],
        lower: vec![-bound; nu],
        upper: vec![bound; nu],
        rows: Rows::none(nx, nu),
    };
    Ocp {
        x0,
        stages: vec![stage; horizon],
        q_final: identity(nx, q_final),
        q_final_linear: vec![0.0; nx],
        rows_final: Rows::none(nx, nu),
    }
}

/// A time-varying problem of random, mildly unstable dynamics without rows, bounds of inputs far away.
pub fn varying(seed: u64, nx: usize, nu: usize, horizon: usize) -> Ocp {
    let mut rng = generator(seed);
    let x0 = (0..nx).map(|_| rng.random_range(-1.0..1.0)).collect();
    let mut ocp = invariant(&identity(nx, 1.0), &Mat::zeros(nx, nu), horizon, x0, [1.0, 0.1, 3.0], f64::INFINITY);
    for stage in &mut ocp.stages {
        stage.a = identity(nx, 1.0) + random(&mut rng, nx, nx, 0.3);
        stage.b = random(&mut rng, nx, nu, 1.0);
        stage.d = (0..nx).map(|_| rng.random_range(-0.1..0.1)).collect();
    }
    ocp
}

/// Cost of responses q |Φ_x E|² + r |Φ_u E|² + q_final |Φ_x[N] E|².
pub fn tube_cost(nx: usize, nu: usize, q: f64, r: f64, q_final: f64) -> TubeCost {
    TubeCost { q: identity(nx, q), r: identity(nu, r), q_final: identity(nx, q_final) }
}

/// A vector of uniform direction and length 1.
pub fn direction(rng: &mut Pcg64, n: usize) -> Vec<f64> {
    loop {
        let v: Vec<f64> = (0..n).map(|_| rng.random_range(-1.0..1.0)).collect();
        let norm = v.iter().map(|v| v * v).sum::<f64>().sqrt();
        if n == 0 || (norm > 0.1 && norm <= 1.0) {
            return v.iter().map(|v| v / norm).collect();
        }
    }
}
