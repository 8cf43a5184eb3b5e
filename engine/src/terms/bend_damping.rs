//! Viscous resistance to bending at a node between two edges.
//!
//! With s = t₁ + t₂, p = 1/(1 + c), z_a = w_a/|e_a| the rate of the curvature in the plane across T = s/|s| is
//!
//! D = P_T dκ/dt = √(2p) y,  y = Q₂ z₂ − Q₁ z₁,  Q_a = I − p t_a sᵀ.
//!
//! (From κ = 2 (t₂ − t₁)/|s|: P_T κ̇ = (2/|s|) [ṫ₂ − ṫ₁ − p (a t₂ − b t₁)], a = t₁·ṫ₂, b = t₂·ṫ₁, and
//! (I − p t₂ t₁ᵀ)(I − t₂ t₂ᵀ) = Q₂.) Since s·t_a = 1/p, sᵀ Q_a = 0: y is normal to s, and with η = t₂·y = −t₁·y,
//!
//! R = ½ (c_b/l_v) |D|² = (c_b/l_v) p |y|²,  τ₁ = ∂R/∂w₁ = −(G/|e₁|) (y + p η s),  τ₂ = ∂R/∂w₂ = (G/|e₂|) (y − p η s),  G = 2 p c_b/l_v.

use super::stencil::{Block, Compact, Corner, Edge, add_corner_blocks, add_corner_force, add_outer, combine, diagonal};
use super::stencil::{scaled, transposed, visit_corner};
use super::{Automatic, Element, Law, Point, Term};
use pliant_linalg::NodeMatrix;
use pliant_math::{Real, Vec3};

/// R = ½ (c_b/l_v) |D|², D = P_T dκ/dt, T = (t₁ + t₂)/|t₁ + t₂|, κ as in [`BendLaw`](super::BendLaw), l_v = fraction · length; f = −∂R/∂v.
///
/// Nodes: three, in order. Parameters: rope length \[m\], c_b [N·m²·s]. Constant: the middle node's Voronoi fraction of the length
/// [-]. Rigid motions dissipate nothing except spinning about the own tangent T (the rope carries no twist angle: its material
/// frame is the Bishop frame). Not finite where an edge vanishes or the rope folds back.
#[derive(Clone, Copy, Debug, Default)]
pub struct BendDampingLaw;

/// The quantities of the module's head.
#[derive(Clone, Copy, Debug)]
struct Rate<S> {
    corner: Corner<S>,
    /// s = t₁ + t₂.
    sum: Vec3<S>,
    /// z₁, z₂ [1/s].
    z: [Vec3<S>; 2],
    y: Vec3<S>,
    /// p η.
    p_eta: S,
    /// G = 2 p c_b/l_v.
    gain: S,
}

impl<S: Real> Rate<S> {
    #[inline]
    fn new(q: &[Vec3<S>], v: &[Vec3<S>], damping: S) -> Self {
        let corner = Corner::new(q);
        let (t1, t2, p) = (corner.one.tangent, corner.two.tangent, corner.p);
        let sum = t1 + t2;
        let z1 = (v[1] - v[0]) * corner.one.length.recip();
        let z2 = (v[2] - v[1]) * corner.two.length.recip();
        let y = z2 - z1 - t2 * (p * sum.dot(&z2)) + t1 * (p * sum.dot(&z1));
        let p_eta = p * t2.dot(&y);
        Self { corner, sum, z: [z1, z2], y, p_eta, gain: p * damping * 2.0 }
    }

    /// (τ₁, τ₂).
    #[inline]
    fn edge_forces(&self) -> [Vec3<S>; 2] {
        let lean = self.sum * self.p_eta;
        let (one, two) = (self.corner.one.length.recip(), self.corner.two.length.recip());
        [(self.y + lean) * (-self.gain * one), (self.y - lean) * (self.gain * two)]
    }
}

impl Law for BendDampingLaw {
    fn name(&self) -> &str {
        "bend_damping"
    }

