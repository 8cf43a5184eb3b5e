//! Many columns of the system of a stage ([`super::system`]): row by row in the processor's vectors, four rows of the right-hand side at
//! a time.

use super::StageRecord;
use super::system::for_blocks;
use crate::step::constraints::{Block, DofPartial};
use nalgebra::{SMatrix, SVector};
use pliant_math::simd::rows::{joined, subtract_four, support};
use pulp::{Arch, Simd, WithSimd};
use std::ops::Range;

/// A row-major matrix of some columns.
#[derive(Clone, Copy)]
pub(super) struct Rows<'a> {
    pub data: &'a [f64],
    pub columns: usize,
}

impl<'a> Rows<'a> {
    #[inline(always)]
    fn row(self, r: usize, range: &Range<usize>) -> &'a [f64] {
        &self.data[r * self.columns..(r + 1) * self.columns][range.clone()]
    }

    /// `M` rows.
    #[inline(always)]
    fn block<const M: usize>(self, first: usize, range: &Range<usize>) -> [&'a [f64]; M] {
        std::array::from_fn(|a| self.row(first + a, range))
    }

    /// Columns in which one of the rows is not zero.
    #[inline(always)]
    fn support(self, rows: impl Iterator<Item = usize>) -> Range<usize> {
        let all = 0..self.columns;
        rows.fold(0..0, |range, r| joined(&range, &support(self.row(r, &all))))
    }
}

