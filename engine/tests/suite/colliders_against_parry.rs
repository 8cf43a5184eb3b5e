//! Gaps of colliders against the distances of parry, an independent collision library.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use parry3d_f64::math::{Pose as TheirPose, Rotation, Vector};
use parry3d_f64::query::distance;
use parry3d_f64::shape::{Ball, Capsule, ConvexPolyhedron, Cuboid, Cylinder, HalfSpace, Shape};
use pliant_engine::geometry::collider::{ColliderShape, PlacedCollider, Polyhedron, candidates, contact_geometry, overlap};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::sync::Arc;

fn random_rotation(rng: &mut Pcg64Mcg) -> UnitQuaternion<f64> {
    let x: Vec<f64> = (0..4).map(|_| rng.random_range(-1.0..1.0)).collect();
    UnitQuaternion::from_quaternion(Quaternion::new(x[0], x[1], x[2], x[3]))
}

fn theirs(collider: &PlacedCollider<f64>) -> (TheirPose, Box<dyn Shape>) {
    let mut q = UnitQuaternion::from_matrix(&collider.rotation);
    if collider.form == ColliderShape::Cylinder {
        // theirs stand along y
        q *= UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
    }
    let p = Vector::new(collider.position[0], collider.position[1], collider.position[2]);
    let pose = TheirPose::from_parts(p, Rotation::from_xyzw(q.i, q.j, q.k, q.w));
    let [a, b, c] = collider.sizes;
    let shape: Box<dyn Shape> = match &collider.form {
        ColliderShape::HalfSpace => Box::new(HalfSpace::new(Vector::new(0.0, 0.0, 1.0))),
        ColliderShape::Ball => Box::new(Ball::new(a)),
        ColliderShape::Capsule => Box::new(Capsule::new(Vector::new(0.0, 0.0, -b), Vector::new(0.0, 0.0, b), a)),
        ColliderShape::Hull(hull) => {
            let corners: Vec<_> = hull.surface().0.iter().map(|c| Vector::new(c[0], c[1], c[2])).collect();
            Box::new(ConvexPolyhedron::from_convex_hull(&corners).unwrap())
        }
        ColliderShape::Cylinder => Box::new(Cylinder::new(b, a)),
        ColliderShape::Block => Box::new(Cuboid::new(Vector::new(a, b, c))),
    };
    (pose, shape)
}

fn apart(a: &PlacedCollider<f64>, b: &PlacedCollider<f64>) -> f64 {
    let ((pa, sa), (pb, sb)) = (theirs(a), theirs(b));
    distance(&pa, &*sa, &pb, &*sb).unwrap().distance
}

fn nearest(a: &PlacedCollider<f64>, b: &PlacedCollider<f64>) -> Option<(f64, Vector3<f64>)> {
    let mut found = Vec::new();
    candidates(a, b, 1.0, &mut found);
    let gap = |(feature_pair, swapped): &(_, bool)| {
        if *swapped { contact_geometry(feature_pair, b, a) } else { contact_geometry(feature_pair, a, b) }.unwrap()
    };
    let all = found.iter().map(|f| (gap(f), if f.1 { -1.0 } else { 1.0 }));
    all.min_by(|x, y| x.0.gap.total_cmp(&y.0.gap)).map(|(m, sign)| (m.gap, m.normal * sign))
}

fn random(form: ColliderShape, rng: &mut Pcg64Mcg) -> PlacedCollider<f64> {
    let sizes = [0, 1, 2].map(|_| rng.random_range(0.1..0.4));
    let rotation: Matrix3<f64> = random_rotation(rng).to_rotation_matrix().into_inner();
    PlacedCollider { form, rotation, position: Vector3::from_fn(|_, _| rng.random_range(-0.2..0.2)), sizes }
}

fn hull(points: &[Vector3<f64>]) -> ColliderShape {
    ColliderShape::Hull(Arc::new(Polyhedron::new(points).unwrap()))
}

/// The name of a form: a hull would print all its corners.
fn kind(form: &ColliderShape) -> String {
    if matches!(form, ColliderShape::Hull(_)) { "a hull".to_owned() } else { format!("{form:?}") }
}

/// A rough stone of about twenty corners beside its origin.
fn stone(rng: &mut Pcg64Mcg) -> ColliderShape {
    let mut point = |_| random_rotation(rng) * Vector3::z() * rng.random_range(0.2..0.3) + Vector3::new(0.05, -0.02, 0.03);
    hull(&(0..30).map(&mut point).collect::<Vec<_>>())
}

