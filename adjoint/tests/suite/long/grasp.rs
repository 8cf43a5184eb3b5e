//! Gradients of grippers that grasp: exact where they hold, zero out of reach, and useful there if they are smoothed.

use crate::common::{Case, scene, with};
use crate::judged::demand;
use pliant_adjoint::{Along, RolloutCotangent, Smoothing, Surrogate, rollout_vjp, surrogate_rollout};
use pliant_engine::grasp::Grasping;
use pliant_engine::rollout::{Rollout, RolloutOptions, rollout};
use pliant_engine::step::{StepOptions, Stepper};
use pliant_math::State;
use pliant_scene::{Clamp, Gripper, Initial, Integrator, Mode, Plane, Rope, Scene, Time};

const ALL: [Integrator; 4] = [Integrator::Euler, Integrator::Midpoint, Integrator::Sdirk2, Integrator::QuasiStatic];

fn phases(run: &Rollout, gripper: usize) -> Vec<bool> {
    run.states.iter().map(|x| run.model.grasps()[gripper].held(&x.z).is_some()).collect()
}

/// Seizing, holding and letting go.
#[test]
fn rollouts_under_every_integrator() {
    for name in ["grasp_rope", "grasp_cloth"] {
        for integrator in ALL {
            let case = Case::new(&with(name, integrator), if name == "grasp_rope" { 50 } else { 15 });
            let run = case.run(StepOptions::default());
            let held = phases(&run, 0);
            assert!(!held[0] && held[12], "{name}: seized");
            assert!(name != "grasp_rope" || !held[50], "{name}: let go");
            let of = |path: &str| case.model.params().find(path).unwrap();
            let gradient = rollout_vjp(&run, &case.x_bar()).unwrap();
            let hand = &case.model.grasps()[0].name;
            for key in ["stiffness", "steepness", "closing_time"] {
                assert!(gradient.theta[of(&format!("{hand}.{key}"))] != 0.0, "{name}: {key} matters");
            }
            demand(&format!("{name} {integrator:?}"), &case, 0);
        }
    }
}

/// A rollout that begins with something held: the held point and its distance are state like any other.
#[test]
fn a_state_with_something_in_hand() {
    for (name, integrator) in [("grasp_rope", Integrator::Sdirk2), ("grasp_cloth", Integrator::Euler)] {
        let case = Case::new(&with(name, integrator), 30);
        let run = case.run(StepOptions::default());
        let case = Case { x0: run.states[8].clone(), u: case.u[8..28].to_vec(), ..case };
        assert!(case.model.grasps()[0].held(&case.x0.z).is_some());
        let report = demand(&format!("{name} in hand"), &case, 0);
        let of_z = report.blocks.iter().find(|b| b.name == "x0.z").unwrap();
        assert!(of_z.derivative.abs() > 0.0, "{of_z:?}");
    }
}

#[test]
fn a_hundred_steps() {
    let mut scene = scene("grasp_rope");
    scene.time.step = 0.003;
    let case = Case::new(&scene, 100);
    demand("a hundred steps", &case, 0);
}

/// Steps without momentum, with contact, a grasp, bodies, rods.
#[test]
fn quasi_static_rollouts() {
    for name in ["quasi_static", "windy", "twisting_rod", "arm_plastic", "cloth_hung"] {
        let mut scene = with(name, Integrator::QuasiStatic);
        scene.contact.rest_gap = scene.contact.rest_gap.max(1e-6);
        let case = Case::new(&scene, if name == "cloth_hung" { 8 } else { 25 });
        // a contact switches with every change of x0.q; friction and stiction of size zero
        let kinks = [("quasi_static", 1), ("arm_plastic", 3)].into_iter().find(|(of, _)| *of == name);
        demand(name, &case, kinks.map_or(0, |(_, n)| n));
        // velocities before the first step are forgotten
        let gradient = rollout_vjp(&case.run(StepOptions::default()), &case.x_bar()).unwrap();
        let nv = case.model.nv();
        let by_x0 = &gradient.x0[nv..2 * nv];
        let own = &case.x_bar()[0][nv..2 * nv];
        assert_eq!(by_x0, own, "{name}");
    }
}

