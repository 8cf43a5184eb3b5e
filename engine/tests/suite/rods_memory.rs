//! Rods that creep and yield: relaxation and flow against closed forms, dissipation, convergence.

use crate::common::{Case, scene};
use pliant_engine::equilibrium::equilibrium;
use pliant_engine::model::{Model, ModelBuilder};
use pliant_engine::rollout::Rollout;
use pliant_engine::step::StepOptions;
use pliant_scene::{Clamp, Creep, End, Gripper, Initial, Integrator, Plasticity, Rope, Scene, Twist, resting_inputs};
use std::sync::Arc;

const INTEGRATORS: [Integrator; 3] = [Integrator::Euler, Integrator::Midpoint, Integrator::Sdirk2];

/// A straight rod between two clamps, twisted evenly; its twist is held.
fn twisted(step: f64, turn: f64) -> Scene {
    let rope = Rope {
        nodes: Some(12),
        bend_stiffness: 0.2,
        twist: Some(Twist { stiffness: 0.05, initial: turn, director: Some([0.0, 0.0, 1.0]), ..Twist::default() }),
        creep: Some(Creep { fraction: 0.5, twist_fraction: Some(0.8), time: 0.3 }),
        ..Rope::default()
    };
    let clamp = |name: &str, end| Gripper { name: name.into(), clamp: Clamp::End(end), ..Gripper::default() };
    let mut scene =
        Scene { rope: vec![rope], gripper: vec![clamp("left", End::First), clamp("right", End::Last)], ..Scene::default() };
    scene.gravity.magnitude = 0.0;
    (scene.time.step, scene.time.duration) = (step, 0.6);
    scene
}

fn place(model: &Model, name: &str) -> usize {
    model.memory_names().iter().position(|n| n == name).unwrap()
}

/// Twisted at once and held: ½ GJ φ²/L (1 + g e^{−2t/τ}), whatever the step and the integrator.
#[test]
fn a_held_twist_relaxes_as_its_closed_form() {
    for integrator in INTEGRATORS {
        for step in [0.1, 0.02] {
            let mut scene = twisted(step, 2.0);
            scene.time.integrator = integrator;
            let mut case = Case::new(&scene, scene.time.n_steps());
            // all of the twist is new to the element
            for node in 0..12 {
                let half = if node == 0 || node == 11 { 0.5 } else { 1.0 };
                case.x0.z[place(&case.model, &format!("rope.node[{node}].creep[2]"))] = 2.0 * half / 11.0;
            }
            let run = case.run(StepOptions { record: false, max_halvings: Some(0) });
            for (k, x) in run.states.iter().enumerate() {
                let energy = case.model.potential_energy(&x.q, &x.z, &case.theta);
                let t = k as f64 * step;
                let exact = 0.5 * 0.05 * 4.0 * (1.0 + 0.8 * (-2.0 * t / 0.3).exp());
                assert!((energy / exact - 1.0).abs() < 1e-10, "{integrator:?}, {step} s, at {t} s: {energy} {exact}");
            }
        }
    }
}

/// A polygon of turning angle φ per joint, all of its nodes held.
fn bent(phi: f64, step: f64) -> Scene {
    let n = 9;
    let mut points = vec![[0.0; 3]];
    for k in 0..n - 1 {
        let (sin, cos) = (phi * k as f64).sin_cos();
        let last = points[k];
        points.push([last[0] + 0.05 * cos, last[1] + 0.05 * sin, 0.0]);
    }
    let rope = Rope {
        nodes: Some(n),
        length: 0.4,
        bend_stiffness: 2e-2,
        bend_damping: 2e-3,
        stretch_stiffness: 200.0,
        stretch_damping: 1.0,
        twist: Some(Twist { stiffness: 1e-2, damping: 1e-4, ..Twist::default() }),
        plasticity: Some(Plasticity { yield_curvature: 4.0, time: 0.2 }),
        initial: Initial::Points { points },
        ..Rope::default()
    };
    let held = Gripper { name: "hand".into(), clamp: Clamp::Nodes((0..n as i64).collect()), ..Gripper::default() };
    let mut scene = Scene { rope: vec![rope], gripper: vec![held], ..Scene::default() };
    scene.gravity.magnitude = 0.0;
    (scene.time.step, scene.time.duration) = (step, 0.4);
    scene
}