/// Tasks of many columns.
pub(super) enum Task<'a> {
    /// `out −= system · x`, but for A.
    Subtract { x: Rows<'a>, out: &'a mut [f64] },
    /// `out −= systemᵀ · x`, but for A.
    SubtractTranspose { x: Rows<'a>, out: &'a mut [f64] },
    /// `b_v += impulse F_λ⁻¹ b_λ/h`.
    Eliminate { b: &'a mut [f64], columns: usize },
    /// `b_λ ← F_λ⁻ᵀ b_λ`, `b_v −= slopeᵀ b_λ`.
    EliminateTranspose { b: &'a mut [f64], columns: usize },
    /// `b_λ ← F_λ⁻¹ (b_λ − slope b_v)`.
    Recover { b: &'a mut [f64], columns: usize },
    /// `b_λ += F_λ⁻ᵀ impulseᵀ b_v/h`.
    RecoverTranspose { b: &'a mut [f64], columns: usize },
    /// `out_λ += scale ∂F/∂q̄ q`.
    Positions { scale: f64, q: Rows<'a>, out: &'a mut [f64] },
}

/// `y −= Σ a_k x_k` for M rows.
#[inline(always)]
fn subtract_rows<S: Simd, const M: usize>(simd: S, y: &mut [f64], a: [f64; M], x: [&[f64]; M]) {
    // the last is taken again, times nothing, where there are no four
    let padded = std::array::from_fn(|k| if k < M { a[k] } else { 0.0 });
    subtract_four(simd, y, padded, std::array::from_fn(|k| x[k.min(M - 1)]));
}

/// `y_r −= Σ_dof part(dof)_r x_dof` for the M rows of a constraint, of which `y` holds all columns.
#[inline(always)]
fn subtract_dofs<S: Simd, const M: usize>(
    simd: S,
    y: &mut [f64],
    part: impl Fn(&DofPartial<M>) -> SVector<f64, M>,
    dofs: &[DofPartial<M>],
    x: Rows,
    range: &Range<usize>,
) {
    for some in dofs.chunks(4) {
        let last = some.len() - 1;
        let rows = [0, 1, 2, 3].map(|i: usize| x.row(some[i.min(last)].v, range));
        let parts = [0, 1, 2, 3].map(|i: usize| if i <= last { part(&some[i]) } else { SVector::zeros() });
        for (r, y) in y.chunks_exact_mut(x.columns).enumerate() {
            subtract_four(simd, &mut y[range.clone()], parts.map(|p| p[r]), rows);
        }
    }
}

/// `y −= m x` for M rows of y, of which `y` holds all columns, and M of `x`.
#[inline(always)]
fn subtract_product<S: Simd, const M: usize>(
    simd: S,
    y: &mut [f64],
    m: &SMatrix<f64, M, M>,
    x: [&[f64]; M],
    columns: usize,
    range: &Range<usize>,
) {
    for (r, y) in y.chunks_exact_mut(columns).enumerate() {
        subtract_rows(simd, &mut y[range.clone()], std::array::from_fn(|c| m[(r, c)]), x);
    }
}

/// `out_dof −= part(dof) · w` for all degrees of freedom of a constraint.
#[inline(always)]
fn subtract_from_dofs<S: Simd, const M: usize>(
    simd: S,
    out: &mut [f64],
    part: impl Fn(&DofPartial<M>) -> SVector<f64, M>,
    dofs: &[DofPartial<M>],
    w: [&[f64]; M],
    columns: usize,
    range: &Range<usize>,
) {
    for dof in dofs {
        let y = &mut out[dof.v * columns..(dof.v + 1) * columns][range.clone()];
        subtract_rows(simd, y, part(dof).into(), w);
    }
}

/// Rows of a constraint in `x`, and the velocities before them.
#[inline(always)]
fn split<const M: usize>(x: &mut [f64], row: usize, columns: usize) -> (&mut [f64], &mut [f64]) {
    let (before, from) = x.split_at_mut(row * columns);
    (before, &mut from[..M * columns])
}

impl<const M: usize> Block<M> {
    #[inline(always)]
    fn run<S: Simd>(&self, simd: S, h: f64, task: &mut Task, Scratch { rows: scratch, supports }: &mut Scratch) {
        let impulse = |dof: &DofPartial<M>| dof.impulse * (-1.0 / h);
        match task {
            Task::Subtract { x, out } => {
                let (all, columns) = (0..x.columns, x.columns);
                let lambda = x.block::<M>(self.row, &all);
                let (velocities, y) = split::<M>(out, self.row, columns);
                subtract_from_dofs(simd, velocities, impulse, &self.dofs, lambda, columns, &all);
                subtract_dofs(simd, y, |dof| dof.slope, &self.dofs, *x, &all);
                subtract_product(simd, y, &self.f_lambda, lambda, columns, &all);
            }
            Task::SubtractTranspose { x, out } => {
                let (all, columns) = (0..x.columns, x.columns);
                let lambda = x.block::<M>(self.row, &all);
                let (velocities, y) = split::<M>(out, self.row, columns);
                subtract_from_dofs(simd, velocities, |dof| dof.slope, &self.dofs, lambda, columns, &all);
                subtract_dofs(simd, y, impulse, &self.dofs, *x, &all);
                subtract_product(simd, y, &self.f_lambda.transpose(), lambda, columns, &all);
            }
            Task::Eliminate { b, columns } => {
                let (columns, (velocities, lambda)) = (*columns, split::<M>(b, self.row, *columns));
                let lambda = Rows { data: lambda, columns };
                let range = lambda.support(0..M);
                // F_λ⁻¹ first: its large entries cancel there
                let w = cleared(scratch, M * columns);
                subtract_product(simd, w, &-self.inverse, lambda.block(0, &range), columns, &range);
                let w = Rows { data: w, columns }.block(0, &range);
                subtract_from_dofs(simd, velocities, impulse, &self.dofs, w, columns, &range);
            }
            Task::EliminateTranspose { b, columns } => {
                let (columns, all, (velocities, lambda)) = (*columns, 0..*columns, split::<M>(b, self.row, *columns));
                let w = cleared(scratch, M * columns);
                subtract_product(
                    simd,
                    w,
                    &-self.inverse.transpose(),
                    Rows { data: lambda, columns }.block(0, &all),
                    columns,
                    &all,
                );
                lambda.copy_from_slice(w);
                let w = Rows { data: w, columns }.block(0, &all);
                subtract_from_dofs(simd, velocities, |dof| dof.slope, &self.dofs, w, columns, &all);
            }
            Task::Recover { b, columns } => {
                let (columns, all, (velocities, lambda)) = (*columns, 0..*columns, split::<M>(b, self.row, *columns));
                let w = cleared(scratch, M * columns);
                w.copy_from_slice(lambda);
                subtract_dofs(simd, w, |dof| dof.slope, &self.dofs, Rows { data: velocities, columns }, &all);
                lambda.fill(0.0);
                subtract_product(simd, lambda, &-self.inverse, Rows { data: w, columns }.block(0, &all), columns, &all);
            }
            Task::RecoverTranspose { b, columns } => {
                let (columns, all, (velocities, lambda)) = (*columns, 0..*columns, split::<M>(b, self.row, *columns));
                let w = cleared(scratch, M * columns);
                subtract_dofs(simd, w, impulse, &self.dofs, Rows { data: velocities, columns }, &all);
                subtract_product(
                    simd,
                    lambda,
                    &-self.inverse.transpose(),
                    Rows { data: w, columns }.block(0, &all),
                    columns,
                    &all,
                );
            }
            Task::Positions { scale, q, out } => {
                let (_, y) = split::<M>(out, self.row, q.columns);
                for dofs in self.dofs.chunks(4) {
                    let range = dofs.iter().fold(0..0, |range, dof| joined(&range, &supports[dof.v]));
                    subtract_dofs(simd, y, |dof| dof.by_q * -*scale, dofs, *q, &range);
                }
            }
        }
    }
}

/// Memory of a task.
#[derive(Default)]
struct Scratch {
    rows: Vec<f64>,
    /// Columns in which each row of positions is not zero.
    supports: Vec<Range<usize>>,
}

/// `count` zeros.
fn cleared(scratch: &mut Vec<f64>, count: usize) -> &mut [f64] {
    scratch.clear();
    scratch.resize(count, 0.0);
    scratch
}

struct Run<'a, 'b>(&'a StageRecord, Task<'b>);

impl WithSimd for Run<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (Self(stage, mut task), mut scratch) = (self, Scratch::default());
        if let Task::Positions { q, .. } = &task {
            scratch.supports.extend((0..stage.v.len()).map(|r| q.support(r..r + 1)));
        }
        for_blocks!(stage, block => block.run(simd, stage.h, &mut task, &mut scratch));
    }
}

impl StageRecord {
    pub(super) fn run(&self, task: Task) {
        if !(self.constraints.joints.is_empty() && self.constraints.cones.is_empty()) {
            Arch::new().dispatch(Run(self, task));
        }
    }
}