    fn force<S: Real>(&self, q: &[Vec3<S>], v: &[Vec3<S>], p: &[S], constants: &[f64], f: &mut [Vec3<S>]) {
        let [tau1, tau2] = Rate::new(q, v, p[1] / (p[0] * constants[0])).edge_forces();
        f[0] += tau1;
        f[1] += tau2 - tau1;
        f[2] -= tau2;
    }

    fn symmetric(&self, p: &[f64]) -> bool {
        p[1] == 0.0
    }
}

/// [`BendDampingLaw`] on many stencils, with hand-derived Jacobians.
#[derive(Clone, Debug)]
pub struct BendDamping {
    automatic: Automatic<BendDampingLaw>,
    compact: Vec<Compact<3, 2>>,
}

/// ∂τ_a/∂w_b = ± G Q_aᵀ Q_b/(|e_a| |e_b|), plus on the diagonal.
#[inline]
fn to_rates(rate: &Rate<f64>) -> [[Block; 2]; 2] {
    let Corner { one, two, one_minus_c, p, .. } = &rate.corner;
    let (s, gain) = (&rate.sum, rate.gain);
    let (i1, i2) = (one.length.recip(), two.length.recip());
    // scale (I + s xᵀ − p t_b sᵀ), where x collects p² (t_a·t_b) s − p t_a.
    let product = |scale: f64, ta: &Vec3<f64>, tb: &Vec3<f64>, cosine: f64| {
        let mut block = diagonal(scale);
        add_outer(&mut block, &(s * scale), &(s * (p * p * cosine) - ta * *p));
        add_outer(&mut block, &(tb * (-p * scale)), s);
        block
    };
    let (t1, t2) = (&one.tangent, &two.tangent);
    let t12 = product(-gain * i1 * i2, t1, t2, 1.0 - one_minus_c);
    [[product(gain * i1 * i1, t1, t1, 1.0), t12], [transposed(&t12), product(gain * i2 * i2, t2, t2, 1.0)]]
}

/// One edge of the corner with its z.
type Side<'a> = (&'a Edge<f64>, &'a Vec3<f64>);

/// (∂τ_a/∂e_a, ∂τ_b/∂e_a) where `y` = Q_b z_b − Q_a z_a. Exchanging a and b turns y around and leaves η and s.
///
/// With α = s·z, P = I − t_a t_aᵀ, ρ = P t_b, β_a = p z_a − p² α_a t_b, β_b = p z_b − p² α_b t_b:
/// |e_a| ∂y/∂e_a = Y = p α_a I + t_a (P β_a − 2 p α_a t_a)ᵀ + z_a t_aᵀ − t_b (P β_b)ᵀ,
/// |e_a| ∂(p η s)/∂e_a = W = s (p Yᵀ t_b − p² η ρ)ᵀ + p η P,   |e_a| ∂c/∂e_a = ρ,  G ∝ p,  and the 1/|e_a| of τ_a.
#[inline]
fn to_edge(rate: &Rate<f64>, y: &Vec3<f64>, (a, za): Side, (b, zb): Side) -> (Block, Block) {
    let (s, p, p_eta) = (&rate.sum, rate.corner.p, rate.p_eta);
    let (ta, tb) = (&a.tangent, &b.tangent);
    let c = 1.0 - rate.corner.one_minus_c;
    let across = |x: Vec3<f64>| x - ta * ta.dot(&x);
    let rho = tb - ta * c;
    let (alpha_a, alpha_b) = (p * s.dot(za), p * s.dot(zb));
    let to_ta = across(za * p) - rho * (p * alpha_a) - ta * (2.0 * alpha_a);
    let to_tb = rho * (p * alpha_b) - across(zb * p);

    let mut dy = diagonal(alpha_a);
    add_outer(&mut dy, ta, &to_ta);
    add_outer(&mut dy, za, ta);
    add_outer(&mut dy, tb, &to_tb);

    let pulled = tb * alpha_a + to_ta * c + ta * tb.dot(za) + to_tb;
    let mut dw = diagonal(p_eta);
    add_outer(&mut dw, s, &((pulled - rho * p_eta) * p));
    add_outer(&mut dw, &(ta * -p_eta), ta);

    let (inverse_a, inverse_b) = (a.length.recip(), b.length.recip());
    let mut own = combine(&dy, 1.0, &dw);
    add_outer(&mut own, &-(y + s * p_eta), &(rho * p + ta));
    let mut other = combine(&dy, -1.0, &dw);
    add_outer(&mut other, &(s * p_eta - y), &(rho * p));
    (scaled(-rate.gain * inverse_a * inverse_a, &own), scaled(rate.gain * inverse_a * inverse_b, &other))
}

