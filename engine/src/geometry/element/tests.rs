#![allow(clippy::unwrap_used)]
use super::nearest::combine;
use super::*;
use crate::geometry::collider::{ColliderShape, Feature, PlacedCollider};
use nalgebra::SVector;
use num_dual::DualSVec64;
use pliant_math::Vec3;
use pliant_math::rotation::about;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

const RADIUS: f64 = 0.02;

/// A contact element with three nodes (edges take the first two) near a shape of every kind with a feature.
fn samples(count: usize) -> impl Iterator<Item = ([Vec3<f64>; 3], Feature, PlacedCollider<f64>)> {
    let mut rng = Pcg64Mcg::seed_from_u64(11);
    let forms = [
        (ColliderShape::Ball, [0.1, 0.0, 0.0], vec![Feature::Whole]),
        (ColliderShape::Capsule, [0.08, 0.2, 0.0], vec![Feature::Whole, Feature::End(-1), Feature::End(1)]),
        (
            ColliderShape::Block,
            [0.1, 0.15, 0.2],
            vec![Feature::corner([1, -1, 1]), Feature::edge(1, [-1, 1]), Feature::edge(2, [1, 1])],
        ),
    ];
    (0..count).flat_map(move |_| {
        let rotation = about(&Vec3::from_fn(|_, _| rng.random_range(-1.0..1.0)).normalize(), rng.random_range(-3.0..3.0));
        let x = std::array::from_fn(|_| Vec3::from_fn(|_, _| rng.random_range(-0.6..0.6)));
        let position = Vec3::from_fn(|_, _| rng.random_range(-0.1..0.1));
        forms.clone().into_iter().flat_map(move |(form, sizes, features)| {
            let shape = PlacedCollider { form, rotation, position, sizes };
            features.into_iter().map(move |feature| (x, feature, shape.clone()))
        })
    })
}

/// Facets of both kinds that may meet the feature.
fn sizes(form: &ColliderShape, feature: Feature) -> &'static [usize] {
    match (form, feature) {
        (_, Feature::Edge(..)) | (ColliderShape::Capsule, Feature::Whole) => &[2],
        (ColliderShape::Capsule, _) => &[3],
        _ => &[2, 3],
    }
}

type Dual = DualSVec64<9>;

fn slope(x: &Dual) -> SVector<f64, 9> {
    x.eps.0.unwrap_or_else(SVector::zeros)
}

fn seeded(x: &[Vec3<f64>; 3]) -> [Vec3<Dual>; 3] {
    std::array::from_fn(|i| Vec3::from_fn(|a, _| Dual::from_re(x[i][a]).derivative(3 * i + a)))
}

fn lifted(shape: &PlacedCollider<f64>) -> PlacedCollider<Dual> {
    PlacedCollider {
        form: shape.form.clone(),
        rotation: shape.rotation.map(Dual::from_re),
        position: shape.position.map(Dual::from_re),
        sizes: shape.sizes.map(Dual::from_re),
    }
}

