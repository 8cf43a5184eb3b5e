//! How a rod is bent and twisted at a node between two edges, and how that changes.
//!
//! With unit tangents t₁, t₂ of edges e₁, e₂ and material axes (a₁, a₂) and (b₁, b₂), normal to t₁ and to t₂, the curvature binormal
//! 2 t₁ × t₂/χ, χ = 1 + t₁·t₂, has the parts α towards the first edge's axes, which it keeps as they are carried to the second edge, and
//! R(−τ) α towards the second's, τ being the twist between the two. The strains are those towards the axes half way:
//! ```text
//! α_j = 2 a_j·(t₂ − t₁)/χ,    κ = R(−τ/2) α,    τ
//! ```
//! |κ| = 2 tan(φ/2) for a turning angle φ, κ_j its part towards the material axis j (Bergou et al. 2010, Discrete Viscous Threads, who
//! take the mean of both edges' parts, cos(τ/2) κ: a rod twisted by half a turn a joint would then not resist bending). The variables are
//! y = (δe₁, δe₂, δα₁, δα₂), δα an edge's turn about its own tangent *beside* parallel transport, which is what moving its ends does to
//! its axes. For moments m that belong to (α, τ) let A = 2 Σ m_j a_j, A^⊥ = t₁ × A, G = m₁ α₁ + m₂ α₂, v = m₃ t₁ × t₂/χ, c = t₁·t₂. Then
//! ```text
//! w₁ = −(c A + G t₂)/χ,   w₂ = (A − G t₁)/χ,   P_a = I − t_a t_aᵀ
//! ∂/∂e₁ = (P₁ w₁ + v)/l₁,   ∂/∂e₂ = (P₂ w₂ + v)/l₂,   ∂/∂α₁ = A^⊥·t₂/χ − m₃,   ∂/∂α₂ = m₃
//! ```
//! and moments M that belong to (κ, τ) are m = (R(τ/2) (M₁, M₂), M₃ + (M₁ κ₂ − M₂ κ₁)/2). The second derivatives are taken along the same
//! displacements one after the other. Since axes carried around a circle of directions come back turned, they do not commute: the
//! matrix is unsymmetric by the moment about the tangent.

use crate::terms::Vec3;

/// Numbers of y.
pub(crate) const VARIABLES: usize = 8;
/// Places of δα₁ and δα₂.
pub(crate) const TURN: [usize; 2] = [6, 7];
/// Derivatives by y.
pub(crate) type Gradient = [f64; VARIABLES];
/// Second derivatives: row by row, how each entry of a gradient changes.
pub(crate) type Hessian = [[f64; VARIABLES]; VARIABLES];

/// An edge and its material axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct EdgeFrame {
    /// Unit tangent.
    pub tangent: Vec3<f64>,
    /// Length \[m\].
    pub length: f64,
    /// Material axes; tangent = first × second.
    pub axes: [Vec3<f64>; 2],
}

/// Two edges that meet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Joint {
    one: EdgeFrame,
    two: EdgeFrame,
    c: f64,
    by_chi: f64,
    /// α₁, α₂.
    alpha: [f64; 2],
    /// Sine and cosine of τ/2.
    half: [f64; 2],
    /// κ₁, κ₂ [-], τ \[rad\].
    pub strain: [f64; 3],
}

/// Moments m and what they make of the first edge's axes.
struct Weighted {
    a: Vec3<f64>,
    a_turned: Vec3<f64>,
    g: f64,
    w1: Vec3<f64>,
    w2: Vec3<f64>,
    g_alpha: f64,
    twist: f64,
    v: Vec3<f64>,
}

impl Joint {
    #[inline]
    pub fn new(one: EdgeFrame, two: EdgeFrame, twist: f64) -> Self {
        let turn = two.tangent - one.tangent;
        // ½|t₂ − t₁|² keeps the relative precision of a nearly straight rod, where 1 − t₁·t₂ cancels
        let one_minus_c = 0.5 * turn.norm_squared();
        let by_chi = 1.0 / (2.0 - one_minus_c);
        let alpha = [0, 1].map(|j: usize| 2.0 * one.axes[j].dot(&turn) * by_chi);
        let (sin, cos) = (0.5 * twist).sin_cos();
        let strain = [alpha[0] * cos + alpha[1] * sin, alpha[1] * cos - alpha[0] * sin, twist];
        Self { one, two, c: 1.0 - one_minus_c, by_chi, alpha, half: [sin, cos], strain }
    }

