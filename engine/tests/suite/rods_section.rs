//! Rods that stiffen and rods with internal friction, against closed forms; what friction costs Newton's method.

use crate::common::{Case, with};
use pliant_engine::equilibrium::equilibrium;
use pliant_engine::model::{Model, ModelBuilder};
use pliant_engine::rollout::{Rollout, rollout};
use pliant_engine::step::StepOptions;
use pliant_scene::{BendFriction, Clamp, End, Gripper, Initial, Integrator, Rope, Scene, Stiffening, Twist, resting_inputs};
use std::sync::Arc;

const INTEGRATORS: [Integrator; 4] = [Integrator::Euler, Integrator::Midpoint, Integrator::Sdirk2, Integrator::QuasiStatic];

/// A polygon with a turning angle φ at every joint, in the plane z = 0.
fn polygon(n: usize, edge: f64, phi: f64) -> Vec<[f64; 3]> {
    let mut points = vec![[0.0; 3]];
    for k in 0..n - 1 {
        let (sin, cos) = (phi * k as f64).sin_cos();
        let last = points[k];
        points.push([last[0] + edge * cos, last[1] + edge * sin, 0.0]);
    }
    points
}

const NODES: usize = 9;
const EDGE: f64 = 0.05;
const EI: f64 = 2e-2;
const EA: f64 = 1e4;

/// Such a rod with all of its nodes held; the first material axis is across its plane.
fn held(phi: f64, step: f64) -> Scene {
    let rope = Rope {
        nodes: Some(NODES),
        length: EDGE * (NODES - 1) as f64,
        bend_stiffness: EI,
        stretch_stiffness: 200.0,
        twist: Some(Twist { stiffness: 1e-2, director: Some([0.0, 0.0, 1.0]), ..Twist::default() }),
        initial: Initial::Points { points: polygon(NODES, EDGE, phi) },
        ..Rope::default()
    };
    let hand = Gripper { name: "hand".into(), clamp: Clamp::Nodes((0..NODES as i64).collect()), ..Gripper::default() };
    let mut scene = Scene { rope: vec![rope], gripper: vec![hand], ..Scene::default() };
    scene.gravity.magnitude = 0.0;
    (scene.time.step, scene.time.duration) = (step, 1.0);
    scene
}

/// On a circle of curvature x a round rod stores ½ EI x² + ¼ c EI x⁴ per length.
#[test]
fn a_bent_rod_stores_what_its_moment_took() {
    for (phi, c) in [(0.4, 0.01), (0.4, -0.003), (0.9, 0.2)] {
        let mut scene = held(phi, 0.01);
        scene.rope[0].stiffening = Some(Stiffening { coefficient: c });
        let case = Case::new(&scene, 1);
        let energy = case.model.potential_energy(&case.x0.q, &case.x0.z, &case.theta);
        let x = 2.0 * (0.5 * phi).tan() / EDGE;
        let exact = EI * (0.5 * x.powi(2) + 0.25 * c * x.powi(4)) * EDGE * (NODES - 2) as f64;
        assert!((energy / exact - 1.0).abs() < 1e-12, "{energy} {exact}");
    }
}

/// Where a light cantilever that is loaded at its tip ends: EI κ (1 + c κ²) = M, M' = −P λ cos θ, θ' = κ, stretched by λ = 1 + P sin θ/EA,
/// by shooting.
fn cantilever(length: f64, load: f64, c: f64) -> [f64; 2] {
    let curvature = |m: f64| {
        let mut x = m / EI;
        for _ in 0..60 {
            x -= (x + c * x.powi(3) - m / EI) / (1.0 + 3.0 * c * x * x);
        }
        x
    };
    let n = 4000;
    let h = length / f64::from(n);
    let slope = |y: [f64; 4]| {
        let stretch = 1.0 + load * y[0].sin() / EA;
        [curvature(y[1]), -load * stretch * y[0].cos(), stretch * y[0].cos(), stretch * y[0].sin()]
    };
    let end = |moment: f64| {
        let mut y = [0.0, moment, 0.0, 0.0];
        for _ in 0..n {
            let add = |d: [f64; 4], by: f64| std::array::from_fn(|k| y[k] + by * d[k]);
            let a = slope(y);
            let b = slope(add(a, 0.5 * h));
            let c = slope(add(b, 0.5 * h));
            let d = slope(add(c, h));
            y = std::array::from_fn(|k| y[k] + h / 6.0 * (a[k] + 2.0 * b[k] + 2.0 * c[k] + d[k]));
        }
        y
    };
    let (mut low, mut high) = (0.0, load * length);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if end(middle)[1] > 0.0 { high = middle } else { low = middle }
    }
    let at = end(low);
    [at[2], at[3]]
}

