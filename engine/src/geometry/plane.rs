//! A sphere of the rope's radius against a half space.

use super::Gap;
use nalgebra::Matrix3;
use pliant_math::rotation::of_vector;
use pliant_math::{Real, Vec3};

/// gap = n·(x − p) − height − r, normal n = rot(a) n₀: outward unit normal of the plane through p, turned about p by the rotation vector a,
/// and shifted along n by the height.
///
/// `x`: node \[m\], `radius`: r of the rope \[m\], `params` = height \[m\] and the three components of a \[rad\], in the world's axes; `point` p
/// \[m\] and `normal` n₀ are constants.
pub fn gap<S: Real>(x: &Vec3<S>, radius: S, params: &[S], point: &Vec3<f64>, normal: &Vec3<f64>) -> (S, Vec3<S>) {
    let n = of_vector(&Vec3::new(params[1], params[2], params[3])) * normal.map(S::from);
    let distance = n.dot(&(x - point.map(S::from)));
    (distance - params[0] - radius, n)
}

/// [`gap`] with the Hessian, which is zero.
#[inline]
pub(super) fn eval(x: &Vec3<f64>, radius: f64, params: [f64; 4], point: &Vec3<f64>, normal: &Vec3<f64>) -> Gap {
    let (gap, normal) = gap(x, radius, &params, point, normal);
    Gap { gap, normal, hessian: Matrix3::zeros() }
}
