//! Products of many columns with what the contacts of solids add to a stage's system ([`super::spot_rows`]): row by row in the
//! processor's vectors, four degrees of freedom or the four numbers of a cone at a time.

use super::StageRecord;
use super::spot_rows::{SpotDof, SpotRecord};
use crate::kkt::lanes::{joined, subtract_four, support};
use nalgebra::{Matrix4, Vector4};
use pulp::{Arch, Simd, WithSimd};
use std::ops::Range;

/// A row-major matrix of some columns.
#[derive(Clone, Copy)]
struct Rows<'a> {
    data: &'a [f64],
    columns: usize,
}

impl<'a> Rows<'a> {
    #[inline(always)]
    fn row(self, r: usize, range: &Range<usize>) -> &'a [f64] {
        &self.data[r * self.columns..(r + 1) * self.columns][range.clone()]
    }

    #[inline(always)]
    fn four(self, first: usize, range: &Range<usize>) -> [&'a [f64]; 4] {
        [0, 1, 2, 3].map(|a| self.row(first + a, range))
    }

    /// Columns in which one of the rows from `first` on is not zero.
    #[inline(always)]
    fn support(self, rows: impl Iterator<Item = usize>) -> Range<usize> {
        let all = 0..self.columns;
        rows.fold(0..0, |range, r| joined(&range, &support(self.row(r, &all))))
    }
}

/// `y −= Σ_dof part(dof) x_dof` for the four rows of a contact, of which `y` holds all columns.
#[inline(always)]
fn subtract_dofs<S: Simd>(
    simd: S,
    y: &mut [f64],
    part: impl Fn(&SpotDof) -> Vector4<f64>,
    dofs: &[SpotDof],
    x: Rows,
    range: &Range<usize>,
) {
    for some in dofs.chunks(4) {
        // the last is taken again, times nothing, where there are no four
        let last = some.len() - 1;
        let rows = [0, 1, 2, 3].map(|i: usize| x.row(some[i.min(last)].v, range));
        let parts = [0, 1, 2, 3].map(|i: usize| if i <= last { part(&some[i]) } else { Vector4::zeros() });
        for (r, y) in y.chunks_exact_mut(x.columns).enumerate() {
            subtract_four(simd, &mut y[range.clone()], parts.map(|p| p[r]), rows);
        }
    }
}

/// `y −= m x` for four rows of y, of which `y` holds all columns, and four of `x`.
#[inline(always)]
fn subtract_product<S: Simd>(simd: S, y: &mut [f64], m: &Matrix4<f64>, x: [&[f64]; 4], columns: usize, range: &Range<usize>) {
    for (r, y) in y.chunks_exact_mut(columns).enumerate() {
        subtract_four(simd, &mut y[range.clone()], [m[(r, 0)], m[(r, 1)], m[(r, 2)], m[(r, 3)]], x);
    }
}

/// `out_dof −= scale · impulse · w` for all degrees of freedom of a contact.
#[inline(always)]
fn subtract_impulse<S: Simd>(
    simd: S,
    out: &mut [f64],
    scale: f64,
    spot: &SpotRecord,
    w: [&[f64]; 4],
    columns: usize,
    range: &Range<usize>,
) {
    for dof in &spot.dofs {
        let y = &mut out[dof.v * columns..(dof.v + 1) * columns][range.clone()];
        subtract_four(simd, y, (dof.impulse * scale).into(), w);
    }
}

/// What is done to the rows of all contacts.
enum Task<'a> {
    /// `out −= system · x`.
    Subtract { x: &'a [f64], out: &'a mut [f64] },
    /// `b_v += impulse F_w⁻¹ b_w/h`.
    Eliminate { b: &'a mut [f64] },
    /// `b_w ← F_w⁻¹ (b_w − slope b_v)`.
    Recover { b: &'a mut [f64] },
    /// `out_w += scale ∂F/∂q̄ q`.
    Positions { scale: f64, q: &'a [f64], out: &'a mut [f64] },
}

struct Run<'a> {
    record: &'a StageRecord,
    task: Task<'a>,
    columns: usize,
}

impl WithSimd for Run<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { record, task, columns } = self;
        match task {
            Task::Subtract { x, out } => record.subtract_with(simd, Rows { data: x, columns }, out),
            Task::Eliminate { b } => record.eliminate_with(simd, b, columns),
            Task::Recover { b } => record.recover_with(simd, b, columns),
            Task::Positions { scale, q, out } => record.positions_with(simd, scale, Rows { data: q, columns }, out),
        }
    }
}

