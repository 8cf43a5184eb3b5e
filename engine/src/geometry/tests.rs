#![allow(clippy::unwrap_used)]
use super::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

const RADIUS: usize = 8;

fn shapes() -> Vec<Shape> {
    vec![
        Shape::plane("floor", Vec3::new(0.1, 0.2, -0.3), Vec3::new(0.3, -0.5, 2.0), 0, [1, 2, 3]).unwrap(),
        Shape::Sphere { name: "ball".into(), center: [0, 1, 2], radius: 3 },
        Shape::Capsule { name: "bar".into(), a: [0, 1, 2], b: [3, 4, 5], radius: 6 },
    ]
}

/// Points and parameters, with capsules met at both ends and between.
fn samples() -> impl Iterator<Item = (Vec3<f64>, Vec<f64>)> {
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    (0..200).map(move |_| {
        let theta = (0..9).map(|_| rng.random_range(-0.5..0.5)).collect();
        (Vec3::from_fn(|_, _| rng.random_range(-1.0..1.0)), theta)
    })
}

type Dual = DualSVec64<3>;

/// The generic gap with the position's three directions seeded.
fn by_duals(shape: &Shape, x: &Vec3<f64>, theta: &[f64]) -> (Dual, Vec3<Dual>) {
    let x = Vec3::from_fn(|a, _| Dual::from_re(x[a]).derivative(a));
    let (p, r): (Vec<_>, _) = (theta.iter().map(|&p| Dual::from_re(p)).collect(), Dual::from_re(theta[RADIUS]));
    match shape {
        Shape::Plane { point, normal, .. } => plane::gap(&x, r, &p, point, normal),
        Shape::Sphere { .. } => sphere::gap(&x, r, &p),
        Shape::Capsule { .. } => capsule::gap(&x, r, &p),
    }
}

fn slope(x: &Dual) -> Vec3<f64> {
    x.eps.0.unwrap_or_else(Vec3::zeros)
}

#[test]
fn kernels_equal_the_generic_gap_and_its_slopes() {
    let mut between = 0;
    for (x, theta) in samples() {
        for shape in shapes() {
            let found = shape.eval(&x, theta[RADIUS], &theta).unwrap();
            let (gap, normal) = by_duals(&shape, &x, &theta);
            assert!((found.gap - gap.re).abs() < 1e-14);
            assert!((found.normal - slope(&gap)).amax() < 1e-12, "n is ∂gap/∂x");
            assert!((found.normal - normal.map(|n| n.re)).amax() < 1e-12);
            assert!((found.normal.norm() - 1.0).abs() < 1e-14);
            let hessian = Matrix3::from_fn(|a, b| slope(&normal[a])[b]);
            assert!((found.hessian - hessian).amax() < 1e-12 * (1.0 + hessian.amax()));
            // Between the ends of a capsule two of the three curvatures vanish.
            let flat = matches!(shape, Shape::Capsule { .. }) && found.hessian.determinant().abs() < 1e-9;
            let trace_of_point = 2.0 / (found.gap + theta[6] + theta[RADIUS]);
            between += usize::from(flat && (found.hessian.trace() - 0.5 * trace_of_point).abs() < 1e-9 * trace_of_point);
        }
    }
    assert!((20..180).contains(&between), "{between} of 200 samples between the ends");
}

