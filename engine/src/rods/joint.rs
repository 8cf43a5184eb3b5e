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
#![allow(clippy::needless_range_loop)] // plain loops are inlined; closures over vectors are not always, and then are slow

use pliant_math::Vec3;
use pliant_math::simd::{Number, Three};

/// Numbers of y.
pub(crate) const VARIABLES: usize = 8;
/// Places of δα₁ and δα₂.
pub(crate) const TURN: [usize; 2] = [6, 7];
/// Derivatives by y.
pub(crate) type Gradient<T = f64> = [T; VARIABLES];
/// Second derivatives: row by row, how each entry of a gradient changes.
pub(crate) type Hessian<T = f64> = [[T; VARIABLES]; VARIABLES];
/// Derivatives of moments by strains, by rows.
pub(crate) type Stiffness<T = f64> = [[T; 3]; 3];

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

/// Two edges that meet, of one joint or, with [`Wide`](pliant_math::simd::Wide) numbers, of several.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Joint<T = f64> {
    /// t₁, t₂.
    tangents: [Three<T>; 2],
    /// 1/l₁, 1/l₂ [1/m].
    by_length: [T; 2],
    /// Of the first edge.
    axes: [Three<T>; 2],
    c: T,
    by_chi: T,
    /// α₁, α₂.
    alpha: [T; 2],
    /// Sine and cosine of τ/2.
    half: [T; 2],
    /// κ₁, κ₂ [-], τ \[rad\].
    pub strain: [T; 3],
}

/// Moments m and what they make of the first edge's axes.
struct Weighted<T> {
    a: Three<T>,
    a_turned: Three<T>,
    g: T,
    w1: Three<T>,
    w2: Three<T>,
    g_alpha: T,
    twist: T,
    v: Three<T>,
}

impl Joint {
    #[inline]
    pub fn new(one: &EdgeFrame, two: &EdgeFrame, twist: f64) -> Self {
        let three = |v: &Vec3<f64>| Three([v.x, v.y, v.z]);
        let axes = one.axes.each_ref().map(three);
        let (sin, cos) = (0.5 * twist).sin_cos();
        let tangents = [three(&one.tangent), three(&two.tangent)];
        Self::of(tangents, [1.0 / one.length, 1.0 / two.length], axes, twist, [sin, cos])
    }
}

impl<T: Number> Joint<T> {
    /// Between edges of these tangents and inverse lengths; `axes`: the first one's; `half`: sine and cosine of half the twist.
    #[inline(always)]
    pub fn of(tangents: [Three<T>; 2], by_length: [T; 2], axes: [Three<T>; 2], twist: T, half: [T; 2]) -> Self {
        let (turn, sum) = (tangents[1] - tangents[0], tangents[1] + tangents[0]);
        // ½|t₂ − t₁|² and ½|t₂ + t₁|² keep the relative precision of a nearly straight rod and of a folded one, where 1 ∓ t₁·t₂ cancel
        let one_minus_c = turn.dot(turn).by(0.5);
        let by_chi = sum.dot(sum).under(2.0);
        let alpha = [axes[0].dot(turn).by(2.0) * by_chi, axes[1].dot(turn).by(2.0) * by_chi];
        let [sin, cos] = half;
        let strain = [(alpha[0] * cos).plus(alpha[1], sin), alpha[1] * cos - alpha[0] * sin, twist];
        Self { tangents, by_length, axes, c: twist.same(1.0) - one_minus_c, by_chi, alpha, half, strain }
    }

    #[inline(always)]
    pub(super) fn zero(&self) -> T {
        self.c.same(0.0)
    }

    /// m of M.
    #[inline(always)]
    fn carried(&self, m: &[T; 3]) -> [T; 3] {
        let [sin, cos] = self.half;
        let twist = m[2] + (m[0] * self.strain[1] - m[1] * self.strain[0]).by(0.5);
        [m[0] * cos - m[1] * sin, m[0] * sin + m[1] * cos, twist]
    }

