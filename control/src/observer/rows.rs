//! Tightenings of output feedback, from rows of responses alone.

use faer::Mat;
use rayon::prelude::*;

use super::kalman::{Observer, Sensing};
use crate::linear::{add_product, product, row_norms};
use crate::tube::{Gains, Norms, RowValues, TubeProblem};

/// Row norms of one stage.
struct StageNorms {
    /// Σ over all disturbances and noises.
    sums: Vec<f64>,
    /// (|to w_j|² + |to the noise that arrives at j|²)^½ at `[j][row]`.
    joint: Vec<Vec<f64>>,
}

/// h_{k,i} = Σ_j |g [P_xx; P_ux][k,j] E_j| + |g [P_xy; P_uy][k,j] F_j| and the norms that weights are made of.
///
/// Rows are propagated backward instead of blocks forward. With the estimate's increments ν_l, which are −M_i (C err + F e) carried to
/// their arrival l = i + d, and the error's own recursion,
/// ```text
/// g_x x_k + g_u u_k = g_x err_k + Σ_{l≤k} c_{k,l} ν_l,      c_{k,l} = (g_x + g_u K_{k,l}) Φ_x[k,l]
/// λ = g_x A_{k−1} … A_i at i = k − d, on the error after the measurement,   c̃_i = c_{k,i+d} A_{i+d−1} … A_i
/// λ_i = λ + (λ − c̃_i) M_i C_i before it,   λ ← λ_i A_{i−1};          response to w_i: λ_i E_i, to e_i: (λ − c̃_i) M_i F_i
/// ```
/// m rows of a stage cost O(m nx² N) for λ, and for c the same with gains that columns share, O(m nx² N²) otherwise; no block product of
/// [`Responses`](super::Responses) is formed. Stages run in parallel.
pub(crate) fn row_tightenings(
    problem: &TubeProblem<'_>,
    sensing: &Sensing,
    observer: &Observer,
    gains: &Gains,
) -> (RowValues, Norms) {
    let stages: Vec<StageNorms> =
        (0..=problem.horizon()).into_par_iter().map(|k| stage_norms(problem, sensing, observer, gains, k)).collect();
    let mut sums = RowValues::zeros(problem.ocp);
    let mut norms: Norms = vec![Vec::new(); problem.horizon() + 1];
    for (k, stage) in stages.into_iter().enumerate() {
        sums.stage_mut(k).copy_from_slice(&stage.sums);
        for (j, joint) in stage.joint.into_iter().enumerate() {
            norms[j].push(joint);
        }
    }
    (sums, norms)
}

fn stage_norms(problem: &TubeProblem<'_>, sensing: &Sensing, observer: &Observer, gains: &Gains, k: usize) -> StageNorms {
    let (g_x, g_u) = problem.rows[k].distinct(problem.nx, problem.nu);
    let mut to_increments = increment_rows(problem, gains, k, &g_x, &g_u);
    let rows = g_x.nrows();
    let mut sums = vec![0.0; rows];
    let mut joint: Vec<Vec<f64>> = vec![vec![0.0; rows]; k + 1];
    let mut count = |j: usize, norms: Vec<f64>| {
        for ((sum, joint), norm) in sums.iter_mut().zip(&mut joint[j]).zip(norms) {
            *sum += norm;
            *joint = joint.hypot(norm);
        }
    };
    let last = sensing.last(k);
    let mut lambda = g_x;
    for i in (0..=k).rev() {
        if last.is_some_and(|last| i <= last) {
            let arrival = i + sensing.delay;
            let mut row = std::mem::replace(&mut to_increments[arrival], Mat::zeros(0, 0));
            for stage in problem.ocp.stages[i..arrival].iter().rev() {
                row = product(row.as_ref(), stage.a.as_ref());
            }
            let difference = &lambda - row;
            let through_gain = product(difference.as_ref(), observer.gains[i].as_ref());
            let of_noise = product(through_gain.as_ref(), sensing.f[i].as_ref());
            count(arrival, row_norms(&of_noise, std::slice::from_ref(&(0..of_noise.ncols()))));
            add_product(lambda.as_mut(), through_gain.as_ref(), sensing.c[i].as_ref(), 1.0);
        }
        count(i, row_norms(&product(lambda.as_ref(), problem.columns[i].as_ref()), &problem.balls[i]));
        if i > 0 {
            lambda = product(lambda.as_ref(), problem.ocp.stages[i - 1].a.as_ref());
        }
    }
    let of_all = |values: &Vec<f64>| problem.rows[k].of_all(values);
    StageNorms { sums: of_all(&sums), joint: joint.iter().map(of_all).collect() }
}

/// c_{k,l} = (g_x + g_u K_{k,l}) Φ_x\[k,l\] for l = 0 … k.
fn increment_rows(problem: &TubeProblem<'_>, gains: &Gains, k: usize, g_x: &Mat<f64>, g_u: &Mat<f64>) -> Vec<Mat<f64>> {
    let start = |l: usize| {
        let mut row = g_x.clone();
        if k < problem.horizon() {
            add_product(row.as_mut(), g_u.as_ref(), gains.get(k, l).as_ref(), 1.0);
        }
        row
    };
    // c_{k,l} (A + B K_{i,l}): back over stage i
    let back = |row: &Mat<f64>, i: usize, l: usize| {
        let stage = &problem.ocp.stages[i];
        let mut earlier = product(row.as_ref(), stage.a.as_ref());
        let on_inputs = product(row.as_ref(), stage.b.as_ref());
        add_product(earlier.as_mut(), on_inputs.as_ref(), gains.get(i, l).as_ref(), 1.0);
        earlier
    };
    let first_shared = gains.first_shared();
    let mut rows = vec![Mat::zeros(0, 0); k + 1];
    rows[k] = start(k);
    // while columns share their gains, one row serves all of them
    let mut shared = rows[k].clone();
    if k >= first_shared {
        for l in (first_shared..k).rev() {
            shared = back(&shared, l, l);
            rows[l] = shared.clone();
        }
    }
    for (l, target) in rows.iter_mut().enumerate().take(first_shared.min(k)) {
        let (mut row, from) = if k >= first_shared { (shared.clone(), first_shared) } else { (start(l), k) };
        for i in (l..from).rev() {
            row = back(&row, i, l);
        }
        *target = row;
    }
    rows
}
