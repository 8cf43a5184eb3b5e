//! The implicit function theorem, once.
//!
//! A stage is a root of r(y; p) = 0 with K = ∂r/∂y factored at the root:
//! ```text
//! jvp:  ẏ = −K⁻¹ (∂r/∂p) ṗ            vjp:  λ = −K⁻ᵀ ȳ,   p̄ += (∂r/∂p)ᵀ λ
//! ```
//! The minus of the theorem stands in [`negate`] and nowhere else. Solves are refined against the matrix
//! itself; many columns at once only where a probe shows that it changes them.

use crate::constants::ADJOINT;
use pliant_engine::step::StageRecord;

/// Contacts at a nanometre's rest gap are 1e7 times stiffer than the rope: systems with them need a second refinement.
pub(crate) fn refinements(stage: &StageRecord) -> usize {
    if stage.n_rows() == stage.v.len() { 1 } else { 2 }
}

fn negate(x: &mut [f64]) {
    x.iter_mut().for_each(|a| *a = -*a);
}

/// The sum of the columns, each divided by its largest entry: without that, one of large entries hides all others.
fn normalized_sum(x: &[f64], columns: usize) -> Vec<f64> {
    let mut largest = vec![0.0_f64; columns];
    largest_entries(x, &mut largest);
    largest.iter_mut().for_each(|m| *m = if *m > 0.0 { 1.0 / *m } else { 0.0 });
    x.chunks_exact(columns).map(|row| dot(row, &largest)).collect()
}

/// Raises `largest` to the largest magnitudes of the columns of `x`.
fn largest_entries(x: &[f64], largest: &mut [f64]) {
    for row in x.chunks_exact(largest.len()) {
        // plain comparisons: they pass NaN over, which then shows all the same
        largest.iter_mut().zip(row).for_each(|(m, x)| *m = if x.abs() > *m { x.abs() } else { *m });
    }
}

/// The product of two rows, in four lanes.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    let mut lanes = [0.0; 4];
    for (a, b) in a.iter().zip(b) {
        lanes.iter_mut().zip(a.iter().zip(b)).for_each(|(lane, (a, b))| *lane += a * b);
    }
    a_rest.iter().zip(b_rest).fold((lanes[0] + lanes[1]) + (lanes[2] + lanes[3]), |sum, (a, b)| sum + a * b)
}

/// Memory of [`root_tangent`], kept from one call to the next.
#[derive(Clone, Debug, Default)]
pub(crate) struct Refinement {
    rhs: Vec<f64>,
    pub defect: Vec<f64>,
    /// Largest entries of the columns of a solution and its correction.
    pub largest: [Vec<f64>; 2],
}

/// Replaces the residual's tangent `x` = (∂r/∂p) ṗ by that of the root, of which only the rows of velocities are meant; row-major,
/// `columns` directions per row.
///
/// Many columns are refined only if that changes their normalized sum, which is solved first as a probe, or if bodies touch: forces
/// shared by four legs may cancel in the sum. They are refined a second time only if the first says that it would show: each correction is to the one
/// before as that is to the solution. A single column is always refined fully.
pub(crate) fn root_tangent(stage: &StageRecord, x: &mut [f64], columns: usize, memory: &mut Refinement) {
    negate(x);
    let refine = columns <= 1 || stage.has_listed_contacts() || worth_refining(stage, normalized_sum(x, columns));
    if !refine {
        stage.solve_velocities(x, columns);
        return;
    }
    memory.rhs.clear();
    memory.rhs.extend_from_slice(x);
    stage.solve_system(x, columns);
    let velocities = stage.v.len() * columns;
    for left in (0..refinements(stage)).rev() {
        memory.defect.clear();
        memory.defect.extend_from_slice(&memory.rhs);
        stage.subtract_system(x, &mut memory.defect, columns);
        stage.solve_velocities(&mut memory.defect, columns);
        let (solution, correction) = (&x[..velocities], &memory.defect[..velocities]);
        let done = left == 0 || (columns > 1 && settled(solution, correction, columns, &mut memory.largest));
        let end = if done {
            velocities
        } else {
            stage.recover_impulses(&mut memory.defect, columns);
            x.len()
        };
        x[..end].iter_mut().zip(&memory.defect).for_each(|(x, d)| *x += d);
        if done {
            break;
        }
    }
}

/// Whether the correction after `d` would be below [`ADJOINT`]`.refined` of the largest entry of `x`, in every column.
pub(crate) fn settled(x: &[f64], d: &[f64], columns: usize, largest: &mut [Vec<f64>; 2]) -> bool {
    for (largest, rows) in largest.iter_mut().zip([x, d]) {
        largest.clear();
        largest.resize(columns, 0.0);
        largest_entries(rows, largest);
    }
    largest[0].iter().zip(&largest[1]).all(|(x, d)| d * d <= ADJOINT.refined * x * x)
}

/// Whether a refinement changes the solution for `rhs` by more than [`ADJOINT`]`.refined` of its largest entry.
pub(crate) fn worth_refining(stage: &StageRecord, rhs: Vec<f64>) -> bool {
    let largest = |x: &[f64]| x[..stage.v.len()].iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let mut x = rhs.clone();
    stage.solve_system(&mut x, 1);
    let mut defect = rhs;
    stage.subtract_system(&x, &mut defect, 1);
    stage.solve_system(&mut defect, 1);
    // written so that NaN is refined, and shows
    let settled = largest(&defect) <= ADJOINT.refined * largest(&x);
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