/// A rope on the floor, and a hand 10 cm away from it: beside and above.
fn lift() -> Scene {
    let rope = Rope {
        nodes: Some(9),
        length: 0.2,
        linear_density: 0.02,
        stretch_stiffness: 50.0,
        stretch_damping: 0.02,
        bend_stiffness: 2e-5,
        bend_damping: 1e-6,
        radius: 0.004,
        initial: Initial::Straight { from: [-0.1, 0.0, 0.004], direction: [1.0, 0.0, 0.0] },
        ..Rope::default()
    };
    let grasp = pliant_scene::Grasp {
        at: [0.013, 0.06, 0.084],
        radius: 0.015,
        stiffness: 40.0,
        closing_time: 0.05,
        smoothing: 3e-3,
        tail: 0.02,
        ..Default::default()
    };
    let hand = Gripper { mode: Mode::Velocity, clamp: Clamp::Grasp(grasp), ..Gripper::default() };
    let mut scene = Scene { rope: vec![rope], gripper: vec![hand], ..Scene::default() };
    scene.plane = vec![Plane { name: "floor".into(), friction: 0.5, ..Plane::default() }];
    scene.time = Time { step: 0.02, duration: 0.8, integrator: Integrator::Euler };
    scene
}

/// Two velocities, one after the other, as controls.
fn controls(v: &[f64; 6], n: usize) -> Vec<Vec<f64>> {
    (0..n).map(|k| [&v[if k < n / 2 { 0..3 } else { 3..6 }], &[1.0]].concat()).collect()
}

/// Gradient by the two velocities.
fn by_velocities(gradient: &RolloutCotangent) -> [f64; 6] {
    let n = gradient.u.len();
    let mut out = [0.0; 6];
    for (k, u) in gradient.u.iter().enumerate() {
        (0..3).for_each(|a| out[if k < n / 2 { a } else { 3 + a }] += u[a]);
    }
    out
}

/// ½ (mean height − goal)² of the rope at the end, and its cotangent.
fn height_error(case: &Case, run: &Rollout, goal: f64) -> (f64, Vec<Vec<f64>>) {
    let nodes = case.model.ropes()[0].nodes.clone();
    let last = run.states.last().unwrap();
    let mean = nodes.clone().map(|i| last.q[3 * i + 2]).sum::<f64>() / nodes.len() as f64;
    let mut x_bar = vec![vec![0.0; case.model.ndx()]; run.states.len()];
    nodes.clone().for_each(|i| x_bar.last_mut().unwrap()[3 * i + 2] = (mean - goal) / nodes.len() as f64);
    (0.5 * (mean - goal).powi(2), x_bar)
}

fn smoothed(case: &Case, along: Along, rest_gap: f64) -> Surrogate<Rollout> {
    let smoothing = Smoothing { rest_gap, grasp: Grasping::Smooth, along };
    surrogate_rollout(&case.model, &case.theta, &case.x0, &case.u, StepOptions::default(), smoothing).unwrap()
}

/// Out of reach the exact gradient is zero; descent by the smoothed one finds the rope and lifts it.
#[test]
fn a_gripper_ten_centimetres_away_finds_the_rope_and_lifts_it() {
    const GOAL: f64 = 0.05;
    let mut case = Case::new(&lift(), 40);
    let n = case.u.len();
    let mut v = [0.0; 6];
    let mut errors = Vec::new();
    for iteration in 0..200 {
        case.u = controls(&v, n);
        let run = smoothed(&case, Along::Hard, 1e-3);
        let (error, x_bar) = height_error(&case, run.as_ref(), GOAL);
        if iteration == 0 {
            let hard = case.run(StepOptions::default());
            assert_eq!(run.as_ref().states, hard.states, "forward stays hard");
            let exact = by_velocities(&rollout_vjp(&hard, &x_bar).unwrap());
            assert_eq!(exact, [0.0; 6], "out of reach");
        }
        let g = by_velocities(&run.vjp(&x_bar).unwrap().into_unmarked());
        let size = g.iter().map(|x| x * x).sum::<f64>().sqrt();
        assert!(size > 0.0 && size.is_finite());
        errors.push(error);
        if error < 1e-3 * errors[0] {
            break;
        }
        // steps of fixed length: the slope far away is thousands of times smaller than in hand
        let step = 0.01 / size;
        v.iter_mut().zip(g).for_each(|(v, g)| *v -= step * g);
    }
    let (first, last) = (errors[0], errors[errors.len() - 1]);
    println!("{} iterations, error {first:.2e} → {last:.2e}", errors.len());
    assert!(last < 1e-2 * first);
}