    #[inline(always)]
    fn weighted(&self, m: &[T; 3]) -> Weighted<T> {
        let [first, second] = self.axes;
        let a = first.times(m[0]).plus(m[1], second).times(self.c.same(2.0));
        let a_turned = second.times(m[0]).plus(-m[1], first).times(self.c.same(2.0));
        let [t1, t2] = self.tangents;
        let g = (m[0] * self.alpha[0]).plus(m[1], self.alpha[1]);
        Weighted {
            w1: a.times(self.c).plus(g, t2).times(-self.by_chi),
            w2: a.plus(-g, t1).times(self.by_chi),
            g_alpha: a_turned.dot(t2) * self.by_chi,
            v: t1.cross(t2).times(m[2] * self.by_chi),
            twist: m[2],
            a,
            a_turned,
            g,
        }
    }

    /// ∂(m·(α, τ))/∂y at fixed m.
    #[inline(always)]
    fn pull_plain(&self, m: &[T; 3]) -> Gradient<T> {
        let w = self.weighted(m);
        let [t1, t2] = self.tangents;
        let Three(g1) = (w.w1.plus(-t1.dot(w.w1), t1) + w.v).times(self.by_length[0]);
        let Three(g2) = (w.w2.plus(-t2.dot(w.w2), t2) + w.v).times(self.by_length[1]);
        [g1[0], g1[1], g1[2], g2[0], g2[1], g2[2], w.g_alpha - w.twist, w.twist]
    }

    /// ∂(M·strain)/∂y at fixed M \[N·m\]: by edges [N], by turns [N·m].
    #[inline(always)]
    pub fn pull(&self, m: &[T; 3]) -> Gradient<T> {
        self.pull_plain(&self.carried(m))
    }

    /// ∂strain/∂y, strain by strain.
    #[inline(always)]
    pub fn gradients(&self) -> [Gradient<T>; 3] {
        let (one, zero) = (self.c.same(1.0), self.zero());
        [self.pull(&[one, zero, zero]), self.pull(&[zero, one, zero]), self.pull_plain(&[zero, zero, one])]
    }

    /// Rates of the strains at ẏ: what the gradients times ẏ are.
    #[inline(always)]
    pub fn rates(&self, y: &Gradient<T>) -> [T; 3] {
        let ([t1, t2], x) = (self.tangents, self.by_chi);
        let (e1, e2) = (Three([y[0], y[1], y[2]]), Three([y[3], y[4], y[5]]));
        let u1 = e1.plus(-t1.dot(e1), t1).times(self.by_length[0]);
        let u2 = e2.plus(-t2.dot(e2), t2).times(self.by_length[1]);
        let c = t2.dot(u1) + t1.dot(u2);
        let [a1, a2] = self.axes;
        let turned = [a2.dot(t2), -a1.dot(t2)];
        let mut alpha = self.alpha;
        for (j, a) in [a1, a2].into_iter().enumerate() {
            let bent = a.dot(u2) - self.c * a.dot(u1) + y[TURN[0]] * turned[j];
            alpha[j] = (bent.by(2.0) - self.alpha[j] * c) * x;
        }
        let tau = y[TURN[1]] - y[TURN[0]] + x * t1.cross(t2).dot(u1 + u2);
        let [sin, cos] = self.half;
        let by_tau = tau.by(0.5);
        [
            (alpha[0] * cos).plus(alpha[1], sin).plus(by_tau, self.strain[1]),
            alpha[1] * cos - alpha[0] * sin - by_tau * self.strain[0],
            tau,
        ]
    }

    /// How [`Joint::pull`] changes with y where M changes by `stiffness` times the strains; `gradients` as [`Joint::gradients`] has them.
    #[inline(always)]
    pub fn hessian(&self, m: &[T; 3], stiffness: &Stiffness<T>, gradients: &[Gradient<T>; 3]) -> Hessian<T> {
        let plain = self.carried(m);
        let mut out = [[self.zero(); VARIABLES]; VARIABLES];
        self.second(&plain, &mut out);
        // m changes with y too: its bending part turns by half the twist, its twisting part has the strains in it
        let turned = self.pull_plain(&[plain[1].by(-0.5), plain[0].by(0.5), self.zero()]);
        let [kappa1, kappa2, tau] = gradients;
        let (m1, m2) = (m[0].by(0.5), m[1].by(0.5));
        let mut by_twist = combined(&stiffness[2], gradients);
        for (c, x) in by_twist.iter_mut().enumerate() {
            *x = x.plus(m1, kappa2[c]).plus(-m2, kappa1[c]);
        }
        add_product(&turned, tau, &mut out);
        add_product(kappa1, &combined(&stiffness[0], gradients), &mut out);
        add_product(kappa2, &combined(&stiffness[1], gradients), &mut out);
        add_product(tau, &by_twist, &mut out);
        out
    }