    /// m of M.
    #[inline]
    fn carried(&self, m: &[f64; 3]) -> [f64; 3] {
        let [sin, cos] = self.half;
        let twist = m[2] + 0.5 * (m[0] * self.strain[1] - m[1] * self.strain[0]);
        [m[0] * cos - m[1] * sin, m[0] * sin + m[1] * cos, twist]
    }

    #[inline]
    fn weighted(&self, m: &[f64; 3]) -> Weighted {
        let axes = &self.one.axes;
        let (a, a_turned) = ((axes[0] * m[0] + axes[1] * m[1]) * 2.0, (axes[1] * m[0] - axes[0] * m[1]) * 2.0);
        let (t1, t2) = (&self.one.tangent, &self.two.tangent);
        let g = m[0] * self.alpha[0] + m[1] * self.alpha[1];
        Weighted {
            w1: (a * self.c + t2 * g) * -self.by_chi,
            w2: (a - t1 * g) * self.by_chi,
            g_alpha: a_turned.dot(t2) * self.by_chi,
            v: t1.cross(t2) * (m[2] * self.by_chi),
            twist: m[2],
            a,
            a_turned,
            g,
        }
    }

    /// ∂(m·(α, τ))/∂y at fixed m.
    #[inline]
    fn pull_plain(&self, m: &[f64; 3]) -> Gradient {
        let w = self.weighted(m);
        let (t1, t2) = (&self.one.tangent, &self.two.tangent);
        let g1 = (w.w1 - t1 * t1.dot(&w.w1) + w.v) / self.one.length;
        let g2 = (w.w2 - t2 * t2.dot(&w.w2) + w.v) / self.two.length;
        [g1[0], g1[1], g1[2], g2[0], g2[1], g2[2], w.g_alpha - w.twist, w.twist]
    }

    /// ∂(M·strain)/∂y at fixed M \[N·m\]: by edges [N], by turns [N·m].
    #[inline]
    pub fn pull(&self, m: &[f64; 3]) -> Gradient {
        self.pull_plain(&self.carried(m))
    }

    /// ∂strain/∂y, strain by strain.
    #[inline]
    pub fn gradients(&self) -> [Gradient; 3] {
        [self.pull(&[1.0, 0.0, 0.0]), self.pull(&[0.0, 1.0, 0.0]), self.pull_plain(&[0.0, 0.0, 1.0])]
    }

    /// Rates of the strains at ẏ: what the gradients times ẏ are.
    #[inline]
    pub fn rates(&self, y: &Gradient) -> [f64; 3] {
        let (t1, t2, x) = (&self.one.tangent, &self.two.tangent, self.by_chi);
        let across = |t: &Vec3<f64>, e: Vec3<f64>, length: f64| (e - t * t.dot(&e)) / length;
        let u1 = across(t1, Vec3::new(y[0], y[1], y[2]), self.one.length);
        let u2 = across(t2, Vec3::new(y[3], y[4], y[5]), self.two.length);
        let c = t2.dot(&u1) + t1.dot(&u2);
        let [a1, a2] = &self.one.axes;
        let turned = [a2.dot(t2), -a1.dot(t2)];
        let alpha = [(a1, 0), (a2, 1)]
            .map(|(a, j)| (2.0 * (a.dot(&u2) - self.c * a.dot(&u1) + y[TURN[0]] * turned[j]) - self.alpha[j] * c) * x);
        let tau = y[TURN[1]] - y[TURN[0]] + x * t1.cross(t2).dot(&(u1 + u2));
        let [sin, cos] = self.half;
        let by_tau = 0.5 * tau;
        [
            alpha[0] * cos + alpha[1] * sin + by_tau * self.strain[1],
            alpha[1] * cos - alpha[0] * sin - by_tau * self.strain[0],
            tau,
        ]
    }

    /// How [`Joint::pull`] changes with y at fixed M; `gradients` as [`Joint::gradients`] has them.
    pub fn hessian(&self, m: &[f64; 3], gradients: &[Gradient; 3]) -> Hessian {
        let plain = self.carried(m);
        let mut out = [[0.0; VARIABLES]; VARIABLES];
        self.second(&plain, &mut out);
        // m changes with y too: its bending part turns by half the twist, its twisting part has the strains in it
        let turned = self.pull_plain(&[-0.5 * plain[1], 0.5 * plain[0], 0.0]);
        let [kappa1, kappa2, tau] = gradients;
        let by_strain: Gradient = std::array::from_fn(|c| 0.5 * (m[0] * kappa2[c] - m[1] * kappa1[c]));
        for (row, (turned, by_tau)) in out.iter_mut().zip(turned.iter().zip(tau)) {
            for (x, (t, s)) in row.iter_mut().zip(tau.iter().zip(&by_strain)) {
                *x += turned * t + by_tau * s;
            }
        }
        out
    }

