//! The matrix of what displacements do to all generalized forces ([`super::dynamics`]): every degree of freedom's row over those at or
//! before it, and its column over those before it, along the way to the root.

use super::dynamics::{Displacement, Partials, as_motion, force_column};
use super::frames::Frames;
use super::tree::Tree;
use nalgebra::{Matrix3, Vector6};
use pliant_math::simd::rows::{PADDING, combine};
use pliant_math::spatial::{column, product, transposed_product};
use pulp::{Arch, Simd, WithSimd};

/// Memory of [`Partials::add`].
#[derive(Clone, Debug, Default)]
pub(super) struct Spread {
    products: Vec<Products>,
    /// α, β, γ and S of all degrees of freedom, a row for each of their numbers, by pieces of [`PADDING`] columns.
    table: Vec<[[f64; PADDING]; 24]>,
    row: Vec<[f64; PADDING]>,
}

/// Entries of a degree of freedom's row in the columns (α; β; γ) at or before it, and its column of the axes S before it.
#[derive(Clone, Copy, Debug)]
struct Products {
    row: [f64; 18],
    column: [f64; 6],
}

/// First row of the axes S in the table.
const AXES: usize = 18;

/// Six numbers of degree of freedom `l` of a piece of the table, from row `first` on.
fn put(piece: &mut [[f64; PADDING]; 24], first: usize, l: usize, values: &Vector6<f64>) {
    (0..6).for_each(|k| piece[first + k][l] = values[k]);
}

/// Of a row without wrenches from outside: nothing but α and the angular part of β counts.
const INERTIAL: usize = 9;

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
        self.spread.row.resize(self.spread.table.len(), [0.0; PADDING]);
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

    /// Adds the mass matrix at what was gathered, armatures left out, to the row-major matrix `out` (rows `stride` apart): symmetric, so
    /// that every row is made up to its diagonal and written down its column too.
    pub fn add_mass(&mut self, tree: &Tree, frames: &Frames<f64>, out: &mut [f64], stride: usize) {
        self.spread.products.clear();
        for (dof, axis) in tree.dofs().iter().zip(&frames.axes) {
            let column = force_column(&self.inertia[dof.body].mul(&axis.s)).into();
            self.spread.products.push(Products { row: [0.0; 18], column });
        }
        self.spread.table.resize(frames.axes.len().div_ceil(PADDING), [[0.0; PADDING]; 24]);
        for (piece, axes) in self.spread.table.iter_mut().zip(frames.axes.chunks(PADDING)) {
            axes.iter().enumerate().for_each(|(l, axis)| put(piece, AXES, l, &column(&axis.s)));
        }
        self.spread.row.resize(self.spread.table.len(), [0.0; PADDING]);
        struct Run<'a>(&'a mut Spread, &'a Tree, &'a mut [f64], usize);
        impl WithSimd for Run<'_> {
            type Output = ();
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) {
                self.0.symmetric_rows(simd, self.1, self.2, self.3);
            }
        }
        Arch::new().dispatch(Run(&mut self.spread, tree, out, stride));
    }

    fn fill_products(&mut self, tree: &Tree, frames: &Frames<f64>) {
        self.spread.products.clear();
        for (i, dof) in tree.dofs().iter().enumerate() {
            let (inertia, b) = (&self.inertia[dof.body], &self.b[dof.body]);
            let s = &frames.axes[i].s;
            let own = &self.columns[i];
            let mut row = [0.0; 18];
            row[..6].copy_from_slice(force_column(&inertia.mul(s)).as_slice());
            row[6..9].copy_from_slice(b.tr_mul(s).as_slice());
            let gamma = as_motion(&own.gamma);
            let turning = own.beta.fixed_rows::<3>(0).into_owned();
            let carried = gamma.cross_force(&self.forces[dof.body]);
            let mut own_column = force_column(&(inertia.mul(&as_motion(&own.alpha)) + b.mul(&turning) + carried));
            if let Some([c, d]) = self.outside.get(dof.body) {
                let s = column(s);
                own_column += product(c, &own.gamma) + product(d, &own.beta);
                row[6..12].iter_mut().zip(&transposed_product(d, &s)).for_each(|(y, x)| *y += x);
                row[12..].copy_from_slice(transposed_product(c, &s).as_slice());
            }
            self.spread.products.push(Products { row, column: own_column.into() });
        }
    }

    fn fill_table(&mut self, frames: &Frames<f64>) {
        self.spread.table.resize(self.columns.len().div_ceil(PADDING), [[0.0; PADDING]; 24]);
        let pieces = self.columns.chunks(PADDING).zip(frames.axes.chunks(PADDING));
        for (piece, (columns, axes)) in self.spread.table.iter_mut().zip(pieces) {
            for (l, (columns, axis)) in columns.iter().zip(axes).enumerate() {
                put(piece, 0, l, &columns.alpha);
                put(piece, 6, l, &columns.beta);
                put(piece, 12, l, &columns.gamma);
                put(piece, AXES, l, &column(&axis.s));
            }
        }
    }

    #[inline(always)]
    fn spread_rows<S: Simd>(&mut self, simd: S, tree: &Tree, out: &mut [f64], stride: usize) {
        let Spread { products, table, row } = &mut self.spread;
        for (i, (dof, products)) in tree.dofs().iter().zip(products.iter()).enumerate() {
            // the joint's own degrees of freedom and all before it
            for run in tree.runs(Some(last_of_joint(tree, i))) {
                let pieces = run.start / PADDING..run.end.div_ceil(PADDING);
                let (row, table) = (&mut row[pieces.clone()], &table[pieces.clone()]);
                match products.row.first_chunk::<INERTIAL>().filter(|_| self.outside.is_empty()) {
                    Some(inertial) => combine::<S, INERTIAL, 0, 24>(simd, row, inertial, table),
                    None => combine::<S, 18, 0, 24>(simd, row, &products.row, table),
                }
                let row = &row.as_flattened()[run.start - PADDING * pieces.start..];
                for (out, x) in out[i * stride + run.start..i * stride + run.end].iter_mut().zip(row) {
                    *out += *x;
                }
            }
            // rows of those strictly before the joint see this degree of freedom from below
            for run in tree.runs(dof.before_joint) {
                let pieces = run.start / PADDING..run.end.div_ceil(PADDING);
                combine::<S, 6, AXES, 24>(simd, &mut row[pieces.clone()], &products.column, &table[pieces.clone()]);
                let row = &row[pieces.clone()].as_flattened()[run.start - PADDING * pieces.start..][..run.len()];
                for (out, x) in out[run.start * stride..].chunks_mut(stride).zip(row) {
                    out[i] += *x;
                }
            }
        }
    }
}

impl Spread {
    #[inline(always)]
    fn symmetric_rows<S: Simd>(&mut self, simd: S, tree: &Tree, out: &mut [f64], stride: usize) {
        let Self { products, table, row } = self;
        for (i, products) in products.iter().enumerate() {
            for run in tree.runs(Some(i)) {
                let pieces = run.start / PADDING..run.end.div_ceil(PADDING);
                combine::<S, 6, AXES, 24>(simd, &mut row[pieces.clone()], &products.column, &table[pieces.clone()]);
                let row = &row[pieces.clone()].as_flattened()[run.start - PADDING * pieces.start..][..run.len()];
                for (l, x) in run.zip(row) {
                    out[i * stride + l] += *x;
                    if l < i {
                        out[l * stride + i] += *x;
                    }
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
