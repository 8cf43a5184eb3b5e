//! Elastic stretching and shearing of a triangle in its plane.

use super::membrane_simd::{self as pieces, Geometric, Wanted};
use super::triangle::{Face, Sym, gradient, hats, pulled};
use crate::terms::{Automatic, Element, Law, Point, Term, contraction};
use pliant_linalg::{NodeMatrix, Places};
use pliant_math::{Real, Vec3};
use std::borrow::Cow;

/// W = A t Y/(2 (1 − ν²)) [(1 − ν) |G|² + ν tr(G)²],  G = (FᵀF − I)/2,  F = Σ xᵢ bᵢᵀ/√area,  A = fraction · area:
/// St. Venant–Kirchhoff, plane stress, constant strain. fᵢ = −fraction F̂ S bᵢ,  S = t Y/(1 − ν²) [(1 − ν) G + ν tr(G) I] \[N/m\].
///
/// Small strains: a strip that is pulled has stress Y × strain and contracts sideways by ν; shearing by γ takes Y/(2 (1 + ν)) γ.
/// Nodes: three. Parameters: area of the sheet \[m²\], Young's modulus Y \[Pa\], Poisson's ratio ν [-], thickness t \[m\]. Constants:
/// the triangle's fraction of the area [-], and √area times the slopes b₁, b₂ of its hat functions in the rest plane (x and y
/// each). Singular at ν = ±1 and nowhere else; pressed to a line or inside out, a triangle keeps a finite force (W knows no
/// volume, so it does not resist that without bound).
#[derive(Clone, Copy, Debug, Default)]
pub struct MembraneLaw;

/// Green strain G = (F̂ᵀF̂/area − I)/2.
#[inline]
fn strain<S: Real>(f: &[Vec3<S>; 2], area: S) -> Sym<S> {
    let half = area.recip() * 0.5;
    Sym::new(f[0].dot(&f[0]) * half - 0.5, f[1].dot(&f[1]) * half - 0.5, f[0].dot(&f[1]) * half)
}

/// (t Y/(1 + ν), t Y ν/(1 − ν²)): S = first · G + second · tr(G) I  \[N/m\].
#[inline]
pub(super) fn moduli<S: Real>([_, young, nu, thickness]: [S; 4]) -> [S; 2] {
    let first = young * thickness / (nu + 1.0);
    [first, first * nu / (-nu + 1.0)]
}

#[inline]
fn stress<S: Real>(g: &Sym<S>, [first, second]: [S; 2]) -> Sym<S> {
    let trace = (g[0] + g[1]) * second;
    Sym::new(g[0] * first + trace, g[1] * first + trace, g[2] * first)
}

/// The part of a stress that pulls: its eigenvalues where they are positive, 0 elsewhere.
#[inline]
pub(super) fn tension(s: &Sym<f64>) -> Sym<f64> {
    let (mean, half) = (0.5 * (s[0] + s[1]), 0.5 * (s[0] - s[1]));
    let radius = half.hypot(s[2]);
    let [high, low] = [mean + radius, mean - radius];
    if low >= 0.0 {
        *s
    } else if high <= 0.0 {
        Sym::zeros()
    } else {
        // high times the projector on its direction, (S − low I)/(high − low)
        let scale = high / (high - low);
        Sym::new((s[0] - low) * scale, (s[1] - low) * scale, s[2] * scale)
    }
}

impl Law for MembraneLaw {
    fn name(&self) -> &str {
        "membrane"
    }

    fn force<S: Real>(&self, q: &[Vec3<S>], _v: &[Vec3<S>], p: &[S], constants: &[f64], f: &mut [Vec3<S>]) {
        let b = hats(constants);
        let gradient = gradient(q, &b);
        let s = stress(&strain(&gradient, p[0]), moduli([p[0], p[1], p[2], p[3]]));
        let fraction = S::from(-constants[0]);
        let [f1, f2] = [1, 2].map(|i| pulled(&gradient, &s, &b[i]) * fraction);
        f[0] -= f1 + f2;
        f[1] += f1;
        f[2] += f2;
    }

    fn energy<S: Real>(&self, q: &[Vec3<S>], p: &[S], constants: &[f64]) -> S {
        let g = strain(&gradient(q, &hats(constants)), p[0]);
        let s = stress(&g, moduli([p[0], p[1], p[2], p[3]]));
        (g[0] * s[0] + g[1] * s[1] + g[2] * s[2] * 2.0) * p[0] * (0.5 * constants[0])
    }

    fn symmetric(&self, _p: &[f64]) -> bool {
        true
    }
}