/// A cantilever's tip against the elastica of its moment: second order in the edges.
#[test]
fn a_loaded_cantilever_is_its_elastica() {
    let (length, mass) = (1.0, 0.012);
    for c in [0.0, 0.3, -0.005] {
        let exact = cantilever(length, mass * 9.81, c);
        let errors = [21, 41, 81].map(|n| {
            let rope = Rope {
                nodes: Some(n),
                length,
                linear_density: 1e-9,
                bend_stiffness: EI,
                stretch_stiffness: EA,
                tip_mass: mass,
                twist: Some(Twist { stiffness: 1e-2, director: Some([0.0, 1.0, 0.0]), ..Twist::default() }),
                stiffening: Some(Stiffening { coefficient: c }),
                initial: Initial::Straight { from: [0.0; 3], direction: [1.0, 0.0, 0.0] },
                ..Rope::default()
            };
            let clamp = Gripper { name: "clamp".into(), clamp: Clamp::End(End::First), ..Gripper::default() };
            let mut scene: Scene = Scene { rope: vec![rope], gripper: vec![clamp], ..Scene::default() };
            scene.gravity.magnitude = 9.81;
            let model = Arc::new(ModelBuilder::new(&scene).unwrap().build());
            let u = resting_inputs(&scene).unwrap();
            let found = equilibrium(&model, model.params().values(), model.initial_positions(), &u).unwrap();
            let at = 3 * (model.ropes()[0].nodes.end - 1);
            (found.q[at] - exact[0]).hypot(-found.q[at + 2] - exact[1])
        });
        println!("c = {c} m²: tip at {exact:.4?}, errors {errors:?}");
        assert!(errors[2] < 1e-3 && errors.windows(2).all(|e| e[0] / e[1] > 3.5), "{c}: {errors:?}");
    }
    // and stiffening is no small thing here
    let [linear, stiff] = [0.0, 0.3].map(|c| cantilever(length, mass * 9.81, c)[1]);
    assert!(stiff < 0.9 * linear, "{stiff} {linear}");
}

fn place(model: &Model, name: &str) -> usize {
    model.memory_names().iter().position(|n| n == name).unwrap()
}

/// A held rod that is bent to and fro between the curvatures ±`most` `cycles` times, each half in `n` steps, begun straight.
fn cycled(most: f64, n: usize, cycles: usize, integrator: Integrator) -> (Rollout, Vec<f64>) {
    let step = 1.0 / n as f64;
    let mut scene = held(0.0, step);
    scene.time.integrator = integrator;
    scene.rope[0].bend_friction = Some(BendFriction { moment: 0.03, curvature: 1.5 });
    let case = Case::new(&scene, 1);
    let mut curvature = vec![0.0];
    let mut towards = |to: f64| {
        let from = *curvature.last().unwrap();
        curvature.extend((1..=n).map(|k| from + (to - from) * k as f64 / n as f64));
    };
    towards(most);
    for _ in 0..cycles {
        towards(-most);
        towards(most);
    }
    let rows: Vec<Vec<f64>> =
        curvature[1..].iter().map(|x| polygon(NODES, EDGE, 2.0 * (0.5 * x * EDGE).atan()).concat()).collect();
    let run = rollout(&case.model, &case.theta, &case.x0, &rows, StepOptions { record: false, max_halvings: Some(0) }).unwrap();
    (run, curvature)
}

/// Cycled between ±κ the friction's moment turns at ±M_f tanh(κ/κ_f), in however many steps, and its loop has 4 M_f (κ − κ_f tanh(κ/κ_f)).
#[test]
fn a_bending_loop_has_its_area() {
    let (moment, over) = (0.03, 1.5);
    for integrator in INTEGRATORS {
        for most in [0.6, 2.0, 6.0] {
            let turned = f64::tanh(most / over);
            for n in [4, 300] {
                let (run, curvature) = cycled(most, n, 16, integrator);
                let k = place(&run.model, "rope.node[4].friction[1]");
                let m: Vec<f64> = run.states.iter().map(|x| moment * x.z[k] / (over * EDGE)).collect();
                let (last, before) = (m[m.len() - 1], m[m.len() - 1 - n]);
                for (value, sign) in [(last, 1.0), (before, -1.0)] {
                    let exact = sign * moment * turned * last.signum();
                    assert!((value - exact).abs() < 1e-7 * moment, "{integrator:?}, {most}/m in {n}: {value} {exact}");
                }
                let first = m.len() - 1 - 2 * n;
                let area: f64 =
                    (first..m.len() - 1).map(|i| 0.5 * (m[i] + m[i + 1]) * (curvature[i + 1] - curvature[i])).sum::<f64>().abs();
                let exact = 4.0 * moment * (most - over * turned);
                assert!(n < 300 || (area / exact - 1.0).abs() < 1e-3, "{integrator:?}, {most}/m: {area} {exact}");
                // what is stored is ½ κ_f M²/M_f per length beside the elastic energy
                let x = &run.states[run.states.len() - 1];
                let energy = run.model.potential_energy(&x.q, &x.z, &run.theta);
                let stored = (0.5 * EI * most * most + 0.5 * over * last * last / moment) * EDGE * (NODES - 2) as f64;
                assert!((energy / stored - 1.0).abs() < 1e-9, "{energy} {stored}");
            }
        }
    }
}

