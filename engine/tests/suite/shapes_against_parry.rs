//! Gaps against those of parry, an independent collision library.

use nalgebra::{Rotation3, Vector3};
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::{Ball, Capsule, HalfSpace};
use pliant_engine::geometry::Shape;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

fn glam(x: &[f64]) -> Vector {
    Vector::new(x[0], x[1], x[2])
}

#[test]
fn gaps_and_normals_equal_parrys() {
    let mut rng = Pcg64Mcg::seed_from_u64(11);
    let rope = 0.003;
    let (mut inside, mut checked) = (0, 0);
    for _ in 0..500 {
        let theta: Vec<f64> = (0..7).map(|k| if k == 6 { 0.3 } else { rng.random_range(-0.6..0.6) }).collect();
        let x = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let direction = Vector3::from_fn(|_, _| rng.random_range(0.1..1.0)).normalize();
        let turned = Rotation3::new(Vector3::new(theta[4], theta[5], theta[6])) * direction;
        let cases: [(Shape, Box<dyn PointQuery>, Pose); 3] = [
            // θ[4..7] turns the plane about its point, θ[3] shifts it along its normal
            (
                Shape::plane("plane", Vector3::new(theta[0], theta[1], theta[2]), direction, 3, [4, 5, 6]).unwrap(),
                Box::new(HalfSpace::new(glam(turned.as_slice()))),
                Pose::from_translation(glam(&theta[..3]) + glam(turned.as_slice()) * theta[3]),
            ),
            (
                Shape::Sphere { name: "sphere".into(), center: [0, 1, 2], radius: 6 },
                Box::new(Ball::new(theta[6])),
                Pose::from_translation(glam(&theta[..3])),
            ),
            (
                Shape::Capsule { name: "capsule".into(), a: [0, 1, 2], b: [3, 4, 5], radius: 6 },
                Box::new(Capsule::new(glam(&theta[..3]), glam(&theta[3..6]), theta[6])),
                Pose::IDENTITY,
            ),
        ];
        for (shape, theirs, pose) in cases {
            let ours = shape.eval(&x, rope, &theta).unwrap();
            let point = glam(x.as_slice());
            let distance = theirs.distance_to_point(&pose, point, false);
            assert!((ours.gap + rope - distance).abs() < 1e-9, "{}: {} against {distance}", shape.name(), ours.gap + rope);

            // The nearest point of the surface lies against the normal.
            let surface = theirs.project_point(&pose, point, false).point;
            let nearest = x - ours.normal * (ours.gap + rope);
            assert!((nearest - Vector3::new(surface.x, surface.y, surface.z)).amax() < 1e-9, "{}", shape.name());
            inside += usize::from(distance < 0.0);
            checked += 1;
        }
    }
    assert!(inside > 100 && checked - inside > 500, "{inside} of {checked} inside");
}