fn corners([a, b, c]: [f64; 3]) -> Vec<Vector3<f64>> {
    let bit = |k: usize, b: usize| if k >> b & 1 == 1 { 1.0 } else { -1.0 };
    (0..8).map(|k| Vector3::new(a * bit(k, 0), b * bit(k, 1), c * bit(k, 2))).collect()
}

/// Two colliders brought to the distance `close` along a line.
fn brought_near(mut a: PlacedCollider<f64>, b: &PlacedCollider<f64>, close: f64, rng: &mut Pcg64Mcg) -> PlacedCollider<f64> {
    let direction = random_rotation(rng) * Vector3::z();
    let direction = if b.form == ColliderShape::HalfSpace { b.rotation * Vector3::z() } else { direction };
    let start = b.position + direction * 3.0;
    let (mut near, mut far) = (0.0, 3.0);
    for _ in 0..60 {
        let middle = 0.5 * (near + far);
        a.position = start - direction * middle;
        if apart(&a, b) > close { near = middle } else { far = middle }
    }
    a.position = start - direction * near;
    a
}

#[test]
fn touching_colliders_are_as_far_apart_as_parry_says() {
    use ColliderShape::{Ball, Block, Capsule, Cylinder, HalfSpace};
    let (mut rng, mut stones) = (Pcg64Mcg::seed_from_u64(3), Pcg64Mcg::seed_from_u64(9));
    let pairs = [
        (Ball, HalfSpace),
        (Capsule, HalfSpace),
        (Block, HalfSpace),
        (Ball, Ball),
        (Ball, Capsule),
        (Ball, Block),
        (Capsule, Capsule),
        (Capsule, Block),
        (Block, Block),
        (stone(&mut stones), HalfSpace),
        (Ball, stone(&mut stones)),
        (Capsule, stone(&mut stones)),
        (Block, stone(&mut stones)),
        (stone(&mut stones), stone(&mut stones)),
        (Cylinder, HalfSpace),
        (Ball, Cylinder),
        (Capsule, Cylinder),
        (Cylinder, Block),
        (Cylinder, stone(&mut stones)),
        (Cylinder, Cylinder),
    ];
    for (first, second) in pairs {
        let mut missed = 0;
        for k in 0..300 {
            let b = random(second.clone(), &mut rng);
            let close = 1e-5;
            let a = brought_near(random(first.clone(), &mut rng), &b, close, &mut rng);
            let distance = apart(&a, &b);
            let (gap, normal) = match if k % 2 == 0 { nearest(&a, &b) } else { nearest(&b, &a).map(|(g, n)| (g, -n)) } {
                Some(found) => found,
                None => {
                    missed += 1;
                    continue;
                }
            };
            if gap - distance > 1e-8 {
                missed += 1;
                continue;
            }
            assert!((gap - distance).abs() < 1e-8, "{} and {}: gap {gap}, distance {distance}", kind(&first), kind(&second));
            // moving apart along the normal opens the gap by as much, as far as rounded things go
            let mut moved = a.clone();
            moved.position += normal * 1e-5;
            assert!((apart(&moved, &b) - distance - 1e-5).abs() < 2e-8, "{} and {}", kind(&first), kind(&second));
        }
        // corners against edges and corners: no such pair stays nearest down to the touch but by chance
        assert!(missed <= 2, "{} and {}: {missed} of 300 missed", kind(&first), kind(&second));
    }
}