    /// ẏ times [`Joint::hessian`]: how M's rate M·(gradients ẏ) changes with y at fixed ẏ.
    pub fn rate_gradient(&self, m: &[f64; 3], gradients: &[Gradient; 3], y: &Gradient) -> Gradient {
        let plain = self.carried(m);
        let mut out = RateGradient { y, sum: [0.0; VARIABLES] };
        self.second(&plain, &mut out);
        let turned = self.pull_plain(&[-0.5 * plain[1], 0.5 * plain[0], 0.0]);
        let [kappa1, kappa2, tau] = gradients;
        let (by_turned, by_tau) = (dot(&turned, y), 0.5 * dot(tau, y));
        let mut sum = out.sum;
        for (k, x) in sum.iter_mut().enumerate() {
            *x += by_turned * tau[k] + by_tau * (m[0] * kappa2[k] - m[1] * kappa1[k]);
        }
        sum
    }

    /// Hands `out` the parts of how [`Joint::pull_plain`] changes with y at fixed m.
    #[inline(always)]
    fn second(&self, m: &[f64; 3], out: &mut impl Parts) {
        let w = self.weighted(m);
        let (t1, t2, c, x) = (&self.one.tangent, &self.two.tangent, self.c, self.by_chi);
        let (i1, i2) = (1.0 / self.one.length, 1.0 / self.two.length);
        let (s11, s12, s22) = (i1 * i1, i1 * i2, i2 * i2);
        let (p1t2, p2t1) = (t2 - t1 * c, t1 - t2 * c);
        let (along1, along2) = (t1.dot(&w.w1), t2.dot(&w.w2));
        let (p1w1, p2w2) = (w.w1 - t1 * along1, w.w2 - t2 * along2);
        let (t12, tx) = (t1.cross(t2), w.twist * x);

        // by e₁: the change of w₁ and of v, then that of P₁/l₁ and of 1/l₁
        out.outer([0, 0], &((w.a + p1w1 + w.v) * (-x * s11)), &p1t2);
        out.outer([0, 0], &(p1t2 * (-x * s11) - t1 * s11), &p1w1);
        out.outer([0, 0], &((p1w1 + w.v) * -s11 + t1 * (along1 * s11) - t12 * (tx * s11)), t1);
        out.diagonal([0, 0], -along1 * s11);
        out.cross([0, 0], &(t2 * (-tx * s11)));
        out.outer([1, 1], &((p2w2 + w.v) * (-x * s22)), &p2t1);
        out.outer([1, 1], &(p2t1 * (-x * s22) - t2 * s22), &p2w2);
        out.outer([1, 1], &((p2w2 + w.v) * -s22 + t2 * (along2 * s22) - t12 * (tx * s22)), t2);
        out.diagonal([1, 1], -along2 * s22);
        out.cross([1, 1], &(t1 * (tx * s22)));
        // P₁ P₂ = I − t₁ t₁ᵀ − t₂ t₂ᵀ + c t₁ t₂ᵀ
        let (g, scale) = (-x * w.g * s12, -x * s12);
        out.outer([0, 1], &((w.a + p1w1 + w.v) * scale), &p2t1);
        out.outer([0, 1], &(p1t2 * scale), &p2w2);
        out.outer([0, 1], &((t1 * c - t2) * g - t12 * (tx * s12)), t2);
        out.outer([0, 1], &(t1 * -g), t1);
        out.diagonal([0, 1], g);
        out.cross([0, 1], &(t1 * (tx * s12)));
        out.outer([1, 0], &(p2t1 * scale), &(w.a + p1w1));
        out.outer([1, 0], &((p2w2 + w.v) * scale), &p1t2);
        out.outer([1, 0], &((t2 * c - t1) * g - t12 * (tx * s12)), t1);
        out.outer([1, 0], &(t2 * -g), t2);
        out.diagonal([1, 0], g);
        out.cross([1, 0], &(t2 * (-tx * s12)));

        out.turn(0, &((w.a_turned * c + p1t2 * w.g_alpha) * (-x * i1)));
        let by_second = w.a_turned - t1 * w.g_alpha;
        out.turn(1, &((by_second - t2 * t2.dot(&by_second)) * (x * i2)));
        out.turns(-w.a.dot(t2) * x);
    }
}

