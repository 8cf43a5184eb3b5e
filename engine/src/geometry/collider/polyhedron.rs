//! Corners, edges and faces of a convex polyhedron in its own frame.

use crate::geometry::constants::GEOMETRY;
use crate::geometry::hull::{Hull, convex_hull};
use pliant_math::Vec3;
use std::collections::BTreeMap;

/// A face: a convex polygon.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Face {
    /// Outward unit normal.
    pub normal: Vec3<f64>,
    /// A point of it \[m\].
    pub point: Vec3<f64>,
    /// Of each of its edges the outward unit normal within the face, and the distance from the origin along it \[m\].
    pub sides: Vec<(Vec3<f64>, f64)>,
}

/// An edge between two faces.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Edge {
    /// Its middle \[m\].
    pub middle: Vec3<f64>,
    /// Unit vector along it.
    pub direction: Vec3<f64>,
    /// Half its length \[m\].
    pub half_length: f64,
    /// Of each face the outward unit normal within the face. A vector across the edge lies between the normals of the faces if its
    /// products with both are positive.
    pub conormals: [Vec3<f64>; 2],
}

/// A convex polyhedron.
#[derive(Clone, Debug, PartialEq)]
pub struct Polyhedron {
    pub(crate) corners: Vec<Vec3<f64>>,
    pub(crate) edges: Vec<Edge>,
    pub(crate) faces: Vec<Face>,
    /// Largest distance of a corner from the origin \[m\].
    pub(crate) reach: f64,
    /// Half its least width \[m\].
    pub(crate) half_width: f64,
    triangles: Vec<[usize; 3]>,
}

impl Polyhedron {
    /// The convex hull of points; none if they lie in a plane, or are fewer than four. Triangles in one plane are one face.
    pub fn new(points: &[Vec3<f64>]) -> Option<Self> {
        let hull = convex_hull(points)?;
        let group = flat_groups(&hull)?;
        let faces = group.iter().max()? + 1;
        let mut out = Self {
            corners: Vec::new(),
            edges: Vec::new(),
            faces: (0..faces).map(|f| face(&hull, &group, f)).collect::<Option<_>>()?,
            reach: hull.corners.iter().map(|c| c.norm()).fold(0.0, f64::max),
            half_width: f64::INFINITY,
            triangles: hull.triangles.clone(),
        };
        let mut used = vec![false; hull.corners.len()];
        for ((f, g), ends) in boundaries(&hull, &group) {
            // a side may be cut by points on it
            let along = hull.corners[*ends.get(1)?] - hull.corners[ends[0]];
            let order = |a: &&usize, b: &&usize| hull.corners[**a].dot(&along).total_cmp(&hull.corners[**b].dot(&along));
            let (&a, &b) = (ends.iter().min_by(order)?, ends.iter().max_by(order)?);
            (used[a], used[b]) = (true, true);
            out.push_edge([f, g], [hull.corners[a], hull.corners[b]])?;
        }
        out.corners = hull.corners.iter().zip(used).filter(|(_, used)| *used).map(|(c, _)| *c).collect();
        let width = |f: &Face| f.normal.dot(&f.point) - out.corners.iter().map(|c| f.normal.dot(c)).fold(f64::INFINITY, f64::min);
        out.half_width = out.faces.iter().map(|f| 0.5 * width(f)).fold(f64::INFINITY, f64::min);
        out.triangles = convex_hull(&out.corners).filter(|h| h.corners == out.corners).map_or(out.triangles, |h| h.triangles);
        (out.half_width > 0.0 && out.corners.len() >= 4).then_some(out)
    }

    fn push_edge(&mut self, faces: [usize; 2], [a, b]: [Vec3<f64>; 2]) -> Option<()> {
        let (middle, direction) = ((a + b) * 0.5, (b - a).try_normalize(0.0)?);
        let conormals = [0, 1].map(|k| {
            let [own, other] = [faces[k], faces[1 - k]].map(|f| self.faces[f].normal);
            let across = own.cross(&direction);
            if across.dot(&other) < 0.0 { -across } else { across }
        });
        for (face, across) in faces.into_iter().zip(conormals) {
            self.faces[face].sides.push((across, across.dot(&middle)));
        }
        self.edges.push(Edge { middle, direction, half_length: 0.5 * (b - a).norm(), conormals });
        Some(())
    }

    /// Corners \[m\] and triangles, counterclockwise from outside.
    pub fn surface(&self) -> (&[Vec3<f64>], &[[usize; 3]]) {
        (&self.corners, &self.triangles)
    }

    /// Signed distance of a point from the plane of a face \[m\].
    pub(crate) fn height(&self, face: usize, y: &Vec3<f64>) -> f64 {
        let face = &self.faces[face];
        face.normal.dot(&(y - face.point))
    }

    /// Whether a point lies over a face, or beside it by no more than `sliver` \[m\].
    pub(crate) fn is_over(&self, face: usize, y: &Vec3<f64>, sliver: f64) -> bool {
        self.faces[face].sides.iter().all(|(across, at)| across.dot(y) - at <= sliver)
    }

    /// The face whose plane is highest under a point, and the signed distance from it \[m\]: of a point inside the nearest.
    pub(crate) fn highest(&self, y: &Vec3<f64>) -> (usize, f64) {
        let heights = (0..self.faces.len()).map(|f| (f, self.height(f, y)));
        heights.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, f64::NEG_INFINITY))
    }

    /// How far it reaches along a unit vector from the origin \[m\].
    pub(crate) fn support(&self, n: &Vec3<f64>) -> f64 {
        self.corners.iter().map(|c| c.dot(n)).fold(f64::NEG_INFINITY, f64::max)
    }
}

