//! Elastic bending of a triangle and its flaps.

use super::fold::Fold;
use super::patch::{Each, FLAPS, NODES, Patch, Shape, Spread, times};
use super::plate_simd::Pieces;
use super::seams::Seams;
use crate::terms::{Automatic, Element, Law, Point, Term};
use pliant_linalg::{NodeMatrix, Places};
use pliant_math::dihedral::fold;
use pliant_math::{Real, Vec3};
use std::cell::RefCell;
use std::sync::OnceLock;

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
///
/// Eight patches at a time (`plate_pieces`). Where only what resists is wanted, the moment of a fold is that of the patches on both of its
/// sides: there it is evaluated once, and answered for by one of them.
#[derive(Clone, Debug)]
pub struct Plate {
    automatic: Automatic<PlateLaw>,
    patches: Vec<Patch>,
    seams: Seams,
    unit: OnceLock<Unit>,
    places: Places,
    pieces: Pieces,
}

/// ν of each patch and its K at D = 1.
type Unit = Vec<(f64, Each<Each<f64>>)>;

thread_local! {
    /// Folds, and the sum of w over each fold's patches: one a thread, so that evaluations neither allocate nor share.
    static FOLDS: RefCell<(Vec<Fold>, Vec<f64>)> = const { RefCell::new((Vec::new(), Vec::new())) };
}

impl Plate {
    /// Bending of the elements' patches; see [`PlateLaw`] for what an element holds.
    ///
    /// # Panics
    /// If an element is not of the law's shape: a mistake where elements are built.
    pub fn new(elements: Vec<Element>) -> Self {
        let patches = Patch::all(PlateLaw.name(), &elements);
        let (seams, places, pieces) = (Seams::new(&patches), Places::default(), Pieces::new(&patches));
        Self { automatic: Automatic::new(PlateLaw, elements), patches, seams, unit: OnceLock::new(), places, pieces }
    }

    /// K of every patch at D = 1 and the ν there is, kept for that ν.
    #[inline]
    fn stiffness(&self, unit: &Unit, k: usize, theta: &[f64]) -> Option<Each<Each<f64>>> {
        let (patch, (kept, at_one)) = (&self.patches[k], &unit[k]);
        let [stiffness, nu] = patch.params.map(|k| theta[k]);
        let at_one = if nu == *kept { *at_one } else { patch.shape.stiffness(nu) };
        (stiffness != 0.0).then(|| at_one.map(|row| row.map(|x| x * stiffness)))
    }

    fn unit(&self, theta: &[f64]) -> &Unit {
        let of = |patch: &Patch| (theta[patch.params[1]], patch.shape.stiffness(theta[patch.params[1]]));
        self.unit.get_or_init(|| self.patches.iter().map(of).collect())
    }

    /// Sums of w over the patches of each fold.
    #[inline]
    fn moments(&self, theta: &[f64], psi: impl Fn(usize) -> f64, sums: &mut Vec<f64>) {
        sums.clear();
        sums.resize(self.seams.folds.len(), 0.0);
        let unit = self.unit(theta);
        for (k, (patch, flaps)) in self.patches.iter().zip(&self.seams.flaps).enumerate() {
            let Some(stiffness) = self.stiffness(unit, k, theta) else { continue };
            let w = times(patch.shape.flaps, &stiffness, &excess(&patch.shape, &flaps.map(|flap| psi(flap.fold))));
            for (flap, w) in flaps.iter().zip(w).take(patch.shape.flaps) {
                sums[flap.fold] += w;
            }
        }
    }

    fn is_limp(&self, theta: &[f64]) -> bool {
        self.patches.iter().all(|patch| theta[patch.params[0]] == 0.0)
    }

