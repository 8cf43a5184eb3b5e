//! Elastic bending of a triangle and its flaps.

use super::fold::{Fold, fold};
use super::patch::{Each, FLAPS, NODES, Patch, Shape, Spread, times};
use crate::kkt::NodeMatrix;
use crate::terms::{Automatic, Element, Law, Point, Real, Term, Vec3};

/// W = ½ (ψ − ψ_rest)ᵀ K (ψ − ψ_rest),  K = D A (M C⁻¹ Mᵀ)⁻¹ at D = 1,  f = −∂W/∂x: the energy of a Kirchhoff plate with the curvature
/// that the folds ψ = 2 tan(θ/2) at the triangle's edges show ([`fold`]; the module `patch` has M and C).
///
/// For a plate D = E t³/(12 (1 − ν²)). Nodes: the triangle's three, then one of each neighbour. Parameters: bending stiffness D
/// \[N·m\], Poisson's ratio ν [-]. Constants: those of [`bend_element`](super::bend_element). Energy and force grow without
/// bound as the sheet folds back onto itself.
#[derive(Clone, Copy, Debug, Default)]
pub struct PlateLaw;

/// ψᵢ and their slopes at a patch's positions, of any scalar; zero beyond the last flap.
pub(super) fn folds_of<S: Real>(shape: &Shape, q: &[Vec3<S>]) -> (Each<S>, Each<[Vec3<S>; 4]>) {
    let (mut psi, mut slopes) = ([S::zero(); FLAPS], [[Vec3::repeat(S::zero()); 4]; FLAPS]);
    for i in 0..shape.flaps {
        (psi[i], slopes[i]) = fold(&shape.nodes(i).map(|k| q[k]));
    }
    (psi, slopes)
}

fn excess<S: Real>(shape: &Shape, psi: &Each<S>) -> Each<S> {
    std::array::from_fn(|i| psi[i] - shape.rest[i])
}

impl Law for PlateLaw {
    fn name(&self) -> &str {
        "plate"
    }

    fn force<S: Real>(&self, q: &[Vec3<S>], _v: &[Vec3<S>], p: &[S], constants: &[f64], f: &mut [Vec3<S>]) {
        let shape = Shape::new(q.len() - 3, constants);
        let (psi, slopes) = folds_of(&shape, q);
        let w = times(shape.flaps, &shape.stiffness(p[1]), &excess(&shape, &psi));
        for i in 0..shape.flaps {
            for (k, g) in shape.nodes(i).into_iter().zip(&slopes[i]) {
                f[k] -= g * (w[i] * p[0]);
            }
        }
    }

    fn energy<S: Real>(&self, q: &[Vec3<S>], p: &[S], constants: &[f64]) -> S {
        let shape = Shape::new(q.len() - 3, constants);
        let psi = excess(&shape, &folds_of(&shape, q).0);
        let w = times(shape.flaps, &shape.stiffness(p[1]), &psi);
        (0..shape.flaps).fold(S::zero(), |sum, i| sum + w[i] * psi[i]) * p[0] * 0.5
    }

    fn symmetric(&self, _p: &[f64]) -> bool {
        true
    }
}

/// [`PlateLaw`] on many patches, with hand-derived Jacobians: w = K (ψ − ψ_rest),
///
/// ∂f/∂x = −Σᵢⱼ Kᵢⱼ (∂ψᵢ/∂x)(∂ψⱼ/∂x)ᵀ − Σᵢ wᵢ ∂²ψᵢ/∂x²
#[derive(Clone, Debug)]
pub struct Plate {
    automatic: Automatic<PlateLaw>,
    patches: Vec<Patch>,
}

impl Plate {
    /// Bending of the elements' patches; see [`PlateLaw`] for what an element holds.
    ///
    /// # Panics
    /// If an element is not of the law's shape: a mistake where elements are built.
    pub fn new(elements: Vec<Element>) -> Self {
        let patches = Patch::all(PlateLaw.name(), &elements);
        Self { automatic: Automatic::new(PlateLaw, elements), patches }
    }

