//! A sphere of the rope's radius against a sphere.

use super::Gap;
use nalgebra::Matrix3;
use pliant_math::{Real, Vec3};

/// gap = |x − c| − R − r, normal n = (x − c)/|x − c|. Negative inside; not finite at x = c.
///
/// `x`: node \[m\], `radius`: r of the rope \[m\], `params` = [c₀, c₁, c₂, R] \[m\].
pub fn gap<S: Real>(x: &Vec3<S>, radius: S, params: &[S]) -> (S, Vec3<S>) {
    let d = x - Vec3::new(params[0], params[1], params[2]);
    let distance = d.dot(&d).sqrt();
    (distance - params[3] - radius, d * distance.recip())
}

/// [`gap`] with H = ∂n/∂x = (I − n nᵀ)/|x − c|, or the distance |x − c| where it is too small for a normal.
#[inline]
pub(super) fn eval(x: &Vec3<f64>, radius: f64, [c0, c1, c2, big]: [f64; 4]) -> Result<Gap, f64> {
    let d = x - Vec3::new(c0, c1, c2);
    let distance = super::usable(d.norm())?;
    let normal = d / distance;
    let hessian = (Matrix3::identity() - normal * normal.transpose()) / distance;
    Ok(Gap { gap: distance - big - radius, normal, hessian })
}
