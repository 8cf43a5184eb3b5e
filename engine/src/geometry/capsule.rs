//! A sphere of the rope's radius against a capsule: a segment ab, thickened.

use super::Gap;
use nalgebra::Matrix3;
use pliant_math::{Real, Vec3};

/// gap = |x − c| − R − r, n = (x − c)/|x − c|, with c = a + s (b − a) the point of the segment nearest to x,
/// s = (x − a)·(b − a)/|b − a|² clamped to [0, 1].
///
/// C¹: gap and n are continuous where s is clamped, ∂n/∂x jumps there by the curvature along the axis. Negative inside; not finite
/// where x lies on the segment or a = b. `x`: node \[m\], `radius`: r of the rope \[m\], `params` = [a₀, a₁, a₂, b₀, b₁, b₂, R] \[m\].
pub fn gap<S: Real>(x: &Vec3<S>, radius: S, params: &[S]) -> (S, Vec3<S>) {
    let (a, b) = (Vec3::new(params[0], params[1], params[2]), Vec3::new(params[3], params[4], params[5]));
    let axis = b - a;
    let s = (x - a).dot(&axis) / axis.dot(&axis);
    let nearest = match s.re() {
        s if s <= 0.0 => a,
        s if s >= 1.0 => b,
        _ => a + axis * s,
    };
    let d = x - nearest;
    let distance = d.dot(&d).sqrt();
    (distance - params[6] - radius, d * distance.recip())
}

/// [`gap`] with H = ∂n/∂x = (I − n nᵀ − t tᵀ)/|x − c|, where t is the unit axis between the ends and zero beyond them; or the
/// distance |x − c| where it is too small for a normal.
#[inline]
pub(super) fn eval(x: &Vec3<f64>, radius: f64, p: [f64; 7]) -> Result<Gap, f64> {
    let (a, b) = (Vec3::new(p[0], p[1], p[2]), Vec3::new(p[3], p[4], p[5]));
    let axis = b - a;
    let square = axis.norm_squared();
    let s = (x - a).dot(&axis) / square;
    let d = x - (a + axis * s.clamp(0.0, 1.0));
    let distance = super::usable(d.norm())?;
    let normal = d / distance;
    let mut across = Matrix3::identity() - normal * normal.transpose();
    if s > 0.0 && s < 1.0 {
        across -= axis * axis.transpose() / square;
    }
    Ok(Gap { gap: distance - p[6] - radius, normal, hessian: across / distance })
}