/// Of every triangle the flat group that it belongs to. Groups grow from their largest triangle.
fn flat_groups(hull: &Hull) -> Option<Vec<usize>> {
    let area = |t: &[usize; 3]| {
        let [a, b, c] = t.map(|k| hull.corners[k]);
        (b - a).cross(&(c - a))
    };
    let size = hull.corners.iter().map(|c| (c - hull.corners[0]).norm()).fold(0.0, f64::max);
    let mut by_size: Vec<usize> = (0..hull.triangles.len()).collect();
    by_size.sort_by(|a, b| area(&hull.triangles[*b]).norm().total_cmp(&area(&hull.triangles[*a]).norm()));
    let across: BTreeMap<[usize; 2], usize> =
        hull.triangles.iter().enumerate().flat_map(|(t, v)| sides(v).map(|s| (s, t))).collect();
    let mut group = vec![usize::MAX; hull.triangles.len()];
    let mut next = 0;
    for seed in by_size {
        if group[seed] != usize::MAX {
            continue;
        }
        let (normal, at) = (area(&hull.triangles[seed]).try_normalize(0.0)?, hull.corners[hull.triangles[seed][0]]);
        let flat =
            |t: usize| hull.triangles[t].iter().all(|k| (hull.corners[*k] - at).dot(&normal).abs() <= GEOMETRY.in_plane * size);
        let mut open = vec![seed];
        while let Some(t) = open.pop() {
            group[t] = next;
            let neighbours = sides(&hull.triangles[t]).map(|[i, j]| across.get(&[j, i]).copied());
            open.extend(neighbours.into_iter().flatten().filter(|n| group[*n] == usize::MAX && flat(*n)));
        }
        next += 1;
    }
    Some(group)
}

fn sides([a, b, c]: &[usize; 3]) -> [[usize; 2]; 3] {
    [[*a, *b], [*b, *c], [*c, *a]]
}

/// The plane of a group of triangles, moved outward to its farthest corner.
fn face(hull: &Hull, group: &[usize], f: usize) -> Option<Face> {
    let own = || hull.triangles.iter().zip(group).filter(move |(_, g)| **g == f).map(|(t, _)| t.map(|k| hull.corners[k]));
    let normal = own().fold(Vec3::zeros(), |sum, [a, b, c]| sum + (b - a).cross(&(c - a))).try_normalize(0.0)?;
    let point = own().flatten().max_by(|a, b| a.dot(&normal).total_cmp(&b.dot(&normal)))?;
    Some(Face { normal, point, sides: Vec::new() })
}

/// Corners on the common side of two groups.
fn boundaries(hull: &Hull, group: &[usize]) -> BTreeMap<(usize, usize), Vec<usize>> {
    let across: BTreeMap<[usize; 2], usize> =
        hull.triangles.iter().enumerate().flat_map(|(t, v)| sides(v).map(|s| (s, t))).collect();
    let mut out: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    for (&[i, j], &t) in &across {
        let Some(&other) = across.get(&[j, i]) else { continue };
        let (f, g) = (group[t], group[other]);
        if f < g {
            out.entry((f, g)).or_default().extend([i, j]);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn triangles_in_a_plane_are_one_face() {
        let turn = nalgebra::Rotation3::new(Vec3::new(0.4, -0.7, 0.2));
        let mut points = Vec::new();
        // with points within faces, on edges and inside
        for x in [-0.1, 0.03, 0.1] {
            for y in [-0.2, 0.0, 0.2] {
                points.extend([-0.3, 0.1, 0.3].map(|z| turn * Vec3::new(x, y, z)));
            }
        }
        let cuboid = Polyhedron::new(&points).unwrap();
        assert_eq!((cuboid.corners.len(), cuboid.edges.len(), cuboid.faces.len()), (8, 12, 6));
        assert!((cuboid.half_width - 0.1).abs() < 1e-15 && (cuboid.reach - 0.14_f64.sqrt()).abs() < 1e-15);
        for edge in &cuboid.edges {
            assert!(edge.conormals[0].dot(&edge.conormals[1]).abs() < 1e-14);
            assert!(edge.conormals.iter().all(|c| c.dot(&edge.middle) > 0.0));
        }
        assert!(cuboid.faces.iter().all(|f| f.sides.len() == 4));
        assert_eq!(cuboid.surface().1.len(), 12);
        let y = turn * Vec3::new(0.05, 0.1, 0.35);
        let (face, height) = cuboid.highest(&y);
        assert!((height - 0.05).abs() < 1e-15 && cuboid.is_over(face, &y, 0.0));
        assert!(!cuboid.is_over(face, &(turn * Vec3::new(0.11, 0.1, 0.35)), 1e-9));
    }

    /// Euler's formula, and every corner below every face.
    #[test]
    fn a_rough_stone_is_whole() {
        let at = |k: i32| {
            let t = f64::from(k);
            Vec3::new((1.3 * t).sin(), (2.1 * t).cos() * 0.7, (0.9 * t + 1.0).sin() * 1.2)
        };
        let stone = Polyhedron::new(&(0..40).map(at).collect::<Vec<_>>()).unwrap();
        let (v, e, f) = (stone.corners.len(), stone.edges.len(), stone.faces.len());
        assert_eq!(v + f, e + 2);
        assert!(v > 10);
        for k in 0..f {
            assert!(stone.corners.iter().all(|c| stone.height(k, c) < 1e-12));
            assert!(stone.is_over(k, &stone.faces[k].point, 1e-12));
        }
    }
}
