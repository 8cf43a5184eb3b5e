//! Rotations as unit quaternions (w, x, y, z), their changes in *body* axes: R ⊕ t = R · rot(t).

use crate::{Real, Vec3};
use nalgebra::Matrix3;

/// A unit quaternion, w first.
pub type Quaternion<S> = [S; 4];

/// Angle of a rotation by a tangent of length s.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Map {
    /// By s: the exponential map. Implicit Euler.
    Exponential,
    /// By 2 atan(s/2): the Cayley map. The whole step of implicit midpoint, whose momentum it keeps.
    Cayley,
    /// By atan(s): half the turn that Cayley's map makes for 2 s. The middle of an implicit midpoint step.
    HalfCayley,
}

/// Below this s² the functions of s are taken from their series, whose next term is below rounding.
const SMALL: f64 = 1e-5;

impl Map {
    /// The quaternion of the turn for tangent `t`.
    pub fn turn<S: Real>(self, t: &Vec3<S>) -> Quaternion<S> {
        let s2 = t.dot(t);
        // (cos, sin/s) of half the angle
        let (c, k) = match self {
            Self::Exponential if s2.re() < SMALL => {
                let c = s2 * (s2 * (s2 * (-1.0 / 46080.0) + 1.0 / 384.0) - 0.125) + 1.0;
                (c, s2 * (s2 * (s2 * (-1.0 / 645_120.0) + 1.0 / 3840.0) - 1.0 / 48.0) + 0.5)
            }
            Self::Exponential => {
                let s = s2.sqrt();
                let half = s * 0.5;
                (half.cos(), half.sin() / s)
            }
            Self::Cayley => {
                let c = (s2 * 0.25 + 1.0).sqrt().recip();
                (c, c * 0.5)
            }
            // the angle whose tangent is s has cosine c; half of it has cos √((1 + c)/2), sin/s = c/(2 cos)
            Self::HalfCayley => {
                let c = (s2 + 1.0).sqrt().recip();
                let half = ((c + 1.0) * 0.5).sqrt();
                (half, c / (half * 2.0))
            }
        };
        [c, t[0] * k, t[1] * k, t[2] * k]
    }

    /// J of rot(t + δ) = rot(t) · rot(J δ), row by row: the change in the turned body's axes.
    #[inline]
    pub fn jacobian(self, t: &Vec3<f64>) -> Matrix3<f64> {
        let s2 = t.norm_squared();
        // (α' − sin α/s)/s², sin α/s, (1 − cos α)/s²
        let (along, k, turn) = match self {
            Self::Exponential if s2 < SMALL => {
                let k = 1.0 - s2 * (1.0 / 6.0 - s2 * (1.0 / 120.0 - s2 / 5040.0));
                (1.0 / 6.0 - s2 * (1.0 / 120.0 - s2 / 5040.0), k, 0.5 - s2 * (1.0 / 24.0 - s2 * (1.0 / 720.0 - s2 / 40320.0)))
            }
            Self::Exponential => {
                let s = s2.sqrt();
                ((1.0 - s.sin() / s) / s2, s.sin() / s, (1.0 - s.cos()) / s2)
            }
            // α' = sin α/s = 1/(1 + s²/4), 1 − cos α = (s²/2)/(1 + s²/4)
            Self::Cayley => {
                let k = 1.0 / (1.0 + 0.25 * s2);
                (0.0, k, 0.5 * k)
            }
            // α' = 1/(1 + s²) = c², sin α = s c, cos α = c, (1 − c)/s² = c²/(1 + c), (c² − c)/s² = −c³/(1 + c)
            Self::HalfCayley => {
                let c = 1.0 / (1.0 + s2).sqrt();
                (-c * c * c / (1.0 + c), c, c * c / (1.0 + c))
            }
        };
        Matrix3::from_diagonal_element(k) + t * t.transpose() * along - crate::spatial::hat(t) * turn
    }
}

