//! From a [`Section`] to a [`SectionLaw`], by dual numbers.

use super::{Moments, Section, SectionLaw, SectionPoint};
use nalgebra::SVector;
use num_dual::{Derivative, DualSVec64};

/// Most parameters of a section, and directions of a dual number.
const MAX_PARAMS: usize = 12;
const CHUNK: usize = 6;
type Dual = DualSVec64<CHUNK>;

/// A section's law with automatic derivatives.
#[derive(Clone, Debug)]
pub struct AutomaticSection<L> {
    /// The law.
    pub law: L,
}

fn seeded(value: f64, direction: usize) -> Dual {
    let mut unit = SVector::zeros();
    unit[direction] = 1.0;
    Dual::new(value, Derivative::some(unit))
}

impl<L: Section> AutomaticSection<L> {
    /// Most parameters that a law may read.
    pub const MAX_PARAMS: usize = MAX_PARAMS;

    /// # Panics
    /// If the law reads more than [`Self::MAX_PARAMS`] parameters: a mistake in its code.
    pub fn new(law: L) -> Self {
        assert!(law.params().len() + law.own(0).len() <= MAX_PARAMS, "{}: more than {MAX_PARAMS} parameters", law.name());
        Self { law }
    }

    fn params(&self, joint: usize) -> impl Iterator<Item = usize> + Clone {
        self.law.params().iter().copied().chain(self.law.own(joint))
    }

    fn values<T: Copy>(&self, joint: usize, of: impl Fn(usize) -> T, zero: T) -> ([T; MAX_PARAMS], usize) {
        let (mut out, mut n) = ([zero; MAX_PARAMS], 0);
        for (x, k) in out.iter_mut().zip(self.params(joint)) {
            (*x, n) = (of(k), n + 1);
        }
        (out, n)
    }
}

impl<L: Section> SectionLaw for AutomaticSection<L> {
    fn name(&self) -> &str {
        self.law.name()
    }

    fn add_moment(&self, at: &SectionPoint, m: &mut [f64; 3]) {
        let (p, n) = self.values(at.joint, |k| at.theta[k], 0.0);
        let by = self.law.moment(at.joint, at.fraction, &at.strain, &at.rate, &p[..n]);
        m.iter_mut().zip(by).for_each(|(m, by)| *m += by);
    }

    fn add(&self, at: &SectionPoint, out: &mut Moments) {
        let (p, n) = self.values(at.joint, |k| Dual::from_re(at.theta[k]), Dual::from_re(0.0));
        let strain = std::array::from_fn(|s| seeded(at.strain[s], s));
        let rate = std::array::from_fn(|s| seeded(at.rate[s], 3 + s));
        for (s, m) in self.law.moment(at.joint, at.fraction, &strain, &rate, &p[..n]).into_iter().enumerate() {
            out.m[s] += m.re;
            if let Some(by) = m.eps.0 {
                (0..3).for_each(|k| out.by_strain[s][k] += by[k]);
                (0..3).for_each(|k| out.by_rate[s][k] += by[3 + k]);
            }
        }
    }

    fn visit_theta(&self, at: &SectionPoint, visit: &mut dyn FnMut(usize, [f64; 3])) {
        let n = self.params(at.joint).count();
        let constant = |x: &[f64; 3]| x.map(Dual::from_re);
        for first in (0..n).step_by(CHUNK) {
            let mut p = [Dual::from_re(0.0); MAX_PARAMS];
            for (k, index) in self.params(at.joint).enumerate() {
                let here = k.checked_sub(first).filter(|d| *d < CHUNK);
                p[k] = here.map_or(Dual::from_re(at.theta[index]), |d| seeded(at.theta[index], d));
            }
            let m = self.law.moment(at.joint, at.fraction, &constant(&at.strain), &constant(&at.rate), &p[..n]);
            for (d, index) in self.params(at.joint).skip(first).take(CHUNK).enumerate() {
                visit(index, std::array::from_fn(|s| m[s].eps.0.map_or(0.0, |by| by[d])));
            }
        }
    }

    fn energy(&self, at: &SectionPoint) -> f64 {
        let (p, n) = self.values(at.joint, |k| at.theta[k], 0.0);
        self.law.energy(at.joint, at.fraction, &at.strain, &p[..n])
    }
}