    /// Contribution of rates to [`Joint::hessian`] at ẏ where M changes by `damping` times them, and what changes with ẏ.
    #[inline(always)]
    pub fn damped(&self, damping: &Stiffness<T>, gradients: &[Gradient<T>; 3], y: &Gradient<T>) -> [Hessian<T>; 2] {
        let (one, zero) = (self.c.same(1.0), self.zero());
        let moved = [
            self.rate_gradient(&[one, zero, zero], gradients, y),
            self.rate_gradient(&[zero, one, zero], gradients, y),
            self.rate_gradient(&[zero, zero, one], gradients, y),
        ];
        let mut out = [[[zero; VARIABLES]; VARIABLES]; 2];
        for (left, row) in gradients.iter().zip(damping) {
            add_product(left, &combined(row, &moved), &mut out[0]);
            add_product(left, &combined(row, gradients), &mut out[1]);
        }
        out
    }

    /// ẏ times [`Joint::hessian`] at fixed M: how M's rate M·(gradients ẏ) changes with y at fixed ẏ.
    #[inline(always)]
    pub fn rate_gradient(&self, m: &[T; 3], gradients: &[Gradient<T>; 3], y: &Gradient<T>) -> Gradient<T> {
        let plain = self.carried(m);
        let mut out = RateGradient { y, sum: [self.zero(); VARIABLES] };
        self.second(&plain, &mut out);
        let turned = self.pull_plain(&[plain[1].by(-0.5), plain[0].by(0.5), self.zero()]);
        let [kappa1, kappa2, tau] = gradients;
        let (by_turned, by_tau) = (dot(&turned, y), dot(tau, y).by(0.5));
        let mut sum = out.sum;
        for (k, x) in sum.iter_mut().enumerate() {
            *x = x.plus(by_turned, tau[k]).plus(by_tau, m[0] * kappa2[k] - m[1] * kappa1[k]);
        }
        sum
    }

    /// Hands `out` the parts of how [`Joint::pull_plain`] changes with y at fixed m.
    #[inline(always)]
    fn second(&self, m: &[T; 3], out: &mut impl Parts<T>) {
        let w = self.weighted(m);
        let ([t1, t2], c, x) = (self.tangents, self.c, self.by_chi);
        let [i1, i2] = self.by_length;
        let (s11, s12, s22) = (i1 * i1, i1 * i2, i2 * i2);
        let (p1t2, p2t1) = (t2.plus(-c, t1), t1.plus(-c, t2));
        let (along1, along2) = (t1.dot(w.w1), t2.dot(w.w2));
        let (p1w1, p2w2) = (w.w1.plus(-along1, t1), w.w2.plus(-along2, t2));
        let (t12, tx) = (t1.cross(t2), w.twist * x);

        // by e₁: the change of w₁ and of v, then that of P₁/l₁ and of 1/l₁
        let by_first = w.a + p1w1 + w.v;
        out.outer([0, 0], by_first.times(-x * s11), p1t2);
        out.outer([0, 0], (p1t2.times(x) + t1).times(-s11), p1w1);
        out.outer([0, 0], (t1.times(along1) - p1w1 - w.v - t12.times(tx)).times(s11), t1);
        out.diagonal([0, 0], -along1 * s11);
        out.cross([0, 0], t2.times(-tx * s11));
        out.outer([1, 1], (p2w2 + w.v).times(-x * s22), p2t1);
        out.outer([1, 1], (p2t1.times(x) + t2).times(-s22), p2w2);
        out.outer([1, 1], (t2.times(along2) - p2w2 - w.v - t12.times(tx)).times(s22), t2);
        out.diagonal([1, 1], -along2 * s22);
        out.cross([1, 1], t1.times(tx * s22));
        // P₁ P₂ = I − t₁ t₁ᵀ − t₂ t₂ᵀ + c t₁ t₂ᵀ
        let (g, scale, across) = (-x * w.g * s12, -x * s12, t12.times(tx * s12));
        out.outer([0, 1], by_first.times(scale), p2t1);
        out.outer([0, 1], p1t2.times(scale), p2w2);
        out.outer([0, 1], (t1.times(c) - t2).times(g) - across, t2);
        out.outer([0, 1], t1.times(-g), t1);
        out.diagonal([0, 1], g);
        out.cross([0, 1], t1.times(tx * s12));
        out.outer([1, 0], p2t1.times(scale), w.a + p1w1);
        out.outer([1, 0], (p2w2 + w.v).times(scale), p1t2);
        out.outer([1, 0], (t2.times(c) - t1).times(g) - across, t1);
        out.outer([1, 0], t2.times(-g), t2);
        out.diagonal([1, 0], g);
        out.cross([1, 0], t2.times(-tx * s12));

        out.turn(0, (w.a_turned.times(c).plus(w.g_alpha, p1t2)).times(-x * i1));
        let by_second = w.a_turned.plus(-w.g_alpha, t1);
        out.turn(1, by_second.plus(-t2.dot(by_second), t2).times(x * i2));
        out.turns(-w.a.dot(t2) * x);
    }
}

