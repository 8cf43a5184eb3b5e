//! A body's mass in numbers that cannot leave the physical range.

use crate::spatial::Inertia;
use crate::{Real, Vec3};
use nalgebra::{Matrix3, Vector3};

/// Where a body's ten numbers stand in θ: mass \[kg\], centre of mass (x, y, z) \[m\] in the body's frame, and the spread of its
/// mass (xx, yy, zz, xy, xz, yz) \[m\], the upper triangular U with positive diagonal and
/// ```text
/// ∫ (r − c)(r − c)ᵀ dm = m U Uᵀ.
/// ```
/// Every m > 0, c and U is the inertia of some body, and every body's is reached: positive principal moments that satisfy
/// the triangle inequality need not be asked for. (The log-Cholesky parameterization of C. Rucker and P. Wensing, 2022,
/// IEEE RA-L 7(2); its logarithms are in the bounds here.)
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BodyInertia {
    /// Index in θ of the mass; nine more follow.
    pub first: usize,
}

/// Numbers per body.
pub const NUMBERS: usize = 10;

/// Defect of an inertia.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum InertiaError {
    /// The mass is zero, negative or not finite.
    #[error("a mass of {0} kg: it must be positive")]
    Mass(f64),
    /// The matrix is not positive definite.
    #[error("the smallest principal moment of inertia is {0:.3e} kg·m²: all must be positive")]
    Negative(f64),
    /// One principal moment is as large as the two others together or larger: no distribution of mass does that.
    #[error(
        "principal moments of inertia {0:.4e}, {1:.4e} and {2:.4e} kg·m² break the triangle inequality: the largest must be no more \
         than the sum of the others"
    )]
    Triangle(f64, f64, f64),
}

impl BodyInertia {
    /// The inertia about the body's origin, in its axes.
    pub fn evaluate<S: Real>(&self, theta: &[S]) -> Inertia<S> {
        let x: [S; NUMBERS] = std::array::from_fn(|k| theta[self.first + k]);
        from_numbers(&x)
    }
}

/// The inertia about the body's origin from (m, c, U).
pub fn from_numbers<S: Real>(x: &[S; NUMBERS]) -> Inertia<S> {
    let [m, cx, cy, cz, xx, yy, zz, xy, xz, yz] = *x;
    // second moments about the origin per mass: U Uᵀ + c cᵀ
    let sxx = xx * xx + xy * xy + xz * xz + cx * cx;
    let syy = yy * yy + yz * yz + cy * cy;
    let szz = zz * zz + cz * cz;
    let sxy = xy * yy + xz * yz + cx * cy;
    let sxz = xz * zz + cx * cz;
    let syz = yz * zz + cy * cz;
    let j = [m * (syy + szz), m * (sxx + szz), m * (sxx + syy), -(m * sxy), -(m * sxz), -(m * syz)];
    Inertia { m, h: Vec3::new(m * cx, m * cy, m * cz), j }
}

/// ∂(m, h, J)/∂ of each number, for [`from_numbers`].
pub fn number_partials(x: &[f64; NUMBERS]) -> [Inertia<f64>; NUMBERS] {
    let [m, cx, cy, cz, xx, yy, zz, xy, xz, yz] = *x;
    let of_mass = from_numbers(&[1.0, cx, cy, cz, xx, yy, zz, xy, xz, yz]);
    // second moments about the origin (sxx, syy, szz, sxy, sxz, syz) per mass
    let second = |h: [f64; 3], s: [f64; 6]| {
        let [a, b, c, d, e, f] = s.map(|s| m * s);
        Inertia { m: 0.0, h: Vec3::from(h), j: [b + c, a + c, a + b, -d, -e, -f] }
    };
    let none = [0.0; 3];
    [
        of_mass,
        second([m, 0.0, 0.0], [2.0 * cx, 0.0, 0.0, cy, cz, 0.0]),
        second([0.0, m, 0.0], [0.0, 2.0 * cy, 0.0, cx, 0.0, cz]),
        second([0.0, 0.0, m], [0.0, 0.0, 2.0 * cz, 0.0, cx, cy]),
        second(none, [2.0 * xx, 0.0, 0.0, 0.0, 0.0, 0.0]),
        second(none, [0.0, 2.0 * yy, 0.0, xy, 0.0, 0.0]),
        second(none, [0.0, 0.0, 2.0 * zz, 0.0, xz, yz]),
        second(none, [2.0 * xy, 0.0, 0.0, yy, 0.0, 0.0]),
        second(none, [2.0 * xz, 0.0, 0.0, yz, zz, 0.0]),
        second(none, [0.0, 2.0 * yz, 0.0, xz, 0.0, zz]),
    ]
}