/// A rollout of smoothed grasps is a function like any other: differences confirm its gradient.
#[test]
fn a_smooth_rollout_agrees_with_its_differences() {
    let mut scene = lift();
    scene.gripper[0].motion = pliant_scene::Motion::Line { velocity: [0.0, -0.02, -0.05] };
    let case = Case::new(&scene, 30);
    let gap = 1e-4;
    let surrogate = smoothed(&case, Along::Smooth, gap);
    let x_bar = case.x_bar();
    let gradient = surrogate.vjp(&x_bar).unwrap().into_unmarked();
    let few = RolloutOptions { max_records: Some(7), ..RolloutOptions::default() };
    let checkpointed = surrogate_rollout(&case.model, &case.theta, &case.x0, &case.u, few, surrogate.smoothing());
    assert_eq!(checkpointed.unwrap().vjp(&x_bar).unwrap().into_unmarked(), gradient);
    let loss = |theta: &[f64], x0: &State, u: &[Vec<f64>]| {
        let options = StepOptions { record: false, ..Default::default() };
        let mut stepper =
            Stepper::new(&case.model, theta, options).unwrap().with_rest_gap(gap).unwrap().with_grasping(Grasping::Smooth);
        let mut states = vec![x0.clone()];
        for u in u {
            let mut state = states[states.len() - 1].clone();
            stepper.step(&mut state, u).unwrap();
            states.push(state);
        }
        states.iter().zip(&x_bar).map(|(x, w)| x.to_flat().iter().zip(w).map(|(x, w)| x * w).sum::<f64>()).sum::<f64>()
    };
    let fourth = |f: &dyn Fn(f64) -> f64, e: f64| (8.0 * (f(e) - f(-e)) - f(2.0 * e) + f(-2.0 * e)) / (12.0 * e);
    let p = 3 * case.model.grasps()[0].node;
    for a in 0..3 {
        let moved = |e: f64| {
            let mut x0 = case.x0.clone();
            x0.q[p + a] += e;
            loss(&case.theta, &x0, &case.u)
        };
        let pushed = |e: f64| {
            let mut u = case.u.clone();
            u[4][a] += e;
            loss(&case.theta, &case.x0, &u)
        };
        for (what, exact, difference) in
            [("position", gradient.x0[p + a], fourth(&moved, 1e-5)), ("velocity", gradient.u[4][a], fourth(&pushed, 1e-3))]
        {
            println!("{what}[{a}]: {exact:.9e} {difference:.9e}");
            assert!((exact - difference).abs() <= 1e-6 * exact.abs().max(1e-6), "{what}[{a}]");
        }
    }
    for key in ["stiffness", "steepness", "radius", "smoothing", "tail", "tail_reach"] {
        let k = case.model.params().find(&format!("hand.{key}")).unwrap();
        let changed = |e: f64| {
            let mut theta = case.theta.clone();
            theta[k] *= 1.0 + e;
            loss(&theta, &case.x0, &case.u)
        };
        let (exact, difference) = (gradient.theta[k] * case.theta[k], fourth(&changed, 1e-3));
        println!("{key}: {exact:.9e} {difference:.9e}");
        assert!((exact - difference).abs() <= 1e-6 * exact.abs() + 1e-11, "{key}");
        assert!(exact != 0.0 || ["radius", "smoothing"].contains(&key), "{key} is felt");
    }
    let closing = |e: f64| {
        let mut u = case.u.clone();
        u[4][3] += e;
        loss(&case.theta, &case.x0, &u)
    };
    let (exact, difference) = (gradient.u[4][3], fourth(&closing, 1e-3));
    assert!((exact / difference - 1.0).abs() < 1e-6, "closing: {exact:e} {difference:e}");
    // and without the smoothing there is nothing
    let hard = rollout(&case.model, &case.theta, &case.x0, &case.u, StepOptions::default()).unwrap();
    assert_eq!(rollout_vjp(&hard, &x_bar).unwrap().u[4][3], 0.0);
}
