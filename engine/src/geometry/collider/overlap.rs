//! Solids that go through each other so deeply that no two of their features show it: bars that cross, a rod through a box, balls with
//! one centre. Contact never gets there by itself; a scene may begin so.

use super::{ColliderShape, FeaturePair, PlacedCollider, contact_geometry};
use crate::geometry::constants::GEOMETRY;
use pliant_math::Vec3;

/// A depth \[m\] by which two colliders certainly overlap; 0 if nothing shows that they do. Not for half spaces, whose candidates show it.
///
/// Of two polyhedra it is exact: the least overlap along normals of faces and across two edges (15 axes for blocks). Otherwise it is that of points on the middle lines of one solid
/// within the other.
pub fn overlap(a: &PlacedCollider<f64>, b: &PlacedCollider<f64>) -> f64 {
    let near = (a.position - b.position).norm() < a.reach() + b.reach();
    if !near || a.form == ColliderShape::HalfSpace || b.form == ColliderShape::HalfSpace {
        return 0.0;
    }
    let sharp = |s: &PlacedCollider<f64>| matches!(s.form, ColliderShape::Block | ColliderShape::Hull(_));
    if sharp(a) && sharp(b) {
        return of_polyhedra(a, b);
    }
    of_lines(a, b).max(of_lines(b, a))
}

/// Drops features that are deeper than the colliders overlap by more than `most` \[m\]: where two boxes touch by their sides, an edge of one
/// may lie deep under an edge of the other without touching it. The overlap is the least along the normals of the features listed and of
/// flat sides.
pub(crate) fn drop_hidden(a: &PlacedCollider<f64>, b: &PlacedCollider<f64>, most: f64, found: &mut Vec<(FeaturePair, bool)>) {
    if [a, b].iter().any(|collider| collider.form == ColliderShape::HalfSpace) {
        return;
    }
    let geometry = |&(features, swapped): &(FeaturePair, bool)| {
        let (first, second) = if swapped { (b, a) } else { (a, b) };
        contact_geometry(&features, first, second).ok().map(|m| (m.gap, overlap_along(first, second, &m.normal)))
    };
    let listed: Vec<_> = found.iter().map(geometry).collect();
    if listed.iter().flatten().all(|(gap, _)| *gap >= -most) {
        return;
    }
    let depth = listed.iter().flatten().map(|(_, overlap)| *overlap).fold(overlap_along_faces(a, b), f64::min).max(0.0);
    let mut listed = listed.iter();
    found.retain(|_| listed.next().is_some_and(|found| found.is_some_and(|(gap, _)| gap >= -depth - most)));
}

/// How far two colliders overlap along a unit vector \[m\], the first on its side; < 0 if they are apart along it. Not for half spaces.
fn overlap_along(a: &PlacedCollider<f64>, b: &PlacedCollider<f64>, n: &Vec3<f64>) -> f64 {
    extent(a, &-n) + extent(b, n) - (a.position - b.position).dot(n)
}

/// The lesser overlap along a unit vector and against it \[m\].
fn overlap_either_way(a: &PlacedCollider<f64>, b: &PlacedCollider<f64>, n: &Vec3<f64>) -> f64 {
    overlap_along(a, b, n).min(overlap_along(a, b, &-n))
}

/// The least overlap of two colliders along the normals of their flat sides \[m\]: the distance between convex bodies is at most this.
fn overlap_along_faces(a: &PlacedCollider<f64>, b: &PlacedCollider<f64>) -> f64 {
    [a, b].into_iter().flat_map(normals).map(|n| overlap_either_way(a, b, &n)).fold(f64::INFINITY, f64::min)
}

/// Normals of flat sides; of two that are opposite only one.
fn normals(s: &PlacedCollider<f64>) -> Vec<Vec3<f64>> {
    let axis = |k: usize| s.rotation.column(k).into_owned();
    match &s.form {
        ColliderShape::Block => (0..3).map(axis).collect(),
        ColliderShape::Cylinder => vec![axis(2)],
        ColliderShape::Hull(p) => p.faces.iter().map(|f| s.rotation * f.normal).collect(),
        _ => Vec::new(),
    }
}

/// Directions of edges; of parallel ones of a block only one.
fn directions(s: &PlacedCollider<f64>) -> Vec<Vec3<f64>> {
    match &s.form {
        ColliderShape::Hull(p) => p.edges.iter().map(|e| s.rotation * e.direction).collect(),
        _ => normals(s),
    }
}

/// How far a collider reaches from its origin along a unit vector \[m\].
fn extent(s: &PlacedCollider<f64>, n: &Vec3<f64>) -> f64 {
    let along = |k: usize| s.rotation.column(k).dot(n).abs();
    let [a, b, c] = s.sizes;
    match &s.form {
        ColliderShape::HalfSpace => f64::INFINITY,
        ColliderShape::Hull(p) => p.support(&s.rotation.tr_mul(n)),
        ColliderShape::Ball => a,
        ColliderShape::Capsule => a + b * along(2),
        ColliderShape::Cylinder => a * (1.0 - along(2) * along(2)).max(0.0).sqrt() + b * along(2),
        ColliderShape::Block => a * along(0) + b * along(1) + c * along(2),
    }
}

