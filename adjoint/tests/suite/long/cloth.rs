//! Sheets of cloth: gradients against differences, and Jacobians by the inverse against tangents.

use crate::common::Case;
use crate::common::sheets::{rippling, thrown};
use crate::judged::demand;
use pliant_adjoint::{Linearization, Seeds, TangentStepper, linearize};
use pliant_engine::step::{StepOptions, StepRecord};
use pliant_math::Vec3;
use pliant_scene::{
    Block, Body, BodyShape, Clamp, Grid, Gripper, Integrator, Joint, JointKind, Law, LinearSolver, Plane, Scene, ShapeKind,
    Sphere,
};

#[test]
fn gradients_of_a_free_sheet() {
    for integrator in [Integrator::Midpoint, Integrator::Euler, Integrator::Sdirk2] {
        let mut scene = thrown(integrator, 0.01, 1.0);
        scene.air.wind = [0.5, 0.0, 1.0];
        (scene.cloth[0].drag_normal, scene.cloth[0].drag_quadratic) = (0.05, 0.3);
        demand(&format!("free {integrator:?}"), &rippling(&scene), 0);
    }
}

#[test]
fn gradients_of_a_held_sheet() {
    let mut scene = thrown(Integrator::Midpoint, 0.01, 1.0);
    let clamp = Clamp::Nodes(vec![0, 1, 2, 3]);
    scene.gripper = vec![Gripper { rope: None, cloth: Some("sheet".to_owned()), clamp, ..Gripper::default() }];
    demand("held", &rippling(&scene), 0);
}

#[test]
fn gradients_of_a_sheet_on_a_ball() {
    for integrator in [Integrator::Euler, Integrator::Sdirk2] {
        let mut scene = thrown(integrator, 0.01, 1.0);
        scene.cloth[0].origin = [-0.2, -0.15, 0.1 + 2e-3];
        scene.cloth[0].velocity = [0.3, 0.1, -1.0];
        scene.sphere = vec![Sphere { name: "ball".to_owned(), center: [0.0, 0.0, 0.0], radius: 0.1, friction: 0.4 }];
        scene.contact.rest_gap = 1e-6;
        gradients_after_landing(&format!("on a ball, {integrator:?}"), &scene);
    }
}

/// Where all forces are elastic, A and B come from the inverse of the matrix; tangents solve for each column. Held by a hand that moves,
/// free, at rest in every step, too soft for the inverse, damped (neither of which takes it), and on a line of slots of its own.
#[test]
fn jacobians_by_the_inverse_are_those_of_tangents() {
    let elastic = |integrator, held: &[i64]| {
        let mut scene = thrown(integrator, 0.05, 0.0);
        scene.time.step = 1e-2;
        let clamp = Clamp::Nodes(held.to_vec());
        let hand = Gripper { rope: None, cloth: Some("sheet".to_owned()), clamp, ..Gripper::default() };
        scene.gripper = if held.is_empty() { Vec::new() } else { vec![hand] };
        scene
    };
    let mut soft = elastic(Integrator::Euler, &[0, 3]);
    soft.cloth[0].youngs_modulus = 1e-2;
    soft.cloth[0].bend_stiffness = Some(1e-9);
    let mut damped = elastic(Integrator::Euler, &[0]);
    damped.cloth[0].membrane_damping = 20.0;
    let mut narrow = elastic(Integrator::Euler, &[0]);
    narrow.solver.linear = LinearSolver::Band;
    let cases = [
        ("held", elastic(Integrator::Euler, &[0, 3]), true),
        ("free", elastic(Integrator::Euler, &[]), true),
        ("quasi-static", elastic(Integrator::QuasiStatic, &[0, 1]), true),
        ("midpoint", elastic(Integrator::Midpoint, &[0]), true),
        ("soft", soft, true),
        ("damped", damped, false),
        ("band", narrow, true),
    ];
    for (what, scene, expected) in cases {
        let mut case = rippling(&scene);
        (0..).zip(&mut case.u).for_each(|(k, u)| u.iter_mut().for_each(|u| *u += 1e-3 * f64::from(k)));
        let run = case.run(StepOptions::default());
        let nu = case.model.nu();
        for record in &run.records {
            assert!(record.stages.iter().all(|(_, stage)| stage.undamped == expected), "{what}");
            let own = linearize(&case.model, &case.theta, record, false);
            let worst = beside_tangents(&case, record, &own).map(|(worst, _)| worst);
            println!("{what}: A {:.1e}, B {:.1e}", worst[0], worst[1]);
            assert!(worst.iter().all(|w| *w < 1e-13), "{what}: {worst:?}");
            assert!(nu == 0 || own.b.iter().any(|x| *x != 0.0));
            let with_theta = linearize(&case.model, &case.theta, record, true);
            assert!(own.a == with_theta.a && own.b == with_theta.b, "{what}");
            let mut theta = Seeds::none(case.model.n_params(), nu, case.model.n_params());
            (0..case.model.n_params()).for_each(|k| theta.add_theta(k, k, 1.0));
            let mut tangents = TangentStepper::new(&case.model, &case.theta, theta);
            tangents.step(record);
            let rows = [&tangents.x.q, &tangents.x.v].into_iter().flatten().zip(&with_theta.c);
            assert!(
                rows.clone().any(|(x, _)| *x != 0.0) && rows.clone().all(|(x, c)| (x - c).abs() <= 1e-13 * (1.0 + x.abs())),
                "{what}"
            );
        }
    }
}