/// Held beyond its yield a rod flows by p = k − y − (k − y) e^{−t/τ}; let go, it comes to rest where
/// p is all of its bending.
#[test]
fn a_rod_bent_beyond_its_yield_stays_bent() {
    let phi = 0.5_f64;
    let (k, y) = (2.0 * (0.5 * phi).tan(), 4.0 * 0.05);
    let exact = (k - y) * -(-0.4_f64 / 0.2).exp_m1();
    let mut set = 0.0;
    for step in [0.1, 0.01] {
        let case = Case::new(&bent(phi, step), (0.4 / step).round() as usize);
        let run = case.run(StepOptions { record: false, max_halvings: Some(0) });
        let end = &run.states[run.states.len() - 1];
        let at = |a: usize| end.z[place(&case.model, &format!("rope.node[4].plastic[{a}]"))];
        set = at(0).hypot(at(1));
        assert!((set / exact - 1.0).abs() < 1e-12, "{set} {exact}");
    }
    let mut scene = bent(phi, 0.01);
    scene.gripper.clear();
    scene.time.integrator = Integrator::Euler;
    let held = Case::new(&bent(phi, 0.01), 40);
    let mut free = Case::new(&scene, 2000);
    free.x0 = held.run(StepOptions { record: false, max_halvings: None }).states[40].clone();
    let run = free.run(StepOptions { record: false, max_halvings: None });
    let q = &run.states[2000].q;
    let edge = |i: usize| [0, 1, 2].map(|a| q[3 * i + 3 + a] - q[3 * i + a]);
    let angle = |i: usize| {
        let (a, b) = (edge(i - 1), edge(i));
        (a[0] * b[1] - a[1] * b[0]).atan2(a[0] * b[0] + a[1] * b[1])
    };
    for i in 1..8 {
        let left = 2.0 * (0.5 * angle(i)).tan();
        let at = |a: usize| run.states[2000].z[place(&free.model, &format!("rope.node[{i}].plastic[{a}]"))];
        let plastic = at(0).hypot(at(1));
        assert!((left / plastic - 1.0).abs() < 1e-6, "node {i}: {left} {plastic}");
        // until the elastic part has fallen below the yield, it flows on
        assert!(plastic > set && plastic < 1.1 * set, "{plastic} {set}");
    }
    // within the yield nothing flows
    let case = Case::new(&bent(0.15, 0.01), 40);
    let run = case.run(StepOptions { record: false, max_halvings: Some(0) });
    assert!(run.states[40].z[..14].iter().all(|p| p.abs() < 1e-15));
}

/// A free rod that begins bent and swings.
fn swinging(step: f64, plastic: bool) -> Rollout {
    let mut scene = bent(0.35, step);
    scene.gripper.clear();
    scene.time.integrator = Integrator::Midpoint;
    let rope = &mut scene.rope[0];
    (rope.bend_damping, rope.stretch_damping) = (0.0, 0.0);
    rope.twist.as_mut().unwrap().damping = 0.0;
    rope.creep = Some(Creep { fraction: 0.5, twist_fraction: None, time: 0.02 });
    rope.plasticity = plastic.then_some(Plasticity { yield_curvature: 4.0, time: 0.02 });
    let mut case = Case::new(&scene, (0.1 / step).round() as usize);
    (0..9).for_each(|i| case.x0.v[3 * i + 2] = 0.1 * (i as f64).sin());
    case.run(StepOptions { record: false, max_halvings: Some(0) })
}

#[test]
fn memory_dissipates_and_keeps_momentum() {
    for plastic in [false, true] {
        let run = swinging(2e-4, plastic);
        let energy = run.energy();
        let rise = energy.windows(2).map(|e| e[1] - e[0]).fold(f64::MIN, f64::max);
        println!("energy {:.4e} J to {:.4e} J, largest rise {rise:.1e} J", energy[0], energy[energy.len() - 1]);
        assert!(energy[energy.len() - 1] < 0.7 * energy[0] && rise < 1e-4 * energy[0]);
        let mass = run.model.masses(&run.theta);
        let momentum = |v: &[f64], a: usize| (0..mass.len()).map(|i| mass[i] * v[3 * i + a]).sum::<f64>();
        let (before, after) = (&run.states[0].v, &run.states[run.states.len() - 1].v);
        assert!((0..3).all(|a| (momentum(before, a) - momentum(after, a)).abs() < 1e-12));
    }
}

/// Relaxation of what moves is of second order in the step.
#[test]
fn creep_is_of_second_order() {
    let runs = [4e-4, 2e-4, 1e-4, 5e-5].map(|step| swinging(step, false));
    let ends = runs.each_ref().map(|run| &run.states[run.states.len() - 1].q[..27]);
    let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    let errors: Vec<f64> = ends.windows(2).map(|w| apart(w[0], w[1])).collect();
    let orders: Vec<f64> = errors.windows(2).map(|e| (e[0] / e[1]).log2()).collect();
    println!("{errors:?}, orders {orders:.2?}");
    assert!(orders.iter().all(|p| (p - 2.0).abs() < 0.2), "{orders:?}");
}

/// At an equilibrium the element has relaxed, and plastic parts stay as they are.
#[test]
fn an_equilibrium_is_that_of_long_times() {
    let at_rest = |scene: &Scene| {
        let model = Arc::new(ModelBuilder::new(scene).unwrap().build());
        let u = resting_inputs(scene).unwrap();
        equilibrium(&model, model.params().values(), model.initial_positions(), &u).unwrap().q
    };
    let creeping = scene("rod_creep");
    let mut elastic = creeping.clone();
    elastic.rope[0].creep = None;
    let (a, b) = (at_rest(&creeping), at_rest(&elastic));
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-12));
}
