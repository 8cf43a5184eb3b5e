//! The transposed system whose contacts are not condensed ([`super::contact_rows`]), for many columns at once: rows of its inverse.
//!
//! Of stages without bodies in which nothing but nodes touches; `x` has nv rows, then four per contact, `columns` numbers each.
#![allow(clippy::needless_range_loop)] // plain loops are inlined; closures over vectors are not always, and then are slow

use super::StageRecord;
use nalgebra::{Matrix4x3, SMatrix};
use pulp::{Arch, Simd, WithSimd};

/// What is done with the rows of a contact and of its node.
#[derive(Clone, Copy)]
enum Work {
    /// `x_w ← F_w⁻ᵀ x_w`, `x_v ← x_v − F_vᵀ x_w`.
    Eliminate,
    /// `x_w ← x_w + (P F_w⁻¹)ᵀ x_v/h`.
    Recover,
}

impl StageRecord {
    /// `out −= systemᵀ · x`.
    pub fn subtract_system_transpose_many(&self, x: &[f64], out: &mut [f64], columns: usize) {
        struct Run<'a>(&'a StageRecord, &'a [f64], &'a mut [f64], usize);
        impl WithSimd for Run<'_> {
            type Output = ();
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) {
                let Self(stage, x, out, columns) = self;
                for c in 0..stage.contacts.len() {
                    stage.subtract_contact(simd, c, x, out, columns);
                }
            }
        }
        let split = self.v.len() * columns;
        self.matrix.nodes.add_mul_transpose_many(-1.0, &x[..split], &mut out[..split], columns);
        Arch::new().dispatch(Run(self, x, out, columns));
    }

    /// `b ← system⁻ᵀ b`.
    pub fn solve_system_transpose_many(&self, b: &mut [f64], columns: usize) {
        self.contacts_do(Work::Eliminate, b, columns);
        self.factor.solve_nodes_transpose(&mut b[..self.v.len() * columns], columns);
        self.contacts_do(Work::Recover, b, columns);
    }

    /// The first nv rows of the system's inverse, as columns: the first of `columns`, the others zero.
    pub fn transposed_inverse(&self, columns: usize, out: &mut Vec<f64>) {
        debug_assert!(self.rows.is_empty() && self.spots.is_empty());
        self.factor.transposed_inverse_of_nodes(columns, out);
        out.resize(self.n_rows() * columns, 0.0);
        self.contacts_do(Work::Recover, out, columns);
    }

    /// Calls `visit(node, ∂F/∂v⁺)` for every contact, positions as they are.
    pub fn visit_contact_rates(&self, mut visit: impl FnMut(usize, &Matrix4x3<f64>)) {
        self.contacts.iter().zip(&self.contact_nodes).for_each(|(contact, node)| visit(*node, &contact.df_dv));
    }

    /// Calls `visit(node, −∂p/∂v⁺/h)` for every contact condensed, positions as they are \[kg/s\].
    pub fn visit_contact_damping(&self, mut visit: impl FnMut(usize, [[f64; 3]; 3])) {
        for (contact, node) in self.contacts.iter().zip(&self.contact_nodes) {
            let block = contact.gain * contact.df_dv / self.h;
            visit(*node, [0, 1, 2].map(|a| [block[(a, 0)], block[(a, 1)], block[(a, 2)]]));
        }
    }

    fn contacts_do(&self, work: Work, b: &mut [f64], columns: usize) {
        struct Run<'a>(&'a StageRecord, Work, &'a mut [f64], usize);
        impl WithSimd for Run<'_> {
            type Output = ();
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) {
                let Self(stage, work, b, columns) = self;
                for c in 0..stage.contacts.len() {
                    match work {
                        Work::Eliminate => stage.eliminate_contact(simd, c, b, columns),
                        Work::Recover => stage.recover_contact(simd, c, b, columns),
                    }
                }
            }
        }
        Arch::new().dispatch(Run(self, work, b, columns));
    }

    #[inline(always)]
    fn subtract_contact<S: Simd>(&self, simd: S, c: usize, x: &[f64], out: &mut [f64], columns: usize) {
        let (contact, v, w) = (&self.contacts[c], 3 * self.contact_nodes[c], self.v.len() + 4 * c);
        let by_velocity = -self.f_v(c).transpose();
        let by_impulse = contact.dp_dw.transpose() / self.h;
        let own = -contact.df_dw.transpose();
        for first in (0..columns).step_by(S::F64_LANES) {
            let at = [first, columns];
            let (x_v, x_w) = (load::<S, 3>(simd, x, v, at), load::<S, 4>(simd, x, w, at));
            let out_v = product(simd, &by_velocity, &x_w, load::<S, 3>(simd, out, v, at));
            let out_w = product(simd, &by_impulse, &x_v, load::<S, 4>(simd, out, w, at));
            store(simd, out, v, at, out_v);
            store(simd, out, w, at, product(simd, &own, &x_w, out_w));
        }
    }

    #[inline(always)]
    fn eliminate_contact<S: Simd>(&self, simd: S, c: usize, b: &mut [f64], columns: usize) {
        let (v, w) = (3 * self.contact_nodes[c], self.v.len() + 4 * c);
        let (inverse, by_velocity) = (self.contacts[c].inverse.transpose(), -self.f_v(c).transpose());
        for first in (0..columns).step_by(S::F64_LANES) {
            let at = [first, columns];
            let x_w = product(simd, &inverse, &load::<S, 4>(simd, b, w, at), [simd.splat_f64s(0.0); 4]);
            let x_v = product(simd, &by_velocity, &x_w, load::<S, 3>(simd, b, v, at));
            store(simd, b, w, at, x_w);
            store(simd, b, v, at, x_v);
        }
    }

    #[inline(always)]
    fn recover_contact<S: Simd>(&self, simd: S, c: usize, b: &mut [f64], columns: usize) {
        let (v, w) = (3 * self.contact_nodes[c], self.v.len() + 4 * c);
        let gain = self.contacts[c].gain.transpose() / self.h;
        for first in (0..columns).step_by(S::F64_LANES) {
            let at = [first, columns];
            let x_w = product(simd, &gain, &load::<S, 3>(simd, b, v, at), load::<S, 4>(simd, b, w, at));
            store(simd, b, w, at, x_w);
        }
    }
}

