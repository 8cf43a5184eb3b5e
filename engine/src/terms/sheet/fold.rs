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
use pliant_math::Vec3;
use pliant_math::dihedral::fold;

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

    /// Factor of (∂ψ/∂x)(∂ψ/∂x)ᵀ in ∂²ψ/∂x²: d²ψ/dθ² over (dψ/dθ)².
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
