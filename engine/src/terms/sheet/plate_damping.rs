//! Viscous resistance to bending of a triangle and its flaps.

use super::fold::Fold;
use super::patch::{Each, FLAPS, Patch, Shape, times};
use super::plate::{folds_of, leverage, weighted};
use crate::terms::{Automatic, Element, Law, Point, Term};
use pliant_linalg::NodeMatrix;
use pliant_math::{Real, Vec3};

/// R = ½ ψ̇ᵀ K_c ψ̇, ψ̇ = Σ (∂ψ/∂x)·v, K_c the K of [`PlateLaw`](super::PlateLaw) with the coefficient c_b in place of D; f = −∂R/∂v.
///
/// So a plate that bends at the rate Ḣ dissipates c_b [(1 − ν) |Ḣ|² + ν tr(Ḣ)²] per area. Nodes and constants as in
/// [`PlateLaw`](super::PlateLaw). Parameters: c_b \[N·m·s\], Poisson's ratio ν [-]. Rigid motions dissipate nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct PlateDampingLaw;

impl Law for PlateDampingLaw {
    fn name(&self) -> &str {
        "plate_damping"
    }

    fn force<S: Real>(&self, q: &[Vec3<S>], v: &[Vec3<S>], p: &[S], constants: &[f64], f: &mut [Vec3<S>]) {
        let shape = Shape::new(q.len() - 3, constants);
        let (_, slopes) = folds_of(&shape, q);
        let mut rates = [S::zero(); FLAPS];
        for i in 0..shape.flaps {
            let nodes = shape.nodes(i);
            rates[i] = nodes.iter().zip(&slopes[i]).fold(S::zero(), |sum, (&k, g)| sum + g.dot(&v[k]));
        }
        let w = times(shape.flaps, &shape.stiffness(p[1]), &rates);
        for i in 0..shape.flaps {
            for (k, g) in shape.nodes(i).into_iter().zip(&slopes[i]) {
                f[k] -= g * (w[i] * p[0]);
            }
        }
    }

    fn symmetric(&self, p: &[f64]) -> bool {
        p[0] == 0.0
    }
}

/// [`PlateDampingLaw`] on many patches, with hand-derived Jacobians: w = K_c ψ̇,
///
/// ∂f/∂v = −Σᵢⱼ Kᵢⱼ (∂ψᵢ/∂x)(∂ψⱼ/∂x)ᵀ,   ∂f/∂x = −Σᵢ wᵢ ∂²ψᵢ/∂x² − Σᵢⱼ Kᵢⱼ (∂ψᵢ/∂x)(∂²ψⱼ/∂x² v)ᵀ
#[derive(Clone, Debug)]
pub struct PlateDamping {
    automatic: Automatic<PlateDampingLaw>,
    patches: Vec<Patch>,
}

impl PlateDamping {
    /// Damping of the elements' patches; see [`PlateDampingLaw`] for what an element holds.
    ///
    /// # Panics
    /// If an element is not of the law's shape: a mistake where elements are built.
    pub fn new(elements: Vec<Element>) -> Self {
        let patches = Patch::all(PlateDampingLaw.name(), &elements);
        Self { automatic: Automatic::new(PlateDampingLaw, elements), patches }
    }

    /// Calls `each(patch, folds, K, w)` for every patch with a coefficient.
    #[inline]
    fn for_each(&self, at: &Point, mut each: impl FnMut(&Patch, &Each<Fold>, &Each<Each<f64>>, &Each<f64>)) {
        for patch in &self.patches {
            let [coefficient, nu] = patch.params.map(|k| at.theta[k]);
            if coefficient != 0.0 {
                let k = patch.shape.stiffness(nu).map(|row| row.map(|x| x * coefficient));
                let folds = patch.folds(at);
                let w = times(patch.shape.flaps, &k, &rates(patch, &folds, at));
                each(patch, &folds, &k, &w);
            }
        }
    }
}