#[test]
fn the_gaps_slope_is_the_normal_by_the_weights_and_its_hessian_symmetric() {
    let mut regions = [0; 3];
    for (x, feature, shape) in samples(300) {
        for &n in sizes(&shape.form, feature) {
            let Ok(plain) = nearest(&x[..n], RADIUS, feature, &shape) else { continue };
            let dual = nearest(&seeded(&x)[..n], Dual::from_re(RADIUS), feature, &lifted(&shape)).unwrap();
            regions[match plain.region {
                Region::Inside => 0,
                Region::Side(_) => 1,
                Region::Node(_) => 2,
            }] += 1;
            assert!((plain.gap - dual.gap.re).abs() < 1e-14);
            assert!((plain.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12 && (plain.normal.norm() - 1.0).abs() < 1e-12);
            let mut hessian = nalgebra::SMatrix::<f64, 9, 9>::zeros();
            for i in 0..3 {
                for a in 0..3 {
                    let by_envelope = plain.weights[i] * plain.normal[a];
                    assert!((slope(&dual.gap)[3 * i + a] - by_envelope).abs() < 1e-10, "{feature:?} of {:?}", shape.form);
                    hessian.set_row(3 * i + a, &slope(&(dual.weights[i] * dual.normal[a])).transpose());
                }
            }
            assert!((hessian - hessian.transpose()).amax() < 1e-9 * (1.0 + hessian.amax()), "{feature:?} of {:?}", shape.form);
        }
    }
    assert!(regions.iter().all(|n| *n > 100), "{regions:?}");
}

/// Balls, and capsules against edges, by brute force over the contact element and the axis.
#[test]
fn distances_are_the_least_there_are() {
    let axis_distance = |p: &Vec3<f64>, shape: &PlacedCollider<f64>, feature: Feature| {
        let axis = shape.rotation.column(2).into_owned();
        let half = if shape.form == ColliderShape::Capsule { shape.sizes[1] } else { 0.0 };
        let t = match feature {
            Feature::End(side) => half * f64::from(side),
            _ => (p - shape.position).dot(&axis).clamp(-half, half),
        };
        (p - shape.position - axis * t).norm() - shape.sizes[0] - RADIUS
    };
    for (x, feature, shape) in samples(40).filter(|(_, _, shape)| shape.form != ColliderShape::Block) {
        for &n in sizes(&shape.form, feature) {
            let found = nearest(&x[..n], RADIUS, feature, &shape).unwrap();
            let at = axis_distance(&combine(&found.weights, &x[..n]), &shape, feature);
            assert!((at - found.gap).abs() < 1e-12, "{feature:?} of {:?}: {at} is {}", shape.form, found.gap);
            let steps = 60;
            for i in 0..=steps {
                for j in 0..=(if n == 3 { steps - i } else { 0 }) {
                    let (b, c) = (f64::from(i) / f64::from(steps), f64::from(j) / f64::from(steps));
                    let p = combine(&[1.0 - b - c, b, c], &x);
                    assert!(axis_distance(&p, &shape, feature) >= found.gap - 1e-12, "{feature:?} of {:?}", shape.form);
                }
            }
        }
    }
}

/// Through a region's border the gap and its slope are continuous.
#[test]
fn gaps_are_smooth_over_the_ends() {
    for (x, feature, shape) in samples(60) {
        for &n in sizes(&shape.form, feature) {
            let moved = |t: f64| [x[0], x[1] + (x[1] - x[0]) * t, x[2]];
            let at = |t: f64| nearest(&moved(t)[..n], RADIUS, feature, &shape);
            let thickness = if shape.form == ColliderShape::Block { 0.0 } else { shape.sizes[0] };
            // what is sharp has a sign only from outside
            let outside = |found: &Nearest<f64>| thickness > 0.0 || found.normal.dot(&shape.outward(feature)) > 0.3;
            let mut last = at(-0.9);
            for k in 1..=2000 {
                let next = at(-0.9 + 1.8e-3 * f64::from(k));
                if let (Ok(a), Ok(b)) = (&last, &next) {
                    // no normal turns faster than a contact element that passes at a tenth of a millimetre makes it
                    let close = [a, b].iter().any(|f| (f.gap + RADIUS + thickness).abs() < 0.05 || !outside(f));
                    let jump = (a.normal - b.normal).norm();
                    assert!(close || jump < 0.2, "{feature:?} of {:?}: {a:?} {b:?}", shape.form);
                    assert!(close || (a.gap - b.gap).abs() < 5e-3);
                }
                last = next;
            }
        }
    }
}

/// Crossing a block's edge, the gap goes through zero with one normal; touching a corner likewise from outside.
#[test]
fn sharp_features_have_signed_gaps() {
    let shape = PlacedCollider {
        form: ColliderShape::Block,
        rotation: about(&Vec3::x(), 0.0),
        position: Vec3::zeros(),
        sizes: [0.1, 0.2, 0.3],
    };
    let edge = Feature::edge(1, [1, 1]); // along y at z = 0.3, x = 0.1
    for depth in [-1e-3, 1e-3] {
        // normal (1, 1)/√2 in (x, z)
        let d = depth / 2f64.sqrt();
        let x = [Vec3::new(0.0 + d, 0.05, 0.4 + d), Vec3::new(0.2 + d, -0.05, 0.2 + d)];
        let found = nearest(&x, 0.0, edge, &shape).unwrap();
        assert!((found.gap - depth).abs() < 1e-12, "{found:?}");
        assert!((found.normal - Vec3::new(1.0, 0.0, 1.0).normalize()).norm() < 1e-12);
        let (corner, out) = (Vec3::new(0.1, 0.2, 0.3), Vec3::new(1.0, 1.0, 1.0).normalize());
        let (s, t) = (Vec3::new(1.0, -1.0, 0.0), Vec3::new(1.0, 1.0, -2.0));
        let at = corner + out * depth;
        let face = [at + s * 0.1, at - s * 0.1 + t * 0.1, at - t * 0.2];
        let found = nearest(&face, 0.0, Feature::corner([1, 1, 1]), &shape).unwrap();
        assert!((found.gap - depth).abs() < 1e-12 && (found.normal - out).norm() < 1e-12, "{found:?}");
    }
}
