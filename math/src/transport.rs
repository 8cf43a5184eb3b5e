//! Vectors carried along: the smallest rotation that takes one direction into another.

use crate::{Real, Vec3};

/// P(a → b) d: the unit vector `d`, normal to the unit vector `a`, after the smallest rotation that takes a into the unit vector `b`. Not
/// finite where b = −a, which no smallest rotation leads to.
#[inline]
pub fn carried<S: Real>(a: &Vec3<S>, b: &Vec3<S>, d: &Vec3<S>) -> Vec3<S> {
    // ½|a + b|², because 1 + a·b loses its digits where b is nearly −a
    let sum = a + b;
    let along = b.dot(d) * sum.dot(&sum).recip();
    d - sum * (along + along)
}

/// The angle \[rad\] in (−π, π] from `u` to `v`, both normal to the unit vector `axis`, counted about it.
#[inline]
pub fn angle<S: Real>(u: &Vec3<S>, v: &Vec3<S>, axis: &Vec3<S>) -> S {
    u.cross(v).dot(axis).atan2(u.dot(v))
}

/// The angle that differs from `principal` by whole turns and is nearest to `near`.
#[inline]
pub fn unwrapped(principal: f64, near: f64) -> f64 {
    let turns = (near - principal) / std::f64::consts::TAU;
    // nearly always none, which needs no rounding
    if turns.abs() < 0.5 { principal } else { principal + std::f64::consts::TAU * turns.round() }
}

/// A unit vector normal to the unit vector `axis`: `wish` without its part along the axis; `None` if nothing is left of it.
pub fn normal_part(wish: &Vec3<f64>, axis: &Vec3<f64>) -> Option<Vec3<f64>> {
    let d = wish - axis * axis.dot(wish);
    let size = d.norm();
    (size > 1e-9 * wish.norm()).then(|| d / size)
}

/// Any unit vector normal to the unit vector `axis`, the same for the same axis.
pub fn any_normal(axis: &Vec3<f64>) -> Vec3<f64> {
    // the coordinate axis that is farthest from it
    let mut least = 0;
    (1..3).for_each(|k| {
        if axis[k].abs() < axis[least].abs() {
            least = k
        }
    });
    let mut wish = Vec3::zeros();
    wish[least] = 1.0;
    normal_part(&wish, axis).unwrap_or(wish)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn carrying_across_a_fold_keeps_its_digits() {
        let (a, across) = (Vec3::new(1.0, 2.0, -0.5).normalize(), Vec3::new(2.0, -1.0, 0.3));
        let across = normal_part(&across, &a).unwrap();
        for open in [1e-2_f64, 1e-4, 1e-6] {
            // folded back but for the angle `open`: what lies along the fold's plane turns by π − open
            let (sin, cos) = open.sin_cos();
            let b = across * sin - a * cos;
            let moved = carried(&a, &b, &across);
            let expected = -across * cos - a * sin;
            assert!((moved - expected).norm() < 1e-15 / open, "{open}: {moved} {expected}");
        }
    }

    #[test]
    fn carrying_turns_about_the_common_normal_only() {
        let (a, b) = (Vec3::new(1.0, 2.0, -0.5).normalize(), Vec3::new(0.3, -1.0, 2.0).normalize());
        let d = any_normal(&a);
        let moved = carried(&a, &b, &d);
        assert_relative_eq!(moved.norm(), 1.0, epsilon = 1e-15);
        assert!(moved.dot(&b).abs() < 1e-15);
        // the part along the common normal stays
        let n = a.cross(&b).normalize();
        assert_relative_eq!(moved.dot(&n), d.dot(&n), epsilon = 1e-15);
        assert_relative_eq!(carried(&b, &a, &moved), d, epsilon = 1e-15);
    }

    #[test]
    fn angles_are_counted_about_the_axis_and_unwrapped() {
        let z = Vec3::z();
        assert_relative_eq!(angle(&Vec3::x(), &Vec3::new(0.6, 0.8, 0.0), &z), 0.8_f64.asin(), epsilon = 1e-15);
        assert_relative_eq!(angle(&Vec3::y(), &Vec3::x(), &z), -0.5 * std::f64::consts::PI, epsilon = 1e-15);
        assert_relative_eq!(unwrapped(-3.0, 3.1), -3.0 + std::f64::consts::TAU);
        assert_relative_eq!(unwrapped(0.5, 100.0), 0.5 + 16.0 * std::f64::consts::TAU);
        assert!(normal_part(&z, &z).is_none());
    }
}