/// Largest difference of A and B of a step from tangents that are solved for column by column, relative to a row's largest entry, and
/// whether they are the same bits.
fn beside_tangents(case: &Case, record: &StepRecord, own: &Linearization) -> [(f64, bool); 2] {
    let (nx, nu, n) = (case.model.ndx(), case.model.nu(), case.model.nv());
    let columns = (nx + nu).next_multiple_of(8);
    let mut seeds = Seeds::none(columns, nu, case.model.n_params());
    (0..nu).for_each(|k| seeds.add_u(k, nx + k, 1.0));
    let mut tangents = TangentStepper::new(&case.model, &case.theta, seeds);
    (0..n).for_each(|k| (tangents.x.q[k * columns + k], tangents.x.v[k * columns + n + k]) = (1.0, 1.0));
    tangents.step(record);
    let rows = [&tangents.x.q, &tangents.x.v].map(|x| x.chunks_exact(columns));
    let mut out = [(0.0_f64, true); 2];
    for (i, row) in rows.into_iter().flatten().enumerate() {
        // (the rest of one in q⁺ = q + h v⁺ where v⁺ = −q/h)
        let least = if i < n { 1.0 } else { f64::MIN_POSITIVE };
        let scale = row.iter().fold(least, |m, x| m.max(x.abs()));
        let parts = [(&own.a[i * nx..(i + 1) * nx], &row[..nx]), (&own.b[i * nu..(i + 1) * nu], &row[nx..nx + nu])];
        for ((worst, same), (own, row)) in out.iter_mut().zip(parts) {
            *worst = own.iter().zip(row).fold(*worst, |m, (a, b)| m.max((a - b).abs() / scale));
            *same &= own == row;
        }
    }
    out
}