/// Partials with respect to the shape's parameters, against Richardson's central differences.
#[test]
fn parameter_slopes_equal_differences() {
    for (x, theta) in samples().take(50) {
        for shape in shapes() {
            let mut visited = Vec::new();
            let visit = &mut |param: usize, dgap: f64, dn: &Vec3<f64>| visited.push((param, dgap, *dn));
            shape.visit_theta(&x, RADIUS, &theta, visit).unwrap();
            for (param, dgap, dn) in &visited {
                let difference = |step: f64| {
                    let at = |by: f64| {
                        let mut moved = theta.clone();
                        moved[*param] += by;
                        shape.eval(&x, moved[RADIUS], &moved).unwrap()
                    };
                    let (up, down) = (at(step), at(-step));
                    ((up.gap - down.gap) / (2.0 * step), (up.normal - down.normal) / (2.0 * step))
                };
                let ((g1, n1), (g2, n2)) = (difference(2e-5), difference(1e-5));
                let (g, n) = ((4.0 * g2 - g1) / 3.0, (n2 * 4.0 - n1) / 3.0);
                assert!((g - dgap).abs() < 1e-8 && (n - dn).amax() < 1e-7 * (1.0 + dn.amax()), "{} θ[{param}]", shape.name());
            }
            assert_eq!(visited[0].0, RADIUS);
            assert_eq!(
                visited.len(),
                match shape {
                    Shape::Plane { .. } => 5,
                    Shape::Sphere { .. } => 5,
                    Shape::Capsule { .. } => 8,
                }
            );
        }
    }
}

/// Moving shape and node together changes nothing: the slopes to a and b add up to −n and −H.
#[test]
fn capsule_slopes_add_up_to_a_translation() {
    let shape = &shapes()[2];
    for (x, theta) in samples() {
        let here = shape.eval(&x, theta[RADIUS], &theta).unwrap();
        let (mut dgap, mut dn) = (Vec3::zeros(), Matrix3::zeros());
        let visit = &mut |param: usize, slope: f64, to_n: &Vec3<f64>| {
            if param < 6 {
                dgap[param % 3] += slope;
                let column = dn.column(param % 3) + to_n;
                dn.set_column(param % 3, &column);
            }
        };
        shape.visit_theta(&x, RADIUS, &theta, visit).unwrap();
        assert!((dgap + here.normal).amax() < 1e-12);
        assert!((dn + here.hessian).amax() < 1e-11 * (1.0 + here.hessian.amax()));
    }
}

#[test]
fn the_normal_of_a_capsule_is_continuous_past_its_ends() {
    let shape = &shapes()[2];
    let theta = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.1, 0.0, 0.01];
    for end in [0.0, 1.0] {
        let at = |along: f64| shape.eval(&Vec3::new(end + along, 0.3, -0.4), 0.01, &theta).unwrap();
        let (before, after) = (at(-1e-9), at(1e-9));
        assert!((before.normal - after.normal).amax() < 1e-8 && (before.gap - after.gap).abs() < 1e-15);
    }
}

#[test]
fn a_node_at_a_centre_is_an_error_that_names_the_shape() {
    let shapes = shapes();
    let theta = [0.1, 0.2, 0.3, 0.1, 0.2, 0.7, 0.05, 0.0, 0.01];
    let ball = shapes[1].eval(&Vec3::new(0.1, 0.2, 0.3), 0.01, &theta);
    let expected = GeometryError::NoNormal { shape: "ball".into(), point: [0.1, 0.2, 0.3], distance: 0.0 };
    assert_eq!(ball, Err(expected));
    let on_axis = Vec3::new(0.1, 0.2, 0.5);
    assert!(matches!(shapes[2].eval(&on_axis, 0.01, &theta), Err(GeometryError::NoNormal { shape, .. }) if shape == "bar"));
    assert!(shapes[2].visit_theta(&on_axis, RADIUS, &theta, &mut |_, _, _| ()).is_err());
    let point = [0.1, 0.2, 0.3, 0.1, 0.2, 0.3, 0.05, 0.0, 0.01];
    assert!(matches!(shapes[2].eval(&Vec3::zeros(), 0.01, &point), Err(GeometryError::NoAxis { shape, .. }) if shape == "bar"));
    assert!(matches!(shapes[1].eval(&Vec3::repeat(f64::NAN), 0.01, &theta), Err(GeometryError::NoNormal { .. })));
    assert!(matches!(Shape::plane("wall", Vec3::zeros(), Vec3::zeros(), 0, [1, 2, 3]), Err(GeometryError::NoPlane { .. })));
}