/// Accumulator of the parts of a second derivative. Blocks are those of the two edges.
trait Parts<T> {
    /// u vᵀ in a block.
    fn outer(&mut self, block: [usize; 2], u: Three<T>, v: Three<T>);
    /// s I in a block.
    fn diagonal(&mut self, block: [usize; 2], s: T);
    /// [u]ₓ in a block.
    fn cross(&mut self, block: [usize; 2], u: Three<T>);
    /// A vector between an edge and the first turn, and its transposed.
    fn turn(&mut self, edge: usize, u: Three<T>);
    /// Between the first turn and itself.
    fn turns(&mut self, s: T);
}

impl<T: Number> Parts<T> for Hessian<T> {
    #[inline(always)]
    fn outer(&mut self, [r, c]: [usize; 2], Three(u): Three<T>, Three(v): Three<T>) {
        for a in 0..3 {
            for b in 0..3 {
                self[3 * r + a][3 * c + b] = self[3 * r + a][3 * c + b].plus(u[a], v[b]);
            }
        }
    }

    #[inline(always)]
    fn diagonal(&mut self, [r, c]: [usize; 2], s: T) {
        for a in 0..3 {
            self[3 * r + a][3 * c + a] = self[3 * r + a][3 * c + a] + s;
        }
    }

    #[inline(always)]
    fn cross(&mut self, [r, c]: [usize; 2], Three(u): Three<T>) {
        for a in 0..3 {
            let (b, d) = ((a + 1) % 3, (a + 2) % 3);
            self[3 * r + a][3 * c + b] = self[3 * r + a][3 * c + b] - u[d];
            self[3 * r + a][3 * c + d] = self[3 * r + a][3 * c + d] + u[b];
        }
    }

    #[inline(always)]
    fn turn(&mut self, edge: usize, Three(u): Three<T>) {
        for a in 0..3 {
            self[3 * edge + a][TURN[0]] = self[3 * edge + a][TURN[0]] + u[a];
            self[TURN[0]][3 * edge + a] = self[TURN[0]][3 * edge + a] + u[a];
        }
    }

    #[inline(always)]
    fn turns(&mut self, s: T) {
        self[TURN[0]][TURN[0]] = self[TURN[0]][TURN[0]] + s;
    }
}

/// ẏ times the parts.
struct RateGradient<'a, T> {
    y: &'a Gradient<T>,
    sum: Gradient<T>,
}

impl<T: Number> RateGradient<'_, T> {
    #[inline(always)]
    fn edge(&self, r: usize) -> Three<T> {
        Three([self.y[3 * r], self.y[3 * r + 1], self.y[3 * r + 2]])
    }

    #[inline(always)]
    fn add(&mut self, c: usize, Three(x): Three<T>) {
        for a in 0..3 {
            self.sum[3 * c + a] = self.sum[3 * c + a] + x[a];
        }
    }

    #[inline(always)]
    fn add_turn(&mut self, x: T) {
        self.sum[TURN[0]] = self.sum[TURN[0]] + x;
    }
}