    /// Forces, and their slopes without what moments do but for where they resist.
    fn stable_jacobian(&self, at: &Point, f: &mut [f64], dq: &mut NodeMatrix) {
        let places = self.places.of(dq, || Patch::find_places(&self.patches, dq));
        FOLDS.with_borrow_mut(|(folds, w)| {
            folds.clear();
            folds.extend(self.seams.folds.iter().map(|nodes| Fold::new(&nodes.map(|n| at.position(n)))));
            self.moments(at.theta, |fold| folds[fold].psi, w);
            self.seams.add_force(f, w, |k| &folds[k].gradient);
            let unit = self.unit(at.theta);
            for (k, (patch, flaps)) in self.patches.iter().zip(&self.seams.flaps).enumerate() {
                let Some(mut stiffness) = self.stiffness(unit, k, at.theta) else { continue };
                let slopes = patch.spread(|i| flaps[i].turned(&folds[flaps[i].fold].gradient));
                for (i, flap) in flaps.iter().enumerate().take(patch.shape.flaps).filter(|(_, flap)| flap.owner) {
                    let (fold, w) = (&folds[flap.fold], w[flap.fold]);
                    stiffness[i][i] += (w * fold.curve()).max(0.0);
                }
                let places = places.map(|p| &p[k * NODES * NODES..(k + 1) * NODES * NODES]);
                patch.add_symmetric(dq, places, &slopes, &weighted(patch.shape.flaps, &stiffness, &slopes), &[None; FLAPS]);
            }
        });
    }
}

/// ψ of a fold and its slope along `weights`.
fn slope_along(nodes: &[usize; 4], at: &Point, weights: &[f64]) -> [f64; 2] {
    let fold = Fold::new(&nodes.map(|n| at.position(n)));
    let along = nodes.iter().zip(&fold.gradient).map(|(n, g)| (0..3).map(|a| g[a] * weights[3 * n + a]).sum::<f64>());
    [fold.psi, along.sum()]
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
        if !self.is_limp(at.theta) {
            self.pieces.add(&self.patches, at, f, None);
        }
    }

    fn add_jacobian(&self, at: &Point, f: &mut [f64], dq: &mut NodeMatrix, _dv: &mut NodeMatrix) {
        if !self.is_limp(at.theta) {
            self.pieces.add(&self.patches, at, f, Some(dq));
        }
    }

    fn add_stable_jacobian(&self, at: &Point, _axial: &[f64], f: &mut [f64], dq: &mut NodeMatrix, _dv: &mut NodeMatrix) {
        if !self.is_limp(at.theta) {
            self.stable_jacobian(at, f, dq);
        }
    }

    fn buckles(&self) -> bool {
        true
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

    /// By D it is −s·u with u = K (ψ − ψ_rest) and s the slopes along the weights, K at D = 1; by ν, where ∂K = −K ∂C K, D (K s)·∂C u.
    fn pull_theta(&self, at: &Point, weights: &[f64], sums: &mut [f64]) {
        let unit = self.unit(at.theta);
        let along: Vec<[f64; 2]> = self.seams.folds.iter().map(|nodes| slope_along(nodes, at, weights)).collect();
        for ((patch, flaps), (kept, at_kept)) in self.patches.iter().zip(&self.seams.flaps).zip(unit) {
            let (n, [stiffness, nu]) = (patch.shape.flaps, patch.params.map(|k| at.theta[k]));
            let k = if nu == *kept { *at_kept } else { patch.shape.stiffness(nu) };
            let u = times(n, &k, &excess(&patch.shape, &flaps.map(|flap| along[flap.fold][0])));
            let s = flaps.map(|flap| along[flap.fold][1]);
            let product = |a: &Each<f64>, b: &Each<f64>| (0..n).map(|i| a[i] * b[i]).sum::<f64>();
            sums[patch.params[0]] -= product(&s, &u);
            sums[patch.params[1]] += stiffness * product(&times(n, &k, &s), &times(n, &patch.shape.compliance_slope(nu), &u));
        }
    }

    fn energy(&self, at: &Point) -> f64 {
        self.pieces.energy(&self.patches, at)
    }

    fn inner(&self) -> bool {
        true
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

    #[test]
    fn what_resists_is_positive() {
        let (kernel, sample) = (Plate::new(patches()), Sample::sheet(5));
        let [exact, stable] = check::stiffnesses(&kernel, &sample.at(), &[]);
        assert!(stable.least() >= -1e-12 * stable.most(), "{}", stable.least());
        assert!(exact.least() < -1e-3 * exact.most(), "{}", exact.least());
    }
}