/// Steps of nodes in fronts by implicit Euler are linearized from the whole inverse, whatever touches or dissipates: sticking, sliding and
/// without friction, on a ball and in the wind, held, with slots of their own order. What refinement changes, nodes that two shapes hold, bands and other integrators
/// solve for each column.
#[test]
fn jacobians_by_the_whole_inverse_are_those_of_tangents() {
    let landed = |friction: f64, speed: f64, integrator| {
        let mut scene = thrown(integrator, 0.4, 0.0);
        scene.time.step = 1e-2;
        scene.cloth[0].origin = [-0.2, -0.15, 1e-3 + 1e-9];
        scene.cloth[0].velocity = [speed, 0.3 * speed, 0.0];
        scene.plane = vec![Plane { name: "floor".to_owned(), point: [0.0; 3], normal: [0.0, 0.0, 1.0], height: 0.0, friction }];
        scene.solver.linear = LinearSolver::Sparse;
        scene
    };
    let euler = Integrator::Euler;
    let mut ball = landed(0.0, 0.3, euler);
    ball.plane.clear();
    ball.cloth[0].origin = [-0.2, -0.15, 0.101];
    ball.sphere = vec![Sphere { name: "ball".to_owned(), center: [0.0, 0.0, 0.0], radius: 0.1, friction: 0.4 }];
    let mut held = ball.clone();
    let clamp = Clamp::Nodes(vec![0, 3]);
    held.gripper = vec![Gripper { rope: None, cloth: Some("sheet".to_owned()), clamp, ..Gripper::default() }];
    let mut windy = landed(0.5, 0.5, euler);
    windy.plane.clear();
    windy.air.wind = [0.5, 0.0, 1.0];
    (windy.cloth[0].drag_normal, windy.cloth[0].membrane_damping, windy.cloth[0].bend_damping) = (0.05, 20.0, 2e-5);
    let mut damped = landed(0.5, 0.5, euler);
    damped.cloth[0].membrane_damping = 20.0;
    let tilted = |friction: f64, speed: f64| {
        let mut scene = landed(friction, speed, euler);
        let unit = |x: [f64; 3]| Vec3::from(x).normalize();
        let (normal, u) = (unit([0.3, -0.2, 0.9]), unit([0.9, 0.0, -0.3]));
        let v = normal.cross(&u);
        scene.plane[0].normal = normal.into();
        (scene.cloth[0].u_axis, scene.cloth[0].v_axis) = (Some(u.into()), Some(v.into()));
        scene.cloth[0].origin = (normal * (1e-3 + 1e-9) - u * 0.2 - v * 0.15).into();
        scene.cloth[0].velocity = (u * speed).into();
        scene
    };
    let mut slipping = tilted(0.1, 1.0);
    slipping.contact.law = Law::Anitescu;
    let mut corner = landed(0.5, 0.0, euler);
    corner.plane.push(Plane {
        name: "wall".to_owned(),
        point: [0.2, 0.0, 0.0],
        normal: [-1.0, 0.0, 0.0],
        height: 0.0,
        friction: 0.3,
    });
    corner.cloth[0].velocity = [0.2, 0.0, 0.0];
    let mut band = landed(0.5, 0.0, euler);
    band.solver.linear = LinearSolver::Band;
    let cases = [
        ("sticking", landed(0.5, 0.0, euler), true),
        ("in a corner", corner, false),
        ("sliding", landed(0.3, 2.0, euler), false), // (which refinement changes, here and on slopes)
        ("without friction", landed(0.0, 0.5, euler), true),
        ("on a ball", ball, true),
        ("held, on a ball", held, true),
        ("in the wind", windy, true),
        ("damped", damped, true),
        ("quasi-static", landed(0.5, 0.0, Integrator::QuasiStatic), true),
        ("band", band, true),
        ("sticking to a slope", tilted(0.8, 0.0), true),
        ("sliding on a slope", tilted(0.1, 1.0), false),
        ("sliding on a slope, by Anitescu's law", slipping, false),
        ("two stages", landed(0.5, 0.0, Integrator::Sdirk2), false),
    ];
    for (what, scene, expected) in cases {
        let mut case = Case::new(&scene, scene.time.n_steps());
        (0..).zip(&mut case.u).for_each(|(k, u)| u.iter_mut().for_each(|u| *u += 1e-3 * f64::from(k)));
        let run = case.run(StepOptions::default());
        let (mut worst, mut other_bits, mut touched) = ([0.0_f64; 2], false, false);
        for record in run.records.iter().step_by(3) {
            let own = linearize(&case.model, &case.theta, record, false);
            let beside = beside_tangents(&case, record, &own);
            worst.iter_mut().zip(beside).for_each(|(worst, (miss, _))| *worst = worst.max(miss));
            other_bits |= !beside[0].1;
            touched |= record.stages.iter().any(|(_, s)| s.contact_modes(&case.model, &case.theta).iter().any(|m| *m > 0));
        }
        println!("{what}: A {:.1e}, B {:.1e}, other bits {other_bits}", worst[0], worst[1]);
        assert!(worst.iter().all(|w| *w < 1e-12), "{what}: {worst:?}");
        assert_eq!(other_bits, expected, "{what}");
        assert!(touched || what == "in the wind", "{what}");
    }
}

