//! Convex hulls of points.

use crate::geometry::constants::GEOMETRY;
use nalgebra::Matrix3;
use parry3d_f64::math::Vector;
use parry3d_f64::transformation::try_convex_hull;
use pliant_math::Vec3;
use std::collections::HashMap;

/// A convex hull as triangles.
#[derive(Clone, Debug, PartialEq)]
pub struct Hull {
    /// Its corners, points of those given.
    pub corners: Vec<Vec3<f64>>,
    /// Its triangles by corners, counterclockwise from outside.
    pub triangles: Vec<[usize; 3]>,
}

/// The convex hull of points; none if they lie in a plane, or are fewer than four.
///
/// Hulls do not change under linear maps. Points are brought to the same extent along all principal axes first, as parry takes those of
/// an extent of 3e-4 for flat.
pub fn convex_hull(points: &[Vec3<f64>]) -> Option<Hull> {
    let n = points.len() as f64;
    let mean = points.iter().sum::<Vec3<f64>>() / n;
    let covariance = points.iter().fold(Matrix3::zeros(), |sum, p| sum + (p - mean) * (p - mean).transpose()) / n;
    if points.len() < 4 || !covariance.iter().all(|x| x.is_finite()) {
        return None;
    }
    let mut eigen = covariance.symmetric_eigen();
    if eigen.eigenvectors.determinant() < 0.0 {
        eigen.eigenvectors.neg_mut(); // a mirror would turn the triangles inside out
    }
    let deviation = eigen.eigenvalues.map(|x| x.max(0.0).sqrt());
    if deviation.min() <= GEOMETRY.flat * deviation.max() {
        return None;
    }
    let whitened = |p: &Vec3<f64>| {
        let y = eigen.eigenvectors.tr_mul(&(p - mean)).component_div(&deviation);
        Vector::new(y[0], y[1], y[2])
    };
    let key = |y: &Vector| [y.x, y.y, y.z].map(f64::to_bits);
    let mut origins: HashMap<[u64; 3], usize> = HashMap::new();
    let mut distinct = Vec::new();
    for (k, point) in points.iter().enumerate() {
        let y = whitened(point);
        origins.entry(key(&y)).or_insert_with(|| {
            distinct.push(y);
            k
        });
    }
    let (corners, triangles) = try_convex_hull(&distinct).ok()?;
    let corners = corners.iter().map(|y| origins.get(&key(y)).map(|k| points[*k])).collect::<Option<_>>()?;
    Some(Hull { corners, triangles: triangles.into_iter().map(|t| t.map(|k| k as usize)).collect() })
}

impl Hull {
    /// A hull of at most `most` of its corners, and the largest distance that the others have from it, outside \[m\].
    ///
    /// It grows from the four corners that are farthest apart: the corner farthest outside comes next.
    pub fn reduced(&self, most: usize) -> (Self, f64) {
        let mut chosen = self.spread_out();
        loop {
            let points: Vec<_> = chosen.iter().map(|k| self.corners[*k]).collect();
            let Some(hull) = convex_hull(&points) else { return (self.clone(), 0.0) };
            let outside = |p: &Vec3<f64>| hull.planes().map(|(n, at)| n.dot(p) - at).fold(f64::NEG_INFINITY, f64::max);
            let far = self.corners.iter().map(outside).enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
            let (next, distance) = far.map_or((0, 0.0), |(k, distance)| (k, distance.max(0.0)));
            if chosen.len() >= most.max(4) || chosen.contains(&next) || distance <= 0.0 {
                return (hull, distance);
            }
            chosen.push(next);
        }
    }

    /// Four corners: two far apart, one far from their line, and one far from the plane of these three.
    fn spread_out(&self) -> Vec<usize> {
        let farthest = |distance: &dyn Fn(&Vec3<f64>) -> f64| {
            let far = self.corners.iter().map(distance).enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
            far.map_or(0, |(k, _)| k)
        };
        let x = |k: usize| self.corners[k];
        let a = farthest(&|p| (p - x(0)).norm());
        let b = farthest(&|p| (p - x(a)).norm());
        let c = farthest(&|p| (p - x(a)).cross(&(x(b) - x(a))).norm());
        let normal = (x(b) - x(a)).cross(&(x(c) - x(a)));
        vec![a, b, c, farthest(&|p| (p - x(a)).dot(&normal).abs())]
    }

    /// Outward unit normals of the triangles and their distances from the origin \[m\]; none of triangles without area.
    fn planes(&self) -> impl Iterator<Item = (Vec3<f64>, f64)> + '_ {
        self.triangles.iter().filter_map(|t| {
            let [a, b, c] = t.map(|k| self.corners[k]);
            let normal = (b - a).cross(&(c - a)).try_normalize(0.0)?;
            Some((normal, normal.dot(&a)))
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Points on a ball, evenly.
    fn ball(n: usize) -> Vec<Vec3<f64>> {
        let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
        let at = |k: usize| {
            let z = 1.0 - (2.0 * k as f64 + 1.0) / n as f64;
            let (r, angle) = ((1.0 - z * z).sqrt(), golden * k as f64);
            Vec3::new(r * angle.cos(), r * angle.sin(), z)
        };
        (0..n).map(at).collect()
    }

    #[test]
    fn plates_are_no_flatter_than_they_are() {
        let turn = nalgebra::Rotation3::new(Vec3::new(0.4, -0.7, 0.2));
        for thickness in [1e-1, 1e-3, 1e-5] {
            let corner = |k: usize| {
                let bit = |b: usize| f64::from(u8::from(k >> b & 1 == 1));
                turn * Vec3::new(bit(0), bit(1), thickness * bit(2))
            };
            let hull = convex_hull(&(0..8).map(corner).chain([turn * Vec3::new(0.5, 0.5, 0.5 * thickness)]).collect::<Vec<_>>());
            let hull = hull.unwrap();
            assert_eq!((hull.corners.len(), hull.triangles.len()), (8, 12), "{thickness}");
        }
        let flat: Vec<_> = ball(30).iter().map(|p| turn * Vec3::new(p[0], p[1], 0.0)).collect();
        assert_eq!(convex_hull(&flat), None);
        assert_eq!(convex_hull(&ball(3)), None);
    }

    #[test]
    fn a_ball_is_reduced_from_within() {
        let whole = convex_hull(&ball(500)).unwrap();
        assert_eq!(whole.corners.len(), 500);
        assert!(whole.planes().all(|(normal, at)| at > 0.99 && whole.corners.iter().all(|c| normal.dot(c) < at + 1e-12)));
        let mut before = f64::INFINITY;
        for most in [8, 16, 32, 64] {
            let (hull, outside) = whole.reduced(most);
            assert_eq!(hull.corners.len(), most);
            assert!(outside < before && outside > 0.0, "{outside} with {most}");
            before = outside;
        }
        assert!(before < 0.1, "{before}");
        let box_of = |p: &Vec3<f64>| p.map(|x| 0.5 * x.signum());
        let cube = convex_hull(&ball(100).iter().map(box_of).collect::<Vec<_>>()).unwrap();
        assert_eq!(cube.reduced(64), (cube.reduced(8).0, 0.0));
    }
}