/// What the parts of a second derivative are gathered in. Blocks are those of the two edges.
trait Parts {
    /// u vᵀ in a block.
    fn outer(&mut self, block: [usize; 2], u: &Vec3<f64>, v: &Vec3<f64>);
    /// s I in a block.
    fn diagonal(&mut self, block: [usize; 2], s: f64);
    /// [u]ₓ in a block.
    fn cross(&mut self, block: [usize; 2], u: &Vec3<f64>);
    /// A vector between an edge and the first turn, and its transposed.
    fn turn(&mut self, edge: usize, u: &Vec3<f64>);
    /// Between the first turn and itself.
    fn turns(&mut self, s: f64);
}

impl Parts for Hessian {
    #[inline(always)]
    fn outer(&mut self, [r, c]: [usize; 2], u: &Vec3<f64>, v: &Vec3<f64>) {
        for a in 0..3 {
            (0..3).for_each(|b| self[3 * r + a][3 * c + b] += u[a] * v[b]);
        }
    }

    #[inline(always)]
    fn diagonal(&mut self, [r, c]: [usize; 2], s: f64) {
        (0..3).for_each(|a| self[3 * r + a][3 * c + a] += s);
    }

    #[inline(always)]
    fn cross(&mut self, [r, c]: [usize; 2], u: &Vec3<f64>) {
        for a in 0..3 {
            let (b, d) = ((a + 1) % 3, (a + 2) % 3);
            self[3 * r + a][3 * c + b] -= u[d];
            self[3 * r + a][3 * c + d] += u[b];
        }
    }

    #[inline(always)]
    fn turn(&mut self, edge: usize, u: &Vec3<f64>) {
        for a in 0..3 {
            self[3 * edge + a][TURN[0]] += u[a];
            self[TURN[0]][3 * edge + a] += u[a];
        }
    }

    #[inline(always)]
    fn turns(&mut self, s: f64) {
        self[TURN[0]][TURN[0]] += s;
    }
}

/// ẏ times the parts.
struct RateGradient<'a> {
    y: &'a Gradient,
    sum: Gradient,
}

impl RateGradient<'_> {
    #[inline(always)]
    fn edge(&self, r: usize) -> Vec3<f64> {
        Vec3::new(self.y[3 * r], self.y[3 * r + 1], self.y[3 * r + 2])
    }

    #[inline(always)]
    fn add(&mut self, c: usize, x: &Vec3<f64>) {
        (0..3).for_each(|a| self.sum[3 * c + a] += x[a]);
    }
}

impl Parts for RateGradient<'_> {
    #[inline(always)]
    fn outer(&mut self, [r, c]: [usize; 2], u: &Vec3<f64>, v: &Vec3<f64>) {
        self.add(c, &(v * u.dot(&self.edge(r))));
    }

    #[inline(always)]
    fn diagonal(&mut self, [r, c]: [usize; 2], s: f64) {
        self.add(c, &(self.edge(r) * s));
    }

    #[inline(always)]
    fn cross(&mut self, [r, c]: [usize; 2], u: &Vec3<f64>) {
        // yᵀ [u]ₓ = (y × u)ᵀ
        self.add(c, &self.edge(r).cross(u));
    }

    #[inline(always)]
    fn turn(&mut self, edge: usize, u: &Vec3<f64>) {
        self.add(edge, &(u * self.y[TURN[0]]));
        self.sum[TURN[0]] += u.dot(&self.edge(edge));
    }

    #[inline(always)]
    fn turns(&mut self, s: f64) {
        self.sum[TURN[0]] += s * self.y[TURN[0]];
    }
}