/// The hull of a block's corners touches as the block does, with as many features.
#[test]
fn a_hull_of_eight_corners_is_a_block() {
    use ColliderShape::{Ball, Block, Capsule, Cylinder, HalfSpace};
    let mut rng = Pcg64Mcg::seed_from_u64(8);
    let mut touching = 0;
    for other in [Ball, Capsule, Cylinder, Block, HalfSpace] {
        for _ in 0..200 {
            let other = random(other.clone(), &mut rng);
            let mut block = random(Block, &mut rng);
            block.position += random_rotation(&mut rng) * Vector3::z() * rng.random_range(0.3..0.8);
            let as_hull = PlacedCollider { form: hull(&corners(block.sizes)), ..block.clone() };
            let gaps = |block: &PlacedCollider<f64>| {
                let mut found = Vec::new();
                candidates(block, &other, 0.02, &mut found);
                let gap = |(pair, swapped): &(_, bool)| {
                    if *swapped { contact_geometry(pair, &other, block) } else { contact_geometry(pair, block, &other) }
                        .unwrap()
                        .gap
                };
                // deeper, an edge of another block may be taken for one on the near side
                let mut gaps: Vec<f64> = found.iter().map(gap).filter(|gap| *gap > -0.02).collect();
                gaps.sort_by(f64::total_cmp);
                gaps
            };
            let (mine, theirs) = (gaps(&as_hull), gaps(&block));
            assert_eq!(mine.len(), theirs.len(), "{:?}", other.form);
            assert!(mine.iter().zip(&theirs).all(|(a, b)| (a - b).abs() < 1e-12), "{mine:?} {theirs:?}");
            touching += mine.len();
            if other.form != HalfSpace {
                assert!((overlap(&as_hull, &other) - overlap(&block, &other)).abs() < 1e-12 || other.form != Block);
            }
        }
    }
    assert!(touching > 200, "{touching}");
}

#[test]
fn a_cylinder_touches_the_floor_with_the_lowest_point_of_its_rims() {
    let mut rng = Pcg64Mcg::seed_from_u64(4);
    let floor = PlacedCollider {
        form: ColliderShape::HalfSpace,
        rotation: Matrix3::identity(),
        position: Vector3::zeros(),
        sizes: [0.0; 3],
    };
    for _ in 0..200 {
        let cylinder = random(ColliderShape::Cylinder, &mut rng);
        let axis = cylinder.rotation.column(2).into_owned();
        let lowest =
            cylinder.position[2] - cylinder.sizes[1] * axis[2].abs() - cylinder.sizes[0] * (1.0 - axis[2] * axis[2]).sqrt();
        let (gap, normal) = nearest(&cylinder, &floor).unwrap();
        assert!((gap - lowest).abs() < 1e-12 && (normal - Vector3::z()).norm() < 1e-15);
    }
    let upright = PlacedCollider {
        form: ColliderShape::Cylinder,
        rotation: Matrix3::identity(),
        position: Vector3::z() * 0.3,
        sizes: [0.1, 0.2, 0.0],
    };
    let mut found = Vec::new();
    candidates(&upright, &floor, 0.2, &mut found);
    assert_eq!(found.len(), 8, "it stands on the points of one rim");
}

#[test]
fn a_cylinder_meets_balls_and_capsules_exactly() {
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    for _ in 0..500 {
        let cylinder = random(ColliderShape::Cylinder, &mut rng);
        let mut ball = random(ColliderShape::Ball, &mut rng);
        ball.position = cylinder.position + random_rotation(&mut rng) * Vector3::z() * 0.9;
        let y = cylinder.rotation.tr_mul(&(ball.position - cylinder.position));
        let across = (y.xy().norm() - cylinder.sizes[0]).max(0.0);
        let along = (y[2].abs() - cylinder.sizes[1]).max(0.0);
        if across.hypot(along) > 0.0 {
            let (gap, _) = nearest(&ball, &cylinder).unwrap();
            assert!((gap - (across.hypot(along) - ball.sizes[0])).abs() < 1e-12);
        }
        let capsule = PlacedCollider { form: ColliderShape::Capsule, ..random(ColliderShape::Capsule, &mut rng) };
        let capsule = PlacedCollider { position: ball.position, ..capsule };
        // distance of points of the axis, the least of which is the capsule's
        let sampled = (0..=2000).map(|k| {
            let x = capsule.position + capsule.rotation.column(2) * (capsule.sizes[1] * (f64::from(k) / 1000.0 - 1.0));
            let y = cylinder.rotation.tr_mul(&(x - cylinder.position));
            let (across, along) = ((y.xy().norm() - cylinder.sizes[0]).max(0.0), (y[2].abs() - cylinder.sizes[1]).max(0.0));
            across.hypot(along) - capsule.sizes[0]
        });
        let least = sampled.fold(f64::INFINITY, f64::min);
        if least > 0.0 {
            let (gap, _) = nearest(&capsule, &cylinder).unwrap();
            // samples lie 0.4 mm apart at most
            assert!(gap > least - 1e-5 && gap < least + 1e-9, "{gap} {least}");
        }
    }
}
