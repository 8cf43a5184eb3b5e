//! Closed ropes and rods against closed forms: circles, their vibrations, their squeezing, their buckling under twist.

use crate::common::Case;
use pliant_engine::rollout::Rollout;
use pliant_engine::step::StepOptions;
use pliant_scene::{Clamp, Gripper, Initial, Integrator, Rope, Scene, Twist};
use std::f64::consts::{PI, TAU};

const EI: f64 = 1e-2;
const DENSITY: f64 = 0.05;
/// Of a ring one metre round \[m\].
const RADIUS: f64 = 1.0 / TAU;

/// A ring in the plane z = 0, straight at rest, without weight; its total twist, if it twists, with GJ = EI.
fn ring(nodes: usize, twist: Option<f64>, integrator: Integrator, step: f64) -> Scene {
    let rope = Rope {
        closed: true,
        nodes: Some(nodes),
        linear_density: DENSITY,
        bend_stiffness: EI,
        twist: twist.map(|initial| Twist { stiffness: EI, initial, ..Twist::default() }),
        initial: Initial::Circle { center: [0.0; 3], normal: [0.0, 0.0, 1.0], first: Some([1.0, 0.0, 0.0]) },
        ..Rope::default()
    };
    let mut scene = Scene { rope: vec![rope], ..Scene::default() };
    scene.gravity.magnitude = 0.0;
    (scene.time.step, scene.time.integrator) = (step, integrator);
    scene
}

fn run(case: &Case) -> Rollout {
    case.run(StepOptions { record: false, max_halvings: Some(0) })
}