/// a·b.
#[inline]
pub(crate) fn dot(a: &Gradient, b: &Gradient) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::super::transport::{any_normal, carried};
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    fn frame(e: Vec3<f64>, turn: f64) -> EdgeFrame {
        let tangent = e.normalize();
        let d = any_normal(&tangent);
        let first = d * turn.cos() + tangent.cross(&d) * turn.sin();
        EdgeFrame { tangent, length: e.norm(), axes: [first, tangent.cross(&first)] }
    }

    /// The edge displaced by δe with its axes carried along, then turned by δα.
    fn moved(f: &EdgeFrame, de: Vec3<f64>, turn: f64) -> EdgeFrame {
        let e = f.tangent * f.length + de;
        let tangent = e.normalize();
        let d = carried(&f.tangent, &tangent, &f.axes[0]);
        let first = d * turn.cos() + tangent.cross(&d) * turn.sin();
        EdgeFrame { tangent, length: e.norm(), axes: [first, tangent.cross(&first)] }
    }

    fn twist(one: &EdgeFrame, two: &EdgeFrame) -> f64 {
        super::super::transport::angle(&carried(&one.tangent, &two.tangent, &one.axes[0]), &two.axes[0], &two.tangent)
    }

    fn joint(one: EdgeFrame, two: EdgeFrame) -> Joint {
        Joint::new(one, two, twist(&one, &two))
    }

    fn displaced(j: &Joint, k: usize, by: f64) -> Joint {
        let mut y = [0.0; VARIABLES];
        y[k] = by;
        joint(moved(&j.one, Vec3::new(y[0], y[1], y[2]), y[TURN[0]]), moved(&j.two, Vec3::new(y[3], y[4], y[5]), y[TURN[1]]))
    }

    fn samples() -> Vec<Joint> {
        let mut rng = Pcg64Mcg::seed_from_u64(4);
        let mut vector = move |size: f64| Vec3::from_fn(|_, _| rng.random_range(-size..size));
        (0..20)
            .map(|k| {
                let e = vector(1.0);
                let bend = if k % 2 == 0 { 0.9 } else { 1e-3 };
                joint(frame(e, 0.3), frame(e * 1.3 + vector(bend), 0.3 + 0.1 * f64::from(k)))
            })
            .collect()
    }

    #[test]
    fn curvatures_are_those_of_discrete_viscous_threads_but_for_the_half_twist() {
        for j in samples() {
            let kb = j.one.tangent.cross(&j.two.tangent) * (2.0 * j.by_chi);
            let mean = |k: usize| (j.one.axes[k] + j.two.axes[k]) * 0.5;
            let cos = j.half[1];
            assert!((cos * j.strain[0] - mean(1).dot(&kb)).abs() < 1e-14);
            assert!((cos * j.strain[1] + mean(0).dot(&kb)).abs() < 1e-14);
            assert!((j.strain[0].hypot(j.strain[1]) - kb.norm()).abs() < 1e-14);
        }
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        let eps = 1e-5;
        for j in samples() {
            let gradients = j.gradients();
            for m in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.7, -0.4, 1.9]] {
                let (pull, hessian) = (j.pull(&m), j.hessian(&m, &gradients));
                for k in 0..VARIABLES {
                    let (up, down) = (displaced(&j, k, eps), displaced(&j, k, -eps));
                    for (s, gradient) in gradients.iter().enumerate() {
                        let slope = (up.strain[s] - down.strain[s]) / (2.0 * eps);
                        assert!((gradient[k] - slope).abs() < 1e-7 * (1.0 + slope.abs()), "{s} {k}");
                    }
                    let (up, down) = (up.pull(&m), down.pull(&m));
                    for r in 0..VARIABLES {
                        let slope = (up[r] - down[r]) / (2.0 * eps);
                        let size = 1.0 + hessian.concat().iter().fold(0.0_f64, |m, x| m.max(x.abs()));
                        assert!((hessian[r][k] - slope).abs() < 2e-7 * size, "M {m:?} ({r}, {k}): {} {slope}", hessian[r][k]);
                    }
                }
                let y = [0.3, -1.0, 0.7, 0.2, 1.4, -0.6, 0.9, -1.3];
                let rates = j.rates(&y);
                for (s, gradient) in gradients.iter().enumerate() {
                    assert!((rates[s] - dot(gradient, &y)).abs() < 1e-12 * (1.0 + rates[s].abs()));
                }
                let by_rate = j.rate_gradient(&m, &gradients, &y);
                for k in 0..VARIABLES {
                    let column: f64 = (0..VARIABLES).map(|r| y[r] * hessian[r][k]).sum();
                    assert!((by_rate[k] - column).abs() < 1e-12 * (1.0 + column.abs()));
                }
                let sum: f64 = (0..3).map(|s| m[s] * gradients[s][5]).sum();
                assert!((pull[5] - sum).abs() < 1e-12 * (1.0 + sum.abs()));
            }
        }
    }
}