    /// Calls `each(patch, folds, K, w)` for every patch with a stiffness.
    #[inline]
    fn for_each(&self, at: &Point, mut each: impl FnMut(&Patch, &Each<Fold>, &Each<Each<f64>>, &Each<f64>)) {
        for patch in &self.patches {
            let [stiffness, nu] = patch.params.map(|k| at.theta[k]);
            if stiffness != 0.0 {
                let k = patch.shape.stiffness(nu).map(|row| row.map(|x| x * stiffness));
                let folds = patch.folds(at);
                let w = times(patch.shape.flaps, &k, &excess(&patch.shape, &folds.map(|f| f.psi)));
                each(patch, &folds, &k, &w);
            }
        }
    }
}

/// wᵢ dψᵢ/dθᵢ, what multiplies ∂²θᵢ/∂x².
pub(super) fn leverage(folds: &Each<Fold>, w: &Each<f64>) -> Each<f64> {
    std::array::from_fn(|i| w[i] * folds[i].slope())
}

/// Kᵢⱼ y_j, by the patch's nodes.
#[inline]
pub(super) fn weighted(n: usize, k: &Each<Each<f64>>, y: &Spread) -> Spread {
    let mut out = [[Vec3::zeros(); NODES]; FLAPS];
    for i in 0..n {
        for j in 0..n {
            for p in 0..NODES {
                out[i][p] += y[j][p] * k[i][j];
            }
        }
    }
    out
}

impl Term for Plate {
    fn name(&self) -> &str {
        PlateLaw.name()
    }

    fn add_force(&self, at: &Point, f: &mut [f64]) {
        self.for_each(at, |patch, folds, _, w| patch.add_force(f, folds, w));
    }

    fn add_jacobian(&self, at: &Point, f: &mut [f64], dq: &mut NodeMatrix, _dv: &mut NodeMatrix) {
        self.for_each(at, |patch, folds, k, w| {
            patch.add_force(f, folds, w);
            let mut k = *k;
            for i in 0..patch.shape.flaps {
                k[i][i] += w[i] * folds[i].curve();
            }
            let slopes = patch.spread(|i| folds[i].gradient);
            let hessians = folds.each_ref().map(Fold::angle_hessian);
            let curved = Some((&leverage(folds, w), &hessians));
            patch.add_symmetric(dq, &slopes, &weighted(patch.shape.flaps, &k, &slopes), curved);
        });
    }

    fn visit_theta(&self, at: &Point, visit: &mut dyn FnMut(usize, usize, f64)) {
        for patch in &self.patches {
            let (n, [stiffness, nu]) = (patch.shape.flaps, patch.params.map(|k| at.theta[k]));
            let folds = patch.folds(at);
            let psi = excess(&patch.shape, &folds.map(|f| f.psi));
            patch.visit(patch.params[0], &folds, &times(n, &patch.shape.stiffness(nu), &psi), visit);
            let by_nu = times(n, &patch.shape.stiffness_slope(nu), &psi).map(|w| w * stiffness);
            patch.visit(patch.params[1], &folds, &by_nu, visit);
        }
    }

    fn energy(&self, at: &Point) -> f64 {
        self.automatic.energy(at)
    }

    fn symmetric(&self, _theta: &[f64]) -> bool {
        true
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
    fn kernel_equals_law_and_energy() {
        let elements = patches();
        let (kernel, law) = (Plate::new(elements.clone()), Automatic::new(PlateLaw, elements));
        check::same_on(Sample::sheet, &kernel, &law);
        check::force_is_energy_slope_on(Sample::sheet, &PlateLaw, &law);
        check::invariant_on(Sample::sheet, &kernel);
        check::jacobians_symmetric_on(Sample::sheet, &kernel);
        check::zero_coefficients_on(Sample::sheet, &kernel, &[0]);
    }
}
