//! Contact of edges and triangles at rest and sliding: what they rest on is not cut, and friction is Coulomb's.

use crate::common::Case;
use crate::common::shapes::{V3, ball, bar, brick, least_gap};
use pliant_engine::step::StepOptions;
use pliant_scene::{Block, Capsule, Clamp, Cloth, Grid, Gripper, Initial, Integrator, Rope, Scene, Sphere, Time, Touching};

fn last(scene: &Scene, steps: usize) -> (Case, Vec<f64>, Vec<f64>) {
    let case = Case::new(scene, steps);
    let state = case.run(StepOptions { record: false, ..StepOptions::default() }).states.pop().unwrap();
    (case, state.q, state.v)
}

/// Four nodes hung over each shape come to rest on it with edges at the rest gap, held by friction.
#[test]
fn a_rope_of_four_nodes_rests_on_its_edges() {
    for kind in 0..3 {
        let rope = Rope {
            nodes: Some(4),
            length: 0.4,
            stretch_stiffness: 1e3,
            stretch_damping: 2.0,
            bend_stiffness: 1e-2,
            bend_damping: 1e-3,
            drag_linear: 0.5,
            radius: 0.004,
            initial: Initial::Straight { from: [-0.2, 0.002, 0.08], direction: [1.0, 0.02, 0.0] },
            contact: Touching::Edges,
            ..Rope::default()
        };
        let mut scene = Scene { rope: vec![rope], ..Scene::default() };
        scene.time = Time { step: 0.005, duration: 1.0, integrator: Integrator::Euler };
        scene.contact.rest_gap = 1e-7;
        match kind {
            0 => scene.sphere = vec![Sphere { friction: 1.0, ..ball() }],
            1 => scene.capsule = vec![Capsule { a: [0.0, -0.1, 0.0], b: [0.0, 0.1, 0.0], radius: 0.05, friction: 1.0, ..bar() }],
            _ => {
                // an edge along y on top
                let half = std::f64::consts::FRAC_PI_8;
                let quaternion = [half.cos(), 0.0, half.sin(), 0.0];
                scene.block = vec![Block { quaternion, half_extents: [0.04, 0.1, 0.04], friction: 1.0, ..brick() }];
            }
        }
        let (case, q, v) = last(&scene, 400);
        let gap = least_gap(&scene, &case.model, &q);
        let fastest = v.iter().fold(0.0f64, |a, v| a.max(v.abs()));
        println!("shape {kind}: least gap {gap:.2e} m, fastest {fastest:.1e} m/s");
        assert!(gap > 0.0 && gap < 1e-5, "{kind}: {gap}");
        assert!(fastest < 1e-3);
    }
}

/// A coarse sheet rests on a box's corner, and on a ball smaller than its triangles, without being cut.
#[test]
fn a_coarse_sheet_rests_on_a_corner_and_on_a_small_ball() {
    for kind in 0..2 {
        let sheet = Cloth {
            grid: Some(Grid { nodes: [4, 4], size: [0.3, 0.3], ..Grid::default() }),
            // the point under load lies within a triangle
            origin: [-0.17, -0.14, 0.09],
            thickness: 2e-3,
            youngs_modulus: 2e4,
            bend_stiffness: Some(5e-4),
            membrane_damping: 100.0,
            bend_damping: 1e-5,
            drag_normal: 1.0,
            contact: Touching::Edges,
            ..Cloth::default()
        };
        let corners = Clamp::Nodes(vec![0, 3, 12, 15]);
        let hand = Gripper { rope: None, cloth: Some("sheet".into()), clamp: corners, ..Gripper::default() };
        let mut scene = Scene { cloth: vec![sheet], gripper: vec![hand], ..Scene::default() };
        scene.time = Time { step: 0.005, duration: 1.0, integrator: Integrator::Euler };
        scene.contact.rest_gap = 1e-7;
        if kind == 0 {
            // a space diagonal upright
            let axis = V3::new(1.0, 1.0, 1.0).cross(&V3::z()).normalize();
            let angle = (1.0 / 3f64.sqrt()).acos();
            let turn = nalgebra::UnitQuaternion::from_axis_angle(&nalgebra::Unit::new_unchecked(axis), angle);
            let quaternion = [turn.w, turn.i, turn.j, turn.k];
            let half = 0.0879 / 3f64.sqrt();
            scene.block = vec![Block { quaternion, half_extents: [half; 3], friction: 0.5, ..brick() }];
        } else {
            scene.sphere = vec![Sphere { radius: 0.02, center: [0.0, 0.0, 0.068], ..ball() }];
        }
        let (case, q, _) = last(&scene, 200);
        let gap = least_gap(&scene, &case.model, &q);
        println!("shape {kind}: least gap {gap:.2e} m");
        // a ball is sampled at every sixteenth of a triangle's side
        assert!(gap > -1e-9 && gap < if kind == 0 { 1e-5 } else { 2e-3 }, "{kind}: {gap}");
        let mut cut = scene.clone();
        cut.cloth[0].contact = Touching::Nodes;
        let (case, q, _) = last(&cut, 200);
        assert!(least_gap(&cut, &case.model, &q) < -1e-3, "nodes alone let it through");
    }
}

