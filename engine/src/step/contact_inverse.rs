//! Products with K for many columns at once, as exact as those with the system whose contacts are not condensed ([`super::contact_rows`]).
//!
//! ```text
//! K x = A x − P w/h,   F_w w = −F_v x
//! ```
//! What rounding does to w is the contact's own stiffness times next to nothing, along P, where K resists as stiffly: solved for, next to
//! nothing is left. In the sum A + P F_w⁻¹ F_v/h it would be along anything.

#![allow(clippy::needless_range_loop)] // plain loops are inlined; closures over vectors are not always, and then are slow

use super::StageRecord;
use crate::contact::Condensed;
use nalgebra::SMatrix;
use pulp::{Arch, Simd, WithSimd};

impl StageRecord {
    /// `out −= K x`, row-major with `columns`; of stages without bodies where nothing but nodes touches.
    pub fn subtract_condensed(&self, x: &[f64], out: &mut [f64], columns: usize) {
        struct Run<'a>(&'a StageRecord, &'a [f64], &'a mut [f64], usize);
        impl WithSimd for Run<'_> {
            type Output = ();
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) {
                let Self(stage, x, out, columns) = self;
                for (contact, &node) in stage.contacts.iter().zip(&stage.contact_nodes) {
                    let rows = 3 * node * columns..(3 * node + 3) * columns;
                    stage.add_impulses(simd, contact, &x[rows.clone()], &mut out[rows], columns);
                }
            }
        }
        debug_assert!(self.rows.is_empty() && self.spots.is_empty());
        self.matrix.nodes.add_mul_many(-1.0, x, out, columns);
        if !self.contacts.is_empty() && columns > 0 {
            Arch::new().dispatch(Run(self, x, out, columns));
        }
    }

    /// Calls `visit(node, ∂f/∂v⁺)` for every contact of a node, with its impulse eliminated and positions as they are [N·s/m].
    pub fn visit_contact_damping(&self, mut visit: impl FnMut(usize, [[f64; 3]; 3])) {
        for (contact, &node) in self.contacts.iter().zip(&self.contact_nodes) {
            let damping = contact.dp_dv / self.h;
            visit(node, std::array::from_fn(|r| std::array::from_fn(|c| damping[(r, c)])));
        }
    }

    /// `out += P w/h` in the rows of a contact's node.
    #[inline(always)]
    fn add_impulses<S: Simd>(&self, simd: S, contact: &Condensed, x: &[f64], out: &mut [f64], columns: usize) {
        let by_velocity = contact.df_dq * (self.h * self.scheme.free.a1) + contact.df_dv;
        let by_impulse = contact.dp_dw / self.h;
        let none = simd.splat_f64s(0.0);
        for first in (0..columns).step_by(S::F64_LANES) {
            let part = first..columns.min(first + S::F64_LANES);
            let mut near = [none; 3];
            for a in 0..3 {
                near[a] = simd.partial_load_f64s(&x[a * columns..][part.clone()]);
            }
            let f = product(simd, &by_velocity, &near, [none; 4]);
            let w = product(simd, &contact.inverse, &f, [none; 4]);
            // what the inverse's rounding leaves
            let left = product(simd, &-contact.df_dw, &w, f);
            let w = product(simd, &contact.inverse, &left, w);
            let change = product(simd, &by_impulse, &w, [none; 3]);
            for a in 0..3 {
                let to = &mut out[a * columns..][part.clone()];
                let now = simd.sub_f64s(simd.partial_load_f64s(to), change[a]);
                simd.partial_store_f64s(to, now);
            }
        }
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