/// [`MembraneLaw`] on many triangles, with hand-derived Jacobians. With first, second as in S = first G + second tr(G) I:
///
/// ∂fᵢ/∂xⱼ = −fraction { (bᵢ·S bⱼ) I + [ ½ first ((F̂bⱼ)(F̂bᵢ)ᵀ + (bᵢ·bⱼ) F̂F̂ᵀ) + second (F̂bᵢ)(F̂bⱼ)ᵀ ]/area }
#[derive(Clone, Debug)]
pub struct Membrane {
    automatic: Automatic<MembraneLaw>,
    faces: Vec<Face<4>>,
    places: Places,
}

impl Membrane {
    /// Stretching of the elements' triangles; see [`MembraneLaw`] for what an element holds.
    ///
    /// # Panics
    /// If an element is not of the law's shape: a mistake where elements are built.
    pub fn new(elements: Vec<Element>) -> Self {
        let faces = Face::all(MembraneLaw.name(), &elements);
        Self { automatic: Automatic::new(MembraneLaw, elements), faces, places: Places::default() }
    }

    /// Forces, and their slopes with this stress in the geometric part.
    fn jacobian(&self, at: &Point, geometric: Geometric, f: &mut [f64], dq: &mut NodeMatrix) {
        let find = || Face::find_places(&self.faces, dq);
        let places = self.places.of(dq, find).map_or_else(|| find().into(), Cow::Borrowed);
        pieces::add(&self.faces, at, Wanted::Slopes(f, dq, geometric, &places));
    }

    /// [`Term::visit_theta`] by a visitor whose type is known, which is inlined.
    fn each_slope(&self, at: &Point, visit: &mut (impl FnMut(usize, usize, f64) + ?Sized)) {
        for face in &self.faces {
            let p = face.values(at.theta);
            let [area, young, nu, thickness] = p;
            let f = gradient(&face.positions(at), &face.hats);
            let g = strain(&f, area);
            let unit = stress(&g, moduli([area, 1.0, nu, 1.0]));
            // ∂G/∂area = −(G + I/2)/area
            let shrunk = -(g + Sym::new(0.5, 0.5, 0.0)) / area;
            // ∂/∂ν of 1/(1 + ν) and of ν/(1 − ν²)
            let complement = 1.0 - nu * nu;
            let by_nu = [-1.0 / (1.0 + nu).powi(2), (1.0 + nu * nu) / (complement * complement)];
            face.visit(face.params[0], &f, &stress(&shrunk, moduli(p)), visit);
            face.visit(face.params[1], &f, &(unit * thickness), visit);
            face.visit(face.params[2], &f, &(stress(&g, by_nu) * (young * thickness)), visit);
            face.visit(face.params[3], &f, &(unit * young), visit);
        }
    }
}

impl Term for Membrane {
    fn name(&self) -> &str {
        MembraneLaw.name()
    }

    fn add_force(&self, at: &Point, f: &mut [f64]) {
        pieces::add(&self.faces, at, Wanted::Forces(f));
    }

    fn add_jacobian(&self, at: &Point, f: &mut [f64], dq: &mut NodeMatrix, _dv: &mut NodeMatrix) {
        self.jacobian(at, Geometric::Here, f, dq);
    }

    /// Three stresses a triangle.
    fn n_axial(&self) -> usize {
        3 * self.faces.len()
    }

    fn predict_axial(&self, at: &Point, dq: &[f64], axial: &mut [f64]) {
        pieces::add(&self.faces, at, Wanted::Stresses(dq, axial));
    }

    fn add_mixed_jacobian(&self, at: &Point, axial: &[f64], f: &mut [f64], dq: &mut NodeMatrix, _dv: &mut NodeMatrix) {
        self.jacobian(at, Geometric::Predicted(axial), f, dq);
    }

    /// With the tension alone in the geometric part.
    fn add_stable_jacobian(&self, at: &Point, axial: &[f64], f: &mut [f64], dq: &mut NodeMatrix, _dv: &mut NodeMatrix) {
        self.jacobian(at, Geometric::Tension(axial), f, dq);
    }

    fn buckles(&self) -> bool {
        true
    }

    fn visit_theta(&self, at: &Point, visit: &mut dyn FnMut(usize, usize, f64)) {
        self.each_slope(at, visit);
    }

    fn pull_theta(&self, at: &Point, weights: &[f64], sums: &mut [f64]) {
        self.each_slope(at, &mut contraction(weights, sums));
    }