/// A straight edge across two bars that run downhill: friction as on an incline.
#[test]
fn an_edge_on_rails_sticks_and_slides_as_a_block_on_an_incline() {
    const MU: f64 = 0.5;
    let on_rails = |slope: f64, rest_gap: f64| {
        let bars = [-0.05, 0.05].map(|y| Capsule {
            name: if y < 0.0 { "left".into() } else { "right".into() },
            a: [-2.0, y, -0.01],
            b: [0.5, y, -0.01],
            radius: 0.01,
            friction: MU,
        });
        let rope = Rope {
            nodes: Some(2),
            length: 0.2,
            bend_stiffness: 0.0,
            radius: 0.005,
            initial: Initial::Straight { from: [0.0, -0.1, 0.005 + rest_gap], direction: [0.0, 1.0, 0.0] },
            contact: Touching::Edges,
            ..Rope::default()
        };
        let mut scene = Scene { rope: vec![rope], capsule: bars.to_vec(), ..Scene::default() };
        scene.gravity.tilt = [0.0, slope];
        scene.contact.rest_gap = rest_gap;
        scene.time = Time { step: 0.01, duration: 1.0, integrator: Integrator::Euler };
        scene
    };
    for part in [0.3, 0.8, 0.95] {
        let (_, q, v) = last(&on_rails((part * MU).atan(), 1e-9), 100);
        // smoothing lets it creep: δ/h ρ/(μ (1 − ρ²))
        let creep = 1e-9 / 0.01 * part / (MU * (1.0 - part * part));
        println!("at {part} of the friction angle: {:.1e} m/s (formula {creep:.1e}), {:.1e} m", v[0], q[0]);
        assert!(-v[0] < 3.0 * creep && -q[0] < 3.0 * creep, "{part}: {v:?}");
    }
    for excess in [1.05, 1.5, 2.0] {
        let slope = excess * MU.atan();
        let case = Case::new(&on_rails(slope, 1e-9), 60);
        let states = case.run(StepOptions { record: false, ..StepOptions::default() }).states;
        let acceleration = (states[20].v[0] - states[60].v[0]) / 0.4;
        let expected = 9.81 * (slope.sin() - MU * slope.cos());
        println!("at {excess} of it: {acceleration:.6} m/s², {expected:.6}");
        assert!((acceleration / expected - 1.0).abs() < 1e-3, "{excess}: {acceleration}, {expected}");
    }
}

/// Planes are touched by nodes either way: nothing differs.
#[test]
fn on_a_plane_edges_change_nothing() {
    let mut scene = crate::common::scene("resting");
    let (_, q, v) = last(&scene, 40);
    scene.rope[0].contact = Touching::Edges;
    assert_eq!((q, v), {
        let (_, q, v) = last(&scene, 40);
        (q, v)
    });
}

/// A light rope over a bar, a weight at one end, pulled slowly down at the other: T₂/T₁ = e^{μφ} over half a turn.
fn capstan(nodes: usize, mu: f64, contact: Touching) -> f64 {
    const R: f64 = 0.05;
    let (radius, length, edges) = (0.002, 0.6, nodes - 1);
    let lift = R + radius;
    // up on one side, round, and down on the other
    let half = std::f64::consts::PI * lift;
    let leg = 0.5 * (length - half);
    let pitch = length / edges as f64;
    // nodes so that edges touch at their middles
    let outer = lift / (0.5 * pitch / lift).cos() + 1e-4;
    let points = (0..nodes).map(|k| {
        let s = k as f64 * pitch;
        let along = (s - leg) / half;
        match along {
            a if a <= 0.0 => [-outer, 0.0, s - leg],
            a if a >= 1.0 => [outer, 0.0, leg + half - s],
            a => {
                let (sin, cos) = (a * std::f64::consts::PI).sin_cos();
                [-outer * cos, 0.0, outer * sin]
            }
        }
    });
    let weight = 0.2;
    let rope = Rope {
        nodes: Some(nodes),
        length,
        linear_density: 1e-3,
        stretch_stiffness: 2e3,
        stretch_damping: 2.0,
        bend_stiffness: 0.0,
        radius,
        tip_mass: weight,
        initial: Initial::Points { points: points.collect() },
        contact,
        ..Rope::default()
    };
    let motion = pliant_scene::Motion::Line { velocity: [0.0, 0.0, -0.02] };
    let hand = Gripper { clamp: Clamp::Nodes(vec![0]), motion, ..Gripper::default() };
    let bar = Capsule { a: [0.0, -0.2, 0.0], b: [0.0, 0.2, 0.0], radius: R, friction: mu, ..bar() };
    let mut scene = Scene { rope: vec![rope], gripper: vec![hand], capsule: vec![bar], ..Scene::default() };
    scene.time = Time { step: 0.004, duration: 3.0, integrator: Integrator::Euler };
    scene.contact.rest_gap = 1e-7;
    let case = Case::new(&scene, 500);
    let states = case.run(StepOptions { record: false, ..StepOptions::default() }).states;
    // means over the way of some edges
    let tension = |q: &[f64], e: usize| {
        let d: f64 = (0..3).map(|a| (q[3 * e + 3 + a] - q[3 * e + a]).powi(2)).sum::<f64>().sqrt();
        2e3 * (d / pitch - 1.0)
    };
    let late = &states[200..];
    let mean = |e: usize| late.iter().map(|s| tension(&s.q, e)).sum::<f64>() / late.len() as f64;
    mean(0) / mean(edges - 1)
}

#[test]
fn a_rope_over_a_bar_obeys_the_capstan_equation() {
    for mu in [0.2, 0.4] {
        let exact = (mu * std::f64::consts::PI).exp();
        let error = |nodes: usize, contact| {
            let found = capstan(nodes, mu, contact);
            println!("capstan μ = {mu}, {nodes} nodes, {contact:?}: {found:.4}, e^μπ = {exact:.4}");
            (found / exact - 1.0).abs()
        };
        // second order in the edges' length
        let [coarse, fine] = [31, 61].map(|nodes| error(nodes, Touching::Edges));
        assert!(fine < 0.01 && coarse < 0.04 && coarse > 3.0 * fine, "{coarse} {fine}");
        assert!(error(61, Touching::Nodes) < 0.01);
    }
}
