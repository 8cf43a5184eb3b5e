//! Masses of shapes and of bodies made of them.

use super::pose::Pose;
use crate::constants::IMPORT;
use nalgebra::{Matrix3, Vector3};
use pliant_math::Vec3;
use pliant_math::inertia::{InertiaError, to_numbers};
use std::f64::consts::PI;

/// A mass in a body's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mass {
    /// Mass \[kg\].
    pub mass: f64,
    /// Centre of mass \[m\].
    pub center: Vec3<f64>,
    /// Inertia about the centre of mass in the frame's axes [kg·m²].
    pub inertia: Matrix3<f64>,
}

/// A shape, centred at its own frame's origin; sizes in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A ball.
    Sphere {
        /// Its radius.
        radius: f64,
    },
    /// A cylinder along z with half balls at its ends.
    Capsule {
        /// Its radius.
        radius: f64,
        /// Half the cylinder's length.
        half: f64,
    },
    /// A cylinder along z.
    Cylinder {
        /// Its radius.
        radius: f64,
        /// Half its length.
        half: f64,
    },
    /// A box.
    Box {
        /// Half its sides.
        half: [f64; 3],
    },
    /// An ellipsoid.
    Ellipsoid {
        /// Its half axes.
        half: [f64; 3],
    },
}

impl Shape {
    /// Volume [m³].
    pub fn volume(&self) -> f64 {
        match *self {
            Self::Sphere { radius } => 4.0 / 3.0 * PI * radius.powi(3),
            Self::Capsule { radius, half } => PI * radius * radius * (2.0 * half + 4.0 / 3.0 * radius),
            Self::Cylinder { radius, half } => 2.0 * PI * radius * radius * half,
            Self::Box { half: [a, b, c] } => 8.0 * a * b * c,
            Self::Ellipsoid { half: [a, b, c] } => 4.0 / 3.0 * PI * a * b * c,
        }
    }

    /// Moments of inertia per mass about its own axes [m²], of uniform density.
    pub fn moments(&self) -> [f64; 3] {
        let from_squares = |s: [f64; 3], by: f64| [by * (s[1] + s[2]), by * (s[0] + s[2]), by * (s[0] + s[1])];
        match *self {
            Self::Sphere { radius } => [0.4 * radius * radius; 3],
            Self::Cylinder { radius, half } => {
                let across = radius * radius / 4.0 + half * half / 3.0;
                [across, across, radius * radius / 2.0]
            }
            Self::Capsule { radius, half } => {
                // the cylinder's share of the volume, and the half balls', whose centres lie 3/8 of the radius beyond its ends
                let r2 = radius * radius;
                let balls = 4.0 / 3.0 * radius / (2.0 * half + 4.0 / 3.0 * radius);
                let cylinder = 1.0 - balls;
                let across = cylinder * (r2 / 4.0 + half * half / 3.0) + balls * (0.4 * r2 + half * half + 0.75 * radius * half);
                [across, across, cylinder * r2 / 2.0 + balls * 0.4 * r2]
            }
            Self::Box { half } => from_squares(half.map(|x| x * x), 1.0 / 3.0),
            Self::Ellipsoid { half } => from_squares(half.map(|x| x * x), 0.2),
        }
    }
}

impl Mass {
    /// No mass.
    pub fn none() -> Self {
        Self { mass: 0.0, center: Vec3::zeros(), inertia: Matrix3::zeros() }
    }

    /// Principal moments [kg·m²] about the axes of `pose`, whose origin is the centre of mass.
    pub fn principal(mass: f64, moments: [f64; 3], pose: &Pose) -> Self {
        Self::with_inertia(mass, &Matrix3::from_diagonal(&Vector3::from(moments)), pose)
    }

    /// An inertia matrix [kg·m²] in the axes of `pose`, whose origin is the centre of mass.
    pub fn with_inertia(mass: f64, inertia: &Matrix3<f64>, pose: &Pose) -> Self {
        let r = pose.matrix();
        Self { mass, center: pose.position, inertia: r * inertia * r.transpose() }
    }

    /// A shape of that mass at `pose`.
    pub fn of_shape(shape: &Shape, mass: f64, pose: &Pose) -> Self {
        Self::principal(mass, shape.moments().map(|x| x * mass), pose)
    }

    /// All of them as one.
    pub fn sum(parts: &[Self]) -> Self {
        let mass: f64 = parts.iter().map(|p| p.mass).sum();
        if mass <= 0.0 {
            return Self::none();
        }
        let center = parts.iter().fold(Vec3::zeros(), |sum, p| sum + p.center * p.mass) / mass;
        let inertia = parts.iter().fold(Matrix3::zeros(), |sum, p| {
            let d = p.center - center;
            sum + p.inertia + (Matrix3::from_diagonal_element(d.norm_squared()) - d * d.transpose()) * p.mass
        });
        Self { mass, center, inertia }
    }

