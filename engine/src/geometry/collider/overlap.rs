//! Solids that go through each other so deeply that no two of their features show it: bars that cross, a rod through a box, balls with
//! one centre. Contact never gets there by itself; a scene may begin so.

use super::{ColliderShape, PlacedCollider};
use pliant_math::Vec3;

/// Points of a line that are looked at, to each side of its middle.
const SAMPLES: i32 = 32;

/// A depth \[m\] by which two colliders certainly overlap; 0 if nothing shows that they do. Not for half spaces, whose candidates show it.
///
/// Of two blocks it is exact: the least overlap along their 15 axes. Otherwise it is that of points on the middle lines of one solid
/// within the other.
pub fn overlap(a: &PlacedCollider<f64>, b: &PlacedCollider<f64>) -> f64 {
    let near = (a.position - b.position).norm() < a.reach() + b.reach();
    if !near || a.form == ColliderShape::HalfSpace || b.form == ColliderShape::HalfSpace {
        return 0.0;
    }
    if (a.form, b.form) == (ColliderShape::Block, ColliderShape::Block) {
        return of_blocks(a, b);
    }
    of_lines(a, b).max(of_lines(b, a))
}

/// The theorem of separating axes: faces of both, and edges across edges.
fn of_blocks(a: &PlacedCollider<f64>, b: &PlacedCollider<f64>) -> f64 {
    let axes = |s: &PlacedCollider<f64>| [0, 1, 2].map(|k| s.rotation.column(k).into_owned());
    let (x, y) = (axes(a), axes(b));
    let across = x.iter().flat_map(|x| y.iter().filter_map(move |y| x.cross(y).try_normalize(1e-6)));
    let half = |axes: &[Vec3<f64>; 3], s: &PlacedCollider<f64>, n: &Vec3<f64>| -> f64 {
        axes.iter().zip(&s.sizes).map(|(axis, size)| size * axis.dot(n).abs()).sum()
    };
    let along = |n: Vec3<f64>| half(&x, a, &n) + half(&y, b, &n) - (a.position - b.position).dot(&n).abs();
    x.into_iter().chain(y).chain(across).map(along).fold(f64::INFINITY, f64::min).max(0.0)
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
    let half = |k: usize| match (a.form, k) {
        (ColliderShape::Block, _) => a.sizes[k],
        (ColliderShape::Capsule | ColliderShape::Cylinder, 2) => a.sizes[1],
        _ => 0.0,
    };
    for k in 0..3 {
        let reach = a.rotation.column(k) * half(k);
        (-SAMPLES..=SAMPLES).for_each(|i| look(a.position + reach * (f64::from(i) / f64::from(SAMPLES))));
    }
    deepest
}

/// Depth of a point in a solid \[m\], negative outside; there a distance for balls and capsules only.
fn depth(s: &PlacedCollider<f64>, point: &Vec3<f64>) -> f64 {
    let d = point - s.position;
    let along = s.rotation.column(2).dot(&d);
    let across = (d.norm_squared() - along * along).max(0.0).sqrt();
    match s.form {
        ColliderShape::HalfSpace => -along,
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