/// The theorem of separating axes: faces of both, and edges across edges.
fn of_polyhedra(a: &PlacedCollider<f64>, b: &PlacedCollider<f64>) -> f64 {
    let (x, y) = (directions(a), directions(b));
    let across = x.iter().flat_map(|x| y.iter().filter_map(move |y| x.cross(y).try_normalize(1e-6)));
    let faces = normals(a).into_iter().chain(normals(b));
    faces.chain(across).map(|n| overlap_either_way(a, b, &n)).fold(f64::INFINITY, f64::min).max(0.0)
}

/// How deep points on the middle lines of `a` are in `b`, with the ball about them that `a` has.
fn of_lines(a: &PlacedCollider<f64>, b: &PlacedCollider<f64>) -> f64 {
    let radius = if matches!(a.form, ColliderShape::Ball | ColliderShape::Capsule) { a.sizes[0] } else { 0.0 };
    let round = matches!(b.form, ColliderShape::Ball | ColliderShape::Capsule);
    let mut deepest = 0.0f64;
    let mut look = |point: Vec3<f64>| {
        let depth = depth(b, &point);
        // outside a block or cylinder the depth is no distance
        if depth > 0.0 || round {
            deepest = deepest.max(depth + radius);
        }
    };
    let half = |k: usize| match (&a.form, k) {
        (ColliderShape::Block, _) => a.sizes[k],
        (ColliderShape::Capsule | ColliderShape::Cylinder, 2) => a.sizes[1],
        _ => 0.0,
    };
    for k in 0..3 {
        let reach = a.rotation.column(k) * half(k);
        let most = GEOMETRY.samples;
        (-most..=most).for_each(|i| look(a.position + reach * (f64::from(i) / f64::from(most))));
    }
    deepest
}

/// Depth of a point in a solid \[m\], negative outside; there a distance for balls and capsules only.
pub(super) fn depth(s: &PlacedCollider<f64>, point: &Vec3<f64>) -> f64 {
    let d = point - s.position;
    let along = s.rotation.column(2).dot(&d);
    let across = (d.norm_squared() - along * along).max(0.0).sqrt();
    match &s.form {
        ColliderShape::HalfSpace => -along,
        ColliderShape::Hull(p) => -p.highest(&s.rotation.tr_mul(&d)).1,
        ColliderShape::Ball => s.sizes[0] - d.norm(),
        ColliderShape::Capsule => s.sizes[0] - across.hypot((along.abs() - s.sizes[1]).max(0.0)),
        ColliderShape::Cylinder => (s.sizes[0] - across).min(s.sizes[1] - along.abs()),
        ColliderShape::Block => (0..3).map(|k| s.sizes[k] - s.rotation.column(k).dot(&d).abs()).fold(f64::INFINITY, f64::min),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Rotation3};

    fn collider(form: ColliderShape, sizes: [f64; 3], position: [f64; 3], turn: [f64; 3]) -> PlacedCollider<f64> {
        let rotation: Matrix3<f64> = Rotation3::new(Vec3::from(turn)).into_inner();
        PlacedCollider { form, rotation, position: position.into(), sizes }
    }

    #[test]
    fn what_crosses_overlaps_and_what_touches_does_not() {
        let (no, quarter) = ([0.0; 3], [std::f64::consts::FRAC_PI_2, 0.0, 0.0]);
        let bar = |turn| collider(ColliderShape::Block, [0.02, 0.02, 0.2], no, turn);
        let deep = [
            overlap(&bar(no), &bar(quarter)),
            overlap(&bar(no), &bar([0.7, 0.4, 0.2])),
            overlap(
                &collider(ColliderShape::Ball, [0.1, 0.0, 0.0], no, no),
                &collider(ColliderShape::Ball, [0.1, 0.0, 0.0], no, no),
            ),
            overlap(&collider(ColliderShape::Capsule, [0.01, 0.3, 0.0], no, quarter), &bar(no)),
            overlap(
                &collider(ColliderShape::Cylinder, [0.03, 0.3, 0.0], no, quarter),
                &collider(ColliderShape::Cylinder, [0.03, 0.3, 0.0], no, no),
            ),
            overlap(
                &collider(ColliderShape::Capsule, [0.03, 0.3, 0.0], no, quarter),
                &collider(ColliderShape::Capsule, [0.03, 0.3, 0.0], no, no),
            ),
        ];
        assert!(deep.iter().all(|d| *d > 0.005), "{deep:?}");
        let touching = [
            overlap(&bar(no), &collider(ColliderShape::Block, [0.3, 0.3, 0.001], [0.0, 0.0, 0.201], [0.0, 0.0, 0.4])),
            overlap(&collider(ColliderShape::Ball, [0.1, 0.0, 0.0], [0.12, 0.0, 0.0], no), &bar(no)),
            overlap(
                &collider(ColliderShape::Ball, [0.1, 0.0, 0.0], [0.0, 0.0, 0.2], no),
                &collider(ColliderShape::Ball, [0.1, 0.0, 0.0], no, no),
            ),
            overlap(
                &collider(ColliderShape::Capsule, [0.1, 0.2, 0.0], [0.2, 0.0, 0.0], no),
                &collider(ColliderShape::Capsule, [0.1, 0.2, 0.0], no, no),
            ),
            overlap(&collider(ColliderShape::Cylinder, [0.1, 0.001, 0.0], [0.0, 0.0, 0.201], no), &bar(no)),
        ];
        assert!(touching.iter().all(|d| *d < 1e-12), "{touching:?}");
    }
}
