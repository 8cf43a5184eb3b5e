//! The angle between two triangles that share an edge, with its first and second derivatives.
//!
//! The edge e = x₁ − x₀ of length l with direction ê; on side a a third node x_a at height h and foot x₀ + s e, c the unit vector
//! from the foot to it, m the triangle's unit normal (both triangles see the same side of the sheet). With θ the turn from one
//! normal to the other, negative where the outer nodes are lifted along the normals,
//!
//! ∂θ/∂x_a = −m/h,   ∂θ/∂x₁ = Σ_sides s m/h,   ∂θ/∂x₀ = Σ_sides (1 − s) m/h,
//!
//! since a foot that is lifted undoes what its node does. From ∂(m/h)/∂x_a = −(m cᵀ + c mᵀ)/h² and
//! ∂(m/h)/∂e = (s/h²)(m cᵀ + c mᵀ) − ê mᵀ/(l h) follow, with Q = (m cᵀ + c mᵀ)/h² and R = ê mᵀ/(l h) per side,
//!
//! θ_aa = Q,  θ_a1 = −s Q + R,  θ_a0 = −(1 − s) Q − R,
//! θ_11 = Σ [m cᵀ/l² − s (R + Rᵀ) + s² Q],  θ_00 = Σ [m cᵀ/l² + (1 − s)(R + Rᵀ) + (1 − s)² Q],
//! θ_10 = Σ [−m cᵀ/l² + s R − (1 − s) Rᵀ + s (1 − s) Q].
//!
//! (m₁c₁ᵀ + m₂c₂ᵀ is symmetric: a quarter turn about ê of the difference of two projectors. Cf. Tamstorf and Grinspun 2013,
//! Discrete bending forces and their Jacobians.)

use crate::terms::stencil::{Block, transposed};
use crate::terms::{Real, Vec3};

/// ψ = 2 tan(θ/2), θ the angle between the normals of triangles (x₀, x₁, x₂) and (x₁, x₀, x₃), and ∂ψ/∂x₀ … ∂ψ/∂x₃ [1/m].
///
/// Computed as −2 l e·(a × b)/(|n₁||n₂| + n₁·n₂) with a = x₂ − x₀, b = x₃ − x₀, n₁ = e × a, n₂ = b × e: no inverse cosine, no
/// cancellation near flat. Positive where the sheet bends away from the side its normals point to; ±∞ where it folds back
/// onto itself (θ = π). Not finite where a triangle has no area.
#[inline]
pub fn fold<S: Real>(x: &[Vec3<S>; 4]) -> (S, [Vec3<S>; 4]) {
    let (e, a, b) = (x[1] - x[0], x[2] - x[0], x[3] - x[0]);
    let (n1, n2) = (e.cross(&a), b.cross(&e));
    let (square1, square2, square) = (n1.dot(&n1), n2.dot(&n2), e.dot(&e));
    let l = square.sqrt();
    let psi = l * e.dot(&a.cross(&b)) * -2.0 / ((square1 * square2).sqrt() + n1.dot(&n2));
    // dψ = (1 + ψ²/4) dθ
    let slope = l * (psi * psi * 0.25 + 1.0);
    let (u, w) = (n1 * (slope / square1), n2 * (slope / square2));
    let (s, t) = (a.dot(&e) / square, b.dot(&e) / square);
    let x1 = u * s + w * t;
    (psi, [u + w - x1, x1, -u, -w])
}

/// One triangle of a fold.
#[derive(Clone, Copy, Debug)]
struct Side {
    normal: Vec3<f64>,
    across: Vec3<f64>,
    height: f64,
    foot: f64,
}

/// A fold with what its second derivatives are made of.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fold {
    /// ψ [-].
    pub psi: f64,
    /// ∂ψ/∂x₀ … ∂ψ/∂x₃ [1/m].
    pub gradient: [Vec3<f64>; 4],
    axis: Vec3<f64>,
    length: f64,
    sides: [Side; 2],
}

impl Fold {
    #[inline]
    pub fn new(x: &[Vec3<f64>; 4]) -> Self {
        let (psi, gradient) = fold(x);
        let e = x[1] - x[0];
        let length = e.norm();
        let side = |node: &Vec3<f64>, sign: f64| {
            let a = node - x[0];
            let n = e.cross(&a) * sign;
            let twice = n.norm();
            let (height, foot) = (twice / length, a.dot(&e) / (length * length));
            Side { normal: n / twice, across: (a - e * foot) / height, height, foot }
        };
        Self { psi, gradient, axis: e / length, length, sides: [side(&x[2], 1.0), side(&x[3], -1.0)] }
    }