/// The product a b.
#[inline]
pub fn product<S: Real>(a: &Quaternion<S>, b: &Quaternion<S>) -> Quaternion<S> {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

/// The inverse of a unit quaternion.
#[inline]
pub fn conjugate<S: Real>(a: &Quaternion<S>) -> Quaternion<S> {
    [a[0], -a[1], -a[2], -a[3]]
}

/// Scaled to length one, which keeps rounding from accumulating over many steps.
#[inline]
pub fn normalized(a: &Quaternion<f64>) -> Quaternion<f64> {
    let norm = a.iter().map(|x| x * x).sum::<f64>().sqrt();
    a.map(|x| x / norm)
}

/// The rotation matrix of a unit quaternion.
#[inline]
pub fn matrix<S: Real>(a: &Quaternion<S>) -> Matrix3<S> {
    let [w, x, y, z] = *a;
    let two = |p: S| p * 2.0;
    let one = S::one();
    Matrix3::new(
        one - two(y * y + z * z),
        two(x * y - w * z),
        two(x * z + w * y),
        two(x * y + w * z),
        one - two(x * x + z * z),
        two(y * z - w * x),
        two(x * z - w * y),
        two(y * z + w * x),
        one - two(x * x + y * y),
    )
}

/// The unit quaternion of a rotation matrix, w ≥ 0. (S. Shepperd, 1978: by the largest of its four squares, for precision.)
pub fn from_matrix(r: &Matrix3<f64>) -> Quaternion<f64> {
    let trace = r.trace();
    let squares = [trace, r[(0, 0)], r[(1, 1)], r[(2, 2)]];
    let largest = (1..4).fold(0, |best, k| if squares[k] > squares[best] { k } else { best });
    let side = |i: usize, j: usize| r[(i, j)] - r[(j, i)];
    let both = |i: usize, j: usize| r[(i, j)] + r[(j, i)];
    let q = match largest {
        0 => [1.0 + trace, side(2, 1), side(0, 2), side(1, 0)],
        1 => [side(2, 1), 1.0 + 2.0 * r[(0, 0)] - trace, both(0, 1), both(0, 2)],
        2 => [side(0, 2), both(0, 1), 1.0 + 2.0 * r[(1, 1)] - trace, both(1, 2)],
        _ => [side(1, 0), both(0, 2), both(1, 2), 1.0 + 2.0 * r[(2, 2)] - trace],
    };
    let q = normalized(&q);
    if q[0] < 0.0 { q.map(|x| -x) } else { q }
}

/// The rotation matrix of a rotation vector \[rad\].
#[inline]
pub fn of_vector<S: Real>(r: &Vec3<S>) -> Matrix3<S> {
    matrix(&Map::Exponential.turn(r))
}

/// Turning by `angle` \[rad\] about the unit axis `a`.
pub fn about<S: Real>(a: &Vec3<f64>, angle: S) -> Matrix3<S> {
    let (s, c) = angle.sin_cos();
    let lost = S::one() - c;
    let entry = |i: usize, j: usize| lost * (a[i] * a[j]);
    let side = |k: usize| s * a[k];
    Matrix3::new(
        entry(0, 0) + c,
        entry(0, 1) - side(2),
        entry(0, 2) + side(1),
        entry(1, 0) + side(2),
        entry(1, 1) + c,
        entry(1, 2) - side(0),
        entry(2, 0) - side(1),
        entry(2, 1) + side(0),
        entry(2, 2) + c,
    )
}

/// The rotation vector of a unit quaternion, at most π long \[rad\].
pub fn logarithm<S: Real>(a: &Quaternion<S>) -> Vec3<S> {
    let a = if a[0].re() < 0.0 { a.map(|x| -x) } else { *a };
    let v = Vec3::new(a[1], a[2], a[3]);
    let s2 = v.dot(&v);
    // 2 atan2(s, w)/s
    let factor = if s2.re() < SMALL {
        let x2 = s2 / (a[0] * a[0]);
        a[0].recip() * ((x2 * (x2 * (x2 * (-1.0 / 7.0) + 0.2) - 1.0 / 3.0) + 1.0) * 2.0)
    } else {
        let s = s2.sqrt();
        s.atan2(a[0]) * 2.0 / s
    };
    v * factor
}

/// J of log(R · rot(δ)) = log R + J δ, at the rotation vector `c`: the inverse of the exponential map's.
pub fn logarithm_jacobian(c: &Vec3<f64>) -> Matrix3<f64> {
    let s2 = c.norm_squared();
    let along = if s2 < 1e-4 {
        1.0 / 12.0 + s2 * (1.0 / 720.0 + s2 / 30240.0)
    } else {
        let s = s2.sqrt();
        (1.0 - 0.5 * s / (0.5 * s).tan()) / s2
    };
    let hat = crate::spatial::hat(c);
    Matrix3::identity() + hat * 0.5 + hat * hat * along
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn check_jacobian(map: Map, t: Vec3<f64>) {
        let j = map.jacobian(&t);
        for k in 0..3 {
            let e = 1e-6;
            let moved = |sign: f64| {
                let mut x = t;
                x[k] += sign * e;
                map.turn(&x)
            };
            let inverse = conjugate(&map.turn(&t));
            let local = |sign: f64| logarithm(&product(&inverse, &moved(sign)));
            let difference = (local(1.0) - local(-1.0)) / (2.0 * e);
            for a in 0..3 {
                assert!((difference[a] - j[(a, k)]).abs() < 1e-9, "{map:?} {t:?}: {difference:?} {j}");
            }
        }
    }

    #[test]
    fn turns_and_their_jacobians_agree() {
        for t in [Vec3::zeros(), Vec3::new(1e-4, -2e-4, 5e-5), Vec3::new(0.003, 0.0, 0.001), Vec3::new(0.4, -0.2, 1.1)] {
            for map in [Map::Exponential, Map::Cayley, Map::HalfCayley] {
                check_jacobian(map, t);
            }
        }
    }

    #[test]
    fn two_half_turns_make_the_whole() {
        let t = Vec3::new(0.3, -0.7, 0.2);
        let half: Quaternion<f64> = Map::HalfCayley.turn(&(t * 0.5));
        let whole = Map::Cayley.turn(&t);
        for (a, b) in product(&half, &half).iter().zip(whole) {
            assert_relative_eq!(*a, b, epsilon = 1e-15);
        }
    }

    #[test]
    fn logarithm_undoes_the_exponential_map() {
        for t in [Vec3::new(1e-9, 0.0, 0.0), Vec3::new(2e-3, 1e-3, 0.0), Vec3::new(1.0, -2.0, 0.5)] {
            let back: Vec3<f64> = logarithm(&Map::Exponential.turn(&t));
            assert_relative_eq!(back, t, epsilon = 1e-15, max_relative = 1e-14);
            assert_relative_eq!(logarithm_jacobian(&t) * Map::Exponential.jacobian(&t), Matrix3::identity(), epsilon = 1e-13);
        }
    }

    #[test]
    fn matrices_and_quaternions_agree() {
        let axis = Vec3::new(0.6, 0.0, 0.8);
        let q: Quaternion<f64> = Map::Exponential.turn(&(axis * 0.7));
        assert_relative_eq!(matrix(&q), about(&axis, 0.7), epsilon = 1e-15);
    }

    #[test]
    fn quaternions_come_back_from_their_matrices() {
        for t in [
            Vec3::zeros(),
            Vec3::new(3.1, 0.1, 0.0),
            Vec3::new(-0.2, 3.0, 0.3),
            Vec3::new(0.1, 0.0, 3.0),
            Vec3::new(0.4, -0.2, 1.1),
        ] {
            let q: Quaternion<f64> = Map::Exponential.turn(&t);
            from_matrix(&matrix(&q)).iter().zip(q).for_each(|(a, b)| assert_relative_eq!(*a, b, epsilon = 1e-15));
        }
    }
}