impl<T: Number> Parts<T> for RateGradient<'_, T> {
    #[inline(always)]
    fn outer(&mut self, [r, c]: [usize; 2], u: Three<T>, v: Three<T>) {
        self.add(c, v.times(u.dot(self.edge(r))));
    }

    #[inline(always)]
    fn diagonal(&mut self, [r, c]: [usize; 2], s: T) {
        self.add(c, self.edge(r).times(s));
    }

    #[inline(always)]
    fn cross(&mut self, [r, c]: [usize; 2], u: Three<T>) {
        // yᵀ [u]ₓ = (y × u)ᵀ
        self.add(c, self.edge(r).cross(u));
    }

    #[inline(always)]
    fn turn(&mut self, edge: usize, u: Three<T>) {
        self.add(edge, u.times(self.y[TURN[0]]));
        self.add_turn(u.dot(self.edge(edge)));
    }

    #[inline(always)]
    fn turns(&mut self, s: T) {
        self.add_turn(s * self.y[TURN[0]]);
    }
}

/// a·b.
#[inline(always)]
pub(crate) fn dot<T: Number>(a: &Gradient<T>, b: &Gradient<T>) -> T {
    let mut sum = a[0] * b[0];
    for k in 1..VARIABLES {
        sum = sum.plus(a[k], b[k]);
    }
    sum
}

/// Σ_s k_s x_s.
#[inline(always)]
fn combined<T: Number>(k: &[T; 3], x: &[Gradient<T>; 3]) -> Gradient<T> {
    let mut out = x[0];
    for (c, out) in out.iter_mut().enumerate() {
        *out = (k[0] * *out).plus(k[1], x[1][c]).plus(k[2], x[2][c]);
    }
    out
}

/// `out += l rᵀ`.
#[inline(always)]
fn add_product<T: Number>(l: &Gradient<T>, r: &Gradient<T>, out: &mut Hessian<T>) {
    for (out, l) in out.iter_mut().zip(l) {
        for (out, r) in out.iter_mut().zip(r) {
            *out = out.plus(*l, *r);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pliant_math::transport::{any_normal, carried};
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
        pliant_math::transport::angle(&carried(&one.tangent, &two.tangent, &one.axes[0]), &two.axes[0], &two.tangent)
    }

    type Pair = [EdgeFrame; 2];

    fn joint([one, two]: &Pair) -> Joint {
        Joint::new(one, two, twist(one, two))
    }

    fn displaced([one, two]: &Pair, k: usize, by: f64) -> Joint {
        let mut y = [0.0; VARIABLES];
        y[k] = by;
        let moved = |frame, e: usize| moved(frame, Vec3::new(y[3 * e], y[3 * e + 1], y[3 * e + 2]), y[TURN[e]]);
        joint(&[moved(one, 0), moved(two, 1)])
    }

    fn samples() -> Vec<Pair> {
        let mut rng = Pcg64Mcg::seed_from_u64(4);
        let mut vector = move |size: f64| Vec3::from_fn(|_, _| rng.random_range(-size..size));
        (0..20)
            .map(|k| {
                let e = vector(1.0);
                let bend = if k % 2 == 0 { 0.9 } else { 1e-3 };
                [frame(e, 0.3), frame(e * 1.3 + vector(bend), 0.3 + 0.1 * f64::from(k))]
            })
            .collect()
    }

    #[test]
    fn curvatures_are_those_of_discrete_viscous_threads_but_for_the_half_twist() {
        for [one, two] in samples() {
            let j = joint(&[one, two]);
            let kb = one.tangent.cross(&two.tangent) * (2.0 * j.by_chi);
            let mean = |k: usize| (one.axes[k] + two.axes[k]) * 0.5;
            let cos = j.half[1];
            assert!((cos * j.strain[0] - mean(1).dot(&kb)).abs() < 1e-14);
            assert!((cos * j.strain[1] + mean(0).dot(&kb)).abs() < 1e-14);
            assert!((j.strain[0].hypot(j.strain[1]) - kb.norm()).abs() < 1e-14);
        }
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        let eps = 1e-5;
        for pair in samples() {
            let j = joint(&pair);
            let gradients = j.gradients();
            for m in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.7, -0.4, 1.9]] {
                let (pull, hessian) = (j.pull(&m), j.hessian(&m, &[[0.0; 3]; 3], &gradients));
                for k in 0..VARIABLES {
                    let (up, down) = (displaced(&pair, k, eps), displaced(&pair, k, -eps));
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