    fn energy(&self, at: &Point) -> f64 {
        let mut sum = 0.0;
        pieces::add(&self.faces, at, Wanted::Energy(&mut sum));
        sum
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
    use crate::terms::sheet::element::tests::faces;

    const YOUNG: f64 = 2.0e5;
    const NU: f64 = 0.3;
    const THICKNESS: f64 = 1.5e-3;

    #[test]
    fn kernel_equals_law_and_energy() {
        let elements = faces(4);
        let (kernel, law) = (Membrane::new(elements.clone()), Automatic::new(MembraneLaw, elements));
        check::same_on(Sample::sheet, &kernel, &law);
        check::force_is_energy_slope_on(Sample::sheet, &MembraneLaw, &law);
        check::invariant_on(Sample::sheet, &kernel);
        check::jacobians_symmetric_on(Sample::sheet, &kernel);
        check::zero_coefficients_on(Sample::sheet, &kernel, &[1]);
    }

    /// One right triangle with legs a and b, deformed by x = F X: the stress that its energy has there, times area.
    fn energy(f: [[f64; 2]; 2]) -> (f64, f64) {
        let rest = [[0.0, 0.0], [0.2, 0.0], [0.05, 0.3]];
        let area = 0.5 * 0.2 * 0.3;
        // a sheet ten times as large
        let constants = crate::terms::sheet::face_constants(&rest, 10.0 * area);
        let element = Element { nodes: vec![0, 1, 2], params: vec![0, 1, 2, 3], constants };
        let q: Vec<f64> =
            rest.iter().flat_map(|x| [f[0][0] * x[0] + f[0][1] * x[1], f[1][0] * x[0] + f[1][1] * x[1], 0.0]).collect();
        let theta = [10.0 * area, YOUNG, NU, THICKNESS];
        (Membrane::new(vec![element]).energy(&Point { q: &q, v: &[0.0; 9], theta: &theta }), area)
    }

    #[test]
    fn uniaxial_tension_has_youngs_modulus_and_poissons_contraction() {
        let e = 1e-4;
        let pulled = |across: f64| energy([[1.0 + e, 0.0], [0.0, 1.0 + across]]);
        // least energy over the lateral strain: three points of a parabola
        let d = 1e-4;
        let (low, mid, high) = (pulled(-NU * e - d).0, pulled(-NU * e).0, pulled(-NU * e + d).0);
        let lateral = -NU * e - 0.5 * d * (high - low) / (high - 2.0 * mid + low);
        assert!((lateral / e + NU).abs() < 1e-3, "{}", lateral / e);
        let (energy, area) = pulled(lateral);
        let expected = 0.5 * YOUNG * e * e * area * THICKNESS;
        assert!((energy / expected - 1.0).abs() < 1e-3, "{energy} against {expected}");
    }

    #[test]
    fn shear_has_the_shear_modulus() {
        let gamma = 1e-4;
        let (energy, area) = energy([[1.0, 0.5 * gamma], [0.5 * gamma, 1.0]]);
        let expected = 0.5 * YOUNG / (2.0 * (1.0 + NU)) * gamma * gamma * area * THICKNESS;
        assert!((energy / expected - 1.0).abs() < 1e-3, "{energy} against {expected}");
    }

    #[test]
    fn a_turned_sheet_is_at_rest() {
        let (c, s) = (0.6, 0.8);
        assert!(energy([[c, -s], [s, c]]).0 < 1e-28 * YOUNG);
    }

    /// The stress after a small displacement is the predicted one to first order.
    #[test]
    fn predicts_stress_to_first_order() {
        let kernel = Membrane::new(faces(4));
        let sample = Sample::sheet(5);
        let predicted = |scale: f64| {
            let d: Vec<f64> = sample.v.iter().map(|v| v * scale).collect();
            let moved: Vec<f64> = sample.q.iter().zip(&d).map(|(q, d)| q + d).collect();
            let (mut before, mut after) = (vec![0.0; kernel.n_axial()], vec![0.0; kernel.n_axial()]);
            kernel.predict_axial(&sample.at(), &d, &mut before);
            kernel.predict_axial(&Point { q: &moved, ..sample.at() }, &vec![0.0; d.len()], &mut after);
            before.iter().zip(&after).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        let (coarse, fine) = (predicted(1e-4), predicted(1e-5));
        assert!((coarse / fine / 100.0 - 1.0).abs() < 0.01, "{coarse} {fine}");
    }

    /// Compressed triangles push their nodes aside; of what resists that is left out, and pulled ones keep all they have.
    #[test]
    fn what_resists_is_positive_and_all_of_it_under_tension() {
        let kernel = Membrane::new(faces(4));
        for (scale, compressed) in [(0.5, true), (10.0, false)] {
            let sample = Sample::sheet(5);
            let q: Vec<f64> = sample.q.iter().map(|q| q * scale).collect();
            let at = Point { q: &q, ..sample.at() };
            let mut axial = vec![0.0; kernel.n_axial()];
            kernel.predict_axial(&at, &vec![0.0; q.len()], &mut axial);
            let pulled = axial.chunks(3).all(|s| s[0] + s[1] > 0.0 && s[0] * s[1] > s[2] * s[2]);
            let [exact, stable] = check::stiffnesses(&kernel, &at, &axial);
            assert!(stable.least() >= -1e-12 * stable.most(), "{}", stable.least());
            assert!(!compressed || exact.least() < -1e-3 * exact.most(), "{}", exact.least());
            assert!(compressed || (pulled && exact.0 == stable.0));
        }
    }
}
