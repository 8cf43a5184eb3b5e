//! Whole responses of output feedback, block by block: for tests and for looking at. Tightenings do not need them.

use faer::Mat;

use super::kalman::{Observer, Sensing};
use crate::linear::{add_product, product};
use crate::tube::{Column, Gains, TubeProblem};

/// Lower triangular in blocks: block (k, j), j ≤ k, at `[k][j]`.
pub type Blocks = Vec<Vec<Mat<f64>>>;

/// Responses of states and inputs to disturbances (unit matrices instead of E) and to noise (unit matrices instead of F).
///
/// ```text
/// x = P_xx w + P_xy e,   u = P_ux w + P_uy e,   y_i = C_{i−d} x_{i−d} + e_i    at its arrival i
/// ```
#[derive(Clone, Debug)]
pub struct Responses {
    /// P_xx, nx × nx blocks.
    pub xx: Blocks,
    /// P_xy, nx × ny; no columns of arrivals before d.
    pub xy: Blocks,
    /// P_ux, nu × nx; rows of stages 0 … N−1.
    pub ux: Blocks,
    /// P_uy, nu × ny.
    pub uy: Blocks,
}

/// State feedback (P_xf, P_uf): normalised Φ of the gains.
pub fn feedback_responses(problem: &TubeProblem<'_>, gains: &Gains) -> (Blocks, Blocks) {
    let (mut xf, mut uf) = (vec![Vec::new(); problem.horizon() + 1], vec![Vec::new(); problem.horizon()]);
    for j in 0..=problem.horizon() {
        let column = Column::propagate(problem, gains, j, Mat::identity(problem.nx, problem.nx));
        for (k, x) in (j..).zip(column.x) {
            xf[k].push(x);
        }
        for (k, u) in (j..).zip(column.u) {
            uf[k].push(u);
        }
    }
    (xf, uf)
}

/// The estimate's error (P_xo, P_yo): x − x̂ = P_xo w + P_yo e.
///
/// With a delay of d steps the estimate of stage k is the filter's of time m = k − d, carried on by A with the inputs applied since: row k
/// is A_{k−1} … A_m times the filter's row m, and A_{k−1} … A_j for disturbances after m. It is what a filter of the state augmented by
/// its d predecessors would estimate, without the augmented matrices.
pub fn observer_responses(problem: &TubeProblem<'_>, sensing: &Sensing, observer: &Observer) -> (Blocks, Blocks) {
    let (mut xo, mut yo) = (Vec::new(), Vec::new());
    for k in 0..=problem.horizon() {
        let last = sensing.last(k);
        let mut of_x = vec![Mat::zeros(0, 0); k + 1];
        let mut of_y: Vec<Mat<f64>> = (0..=k).map(|i| Mat::zeros(problem.nx, arrival_size(sensing, i))).collect();
        let mut response = Mat::identity(problem.nx, problem.nx);
        for j in (0..=k).rev() {
            if last.is_some_and(|last| j <= last) {
                of_y[j + sensing.delay] = product(response.as_ref(), observer.gains[j].as_ref());
                response = product(response.as_ref(), observer.kept[j].as_ref());
            }
            of_x[j] = response.clone();
            if j > 0 {
                response = product(response.as_ref(), problem.ocp.stages[j - 1].a.as_ref());
            }
        }
        xo.push(of_x);
        yo.push(of_y);
    }
    (xo, yo)
}

/// Size of the measurement that arrives at stage i.
fn arrival_size(sensing: &Sensing, i: usize) -> usize {
    i.checked_sub(sensing.delay).and_then(|s| sensing.c.get(s)).map_or(0, Mat::nrows)
}

/// (M T)[k] = T[k] − A_{k−1} T[k−1].
fn apply_m(problem: &TubeProblem<'_>, t: &Blocks) -> Blocks {
    let mut out = t.clone();
    for k in 1..t.len() {
        for j in 0..k {
            add_product(out[k][j].as_mut(), problem.ocp.stages[k - 1].a.as_ref(), t[k - 1][j].as_ref(), -1.0);
        }
    }
    out
}

/// out −= a b for block lower triangular a and b.
fn subtract_product(out: &mut Blocks, a: &Blocks, b: &Blocks) {
    for (out, a) in out.iter_mut().zip(a) {
        for (j, out) in out.iter_mut().enumerate() {
            for l in j..a.len() {
                add_product(out.as_mut(), a[l].as_ref(), b[l][j].as_ref(), -1.0);
            }
        }
    }
}

impl Responses {
    /// Composes state feedback and observer.
    ///
    /// ```text
    /// P_xx = P_xf + P_xo − P_xf M P_xo,   P_ux = P_uf − P_uf M P_xo,   P_xy = P_yo − P_xf M P_yo,   P_uy = −P_uf M P_yo
    /// ```
    /// O(N³) block products.
    pub fn new(problem: &TubeProblem<'_>, sensing: &Sensing, observer: &Observer, gains: &Gains) -> Self {
        let (xf, uf) = feedback_responses(problem, gains);
        let (xo, yo) = observer_responses(problem, sensing, observer);
        let (m_xo, m_yo) = (apply_m(problem, &xo), apply_m(problem, &yo));
        let mut xx = xf.clone();
        for (xx, xo) in xx.iter_mut().flatten().zip(xo.iter().flatten()) {
            *xx += xo;
        }
        subtract_product(&mut xx, &xf, &m_xo);
        let mut ux = uf.clone();
        subtract_product(&mut ux, &uf, &m_xo);
        let mut xy = yo.clone();
        subtract_product(&mut xy, &xf, &m_yo);
        let zero = |row: &Vec<Mat<f64>>| row.iter().map(|y| Mat::zeros(problem.nu, y.ncols())).collect();
        let mut uy: Blocks = yo[..problem.horizon()].iter().map(zero).collect();
        subtract_product(&mut uy, &uf, &m_yo);
        Self { xx, xy, ux, uy }
    }
}