impl StageRecord {
    fn run(&self, task: Task, columns: usize) {
        if !self.spots.is_empty() {
            Arch::new().dispatch(Run { record: self, task, columns });
        }
    }

    pub(super) fn subtract_spots(&self, x: &[f64], out: &mut [f64], columns: usize) {
        if columns == 1 {
            return self.subtract_spots_one(x, out);
        }
        self.run(Task::Subtract { x, out }, columns);
    }

    #[inline(always)]
    fn subtract_with<S: Simd>(&self, simd: S, x: Rows, out: &mut [f64]) {
        let (columns, all) = (x.columns, 0..x.columns);
        let (velocities, cones) = out.split_at_mut(self.spot_row(0) * columns);
        for (k, (spot, y)) in self.spots.iter().zip(cones.chunks_exact_mut(4 * columns)).enumerate() {
            let w = x.four(self.spot_row(k), &all);
            subtract_impulse(simd, velocities, -1.0 / self.h, spot, w, columns, &all);
            subtract_dofs(simd, y, |dof| dof.slope, &spot.dofs, x, &all);
            subtract_product(simd, y, &spot.f_w, w, columns, &all);
        }
    }

    /// `b_v += impulse F_w⁻¹ b_w/h`.
    pub(super) fn eliminate_spots(&self, b: &mut [f64], columns: usize) {
        if columns == 1 {
            return self.eliminate_spots_one(b);
        }
        self.run(Task::Eliminate { b }, columns);
    }

    #[inline(always)]
    fn eliminate_with<S: Simd>(&self, simd: S, b: &mut [f64], columns: usize) {
        let (velocities, cones) = b.split_at_mut(self.spot_row(0) * columns);
        // F_w⁻¹ first: its large entries cancel there
        let mut w = vec![0.0; 4 * columns];
        for (spot, cone) in self.spots.iter().zip(cones.chunks_exact(4 * columns)) {
            let cone = Rows { data: cone, columns };
            let range = cone.support(0..4);
            w.fill(0.0);
            subtract_product(simd, &mut w, &-spot.inverse, cone.four(0, &range), columns, &range);
            let w = Rows { data: &w, columns }.four(0, &range);
            subtract_impulse(simd, velocities, -1.0 / self.h, spot, w, columns, &range);
        }
    }

    /// `b_w ← F_w⁻¹ (b_w − slope b_v)`.
    pub(super) fn recover_spots(&self, b: &mut [f64], columns: usize) {
        if columns == 1 {
            return self.recover_spots_one(b);
        }
        self.run(Task::Recover { b }, columns);
    }

    #[inline(always)]
    fn recover_with<S: Simd>(&self, simd: S, b: &mut [f64], columns: usize) {
        let (velocities, cones) = b.split_at_mut(self.spot_row(0) * columns);
        let (velocities, all) = (Rows { data: velocities, columns }, 0..columns);
        let mut w = vec![0.0; 4 * columns];
        for (spot, cone) in self.spots.iter().zip(cones.chunks_exact_mut(4 * columns)) {
            w.copy_from_slice(cone);
            subtract_dofs(simd, &mut w, |dof| dof.slope, &spot.dofs, velocities, &all);
            cone.fill(0.0);
            subtract_product(simd, cone, &-spot.inverse, Rows { data: &w, columns }.four(0, &all), columns, &all);
        }
    }

    pub(super) fn add_spot_positions(&self, scale: f64, q: &[f64], out: &mut [f64], columns: usize) {
        if columns == 1 {
            return self.add_spot_positions_one(scale, q, out);
        }
        self.run(Task::Positions { scale, q, out }, columns);
    }

    #[inline(always)]
    fn positions_with<S: Simd>(&self, simd: S, scale: f64, q: Rows, out: &mut [f64]) {
        let columns = q.columns;
        let supports: Vec<Range<usize>> = (0..self.v.len()).map(|r| q.support(r..r + 1)).collect();
        let cones = &mut out[self.spot_row(0) * columns..];
        for (spot, y) in self.spots.iter().zip(cones.chunks_exact_mut(4 * columns)) {
            for dofs in spot.dofs.chunks(4) {
                let range = dofs.iter().fold(0..0, |range, dof| joined(&range, &supports[dof.v]));
                subtract_dofs(simd, y, |dof| dof.by_q * -scale, dofs, q, &range);
            }
        }
    }
}