/// A polygon with its edges at rest length has no tension, and its bending energy π EI/R at once with every edge's angle 2π/n.
#[test]
fn a_circle_stays_and_stores_pi_ei_over_r() {
    let mut errors = Vec::new();
    for nodes in [16, 32, 64] {
        for twist in [None, Some(0.0)] {
            let case = Case::new(&ring(nodes, twist, Integrator::Midpoint, 0.01), 50);
            let run = run(&case);
            let moved = run.states[50].q.iter().zip(&run.states[0].q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(moved < 1e-9, "{nodes}: {moved}");
            let energy = run.energy()[0];
            let polygon = nodes as f64 * EI * (2.0 * (PI / nodes as f64).tan()).powi(2) * nodes as f64 / 2.0;
            assert!((energy / polygon - 1.0).abs() < 1e-10, "{energy} {polygon}");
            errors.push(energy / (PI * EI / RADIUS) - 1.0);
        }
    }
    println!("energy over π EI/R, less one: {errors:.5?}");
    assert!((errors[0] / errors[2] - 4.0).abs() < 0.1 && (errors[2] / errors[4] - 4.0).abs() < 0.1);
}

/// In its plane, with n = 2 waves: ω² = n²(n² − 1)²/(n² + 1) EI/(ρA R⁴).
#[test]
fn a_ring_rings_at_its_frequency() {
    let exact = (4.0 * 9.0 / 5.0 * EI / (DENSITY * RADIUS.powi(4))).sqrt();
    let errors = [20_usize, 40, 80].map(|nodes| {
        let steps = 700;
        let mut case = Case::new(&ring(nodes, None, Integrator::Midpoint, 3.2 * TAU / exact / steps as f64), steps);
        let mode: Vec<[f64; 2]> = (0..nodes)
            .map(|i| {
                let a = TAU * i as f64 / nodes as f64;
                let (out, along) = ((2.0 * a).cos(), -0.5 * (2.0 * a).sin());
                [out * a.cos() - along * a.sin(), out * a.sin() + along * a.cos()]
            })
            .collect();
        for (i, [x, y]) in mode.iter().enumerate() {
            (case.x0.v[3 * i], case.x0.v[3 * i + 1]) = (1e-3 * x, 1e-3 * y);
        }
        let run = run(&case);
        let amplitude = |k: usize| -> f64 {
            let moved = |i: usize, a: usize| run.states[k].q[3 * i + a] - run.states[0].q[3 * i + a];
            mode.iter().enumerate().map(|(i, m)| m[0] * moved(i, 0) + m[1] * moved(i, 1)).sum()
        };
        let zeros: Vec<f64> = (1..steps)
            .filter(|k| amplitude(*k) * amplitude(k + 1) < 0.0)
            .map(|k| k as f64 + amplitude(k) / (amplitude(k) - amplitude(k + 1)))
            .collect();
        // half a period from zero to zero
        let half = (zeros[zeros.len() - 1] - zeros[0]) / (zeros.len() - 1) as f64 * case.model.step_length();
        PI / half / exact - 1.0
    });
    println!("frequency of two waves, relative error with 20, 40, 80 edges: {errors:.5?}");
    assert!(errors[2].abs() < 2e-3 && (errors[0] / errors[1] - 4.0).abs() < 0.5, "{errors:?}");
}

/// Squeezed between two opposite points: δ = (π/4 − 2/π) F R³/EI (Timoshenko, Strength of Materials I, thin rings).
#[test]
fn a_squeezed_ring_yields_as_in_the_textbook() {
    let energy = |nodes: usize, squeeze: f64| {
        let mut scene = ring(nodes, None, Integrator::Euler, 0.05);
        scene.rope[0].bend_damping = 1e-3;
        let finger = |name: &str, node: i64| Gripper { name: name.into(), clamp: Clamp::Nodes(vec![node]), ..Gripper::default() };
        scene.gripper = vec![finger("right", 0), finger("left", nodes as i64 / 2)];
        let mut case = Case::new(&scene, 400);
        for u in &mut case.u {
            (u[0], u[3]) = (u[0] - 0.5 * squeeze, u[3] + 0.5 * squeeze);
        }
        let run = run(&case);
        let n = run.energy().len() - 1;
        run.energy()[n]
    };
    let errors = [20, 40, 80].map(|nodes| {
        let by = 0.01 * RADIUS;
        // what is odd in the displacement cancels
        let stiffness = (energy(nodes, by) + energy(nodes, -by) - 2.0 * energy(nodes, 0.0)) / (by * by);
        stiffness * (PI / 4.0 - 2.0 / PI) * RADIUS.powi(3) / EI - 1.0
    });
    println!("stiffness between two points, relative error with 20, 40, 80 edges: {errors:.5?}");
    assert!(errors[2].abs() < 5e-3 && (errors[0] / errors[1] - 4.0).abs() < 1.0, "{errors:?}");
}

/// Out of the plane: how far the ring goes there in its second wave.
fn out_of_plane(nodes: usize, twist: f64) -> f64 {
    let mut case = Case::new(&ring(nodes, Some(twist), Integrator::Midpoint, 2e-3), 400);
    let wave = |i: usize| (2.0 * TAU * i as f64 / nodes as f64).sin_cos();
    for i in 0..nodes {
        case.x0.v[3 * i + 2] = 1e-6 * wave(i).0;
    }
    let run = run(&case);
    let size = |q: &[f64]| {
        let (s, c) = (0..nodes).fold((0.0, 0.0), |(s, c), i| (s + q[3 * i + 2] * wave(i).0, c + q[3 * i + 2] * wave(i).1));
        s.hypot(c)
    };
    let sizes: Vec<f64> = run.states.iter().map(|x| size(&x.q)).collect();
    let early = sizes[..40].iter().fold(0.0_f64, |m, s| m.max(*s));
    sizes.iter().fold(0.0_f64, |m, s| m.max(*s)) / early
}

/// Michell 1889, Zajac 1962: a ring leaves its plane at a twist of 2π √3 EI/GJ.
#[test]
fn a_twisted_ring_leaves_its_plane_at_two_pi_root_three() {
    let critical = TAU * 3.0_f64.sqrt();
    let (below, above) = (out_of_plane(48, 0.97 * critical), out_of_plane(48, 1.05 * critical));
    println!("out of the plane, over the beginning: {below:.1} below, {above:.1e} above");
    assert!(below < 30.0 && above > 1e3);
}

/// The twist of the whole ring is what it begins with, whole turns or not, and costs GJ φ²/2L.
#[test]
fn a_ring_keeps_the_twist_it_is_joined_with() {
    for twist in [0.0, TAU, 5.0, -11.3, 40.0] {
        let at = |twist| {
            let case = Case::new(&ring(24, Some(twist), Integrator::Midpoint, 0.01), 0);
            case.model.potential_energy(&case.x0.q, &case.x0.z, &case.theta)
        };
        let stored = at(twist) - at(0.0);
        assert!((stored - 0.5 * EI * twist * twist).abs() < 1e-12 * (1.0 + twist * twist), "{twist}: {stored}");
    }
}

/// Where the ring is joined changes nothing for a round section.
#[test]
fn the_seam_is_nowhere() {
    let (nodes, shift) = (24, 7);
    let thrown = |shift: usize| {
        let mut scene = ring(nodes, Some(7.3), Integrator::Midpoint, 5e-3);
        let a = TAU * shift as f64 / nodes as f64;
        scene.rope[0].initial =
            Initial::Circle { center: [0.0; 3], normal: [0.0, 0.0, 1.0], first: Some([a.cos(), a.sin(), 0.0]) };
        let mut case = Case::new(&scene, 60);
        for i in 0..nodes {
            let a = TAU * (i + shift) as f64 / nodes as f64;
            let v = [0.3 * (2.0 * a).cos(), 0.2 * (a + 0.5).sin(), 0.5 * (3.0 * a).cos() + 0.2 * (2.0 * a).sin()];
            case.x0.v[3 * i..3 * i + 3].copy_from_slice(&v);
        }
        let run = run(&case);
        run.states[60].q.clone()
    };
    let (a, b) = (thrown(0), thrown(shift));
    let apart = (0..3 * nodes).map(|k| (b[k] - a[(k + 3 * shift) % (3 * nodes)]).abs()).fold(0.0, f64::max);
    assert!(apart < 1e-8, "{apart}");
}
