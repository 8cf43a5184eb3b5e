//! Where a frame stands in another.

use crate::constants::IMPORT;
use nalgebra::Matrix3;
use pliant_math::Vec3;
use pliant_math::rotation::{Map, Quaternion, from_matrix, matrix, normalized, product};

/// A frame in another: its origin \[m\] and its axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Origin.
    pub position: Vec3<f64>,
    /// Axes, a unit quaternion.
    pub rotation: Quaternion<f64>,
}

impl Pose {
    /// The same frame.
    pub fn identity() -> Self {
        Self { position: Vec3::zeros(), rotation: [1.0, 0.0, 0.0, 0.0] }
    }

    /// Where a frame that stands at `inner` in this one stands in this one's parent.
    pub fn then(&self, inner: &Self) -> Self {
        Self { position: self.point(&inner.position), rotation: normalized(&product(&self.rotation, &inner.rotation)) }
    }

    /// A point of this frame in the parent's.
    pub fn point(&self, p: &Vec3<f64>) -> Vec3<f64> {
        self.position + self.direction(p)
    }

    /// A vector of this frame in the parent's axes.
    pub fn direction(&self, v: &Vec3<f64>) -> Vec3<f64> {
        self.matrix() * v
    }

    /// Axes as columns.
    pub fn matrix(&self) -> Matrix3<f64> {
        matrix(&self.rotation)
    }
}

/// −0 as 0.
pub fn plain<const N: usize>(x: [f64; N]) -> [f64; N] {
    x.map(|x| x + 0.0)
}

/// Turning by `angle` \[rad\] about `axis`, of any length but zero.
pub fn about(axis: &Vec3<f64>, angle: f64) -> Quaternion<f64> {
    Map::Exponential.turn(&(axis.normalize() * angle))
}

/// Three turns about the axes that `sequence` names: lower case about axes that turned along, upper case about fixed ones.
pub fn euler(angles: &[f64; 3], sequence: &str) -> Quaternion<f64> {
    sequence.chars().zip(angles).fold([1.0, 0.0, 0.0, 0.0], |q, (letter, angle)| {
        let axis = match letter.to_ascii_lowercase() {
            'x' => Vec3::x(),
            'y' => Vec3::y(),
            _ => Vec3::z(),
        };
        let turn = about(&axis, *angle);
        if letter.is_ascii_lowercase() { product(&q, &turn) } else { product(&turn, &q) }
    })
}

/// The frame with that x axis, and its y axis in the half-plane of `y`; none if they are parallel.
pub fn from_xy(x: &Vec3<f64>, y: &Vec3<f64>) -> Option<Quaternion<f64>> {
    let x = x.try_normalize(0.0)?;
    let y = (y - x * x.dot(y)).try_normalize(IMPORT.parallel * y.norm())?;
    Some(from_matrix(&Matrix3::from_columns(&[x, y, x.cross(&y)])))
}

/// The shortest turn that takes the z axis to `z`.
pub fn from_z(z: &Vec3<f64>) -> Quaternion<f64> {
    let z = z.normalize();
    let axis = Vec3::z().cross(&z);
    let sine = axis.norm();
    let axis = if sine < IMPORT.along_z { Vec3::x() } else { axis };
    about(&axis, sine.atan2(z[2]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn sequences_turn_about_moving_and_fixed_axes() {
        let angles = [0.3, -0.8, 1.1];
        let moving = matrix(&euler(&angles, "xyz"));
        let [x, y, z] = [about(&Vec3::x(), 0.3), about(&Vec3::y(), -0.8), about(&Vec3::z(), 1.1)].map(|q| matrix(&q));
        assert_relative_eq!(moving, x * y * z, epsilon = 1e-15);
        assert_relative_eq!(matrix(&euler(&angles, "XYZ")), z * y * x, epsilon = 1e-15);
    }

    #[test]
    fn axes_point_where_they_are_told() {
        for z in [Vec3::new(0.1, -2.0, 0.5), Vec3::new(0.0, 0.0, -3.0), Vec3::z()] {
            assert_relative_eq!(matrix(&from_z(&z)) * Vec3::z(), z.normalize(), epsilon = 1e-15);
        }
        let (x, y) = (Vec3::new(1.0, 1.0, 0.0), Vec3::new(0.0, 1.0, 1.0));
        let frame = from_xy(&x, &y).map(|q| matrix(&q)).unwrap_or_default();
        assert_relative_eq!(frame.column(0).into_owned(), x.normalize(), epsilon = 1e-15);
        assert!(frame.column(1).dot(&y) > 0.0 && frame.column(1).dot(&x).abs() < 1e-15);
        assert!(from_xy(&x, &(x * 2.0)).is_none());
    }
}