/// A free rod that begins bent and swings.
fn swinging(step: f64, integrator: Integrator, friction: Option<BendFriction>) -> Rollout {
    let mut scene = held(0.35, step);
    scene.gripper.clear();
    scene.time.integrator = integrator;
    scene.rope[0].bend_friction = friction;
    let mut case = Case::new(&scene, (0.1 / step).round() as usize);
    (0..NODES).for_each(|i| case.x0.v[3 * i + 2] = 0.1 * (i as f64).sin());
    case.run(StepOptions { record: false, max_halvings: Some(0) })
}

#[test]
fn friction_dissipates_and_keeps_momentum() {
    let friction = |moment| Some(BendFriction { moment, curvature: 0.5 });
    for integrator in [Integrator::Midpoint, Integrator::Euler, Integrator::Sdirk2] {
        let [free, run] = [None, friction(0.02)].map(|f| swinging(2e-4, integrator, f));
        let [without, with] = [&free, &run].map(|run| run.energy());
        let rise = with.windows(2).map(|e| e[1] - e[0]).fold(f64::MIN, f64::max);
        let end = |e: &[f64]| e[e.len() - 1] / e[0];
        println!("{integrator:?}: {:.4} of the energy without, {:.4} with, largest rise {rise:.1e} J", end(&without), end(&with));
        assert!(end(&with) < 0.7 * end(&without) && rise < 1e-6 * with[0]);
        let mass = run.model.masses(&run.theta);
        let momentum = |v: &[f64], a: usize| (0..mass.len()).map(|i| mass[i] * v[3 * i + a]).sum::<f64>();
        let (before, after) = (&run.states[0].v, &run.states[run.states.len() - 1].v);
        assert!((0..3).all(|a| (momentum(before, a) - momentum(after, a)).abs() < 1e-12));
    }
}

/// A rod that hangs from a hand which waves it, at the step of a hundredth of a second.
fn waved(integrator: Integrator, friction: Option<BendFriction>) -> Rollout {
    let mut scene = with("rod_friction", integrator);
    (scene.rope[0].nodes, scene.rope[0].bend_friction) = (Some(15), friction);
    scene.time.duration = 3.0;
    Case::new(&scene, 300).run(StepOptions { record: false, max_halvings: None })
}

/// Friction no stiffer than the rod costs Newton's method next to nothing; stiffer, or nearly dry (steps bend by many κ_f), some iterations. No
/// step is halved for it.
#[test]
fn newton_finds_its_way_through_turns() {
    let count = |run: &Rollout| {
        let iterations: Vec<usize> = run.traces.iter().map(|t| t.work.iterations).collect();
        let retries: usize = run.traces.iter().map(|t| t.retries).sum();
        (iterations.iter().sum::<usize>() as f64 / iterations.len() as f64, iterations.iter().max().copied().unwrap(), retries)
    };
    for integrator in [Integrator::Euler, Integrator::Midpoint, Integrator::Sdirk2] {
        let (plain, most, retries) = count(&waved(integrator, None));
        println!("{integrator:?}, without: {plain:.2} iterations a step, {most} at most, {retries} retries");
        for (moment, curvature) in [(0.002, 0.8), (0.01, 0.8), (0.1, 0.8), (0.01, 0.1), (0.1, 0.1), (0.01, 0.01)] {
            let (mean, most, retries) = count(&waved(integrator, Some(BendFriction { moment, curvature })));
            println!("  {moment} N·m over {curvature}/m: {mean:.2} iterations a step, {most} at most, {retries} retries");
            let most = if moment / curvature < EI { 1.5 * plain } else { plain + 20.0 };
            assert!(mean < most && retries == 0, "{integrator:?}, {moment} N·m over {curvature}/m: {mean}, {retries}");
        }
    }
}