/// Thirty steps until things lie, then five that are checked.
fn gradients_after_landing(what: &str, scene: &Scene) -> Case {
    let case = Case::new(scene, 30);
    let run = case.run(StepOptions { record: false, ..StepOptions::default() });
    let case = Case { x0: run.states[30].clone(), u: case.u[..5].to_vec(), ..case };
    demand(what, &case, 1);
    case
}

#[test]
fn gradients_of_a_sheet_on_a_box() {
    let mut scene = thrown(Integrator::Euler, 0.01, 1.0);
    scene.cloth[0].origin = [-0.2, -0.15, 2e-3];
    scene.cloth[0].velocity = [0.3, 0.1, -0.5];
    let half_extents = [0.1, 0.08, 0.1];
    let position = [0.0, 0.0, -0.1];
    scene.block =
        vec![Block { name: "table".to_owned(), position, half_extents, quaternion: [1.0, 0.0, 0.0, 0.0], friction: 0.4 }];
    scene.contact.rest_gap = 1e-6;
    let case = gradients_after_landing("on a box", &scene);
    // nodes over the table lie on it, half a thickness up; overhanging ones have fallen
    let height = |i: usize| case.x0.q[3 * i + 2];
    let over = (0..20).filter(|&i| case.x0.q[3 * i].abs() < 0.09 && case.x0.q[3 * i + 1].abs() < 0.07);
    assert!(over.clone().count() > 0 && over.clone().all(|i| height(i) > 0.9e-3));
    assert!(height(0) < 0.0);
}

/// A ball of 50 g falls into a sheet that is held at its ends, and is carried.
#[test]
fn gradients_of_a_ball_in_a_sheet() {
    let mut scene = thrown(Integrator::Euler, 0.01, 1.0);
    scene.cloth[0].grid = Some(Grid { nodes: [7, 5], size: [0.4, 0.3], ..Grid::default() });
    scene.cloth[0].origin = [-0.2, -0.15, 0.0];
    let nodes = (0..5).chain(30..35).collect();
    scene.gripper =
        vec![Gripper { rope: None, cloth: Some("sheet".to_owned()), clamp: Clamp::Nodes(nodes), ..Gripper::default() }];
    let shape = BodyShape {
        kind: ShapeKind::Sphere,
        position: [0.0; 3],
        quaternion: [1.0, 0.0, 0.0, 0.0],
        radius: Some(0.08),
        half_length: None,
        half_extents: None,
        points: None,
        friction: Some(0.3),
    };
    let joint = Joint { name: "float".to_owned(), kind: JointKind::Free, ..Joint::default() };
    let ball = Body {
        name: "ball".to_owned(),
        position: [0.01, 0.02, 0.083],
        mass: 0.05,
        inertia: Some([1.3e-4, 1.3e-4, 1.3e-4, 0.0, 0.0, 0.0]),
        joint: vec![joint],
        shape: vec![shape],
        ..Body::default()
    };
    scene.body = vec![ball];
    scene.contact.rest_gap = 1e-6;
    let case = gradients_after_landing("ball in a sheet", &scene);
    let middle = case.x0.q[3 * 17 + 2];
    assert!(middle < -1e-4, "the sheet carries it: {middle}");
}
