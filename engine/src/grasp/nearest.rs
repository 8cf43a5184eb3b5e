//! The point of an edge or a triangle nearest to a point.

use pliant_math::{Real, Vec3};

/// Part of an element that a nearest point lies in, by the element's own numbers of nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Region {
    /// A node.
    Vertex(usize),
    /// Between two nodes.
    Edge(usize, usize),
    /// Inside a triangle.
    Face,
}

impl Region {
    /// A number that tells it apart from the others.
    pub fn mode(self) -> u8 {
        match self {
            Self::Vertex(i) => i as u8,
            Self::Edge(i, j) => 2 + (i + j) as u8,
            Self::Face => 6,
        }
    }

    /// Weights of the nodes `x` at the point of this region (of its line or plane) nearest to `p`; any scalar.
    pub fn weights<S: Real>(self, p: &Vec3<S>, x: &[Vec3<S>; 3]) -> [S; 3] {
        let mut w = [S::zero(); 3];
        match self {
            Self::Vertex(i) => w[i] = S::one(),
            Self::Edge(i, j) => {
                let e = x[j] - x[i];
                w[j] = (p - x[i]).dot(&e) / e.dot(&e);
                w[i] = S::one() - w[j];
            }
            Self::Face => {
                let (a, b, r) = (x[1] - x[0], x[2] - x[0], p - x[0]);
                let (aa, ab, bb, ra, rb) = (a.dot(&a), a.dot(&b), b.dot(&b), r.dot(&a), r.dot(&b));
                let det = aa * bb - ab * ab;
                w[1] = (ra * bb - rb * ab) / det;
                w[2] = (rb * aa - ra * ab) / det;
                w[0] = S::one() - w[1] - w[2];
            }
        }
        w
    }
}

/// Region and squared distance of the point of an element of `corners` nodes nearest to `p`.
pub(super) fn nearest(p: &Vec3<f64>, x: &[Vec3<f64>; 3], corners: usize) -> (Region, f64) {
    let distance2 = |region: Region| {
        let w = region.weights(p, x);
        (p - (x[0] * w[0] + x[1] * w[1] + x[2] * w[2])).norm_squared()
    };
    if corners == 3 {
        let w = Region::Face.weights(p, x);
        // not so for the NaNs of a triangle without area
        if w.iter().all(|w| *w >= 0.0) {
            return (Region::Face, distance2(Region::Face));
        }
    }
    let sides: &[(usize, usize)] = if corners == 3 { &[(0, 1), (1, 2), (0, 2)] } else { &[(0, 1)] };
    let on_side = |&(i, j): &(usize, usize)| {
        let t = Region::Edge(i, j).weights(p, x)[j];
        // a side without length is its first node
        let region = if t >= 1.0 {
            Region::Vertex(j)
        } else if t > 0.0 {
            Region::Edge(i, j)
        } else {
            Region::Vertex(i)
        };
        (region, distance2(region))
    };
    let mut best = on_side(&sides[0]);
    for side in &sides[1..] {
        let other = on_side(side);
        if other.1 < best.1 {
            best = other;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against a fine search over the triangle.
    #[test]
    fn nearest_points_of_triangles_and_edges() {
        let x = [Vec3::new(0.1, 0.0, 0.0), Vec3::new(1.0, 0.2, 0.1), Vec3::new(0.3, 0.9, -0.2)];
        let points = (0..400).map(|k| {
            let s = |f: f64| (f * (k as f64 + 0.5)).sin();
            Vec3::new(0.5 + 1.5 * s(1.3), 0.4 + 1.5 * s(2.7), 0.7 * s(4.1))
        });
        let mut seen = [0; 7];
        for p in points {
            for corners in [2, 3] {
                let (region, d2) = nearest(&p, &x, corners);
                let w = region.weights(&p, &x);
                assert!(w.iter().all(|w| (-1e-12..=1.0 + 1e-12).contains(w)) && (w.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                let n = 60;
                let mut least = f64::INFINITY;
                for i in 0..=n {
                    for j in 0..=(if corners == 3 { n - i } else { 0 }) {
                        let [b, c] = [i, j].map(|k| f64::from(k) / f64::from(n));
                        least = least.min((p - (x[0] * (1.0 - b - c) + x[1] * b + x[2] * c)).norm_squared());
                    }
                }
                assert!(d2 <= least + 1e-12 && d2.sqrt() > least.sqrt() - 0.02, "{region:?}: {d2} {least}");
                seen[usize::from(region.mode())] += usize::from(corners == 3);
            }
        }
        assert!(seen.iter().all(|n| *n > 0), "every region occurs: {seen:?}");
    }
}