/// ψ̇ᵢ.
fn rates(patch: &Patch, folds: &Each<Fold>, at: &Point) -> Each<f64> {
    std::array::from_fn(|i| {
        if i < patch.shape.flaps {
            folds[i].gradient.iter().zip(&patch.velocities(at, i)).map(|(g, v)| g.dot(v)).sum()
        } else {
            0.0
        }
    })
}

impl Term for PlateDamping {
    fn name(&self) -> &str {
        PlateDampingLaw.name()
    }

    fn inner(&self) -> bool {
        true
    }

    fn add_force(&self, at: &Point, f: &mut [f64]) {
        self.for_each(at, |patch, folds, _, w| patch.add_force(f, folds, w));
    }

    fn add_jacobian(&self, at: &Point, f: &mut [f64], dq: &mut NodeMatrix, dv: &mut NodeMatrix) {
        self.for_each(at, |patch, folds, k, w| {
            patch.add_force(f, folds, w);
            let n = patch.shape.flaps;
            let slopes = patch.spread(|i| folds[i].gradient);
            patch.add_symmetric(dv, None, &slopes, &weighted(n, k, &slopes), &[None; FLAPS]);

            let hessians = folds.each_ref().map(Fold::angle_hessian);
            let turned = patch.spread(|i| folds[i].curvature_along(&hessians[i], &patch.velocities(at, i)));
            let mut to_rates = weighted(n, k, &turned);
            for i in 0..n {
                let curve = w[i] * folds[i].curve();
                to_rates[i].iter_mut().zip(&slopes[i]).for_each(|(z, y)| *z += y * curve);
            }
            patch.add_general(dq, &slopes, &to_rates, &leverage(folds, w), &hessians);
        });
    }

    fn visit_theta(&self, at: &Point, visit: &mut dyn FnMut(usize, usize, f64)) {
        for patch in &self.patches {
            let (n, [coefficient, nu]) = (patch.shape.flaps, patch.params.map(|k| at.theta[k]));
            let folds = patch.folds(at);
            let rates = rates(patch, &folds, at);
            patch.visit(patch.params[0], &folds, &times(n, &patch.shape.stiffness(nu), &rates), visit);
            let by_nu = times(n, &patch.shape.stiffness_slope(nu), &rates).map(|w| w * coefficient);
            patch.visit(patch.params[1], &folds, &by_nu, visit);
        }
    }

    fn pull_theta(&self, at: &Point, weights: &[f64], sums: &mut [f64]) {
        for patch in &self.patches {
            let (n, [coefficient, nu]) = (patch.shape.flaps, patch.params.map(|k| at.theta[k]));
            let folds = patch.folds(at);
            let rates = rates(patch, &folds, at);
            let pulled = patch.pulled(&folds, weights);
            let along = |k: Each<Each<f64>>| -> f64 { times(n, &k, &rates).iter().zip(&pulled).map(|(w, x)| w * x).sum() };
            sums[patch.params[0]] -= along(patch.shape.stiffness(nu));
            if coefficient != 0.0 {
                sums[patch.params[1]] -= coefficient * along(patch.shape.stiffness_slope(nu));
            }
        }
    }

    fn symmetric(&self, theta: &[f64]) -> bool {
        self.patches.iter().all(|patch| theta[patch.params[0]] == 0.0)
    }

    fn visit_stencils(&self, visit: &mut dyn FnMut(&[usize])) {
        self.automatic.visit_stencils(visit);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::terms::check::{self, Sample};
    use crate::terms::sheet::element::tests::patches;

    #[test]
    fn kernel_equals_law_and_takes_power() {
        let elements = patches();
        let (kernel, law) = (PlateDamping::new(elements.clone()), Automatic::new(PlateDampingLaw, elements));
        check::same_on(Sample::sheet, &kernel, &law);
        check::invariant_on(Sample::sheet, &kernel);
        check::takes_power_on(Sample::sheet, &kernel);
        check::zero_coefficients_on(Sample::sheet, &kernel, &[0]);
    }
}