    /// dψ/dθ.
    #[inline]
    pub fn slope(&self) -> f64 {
        1.0 + 0.25 * self.psi * self.psi
    }

    /// What multiplies (∂ψ/∂x)(∂ψ/∂x)ᵀ in ∂²ψ/∂x²: d²ψ/dθ² over (dψ/dθ)².
    #[inline]
    pub fn curve(&self) -> f64 {
        0.5 * self.psi / self.slope()
    }

    /// ∂²θ/∂x_i∂x_j [1/m²], the blocks [`BLOCKS`] of it; those above the diagonal are their transposes, and the outer nodes have
    /// nothing to do with each other.
    #[inline]
    pub fn angle_hessian(&self) -> [Block; 9] {
        let mut out = [[[0.0; 3]; 3]; 9];
        let inverse = 1.0 / (self.length * self.length);
        for (k, side) in self.sides.iter().enumerate() {
            let Side { normal: m, across: c, height: h, foot: s } = side;
            let (u, own) = (1.0 - s, m * inverse);
            let (scaled, tilted) = (c / (h * h), m / (self.length * h));
            for a in 0..3 {
                for b in 0..3 {
                    let own = own[a] * c[b];
                    let q = m[a] * scaled[b] + scaled[a] * m[b];
                    let (r, turned) = (self.axis[a] * tilted[b], tilted[a] * self.axis[b]);
                    out[0][a][b] += own + u * (r + turned) + u * u * q;
                    out[1][a][b] += s * r - u * turned + s * u * q - own;
                    out[2][a][b] += own - s * (r + turned) + s * s * q;
                    out[3 + 3 * k][a][b] = -u * q - r;
                    out[4 + 3 * k][a][b] = r - s * q;
                    out[5 + 3 * k][a][b] = q;
                }
            }
        }
        out
    }

    /// (∂²ψ/∂x²) v.
    #[inline]
    pub fn curvature_along(&self, hessian: &[Block; 9], v: &[Vec3<f64>; 4]) -> [Vec3<f64>; 4] {
        let along: f64 = self.gradient.iter().zip(v).map(|(g, v)| g.dot(v)).sum::<f64>() * self.curve();
        let slope = self.slope();
        let mut out = self.gradient.map(|g| g * along);
        for (&(i, j), block) in BLOCKS.iter().zip(hessian) {
            out[i] += multiply(block, &v[j]) * slope;
            if i != j {
                out[j] += multiply(&transposed(block), &v[i]) * slope;
            }
        }
        out
    }
}

/// Places of the blocks of [`Fold::angle_hessian`].
pub(super) const BLOCKS: [(usize, usize); 9] = [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2), (3, 0), (3, 1), (3, 3)];

#[inline]
fn multiply(block: &Block, x: &Vec3<f64>) -> Vec3<f64> {
    Vec3::from_fn(|a, _| block[a][0] * x[0] + block[a][1] * x[1] + block[a][2] * x[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bent(theta: f64) -> [Vec3<f64>; 4] {
        // edge along y; the outer nodes at unequal heights and feet, the second one turned down by θ
        let (s, c) = theta.sin_cos();
        [Vec3::zeros(), Vec3::new(0.0, 0.5, 0.0), Vec3::new(-0.3, 0.1, 0.0), Vec3::new(0.2 * c, 0.7, -0.2 * s)]
    }

    #[test]
    fn is_twice_the_tangent_of_half_the_angle_down_to_the_last_digits() {
        for theta in [3.0, 1.0, 0.1, 1e-4, 1e-9, 1e-14, 0.0, -1e-9, -0.5] {
            let (psi, _) = fold(&bent(theta));
            let expected = 2.0 * (0.5 * theta).tan();
            assert!((psi - expected).abs() <= 4e-15 * expected.abs().max(1e-300), "{theta}: {psi} against {expected}");
        }
    }

    #[test]
    fn the_same_from_both_sides() {
        let x = bent(0.4);
        let (one, g) = fold(&x);
        let (two, k) = fold(&[x[1], x[0], x[3], x[2]]);
        assert!((one - two).abs() < 1e-15 && (g[3] - k[2]).norm() < 1e-13 && (g[0] - k[1]).norm() < 1e-13);
    }
}