    /// xx, yy, zz, xy, xz, yz.
    pub fn numbers(&self) -> [f64; 6] {
        let j = &self.inertia;
        [j[(0, 0)], j[(1, 1)], j[(2, 2)], j[(0, 1)], j[(0, 2)], j[(1, 2)]]
    }

    /// Whether a distribution of mass can have it.
    pub fn check(&self) -> Result<(), InertiaError> {
        to_numbers(self.mass, self.center, &self.inertia).map(drop)
    }

    /// With other principal moments about the same axes.
    pub fn with_moments(&self, change: impl Fn([f64; 3]) -> [f64; 3]) -> Self {
        let eigen = self.inertia.symmetric_eigen();
        let moments = change([eigen.eigenvalues[0], eigen.eigenvalues[1], eigen.eigenvalues[2]]);
        let r = eigen.eigenvectors;
        Self { inertia: r * Matrix3::from_diagonal(&Vector3::from(moments)) * r.transpose(), ..*self }
    }

    /// Whether the largest principal moment exceeds the sum of the others, beyond rounding.
    pub fn is_unbalanced(&self) -> bool {
        let mut moments = self.inertia.symmetric_eigenvalues();
        moments.as_mut_slice().sort_by(f64::total_cmp);
        moments[0] + moments[1] < moments[2] * (1.0 - IMPORT.moments_rounding)
    }

    /// The nearest inertia that a distribution of mass has, a millionth of its size within the possible range.
    pub fn made_possible(&self) -> Self {
        self.with_moments(|m| {
            // second moments of mass along the axes, which must be positive
            let half = 0.5 * (m[0] + m[1] + m[2]);
            let floor = IMPORT.least_moment.0 * half.max(IMPORT.least_moment.1);
            let s = m.map(|x| (half - x).max(floor));
            [s[1] + s[2], s[0] + s[2], s[0] + s[1]]
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use approx::assert_relative_eq;

    /// ∫ x² dm and ∫ z² dm per mass, by slices along z.
    fn by_slices(radius_at: impl Fn(f64) -> f64, half: f64) -> (f64, f64, f64) {
        let n = 200_000;
        let (mut volume, mut xx, mut zz) = (0.0, 0.0, 0.0);
        for k in 0..n {
            let z = half * (2.0 * (k as f64 + 0.5) / f64::from(n) - 1.0);
            let r2 = radius_at(z).powi(2);
            let slice = PI * r2 * 2.0 * half / f64::from(n);
            volume += slice;
            xx += slice * r2 / 4.0;
            zz += slice * z * z;
        }
        (volume, xx / volume, zz / volume)
    }

    #[test]
    fn round_shapes_have_the_moments_of_their_slices() {
        let (r, h) = (0.2, 0.35);
        let capsule = |z: f64| if z.abs() < h { r } else { (r * r - (z.abs() - h).powi(2)).max(0.0).sqrt() };
        let cases: [(Shape, (f64, f64, f64)); 3] = [
            (Shape::Capsule { radius: r, half: h }, by_slices(capsule, h + r)),
            (Shape::Cylinder { radius: r, half: h }, by_slices(|_| r, h)),
            (Shape::Ellipsoid { half: [r, r, h] }, by_slices(|z| r * (1.0 - (z / h).powi(2)).sqrt(), h)),
        ];
        for (shape, (volume, xx, zz)) in cases {
            assert_relative_eq!(shape.volume(), volume, max_relative = 1e-8);
            let [a, b, c] = shape.moments();
            assert_relative_eq!(a, xx + zz, max_relative = 1e-8);
            assert_relative_eq!(b, a);
            assert_relative_eq!(c, 2.0 * xx, max_relative = 1e-8);
        }
    }

    #[test]
    fn two_halves_make_a_box() {
        let half = Shape::Box { half: [0.1, 0.2, 0.15] };
        let at = |x: f64| Pose { position: Vec3::new(x, 0.0, 0.0), ..Pose::identity() };
        let sum = Mass::sum(&[Mass::of_shape(&half, 1.5, &at(-0.1)), Mass::of_shape(&half, 1.5, &at(0.1))]);
        let whole = Mass::of_shape(&Shape::Box { half: [0.2, 0.2, 0.15] }, 3.0, &Pose::identity());
        assert_relative_eq!(sum.inertia, whole.inertia, epsilon = 1e-15);
        assert!(sum.center.norm() < 1e-16);
    }

    #[test]
    fn impossible_inertias_are_made_possible() {
        let mass = Mass::principal(2.0, [0.1, 0.1, 0.3], &Pose::identity());
        assert!(mass.check().is_err() && mass.is_unbalanced());
        mass.made_possible().check().unwrap();
        // a flat disc is the limit of the possible range
        let disc = Mass::principal(2.0, [0.1, 0.1, 0.2], &Pose::identity());
        assert!(disc.check().is_ok() && !disc.is_unbalanced());
    }
}
