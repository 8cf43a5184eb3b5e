//! Viscous resistance of a triangle to stretching and shearing.

use super::triangle::{Face, Sym, along, between, gradient, hats, product, pulled};
use crate::terms::stencil::{add_outer, diagonal};
use crate::terms::{Automatic, Element, Law, Point, Term, contraction};
use pliant_linalg::NodeMatrix;
use pliant_math::{Real, Vec3};

/// R = ½ A t η |Ġ|², Ġ = (FᵀḞ + ḞᵀF)/2 the rate of Green strain; f = −∂R/∂v: fᵢ = −fraction F̂ S bᵢ, S = t η Ġ \[N/m\].
///
/// Nodes: three. Parameters: area of the sheet \[m²\], viscosity η \[Pa·s\], thickness t \[m\]. Constants as in
/// [`MembraneLaw`](super::MembraneLaw). Rigid motions dissipate nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct MembraneDampingLaw;

/// 2 · area · Ġ.
#[inline]
fn rate<S: Real>(f: &[Vec3<S>; 2], v: &[Vec3<S>; 2]) -> Sym<S> {
    Sym::new(f[0].dot(&v[0]) * 2.0, f[1].dot(&v[1]) * 2.0, f[0].dot(&v[1]) + f[1].dot(&v[0]))
}

impl Law for MembraneDampingLaw {
    fn name(&self) -> &str {
        "membrane_damping"
    }

    fn force<S: Real>(&self, q: &[Vec3<S>], v: &[Vec3<S>], p: &[S], constants: &[f64], f: &mut [Vec3<S>]) {
        let b = hats(constants);
        let (position, velocity) = (gradient(q, &b), gradient(v, &b));
        let s = rate(&position, &velocity) * (p[1] * p[2] / p[0] * (-0.5 * constants[0]));
        let [f1, f2] = [1, 2].map(|i| pulled(&position, &s, &b[i]));
        f[0] -= f1 + f2;
        f[1] += f1;
        f[2] += f2;
    }

    fn symmetric(&self, p: &[f64]) -> bool {
        p[1] == 0.0
    }
}

/// [`MembraneDampingLaw`] on many triangles, with hand-derived Jacobians, c = t η fraction/(2 area), V̂ = Σ vᵢ bᵢᵀ:
///
/// ∂fᵢ/∂vⱼ = −c ((F̂bⱼ)(F̂bᵢ)ᵀ + (bᵢ·bⱼ) F̂F̂ᵀ),  ∂fᵢ/∂xⱼ = −fraction (bᵢ·S bⱼ) I − c ((F̂bⱼ)(V̂bᵢ)ᵀ + (bᵢ·bⱼ) F̂V̂ᵀ)
#[derive(Clone, Debug)]
pub struct MembraneDamping {
    automatic: Automatic<MembraneDampingLaw>,
    faces: Vec<Face<3>>,
}

impl MembraneDamping {
    /// Damping of the elements' triangles; see [`MembraneDampingLaw`] for what an element holds.
    ///
    /// # Panics
    /// If an element is not of the law's shape: a mistake where elements are built.
    pub fn new(elements: Vec<Element>) -> Self {
        let faces = Face::all(MembraneDampingLaw.name(), &elements);
        Self { automatic: Automatic::new(MembraneDampingLaw, elements), faces }
    }

    /// Calls `each(face, F̂, V̂, η t/(2 area))` for every triangle with a coefficient.
    #[inline]
    fn for_each(&self, at: &Point, mut each: impl FnMut(&Face<3>, &[Vec3<f64>; 2], &[Vec3<f64>; 2], f64)) {
        for face in &self.faces {
            let [area, viscosity, thickness] = face.values(at.theta);
            if viscosity != 0.0 && thickness != 0.0 {
                let (f, v) = (gradient(&face.positions(at), &face.hats), gradient(&face.velocities(at), &face.hats));
                each(face, &f, &v, 0.5 * viscosity * thickness / area);
            }
        }
    }

