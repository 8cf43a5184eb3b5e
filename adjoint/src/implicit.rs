//! The implicit function theorem, once.
//!
//! A stage is a root of r(y; p) = 0 with K = ∂r/∂y factored at the root:
//! ```text
//! jvp:  ẏ = −K⁻¹ (∂r/∂p) ṗ            vjp:  λ = −K⁻ᵀ ȳ,   p̄ += (∂r/∂p)ᵀ λ
//! ```
//! The minus of the theorem stands in [`negate`] and nowhere else. Solves are refined against the matrix
//! itself; many columns at once only where a probe shows that it changes them.

use pliant_engine::step::StageRecord;

/// Contacts at a nanometre's rest gap are 1e7 times stiffer than the rope: systems with them need a second refinement.
fn refinements(stage: &StageRecord) -> usize {
    if stage.n_rows() == stage.v.len() { 1 } else { 2 }
}

/// Relative change by a refinement below which it is not worth its price for many columns.
const REFINED: f64 = 1e-12;

fn negate(x: &mut [f64]) {
    x.iter_mut().for_each(|a| *a = -*a);
}

/// Memory of [`root_tangent`], kept from one call to the next.
#[derive(Clone, Debug, Default)]
pub(crate) struct Refinement {
    rhs: Vec<f64>,
    defect: Vec<f64>,
}

/// Replaces the residual's tangent `x` = (∂r/∂p) ṗ by that of the root; row-major, `columns` directions per row.
///
/// Many columns are refined only if that changes their sum, which is solved first as a probe, or if bodies touch: what four legs share
/// may cancel in the sum.
pub(crate) fn root_tangent(stage: &StageRecord, x: &mut [f64], columns: usize, memory: &mut Refinement) {
    negate(x);
    let refine = columns <= 1
        || stage.has_solids()
        || worth_refining(stage, x.chunks_exact(columns).map(|row| row.iter().sum()).collect());
    if refine {
        memory.rhs.clear();
        memory.rhs.extend_from_slice(x);
    }
    stage.solve_system(x, columns);
    for _ in 0..if refine { refinements(stage) } else { 0 } {
        memory.defect.clear();
        memory.defect.extend_from_slice(&memory.rhs);
        stage.subtract_system(x, &mut memory.defect, columns);
        stage.solve_system(&mut memory.defect, columns);
        x.iter_mut().zip(&memory.defect).for_each(|(x, d)| *x += d);
    }
}

/// Whether a refinement changes the solution for `rhs` by more than [`REFINED`] of its largest entry.
fn worth_refining(stage: &StageRecord, rhs: Vec<f64>) -> bool {
    let largest = |x: &[f64]| x[..stage.v.len()].iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let mut x = rhs.clone();
    stage.solve_system(&mut x, 1);
    let mut defect = rhs;
    stage.subtract_system(&x, &mut defect, 1);
    stage.solve_system(&mut defect, 1);
    // written so that NaN is refined, and shows
    let settled = largest(&defect) <= REFINED * largest(&x);
    !settled
}

/// The multiplier λ of the cotangent `y_bar` of the root's velocities; rows of the contacts follow those of the velocities.
pub(crate) fn multiplier(stage: &StageRecord, y_bar: &[f64]) -> Vec<f64> {
    let mut rhs = y_bar.to_vec();
    rhs.resize(stage.n_rows(), 0.0);
    negate(&mut rhs);
    let mut lambda = rhs.clone();
    stage.solve_system_transpose(&mut lambda);
    for _ in 0..refinements(stage) {
        let mut defect = rhs.clone();
        stage.subtract_system_transpose(&lambda, &mut defect);
        stage.solve_system_transpose(&mut defect);
        lambda.iter_mut().zip(&defect).for_each(|(l, d)| *l += d);
    }
    lambda
}