/// ∂τ_a/∂e_b.
#[inline]
fn to_edges(rate: &Rate<f64>) -> [[Block; 2]; 2] {
    let (one, two) = ((&rate.corner.one, &rate.z[0]), (&rate.corner.two, &rate.z[1]));
    let (t11, t21) = to_edge(rate, &rate.y, one, two);
    let (t22, t12) = to_edge(rate, &-rate.y, two, one);
    [[t11, t12], [t21, t22]]
}

impl BendDamping {
    /// Bending damping at the elements' middle nodes; see [`BendDampingLaw`] for what an element holds.
    ///
    /// # Panics
    /// If an element is not of the law's shape: a mistake where elements are built.
    pub fn new(elements: Vec<Element>) -> Self {
        let compact = Compact::all(BendDampingLaw.name(), &elements);
        Self { automatic: Automatic::new(BendDampingLaw, elements), compact }
    }

    /// Calls `each(element, rate)` for every stencil with a coefficient.
    #[inline]
    fn for_each(&self, at: &Point, mut each: impl FnMut(&Compact<3, 2>, &Rate<f64>)) {
        for e in &self.compact {
            let p = e.values(at.theta);
            if p[1] != 0.0 {
                each(e, &Rate::new(&e.positions(at), &e.velocities(at), p[1] / (p[0] * e.constant)));
            }
        }
    }
}

impl Term for BendDamping {
    fn name(&self) -> &str {
        BendDampingLaw.name()
    }

    fn inner(&self) -> bool {
        true
    }

    fn add_force(&self, at: &Point, f: &mut [f64]) {
        self.for_each(at, |e, rate| {
            let [tau1, tau2] = rate.edge_forces();
            add_corner_force(f, e.nodes, &tau1, &tau2);
        });
    }

    fn add_jacobian(&self, at: &Point, f: &mut [f64], dq: &mut NodeMatrix, dv: &mut NodeMatrix) {
        self.for_each(at, |e, rate| {
            let [tau1, tau2] = rate.edge_forces();
            add_corner_force(f, e.nodes, &tau1, &tau2);
            add_corner_blocks(dv, e.nodes, &to_rates(rate));
            add_corner_blocks(dq, e.nodes, &to_edges(rate));
        });
    }

    fn visit_theta(&self, at: &Point, visit: &mut dyn FnMut(usize, usize, f64)) {
        for e in &self.compact {
            let p = e.values(at.theta);
            let rate = Rate::new(&e.positions(at), &e.velocities(at), (p[0] * e.constant).recip());
            let per_coefficient = rate.edge_forces();
            visit_corner(e.nodes, e.params[0], &per_coefficient.map(|tau| tau * (-p[1] / p[0])), visit);
            visit_corner(e.nodes, e.params[1], &per_coefficient, visit);
        }
    }

