//! The implicit function theorem, once.
//!
//! A stage is a root of r(y; p) = 0 with K = ∂r/∂y factored at the root:
//! ```text
//! jvp:  ẏ = −K⁻¹ (∂r/∂p) ṗ            vjp:  λ = −K⁻ᵀ ȳ,   p̄ += (∂r/∂p)ᵀ λ
//! ```
//! The minus of the theorem stands in [`negated`] and nowhere else. Solves are refined once against the matrix itself.

use pliant_engine::step::StageRecord;

/// Contacts at a nanometre's rest gap are 1e7 times stiffer than the rope: their systems need a second refinement.
fn refinements(stage: &StageRecord) -> usize {
    if stage.w.is_empty() { 1 } else { 2 }
}

fn negated(x: &[f64]) -> Vec<f64> {
    x.iter().map(|a| -a).collect()
}

/// Tangent of the root for the residual's tangent `dr` = (∂r/∂p) ṗ; both row-major, `columns` directions per row.
pub(crate) fn root_tangent(stage: &StageRecord, dr: &[f64], columns: usize) -> Vec<f64> {
    let rhs = negated(dr);
    let mut y_dot = rhs.clone();
    stage.factor.solve_many(&mut y_dot, columns);
    for _ in 0..refinements(stage) {
        let mut defect = rhs.clone();
        stage.matrix.add_mul_many(-1.0, &y_dot, &mut defect, columns);
        stage.factor.solve_many(&mut defect, columns);
        y_dot.iter_mut().zip(&defect).for_each(|(y, d)| *y += d);
    }
    y_dot
}

/// The multiplier λ of the cotangent `y_bar` of the root.
pub(crate) fn multiplier(stage: &StageRecord, y_bar: &[f64]) -> Vec<f64> {
    let rhs = negated(y_bar);
    let mut lambda = rhs.clone();
    stage.factor.solve_transpose(&mut lambda);
    for _ in 0..refinements(stage) {
        let mut defect = rhs.clone();
        stage.matrix.add_mul_transpose(-1.0, &lambda, &mut defect);
        stage.factor.solve_transpose(&mut defect);
        lambda.iter_mut().zip(&defect).for_each(|(l, d)| *l += d);
    }
    lambda
}