/// A vector of each of `R` rows from `row` on, of columns `at[0]` on of `at[1]`.
#[inline(always)]
fn load<S: Simd, const R: usize>(simd: S, x: &[f64], row: usize, [first, columns]: [usize; 2]) -> [S::f64s; R] {
    let mut out = [simd.splat_f64s(0.0); R];
    let end = columns.min(first + S::F64_LANES);
    for r in 0..R {
        out[r] = simd.partial_load_f64s(&x[(row + r) * columns..(row + r + 1) * columns][first..end]);
    }
    out
}

/// The same back.
#[inline(always)]
fn store<S: Simd, const R: usize>(simd: S, x: &mut [f64], row: usize, [first, columns]: [usize; 2], values: [S::f64s; R]) {
    let end = columns.min(first + S::F64_LANES);
    for r in 0..R {
        simd.partial_store_f64s(&mut x[(row + r) * columns..(row + r + 1) * columns][first..end], values[r]);
    }
}

/// `sum + m x`.
#[inline(always)]
fn product<S: Simd, const R: usize, const C: usize>(
    simd: S,
    m: &SMatrix<f64, R, C>,
    x: &[S::f64s; C],
    mut sum: [S::f64s; R],
) -> [S::f64s; R] {
    for c in 0..C {
        for r in 0..R {
            sum[r] = simd.mul_add_e_f64s(simd.splat_f64s(m[(r, c)]), x[c], sum[r]);
        }
    }
    sum
}