    fn symmetric(&self, theta: &[f64]) -> bool {
        self.compact.iter().all(|e| theta[e.params[1]] == 0.0)
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
    use num_dual::{Dual64, DualNum};

    fn one() -> BendDamping {
        BendDamping::new(vec![Element { nodes: vec![0, 1, 2], params: vec![0, 1], constants: vec![0.1] }])
    }

    #[test]
    fn kernel_equals_law_and_takes_power() {
        let elements = check::elements(3, 2);
        let (kernel, law) = (BendDamping::new(elements.clone()), Automatic::new(BendDampingLaw, elements));
        check::same(&kernel, &law);
        check::linear_momentum(&kernel);
        check::takes_power(&kernel);
        check::zero_coefficient(&kernel, 1);
        assert!(!kernel.symmetric(&Sample::new(0).theta));
    }

    /// −f·v = 2R with R by its definition: κ differentiated along the motion by a dual number of time, projected across T.
    #[test]
    fn power_is_twice_the_dissipation_of_the_definition() {
        for seed in 0..20 {
            let sample = Sample::new(seed);
            let (q, v) = (&sample.q, &sample.v);
            let x: Vec<_> = (0..3).map(|i| Vec3::from_fn(|a, _| Dual64::new(q[3 * i + a], v[3 * i + a]))).collect();
            let unit = |e: Vec3<Dual64>| e * e.dot(&e).sqrt().recip();
            let (t1, t2) = (unit(x[1] - x[0]), unit(x[2] - x[1]));
            let sum = t1 + t2;
            let curvature = (t2 - t1) * (sum.dot(&sum).sqrt().recip() * 2.0);
            let tangent = sum.map(|x| x.re).normalize();
            let rate = curvature.map(|x| x.eps);
            let across = rate - tangent * tangent.dot(&rate);
            let twice = sample.theta[1] / (sample.theta[0] * 0.1) * across.norm_squared();

            let f = check::force(&one(), &sample.at());
            let power: f64 = f.iter().zip(v).map(|(f, v)| f * v).sum();
            assert!((power + twice).abs() < 1e-12 * twice, "{power} against {twice}");
        }
    }

    /// |D|² = (4/σ) [N + (2ċ² − m²)/σ + (1 − c)/(1 + c) ċ²/σ], σ = 2 (1 + c), written out in products of t and ṫ.
    #[test]
    fn power_is_that_of_the_closed_form() {
        let sample = Sample::new(7);
        let (at, l_v) = (sample.at(), sample.theta[0] * 0.1);
        let edge = |i: usize| {
            let (e, w) = (at.position(i + 1) - at.position(i), at.velocity(i + 1) - at.velocity(i));
            let t = e.normalize();
            (t, (w - t * t.dot(&w)) / e.norm())
        };
        let ((t1, d1), (t2, d2)) = (edge(0), edge(1));
        let (c, a, b) = (t1.dot(&t2), t1.dot(&d2), t2.dot(&d1));
        let (c_dot, m, sigma) = (a + b, a - b, 2.0 * (1.0 + c));
        let n = d1.norm_squared() + d2.norm_squared() - 2.0 * d1.dot(&d2);
        let square = 4.0 / sigma * (n + (2.0 * c_dot * c_dot - m * m) / sigma + (1.0 - c) / (1.0 + c) * c_dot * c_dot / sigma);
        let expected = sample.theta[1] / l_v * square;
        let power: f64 = check::force(&one(), &at).iter().zip(&sample.v).map(|(f, v)| f * v).sum();
        assert!((power + expected).abs() < 1e-12 * expected);
    }

    /// Rotations about any axis across T feel nothing; the spin about T is resisted, and that is the law.
    #[test]
    fn of_rigid_motions_only_the_spin_about_the_tangent_dissipates() {
        let sample = Sample::new(3);
        let at = sample.at();
        let tangent = |i: usize| (at.position(i + 1) - at.position(i)).normalize();
        let axis = (tangent(0) + tangent(1)).normalize();
        let across = axis.cross(&Vec3::new(0.3, -0.2, 1.0)).normalize();
        let power = |omega: Vec3<f64>| {
            let v: Vec<f64> =
                (0..at.q.len() / 3).flat_map(|i| omega.cross(&at.position(i)).add_scalar(0.2).as_slice().to_vec()).collect();
            let point = Point { v: &v, ..at };
            -check::force(&one(), &point).iter().zip(&v).map(|(f, v)| f * v).sum::<f64>()
        };
        let spin = power(axis);
        assert!(spin > 1e-3, "{spin}");
        assert!(power(across).abs() < 1e-13 * spin.max(1.0) && power(across.cross(&axis)).abs() < 1e-13 * spin.max(1.0));
    }
}
