//! A and B of ropes and rods from the inverse of a step's matrix, with and without contact, beside tangents that solve for every column.

use crate::common::{Case, with};
use pliant_adjoint::{Linearization, Seeds, TangentStepper, linearize};
use pliant_engine::step::{StepOptions, StepRecord};
use pliant_scene::{Integrator, Plane, Scene, Sphere};

/// The scene of this name without damping and wind.
fn elastic(name: &str, integrator: Integrator) -> Scene {
    let mut scene = with(name, integrator);
    for rope in &mut scene.rope {
        (rope.stretch_damping, rope.bend_damping, rope.drag_linear, rope.drag_quadratic) = (0.0, 0.0, 0.0, 0.0);
        if let Some(twist) = &mut rope.twist {
            twist.damping = 0.0;
        }
    }
    scene
}

/// On a slope that it slides down, and over a ball.
fn touching(name: &str) -> Scene {
    let mut scene = elastic(name, Integrator::Euler);
    scene.gripper.clear();
    scene.plane =
        vec![Plane { point: [0.0, 0.0, -0.012], normal: [0.1, -0.2, 1.0], friction: 0.3, name: "slope".into(), height: 0.0 }];
    scene.sphere = vec![Sphere { name: "ball".into(), center: [0.3, 0.0, -0.06], radius: 0.05, friction: 0.6 }];
    scene
}

/// Every column by a tangent of its own, which is always refined.
fn by_tangents(case: &Case, record: &StepRecord) -> Linearization {
    let (n, nx, nu, np) = (case.model.nv(), case.model.ndx(), case.model.nu(), case.model.n_params());
    let column = |k: usize| {
        let mut seeds = Seeds::none(1, nu, np);
        if (nx..nx + nu).contains(&k) {
            seeds.add_u(k - nx, 0, 1.0);
        } else if k >= nx + nu {
            seeds.add_theta(k - nx - nu, 0, 1.0);
        }
        let mut tangent = TangentStepper::new(&case.model, &case.theta, seeds);
        if k < n {
            tangent.x.q[k] = 1.0;
        } else if k < 2 * n {
            tangent.x.v[k - n] = 1.0;
        }
        tangent.step(record);
        [tangent.x.q, tangent.x.v].concat()
    };
    let columns: Vec<_> = (0..nx + nu + np).map(column).collect();
    let part = |part: &[Vec<f64>]| (0..nx).flat_map(|i| part.iter().map(move |column| column[i])).collect();
    Linearization { a: part(&columns[..nx]), b: part(&columns[nx..nx + nu]), c: part(&columns[nx + nu..]) }
}

/// Largest difference between rows, beside the largest of the row and the rounding of a displacement or its rate.
fn farthest(case: &Case, h: f64, own: &[f64], other: &[f64]) -> f64 {
    let (n, rows) = (case.model.nv(), case.model.ndx());
    let columns = own.len() / rows;
    let miss = |(i, (a, b)): (usize, (&[f64], &[f64]))| {
        let unit: f64 = if i < n { 1.0 } else { 1.0 / h };
        let scale = b.iter().fold(unit, |m, x| m.max(x.abs()));
        a.iter().zip(b).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs() / scale))
    };
    let pairs = own.chunks_exact(columns.max(1)).zip(other.chunks_exact(columns.max(1)));
    pairs.enumerate().map(miss).fold(0.0, f64::max)
}

#[test]
fn jacobians_by_the_inverse_are_those_of_tangents() {
    let mut free = elastic("twisting_rod", Integrator::Euler);
    free.gripper.clear();
    let mut lying = touching("twisting_rod");
    lying.rope[0].velocity = [0.0; 3];
    let mut loose = touching("twisting_rod");
    loose.contact.rest_gap = 1e-5;
    let mut plain = touching("twisting_rod");
    plain.rope[0].twist = None;
    let cases = [
        ("clamped and turned", elastic("twisting_rod", Integrator::Euler), true, 0),
        ("quasi-static", elastic("twisting_rod", Integrator::QuasiStatic), true, 0),
        ("free", free, true, 0),
        ("ring", elastic("ring", Integrator::Euler), true, 0),
        ("thrown at a slope", touching("twisting_rod"), true, 1),
        ("laid on it", lying, true, 1),
        ("laid on it, smoother", loose, true, 1),
        ("without twist", plain, true, 1),
        ("damped", with("twisting_rod", Integrator::Euler), false, 0),
        ("midpoint", elastic("twisting_rod", Integrator::Midpoint), true, 0),
    ];
    for (what, scene, undamped, touches) in cases {
        let case = Case::new(&scene, 40);
        let run = case.run(StepOptions::default());
        let (mut worst, mut touched) = ([0.0_f64; 3], 0);
        for record in &run.records {
            assert!(record.stages.iter().all(|(_, stage)| stage.undamped == undamped), "{what}");
            let modes = record.stages.iter().flat_map(|(_, stage)| stage.contact_modes(&case.model, &case.theta));
            touched += modes.filter(|mode| *mode > 0).count();
            let (own, other) = (linearize(&case.model, &case.theta, record, true), by_tangents(&case, record));
            for (worst, (own, other)) in worst.iter_mut().zip([(&own.a, &other.a), (&own.b, &other.b), (&own.c, &other.c)]) {
                *worst = worst.max(farthest(&case, record.h, own, other));
            }
            let alone = linearize(&case.model, &case.theta, record, false);
            for (worst, (own, alone)) in worst.iter_mut().zip([(&own.a, &alone.a), (&own.b, &alone.b)]) {
                *worst = worst.max(farthest(&case, record.h, own, alone));
            }
        }
        println!("{what}: A {:.1e}, B {:.1e}, C {:.1e}; {touched} contacts", worst[0], worst[1], worst[2]);
        assert!(worst.iter().all(|w| *w < 1e-12), "{what}: {worst:?}");
        assert!(touched >= touches, "{what}");
    }
}
