//! The matrix of what displacements do to all generalized forces ([`super::dynamics`]): every degree of freedom's row over those at or
//! before it, and its column over those before it, along the way to the root.

use super::dynamics::{Displacement, Partials, as_motion, force_column};
use super::frames::Frames;
use super::spatial::{column, product, transposed_product};
use super::tree::Tree;
use crate::kkt::lanes::{PADDING, combine};
use nalgebra::Matrix3;
use pulp::{Arch, Simd, WithSimd};

/// Memory of [`Partials::add`].
#[derive(Clone, Debug, Default)]
pub(super) struct Spread {
    products: Vec<Products>,
    /// Row by row α, β and γ of all degrees of freedom and two rows of zeros, then S and two more, longer than these by [`PADDING`].
    table: Vec<f64>,
    row: Vec<f64>,
}

/// What a degree of freedom's row holds of the columns (α; β; γ) at or before it, and its column of the axes S before it, with the
/// opposite sign and filled up with zeros to fours.
#[derive(Clone, Copy, Debug)]
struct Products {
    row: [f64; 20],
    column: [f64; 8],
}

impl Partials {
    /// Adds the change of τ to the row-major matrix `out` (rows `stride` apart), for the displacement `by`; `turns` holds J of every
    /// joint that has one of its own (identity if empty).
    pub fn add(
        &mut self,
        tree: &Tree,
        frames: &Frames<f64>,
        by: Displacement,
        turns: &[Option<Matrix3<f64>>],
        out: &mut [f64],
        stride: usize,
    ) {
        self.fill_columns(tree, frames, by, turns);
        self.fill_products(tree, frames);
        self.fill_table(frames);
        self.spread.row.resize(tree.nv() + PADDING, 0.0);
        struct Run<'a>(&'a mut Partials, &'a Tree, &'a mut [f64], usize);
        impl WithSimd for Run<'_> {
            type Output = ();
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) {
                self.0.spread_rows(simd, self.1, self.2, self.3);
            }
        }
        Arch::new().dispatch(Run(self, tree, out, stride));
    }

    fn fill_products(&mut self, tree: &Tree, frames: &Frames<f64>) {
        self.spread.products.clear();
        for (i, dof) in tree.dofs().iter().enumerate() {
            let (inertia, b) = (&self.inertia[dof.body], &self.b[dof.body]);
            let s = &frames.axes[i].s;
            let own = &self.columns[i];
            let mut row = [0.0; 20];
            set_negative(&mut row[..6], force_column(&inertia.mul(s)).as_slice());
            set_negative(&mut row[6..9], b.tr_mul(s).as_slice());
            let gamma = as_motion(&own.gamma);
            let turning = own.beta.fixed_rows::<3>(0).into_owned();
            let carried = gamma.cross_force(&self.forces[dof.body]);
            let mut own_column = force_column(&(inertia.mul(&as_motion(&own.alpha)) + b.mul(&turning) + carried));
            if let Some([c, d]) = self.outside.get(dof.body) {
                let s = column(s);
                own_column += product(c, &own.gamma) + product(d, &own.beta);
                row[6..12].iter_mut().zip(&transposed_product(d, &s)).for_each(|(y, x)| *y -= x);
                set_negative(&mut row[12..18], transposed_product(c, &s).as_slice());
            }
            let mut column = [0.0; 8];
            set_negative(&mut column[..6], own_column.as_slice());
            self.spread.products.push(Products { row, column });
        }
    }

    fn fill_table(&mut self, frames: &Frames<f64>) {
        let stride = self.columns.len() + PADDING;
        self.spread.table.resize(28 * stride, 0.0);
        for (l, (columns, axis)) in self.columns.iter().zip(&frames.axes).enumerate() {
            let s = column(&axis.s);
            for (first, values) in [(0, &columns.alpha), (6, &columns.beta), (12, &columns.gamma), (20, &s)] {
                for (k, value) in values.iter().enumerate() {
                    self.spread.table[(first + k) * stride + l] = *value;
                }
            }
        }
    }

    #[inline(always)]
    fn spread_rows<S: Simd>(&mut self, simd: S, tree: &Tree, out: &mut [f64], stride: usize) {
        let width = self.columns.len() + PADDING;
        let (before, axes) = self.spread.table.split_at(20 * width);
        // without wrenches from outside nothing but α and the angular part of β counts
        let used = if self.outside.is_empty() { 12 } else { 20 };
        for (i, (dof, products)) in tree.dofs().iter().zip(&self.spread.products).enumerate() {
            // the joint's own degrees of freedom and all before it
            for run in tree.runs(Some(last_of_joint(tree, i))) {
                let row = &mut self.spread.row[..run.len().next_multiple_of(PADDING)];
                combine(simd, row, &products.row[..used], before, width, run.start);
                for (out, x) in out[i * stride + run.start..i * stride + run.end].iter_mut().zip(row) {
                    *out += *x;
                }
            }
            // rows of those strictly before the joint see this degree of freedom from below
            for run in tree.runs(dof.before_joint) {
                let row = &mut self.spread.row[..run.len().next_multiple_of(PADDING)];
                combine(simd, row, &products.column, axes, width, run.start);
                for (out, x) in out[run.start * stride..].chunks_mut(stride).zip(&row[..run.len()]) {
                    out[i] += *x;
                }
            }
        }
    }
}

/// The last degree of freedom of the joint of `i`.
fn last_of_joint(tree: &Tree, i: usize) -> usize {
    let joint = &tree.joints()[tree.dofs()[i].joint];
    joint.v + joint.kind.n_dofs() - 1
}

fn set_negative(to: &mut [f64], from: &[f64]) {
    to.iter_mut().zip(from).for_each(|(t, f)| *t = -f);
}