/// The ten numbers of a body of mass `m`, centre `c` and inertia matrix `about_centre` (its axes, about its centre of mass).
pub fn to_numbers(m: f64, c: Vec3<f64>, about_centre: &Matrix3<f64>) -> Result<[f64; NUMBERS], InertiaError> {
    if !(m > 0.0 && m.is_finite()) {
        return Err(InertiaError::Mass(m));
    }
    let mut moments = about_centre.symmetric_eigenvalues();
    moments.as_mut_slice().sort_by(f64::total_cmp);
    let [a, b, c_max] = [moments[0], moments[1], moments[2]];
    if a.is_nan() || a <= 0.0 {
        return Err(InertiaError::Negative(a));
    }
    let spread = Matrix3::from_diagonal_element(0.5 * about_centre.trace()) - about_centre;
    let thick = thickened(&(spread / m)).ok_or(InertiaError::Triangle(a, b, c_max))?;
    let u = upper_cholesky(&thick).ok_or(InertiaError::Triangle(a, b, c_max))?;
    Ok([m, c[0], c[1], c[2], u[(0, 0)], u[(1, 1)], u[(2, 2)], u[(0, 1)], u[(0, 2)], u[(1, 2)]])
}

/// Thickness that a flat body or a thin rod is given, relative to its size.
const THICKNESS: f64 = 1e-6;

/// Second moments with flat directions made that thick; none if one is negative beyond rounding.
fn thickened(spread: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let (floor, mut eigen) = (spread.trace() * THICKNESS * THICKNESS, spread.symmetric_eigen());
    if eigen.eigenvalues.min() >= floor {
        return Some(*spread);
    }
    let possible = eigen.eigenvalues.min() > -1e-6 * spread.trace();
    eigen.eigenvalues.iter_mut().for_each(|x| *x = x.max(floor));
    possible.then(|| eigen.recompose())
}

/// U with A = U Uᵀ; none unless A is positive definite.
fn upper_cholesky(a: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let flipped = Matrix3::from_fn(|i, j| a[(2 - i, 2 - j)]);
    let l = flipped.cholesky()?.l();
    let u = Matrix3::from_fn(|i, j| l[(2 - i, 2 - j)]);
    let smallest = Vector3::new(u[(0, 0)], u[(1, 1)], u[(2, 2)]).min();
    (smallest > 1e-9 * a.trace().sqrt()).then_some(u)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::spatial::full;
    use approx::assert_relative_eq;

    #[test]
    fn numbers_give_back_the_inertia() {
        let (m, c) = (2.5, Vec3::new(0.1, -0.2, 0.05));
        let about_centre = Matrix3::new(0.04, 0.003, -0.002, 0.003, 0.05, 0.001, -0.002, 0.001, 0.03);
        let inertia: Inertia<f64> = from_numbers(&to_numbers(m, c, &about_centre).unwrap());
        let shift = (Matrix3::from_diagonal_element(c.norm_squared()) - c * c.transpose()) * m;
        assert_relative_eq!(full(&inertia.j), about_centre + shift, epsilon = 1e-16);
        assert_relative_eq!(inertia.h, c * m, epsilon = 1e-16);
    }

    #[test]
    fn partials_are_those_of_dual_numbers() {
        use num_dual::Dual64;
        let x = [2.0, 0.1, -0.2, 0.3, 0.2, 0.15, 0.1, 0.02, -0.03, 0.01];
        for (k, change) in number_partials(&x).iter().enumerate() {
            let dual = from_numbers(&std::array::from_fn(|i| Dual64::new(x[i], if i == k { 1.0 } else { 0.0 })));
            assert_relative_eq!(change.m, dual.m.eps, epsilon = 1e-15);
            assert_relative_eq!(change.h, dual.h.map(|h| h.eps), epsilon = 1e-15);
            assert_relative_eq!(change.j[..], dual.j.map(|j| j.eps)[..], epsilon = 1e-15);
        }
    }

    #[test]
    fn impossible_inertias_are_refused() {
        let diagonal = |a, b, c| Matrix3::from_diagonal(&Vector3::new(a, b, c));
        let of = |m, j: Matrix3<f64>| to_numbers(m, Vec3::zeros(), &j).unwrap_err();
        assert!(matches!(of(0.0, diagonal(1.0, 1.0, 1.0)), InertiaError::Mass(_)));
        assert!(matches!(of(1.0, diagonal(1.0, -1.0, 1.0)), InertiaError::Negative(_)));
        assert!(matches!(of(1.0, diagonal(1.0, 1.0, 2.5)), InertiaError::Triangle(..)));
        // a flat disc is the limit of the possible range
        assert!(to_numbers(1.0, Vec3::zeros(), &diagonal(1.0, 1.0, 2.0)).is_ok());
    }
}
