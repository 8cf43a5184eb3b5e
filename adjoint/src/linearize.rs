//! Full Jacobians of a step: which way of taking them fits it.

use crate::inverse::Inverse;
use crate::linearization::{Linearization, VECTOR};
use crate::seeds::Seeds;
use crate::tangent::TangentStepper;
use pliant_engine::model::Model;
use pliant_engine::step::StepRecord;

/// Takes Jacobians of many steps of one model at one θ, in memory of its own.
#[derive(Clone, Debug)]
pub struct Linearizer<'m> {
    tangent: TangentStepper<'m>,
    inverse: Inverse,
    /// Of columns of θ alone, for C where A and B come from elsewhere; made when first needed.
    of_theta: Option<TangentStepper<'m>>,
    nv: usize,
    nx: usize,
    nu: usize,
    np: usize,
    /// Columns of the velocities: none of a step that does not depend on them, whose part of A is zero.
    of_v: usize,
}

impl<'m> Linearizer<'m> {
    /// Of A and B, and of C for all of θ if `with_theta`.
    pub fn new(model: &'m Model, theta: &'m [f64], with_theta: bool) -> Self {
        let (nx, nu) = (model.ndx(), model.nu());
        let np = if with_theta { model.n_params() } else { 0 };
        let nv = model.nv();
        let of_v = if model.forgets_velocities() { 0 } else { nv };
        let of_x = nx - nv + of_v;
        // rows of whole vectors, which the kernels need no remainders for
        let columns = (of_x + nu + np).next_multiple_of(VECTOR);
        let mut seeds = Seeds::none(columns, nu, model.n_params());
        (0..nu).for_each(|k| seeds.add_u(k, of_x + k, 1.0));
        (0..np).for_each(|k| seeds.add_theta(k, of_x + nu + k, 1.0));
        let tangent = TangentStepper::new(model, theta, seeds);
        Self { tangent, inverse: Inverse::default(), of_theta: None, nv, nx, nu, np, of_v }
    }

    /// The Jacobians of a step, from its factorization; C is empty unless asked for.
    pub fn linearize(&mut self, step: &StepRecord) -> Linearization {
        let cx = self.tangent.context();
        if let Some(ab) = self.inverse.linearize(cx, step, self.nu) {
            return Linearization { c: self.by_theta(step), ..ab };
        }
        let (nv, m, of_v) = (self.nv, self.tangent.seeds.columns, self.of_v);
        let x = &mut self.tangent.x;
        for (first, n, block) in [(0, nv, &mut x.q), (nv, of_v, &mut x.v), (nv + of_v, self.nx - 2 * nv, &mut x.z)] {
            block.fill(0.0);
            (0..n).for_each(|k| block[k * m + first + k] = 1.0);
        }
        self.tangent.step(step);
        let x = &self.tangent.x;
        let rows = || x.q.chunks_exact(m).chain(x.v.chunks_exact(m)).chain(x.z.chunks_exact(m));
        let of_x = self.nx - nv + of_v;
        let mut a = Vec::with_capacity(self.nx * self.nx);
        for row in rows() {
            a.extend_from_slice(&row[..nv + of_v]);
            a.resize(a.len() + nv - of_v, 0.0);
            a.extend_from_slice(&row[nv + of_v..of_x]);
        }
        let part = |from: usize, to: usize| {
            let mut out = Vec::with_capacity(self.nx * (to - from));
            rows().for_each(|r| out.extend_from_slice(&r[from..to]));
            out
        };
        Linearization { a, b: part(of_x, of_x + self.nu), c: part(of_x + self.nu, of_x + self.nu + self.np) }
    }

    /// C alone, of a step that remembers nothing.
    fn by_theta(&mut self, step: &StepRecord) -> Vec<f64> {
        if self.np == 0 {
            return Vec::new();
        }
        let all = &self.tangent;
        let tangent = self.of_theta.get_or_insert_with(|| {
            let mut seeds = Seeds::none(self.np.next_multiple_of(VECTOR), self.nu, self.np);
            (0..self.np).for_each(|k| seeds.add_theta(k, k, 1.0));
            all.with_seeds(seeds)
        });
        tangent.x.q.fill(0.0);
        tangent.x.v.fill(0.0);
        tangent.step(step);
        let (columns, x) = (tangent.seeds.columns, &tangent.x);
        let rows = x.q.chunks_exact(columns).chain(x.v.chunks_exact(columns));
        rows.flat_map(|row| &row[..self.np]).copied().collect()
    }
}

/// A and B, and C for all of θ if `with_theta` (else empty), from the factorization of the step; for many steps see [`Linearizer`].
pub fn linearize(model: &Model, theta: &[f64], step: &StepRecord, with_theta: bool) -> Linearization {
    Linearizer::new(model, theta, with_theta).linearize(step)
}
