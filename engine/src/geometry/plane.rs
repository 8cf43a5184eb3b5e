//! A sphere of the rope's radius against a half space.

use super::Gap;
use nalgebra::Matrix3;
use pliant_math::{Real, Vec3};

/// gap = n·(x − p) − height − r, normal n: outward unit normal of the plane through p, shifted along it by the height.
///
/// `x`: node \[m\], `radius`: r of the rope \[m\], `params` = \[height\] \[m\]; `point` p \[m\] and `normal` n are constants.
pub fn gap<S: Real>(x: &Vec3<S>, radius: S, params: &[S], point: &Vec3<f64>, normal: &Vec3<f64>) -> (S, Vec3<S>) {
    let n = normal.map(S::from);
    let distance = n.dot(&(x - point.map(S::from)));
    (distance - params[0] - radius, n)
}

/// [`gap`] with the Hessian, which is zero.
#[inline]
pub(super) fn eval(x: &Vec3<f64>, radius: f64, height: f64, point: &Vec3<f64>, normal: &Vec3<f64>) -> Gap {
    Gap { gap: normal.dot(&(x - point)) - height - radius, normal: *normal, hessian: Matrix3::zeros() }
}