    /// [`Term::visit_theta`] by a visitor whose type is known, which is inlined.
    fn each_slope(&self, at: &Point, visit: &mut (impl FnMut(usize, usize, f64) + ?Sized)) {
        for face in &self.faces {
            let [area, viscosity, thickness] = face.values(at.theta);
            let (f, v) = (gradient(&face.positions(at), &face.hats), gradient(&face.velocities(at), &face.hats));
            let unit = rate(&f, &v) * (0.5 / area);
            face.visit(face.params[0], &f, &(unit * (-viscosity * thickness / area)), visit);
            face.visit(face.params[1], &f, &(unit * thickness), visit);
            face.visit(face.params[2], &f, &(unit * viscosity), visit);
        }
    }
}

impl Term for MembraneDamping {
    fn name(&self) -> &str {
        MembraneDampingLaw.name()
    }

    fn inner(&self) -> bool {
        true
    }

    fn add_force(&self, at: &Point, f: &mut [f64]) {
        self.for_each(at, |face, gradient, v, c| face.add_force(f, gradient, &(rate(gradient, v) * c)));
    }

    fn add_jacobian(&self, at: &Point, f: &mut [f64], dq: &mut NodeMatrix, dv: &mut NodeMatrix) {
        self.for_each(at, |face, gradient, v, c| {
            let s = rate(gradient, v) * c;
            face.add_force(f, gradient, &s);
            let (still, moving) = (product(gradient, gradient), product(gradient, v));
            let (x, w) = (face.hats.map(|b| along(gradient, &b)), face.hats.map(|b| along(v, &b)));
            let c = -c * face.fraction;
            let block = |i: usize, j: usize, whole: &[[f64; 3]; 3], other: &Vec3<f64>| {
                let scale = c * face.hats[i].dot(&face.hats[j]);
                let mut block = whole.map(|row| row.map(|x| scale * x));
                add_outer(&mut block, &(x[j] * c), other);
                block
            };
            face.add_blocks(dv, None, |i, j| block(i, j, &still, &x[i]));
            face.add_blocks(dq, None, |i, j| {
                let mut out = block(i, j, &moving, &w[i]);
                let own = diagonal(-face.fraction * between(&face.hats[i], &s, &face.hats[j]));
                (0..3).for_each(|a| out[a][a] += own[a][a]);
                out
            });
        });
    }

    fn visit_theta(&self, at: &Point, visit: &mut dyn FnMut(usize, usize, f64)) {
        self.each_slope(at, visit);
    }

    fn pull_theta(&self, at: &Point, weights: &[f64], sums: &mut [f64]) {
        self.each_slope(at, &mut contraction(weights, sums));
    }

    fn symmetric(&self, theta: &[f64]) -> bool {
        self.faces.iter().all(|face| theta[face.params[1]] == 0.0)
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
    use crate::terms::sheet::element::tests::faces;

    #[test]
    fn kernel_equals_law_and_takes_power() {
        let elements = faces(3);
        let (kernel, law) = (MembraneDamping::new(elements.clone()), Automatic::new(MembraneDampingLaw, elements));
        check::same_on(Sample::sheet, &kernel, &law);
        check::invariant_on(Sample::sheet, &kernel);
        check::takes_power_on(Sample::sheet, &kernel);
        check::zero_coefficients_on(Sample::sheet, &kernel, &[1]);
    }

    /// A sheet pulled at rate ε̇ along x dissipates η ε̇² per volume, and one that spins nothing.
    #[test]
    fn power_is_viscosity_times_squared_rate() {
        let rest = [[0.0, 0.0], [0.2, 0.0], [0.05, 0.3]];
        let (area, eta, t, rate) = (0.03, 7.0, 1e-3, 0.4);
        let constants = crate::terms::sheet::face_constants(&rest, area);
        let kernel = MembraneDamping::new(vec![Element { nodes: vec![0, 1, 2], params: vec![0, 1, 2], constants }]);
        let q: Vec<f64> = rest.iter().flat_map(|x| [x[0], x[1], 0.0]).collect();
        let power = |v: &dyn Fn(&[f64]) -> [f64; 3]| {
            let v: Vec<f64> = q.chunks(3).flat_map(v).collect();
            let f = check::force(&kernel, &Point { q: &q, v: &v, theta: &[area, eta, t] });
            -f.iter().zip(&v).map(|(f, v)| f * v).sum::<f64>()
        };
        let expected = eta * rate * rate * area * t;
        assert!((power(&|x| [rate * x[0], 0.0, 0.0]) / expected - 1.0).abs() < 1e-12);
        assert!(power(&|x| [-x[1], x[0], 0.0]).abs() < 1e-15);
    }
}
