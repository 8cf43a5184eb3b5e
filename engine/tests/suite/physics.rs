//! Statics, contact, invariants and convergence against closed forms and ordinary differential equations.

use pliant_engine::equilibrium::equilibrium;
use pliant_engine::model::{Model, ModelBuilder};
use pliant_engine::step::{StepOptions, Stepper};
use pliant_math::State;
use pliant_scene::{
    Clamp, Contact, End, Gripper, Initial, Integrator, Law, Motion, Plane, Rope, Scene, Time, control_rows, resting_inputs,
};
use std::sync::Arc;

const G: f64 = 9.81;
const NODES: [usize; 4] = [21, 41, 81, 161];
const NO_RECORD: StepOptions = StepOptions { record: false, max_halvings: None };

fn build(scene: &Scene) -> Arc<Model> {
    Arc::new(ModelBuilder::new(scene).unwrap().build())
}

fn start(model: &Model) -> State {
    model.initial_state()
}

/// Runs through `controls`, showing every new state to `see`.
fn run(model: &Model, theta: &[f64], mut x: State, controls: &[Vec<f64>], mut see: impl FnMut(&State)) -> State {
    let mut stepper = Stepper::new(model, theta, NO_RECORD).unwrap();
    for u in controls {
        stepper.step(&mut x, u).unwrap();
        see(&x);
    }
    x
}

fn settle(scene: &Scene) -> (Arc<Model>, Vec<f64>) {
    let model = build(scene);
    let u = resting_inputs(scene).unwrap();
    let q = equilibrium(&model, model.params().values(), model.initial_positions(), &u).unwrap().q;
    (model, q)
}

/// Observed order of errors at meshes or steps halved again and again.
fn orders<const N: usize>(errors: [f64; N]) -> Vec<f64> {
    errors.windows(2).map(|e| (e[0] / e[1]).abs().log2()).collect()
}

/// At most 1 % in every quantity at 41 nodes, and second order of all of them together on the finest pair: the error of a
/// single quantity may change its sign between two meshes.
fn second_order<const N: usize>(what: &str, exact: [f64; N], found: [[f64; N]; 4]) {
    let relative = found.map(|f| std::array::from_fn::<f64, N, _>(|i| f[i] / exact[i] - 1.0));
    let together = relative.map(|e| e.iter().map(|e| e * e).sum::<f64>().sqrt());
    let p = orders(together);
    let list = |x: &[f64]| x.iter().map(|x| format!("{x:.1e} ")).collect::<String>();
    println!("{what}: at 41 nodes {}, together {}, orders {p:.2?}", list(&relative[1]), list(&together));
    assert!(relative[1].iter().all(|e| e.abs() < 0.01), "{what}: more than 1 % at 41 nodes");
    assert!((p[2] - 2.0).abs() < 0.15, "{what}: order {p:?}");
}

// ---- Hanging chain -------------------------------------------------------------------------------------------------

/// a of the catenary of unit length and span r: 2 a sinh(r / 2a) = 1.
fn catenary(span: f64) -> f64 {
    bisect(1e-2, 10.0, |a| 1.0 - 2.0 * a * (span / (2.0 * a)).sinh())
}

/// Root of an increasing function.
fn bisect(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if f(middle) < 0.0 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// sag / L and H / wL of a chain of `nodes` nodes.
fn chain(span: f64, nodes: usize) -> [f64; 2] {
    let stiffness = 1e7;
    let rope = Rope {
        nodes: Some(nodes),
        stretch_stiffness: stiffness,
        bend_stiffness: 0.0,
        initial: Initial::Between { from: [0.0; 3], to: [span, 0.0, 0.0], sag: None },
        ..Rope::default()
    };
    let weight = rope.linear_density * G;
    let hold = Gripper { clamp: Clamp::Nodes(vec![0, -1]), ..Gripper::default() };
    let (_, q) = settle(&Scene { rope: vec![rope], gripper: vec![hold], ..Scene::default() });
    let edge = |e: usize| [0, 1, 2].map(|a| q[3 * e + 3 + a] - q[3 * e + a]);
    // horizontal part of the tension, averaged over the edges because EA times a small strain loses digits
    let horizontal = |e: usize| {
        let d = edge(e);
        let length = d.iter().map(|x| x * x).sum::<f64>().sqrt();
        stiffness * (length * (nodes - 1) as f64 - 1.0) * d[0] / length
    };
    let mean = (0..nodes - 1).map(horizontal).sum::<f64>() / (nodes - 1) as f64;
    [-q[3 * (nodes / 2) + 2], mean / weight]
}

#[test]
fn hanging_chain_is_a_catenary() {
    for (span, sag, pull) in [(0.5, 0.398194, 0.114820), (0.9, 0.190709, 0.560094), (0.95, 0.135898, 0.851862)] {
        let a = catenary(span);
        let exact = [a * ((span / (2.0 * a)).cosh() - 1.0), a];
        assert!((exact[0] - sag).abs() < 1e-6 && (exact[1] - pull).abs() < 1e-6);
        let found = NODES.map(|n| chain(span, n));
        second_order(&format!("catenary {span}: sag/L, H/wL"), exact, found);
    }
}

// ---- Elastica ------------------------------------------------------------------------------------------------------

/// v/L, (L − x)/L and end angle of EI θ'' = −(w (L − s) + P) cos θ, θ(0) = 0, θ'(L) = 0; k = wL³/EI, α = PL²/EI.
/// A rope of λ = EI/(EA L²) > 0 also stretches by ε = λ (k σ + α) sin θ, with σ = (L − s)/L from the free end.
fn elastica(k: f64, alpha: f64, lambda: f64) -> [f64; 3] {
    let shoot = |end: f64| {
        let slope = |s: f64, y: [f64; 4]| {
            let (load, (sin, cos)) = (k * s + alpha, y[0].sin_cos());
            let stretch = 1.0 + lambda * load * sin;
            [y[1], -load * stretch * cos, stretch * cos, stretch * sin]
        };
        let steps = 1000;
        let h = 1.0 / f64::from(steps);
        let moved = |y: [f64; 4], d: [f64; 4], h: f64| [0, 1, 2, 3].map(|i| y[i] + h * d[i]);
        (0..steps).fold([end, 0.0, 0.0, 0.0], |y, j| {
            let s = f64::from(j) * h;
            let a = slope(s, y);
            let b = slope(s + 0.5 * h, moved(y, a, 0.5 * h));
            let c = slope(s + 0.5 * h, moved(y, b, 0.5 * h));
            let d = slope(s + h, moved(y, c, h));
            moved(y, [0, 1, 2, 3].map(|i| a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]), h / 6.0)
        })
    };
    let end = bisect(0.0, std::f64::consts::FRAC_PI_2, |end| shoot(end)[0]);
    let y = shoot(end);
    [y[3], 1.0 - y[2], end]
}

/// The same of a rope whose first edge is clamped horizontally.
fn cantilever(k: f64, alpha: f64, nodes: usize) -> [f64; 3] {
    let stiffness = 0.01;
    let rope = Rope {
        nodes: Some(nodes),
        stretch_stiffness: stiffness / LAMBDA,
        bend_stiffness: stiffness,
        linear_density: k * stiffness / G,
        tip_mass: alpha * stiffness / G,
        ..Rope::default()
    };
    let clamp = Gripper { clamp: Clamp::End(End::First), ..Gripper::default() };
    let (model, q) = settle(&Scene { rope: vec![rope], gripper: vec![clamp], ..Scene::default() });
    let tip = 3 * (model.ropes()[0].nodes.end - 1);
    let edge = [q[tip] - q[tip - 3], q[tip + 2] - q[tip - 1]];
    [-q[tip + 2], 1.0 - q[tip], (-edge[1]).atan2(edge[0])]
}

/// EI / (EA L²) of the cantilevers: nearly inextensible.
const LAMBDA: f64 = 1e-6;

fn cantilevers(name: &str, k: f64, alpha: f64, table: [f64; 3]) {
    let ideal = elastica(k, alpha, 0.0);
    assert!(ideal.iter().zip(table).all(|(x, t)| (x - t).abs() < 6e-6), "{name}: {ideal:?} is not {table:?}");
    // a rope must weigh something: under a tip load a 1e-5th of it
    let k = k + 1e-5 * alpha;
    let exact = elastica(k, alpha, LAMBDA);
    let found = NODES.map(|n| cantilever(k, alpha, n));
    second_order(&format!("{name}: v/L, (L-x)/L, end angle"), exact, found);
}

#[test]
fn cantilever_under_its_own_weight() {
    let table = [
        (1.0, [0.12347, 0.00875, 0.16512]),
        (4.0, [0.42516, 0.10989, 0.58859]),
        (8.0, [0.64063, 0.27558, 0.94012]),
        (32.0, [0.87846, 0.67151, 1.46136]),
    ];
    table.into_iter().for_each(|(k, values)| cantilevers(&format!("self-weight k = {k}"), k, 0.0, values));
}

#[test]
fn cantilever_under_a_tip_load() {
    let table = [
        (0.5, [0.16214, 0.01592, 0.24453]),
        (1.0, [0.30172, 0.05643, 0.46135]),
        (2.0, [0.49346, 0.16064, 0.78175]),
        (5.0, [0.71379, 0.38763, 1.21537]),
        (10.0, [0.81061, 0.55500, 1.43029]),
    ];
    table.into_iter().for_each(|(alpha, values)| cantilevers(&format!("tip load α = {alpha}"), 0.0, alpha, values));
}

// ---- Contact -------------------------------------------------------------------------------------------------------

const MU: f64 = 0.5;
const RADIUS: f64 = 0.01;

/// A short rope of three nodes along x, `gap` above a floor; gravity is tilted by `slope`, so that downhill is −x.
fn block(slope: f64, gap: f64, speed: f64, contact: Contact, integrator: Integrator) -> Scene {
    let rope = Rope {
        nodes: Some(3),
        length: 0.1,
        stretch_stiffness: 1e3,
        radius: RADIUS,
        velocity: [speed, 0.0, 0.0],
        initial: Initial::Straight { from: [0.0, 0.0, RADIUS + gap], direction: [1.0, 0.0, 0.0] },
        ..Rope::default()
    };
    let mut scene = Scene { rope: vec![rope], contact, ..Scene::default() };
    scene.plane = vec![Plane { friction: MU, ..Plane::default() }];
    scene.gravity.tilt = [0.0, slope];
    scene.time = Time { step: 0.01, duration: 1.0, integrator };
    scene
}

fn with_gap(rest_gap: f64, law: Law) -> Contact {
    Contact { law, rest_gap, ..Contact::default() }
}

/// Velocity along the slope and height after each of `steps` steps, of every node.
fn slide(scene: &Scene, steps: usize) -> Vec<[[f64; 2]; 3]> {
    let model = build(scene);
    let mut seen = Vec::new();
    let see = |x: &State| seen.push([0, 1, 2].map(|i| [x.v[3 * i], x.q[3 * i + 2] - RADIUS]));
    run(&model, model.params().values(), start(&model), &vec![Vec::new(); steps], see);
    seen
}

#[test]
fn block_sticks_below_the_friction_angle() {
    for (rho, rest_gap) in [(0.3, 1e-9), (0.8, 1e-9), (0.9, 1e-8), (0.8, 1e-7), (0.8, 1e-6)] {
        let slope = (rho * MU).atan();
        // each of sdirk2's stages is a contact solve of length (1 − 1/√2) h
        for (integrator, stage) in [(Integrator::Euler, 0.01), (Integrator::Sdirk2, 0.01 * (1.0 - 0.5_f64.sqrt()))] {
            let creep = rest_gap / stage * rho / (MU * (1.0 - rho * rho));
            let scene = block(slope, rest_gap, 0.0, with_gap(rest_gap, Law::Coulomb), integrator);
            let last = *slide(&scene, 100).last().unwrap();
            let fastest = last.iter().map(|n| n[0].abs()).fold(0.0, f64::max);
            println!("stick ρ = {rho}, δ = {rest_gap:e}, {integrator:?}: {fastest:.2e} m/s, formula {creep:.2e}");
            assert!(last.iter().all(|n| n[0] < 0.0 && -n[0] > creep / 3.0 && -n[0] < creep * 3.0), "{last:?}");
            assert!(rest_gap > 1e-9 || integrator == Integrator::Sdirk2 || fastest <= 1e-6);
        }
    }
}

#[test]
fn block_slides_above_the_friction_angle() {
    for excess in [1.05, 1.3, 2.0] {
        let slope = excess * MU.atan();
        let expected = G * (slope.sin() - MU * slope.cos());
        for integrator in [Integrator::Euler, Integrator::Sdirk2] {
            let seen = slide(&block(slope, 1e-9, 0.0, Contact::default(), integrator), 100);
            for (late, early) in seen[99].iter().zip(&seen[19]) {
                let acceleration = -(late[0] - early[0]) / 0.8;
                assert!((acceleration / expected - 1.0).abs() < 1e-3, "{excess} {integrator:?}: {acceleration}, {expected}");
            }
            let mean = -(seen[99][1][0] - seen[19][1][0]) / 0.8;
            println!("slide at {excess} × friction angle, {integrator:?}: relative error {:.1e}", mean / expected - 1.0);
        }
    }
}

/// The convex law's sliding node rides on a gap μ h |v|; Coulomb's stays at the rest gap.
#[test]
fn convex_law_lifts_sliding_bodies_off() {
    let (h, speed) = (0.01, 1.0);
    let convex = slide(&block(0.0, MU * h * speed, speed, with_gap(1e-9, Law::Anitescu), Integrator::Euler), 8);
    let coulomb = slide(&block(0.0, 1e-9, speed, with_gap(1e-9, Law::Coulomb), Integrator::Euler), 8);
    for node in 0..3 {
        let ([v, gap], [v_coulomb, gap_coulomb]) = (convex[7][node], coulomb[7][node]);
        println!("lift-off: gap / (μ h v) {:.6}, Coulomb {gap_coulomb:.2e} m", gap / (MU * h * v));
        assert!((gap / (MU * h * v) - 1.0).abs() < 1e-3);
        assert!((gap_coulomb / 1e-9 - 1.0).abs() < 0.01);
        assert!((v_coulomb - (speed - 8.0 * h * MU * G)).abs() < 1e-3 * speed);
    }
}

#[test]
fn sdirk2_rests_quietly() {
    let rest = slide(&block(0.0, 1e-9, 0.0, Contact::default(), Integrator::Sdirk2), 200);
    let off = rest.iter().flatten().map(|n| (n[1] - 1e-9).abs()).fold(0.0, f64::max);
    println!("resting, sdirk2: largest departure from the rest gap {off:.1e} m");
    assert!(off < 1e-12);
}

/// Kinetic energy after over before an impact at 1 m/s, for gaps of 0 to 1 times what is travelled in a step.
fn impacts(integrator: Integrator) -> Vec<f64> {
    let after = |part: f64| {
        let mut scene = block(0.0, 1e-8 + part * 0.01, 0.0, Contact::default(), integrator);
        scene.rope[0].velocity = [0.0, 0.0, -1.0];
        scene.gravity.magnitude = 1e-3;
        let model = build(&scene);
        let x = run(&model, model.params().values(), start(&model), &[vec![], vec![], vec![]], |_| ());
        assert!((0..3).all(|i| x.q[3 * i + 2] > RADIUS), "{integrator:?} sinks");
        x.v.iter().map(|v| v * v).sum::<f64>() / 3.0
    };
    (0..=10).map(|k| after(0.1 * f64::from(k))).collect()
}

#[test]
fn euler_impacts_take_the_energy() {
    let ratios = impacts(Integrator::Euler);
    println!("impacts, Euler: kinetic energy after over before {ratios:?}");
    assert!(ratios.iter().all(|r| *r < 1e-6));
}

// ---- Invariants ----------------------------------------------------------------------------------------------------

/// A soft cable held at its first node; its fastest mode has ω = 2 √(EA/ρ) / l = 400 rad/s.
fn pendulum(h: f64, integrator: Integrator) -> Scene {
    let rope = Rope {
        nodes: Some(6),
        length: 0.5,
        stretch_stiffness: 20.0,
        bend_stiffness: 1e-3,
        initial: Initial::Straight { from: [0.0; 3], direction: [0.5, 0.1, -1.0] },
        ..Rope::default()
    };
    let time = Time { step: h, duration: 1.0, integrator };
    Scene { rope: vec![rope], gripper: vec![Gripper::default()], time, ..Scene::default() }
}

/// Energy after every step.
fn energies(h: f64, steps: usize) -> Vec<f64> {
    let model = build(&pendulum(h, Integrator::Midpoint));
    let theta = model.params().values();
    let mut out = Vec::with_capacity(steps);
    let see = |x: &State| out.push(model.kinetic_energy(&x.q, &x.v, theta) + model.potential_energy(&x.q, &x.z, theta));
    run(&model, theta, start(&model), &vec![vec![0.0; 3]; steps], see);
    out
}

#[test]
fn midpoint_energy_error_is_second_order_without_trend() {
    let scale = 0.05 * 0.5 * G * 0.25;
    let model = build(&pendulum(1e-3, Integrator::Midpoint));
    let at_start = model.potential_energy(model.initial_positions(), &[], model.params().values());
    let largest = |e: &[f64]| e.iter().map(|e| (e - at_start).abs()).fold(0.0, f64::max) / scale;
    let errors = [2e-3, 1e-3, 5e-4].map(|h: f64| largest(&energies(h, (1.0 / h).round() as usize)));
    println!("midpoint energy error over 1 s: {errors:?}, orders {:.2?}", orders(errors));
    assert!(orders(errors).iter().all(|p| (p - 2.0).abs() < 0.3), "{errors:?}");

    let steps = ENERGY_STEPS;
    let long = energies(5e-4, steps);
    let mean = |e: &[f64]| e.iter().map(|e| e - at_start).sum::<f64>() / e.len() as f64 / scale;
    let quarters: Vec<f64> = long.chunks(steps / 4).map(mean).collect();
    let drift = (quarters[3] - quarters[0]).abs();
    println!("midpoint energy over {steps} steps at hω = 0.2: largest error {:.2e}, quarter means {quarters:?}", largest(&long));
    assert!(largest(&long) < 5.0 * errors[2], "the error grows with time");
    assert!(drift < 0.5 * errors[2], "the energy drifts: {quarters:?}");
}

const ENERGY_STEPS: usize = 100_000;

#[test]
fn free_rope_keeps_momentum() {
    let rope = Rope { nodes: Some(9), stretch_stiffness: 100.0, stretch_damping: 0.05, bend_stiffness: 5e-3, ..Rope::default() };
    // midpoint keeps angular momentum too, but for bend damping, which brakes a spin about the rope's own tangent
    let cases = [
        (Integrator::Midpoint, 1e-4, false),
        (Integrator::Midpoint, 0.0, true),
        (Integrator::Euler, 1e-4, false),
        (Integrator::Sdirk2, 1e-4, false),
    ];
    for (integrator, bend_damping, angular) in cases {
        let rope = Rope { bend_damping, ..rope.clone() };
        let time = Time { step: 2e-3, duration: 1.0, integrator };
        let mut scene = Scene { rope: vec![rope], time, ..Scene::default() };
        scene.gravity.magnitude = 0.0;
        let model = build(&scene);
        let theta = model.params().values();
        let mass = model.masses(theta);
        let mut x = start(&model);
        x.v = (0..x.v.len()).map(|k| (1.7 * k as f64).sin()).collect();
        let momentum = |x: &State| {
            let (mut p, mut l) = ([0.0; 3], [0.0; 3]);
            for (i, m) in mass.iter().enumerate() {
                let (q, v) = (&x.q[3 * i..3 * i + 3], &x.v[3 * i..3 * i + 3]);
                for a in 0..3 {
                    let (b, c) = ((a + 1) % 3, (a + 2) % 3);
                    p[a] += m * v[a];
                    l[a] += m * (q[b] * v[c] - q[c] * v[b]);
                }
            }
            (p, l)
        };
        let (p0, l0) = momentum(&x);
        let (mut linear, mut turning) = (0.0_f64, 0.0_f64);
        run(&model, theta, x, &vec![Vec::new(); 500], |x| {
            let (p, l) = momentum(x);
            for a in 0..3 {
                linear = linear.max((p[a] - p0[a]).abs());
                turning = turning.max((l[a] - l0[a]).abs());
            }
        });
        let size = mass.iter().sum::<f64>();
        println!("free rope, {integrator:?}: momentum changes by {:.1e} of m·1 m/s, angular {turning:.1e}", linear / size);
        assert!(linear < 1e-10 * size);
        assert!(!angular || turning < 1e-10 * size);
    }
}

/// Drag takes what is missing: without it midpoint keeps the energy, with it the energy only falls.
#[test]
fn drag_takes_energy() {
    let mut scene = pendulum(2e-3, Integrator::Midpoint);
    scene.rope[0].drag_linear = 0.02;
    scene.rope[0].drag_quadratic = 0.02;
    let model = build(&scene);
    let theta = model.params().values();
    let energy = |x: &State| model.kinetic_energy(&x.q, &x.v, theta) + model.potential_energy(&x.q, &x.z, theta);
    let first = energy(&start(&model));
    let last = energy(&run(&model, theta, start(&model), &vec![vec![0.0; 3]; 500], |_| ()));
    let kept = *energies(2e-3, 500).last().unwrap();
    println!("energy after 1 s: {:.4} J with drag, {:.4} J without, {first:.4} J at first", last, kept);
    assert!(last < first - 1e-3 && (kept - first).abs() < 0.05 * (first - last));
}

// ---- Convergence in time -------------------------------------------------------------------------------------------

/// Final state of a smooth swing: the rope rests under tilted gravity, then gravity stands upright; the hand may move.
fn swing(integrator: Integrator, h: f64, moving: bool) -> Vec<f64> {
    let mut scene = pendulum(h, integrator);
    scene.rope[0].stretch_stiffness = 100.0;
    scene.rope[0].stretch_damping = 0.05;
    scene.gravity.tilt = [0.1, 0.4];
    scene.rope[0].initial = Initial::Straight { from: [0.0; 3], direction: [-0.4, 0.1, -1.0] };
    let (_, q) = settle(&scene);
    scene.gravity.tilt = [0.0; 2];
    if moving {
        scene.gripper[0].motion =
            Motion::Sine { amplitude: [0.05, 0.0, 0.02], frequency: 1.0, phase: std::f64::consts::FRAC_PI_2 };
    }
    let model = build(&scene);
    let controls = control_rows(&scene, (0.4 / h).round() as usize).unwrap();
    let x = State { v: vec![0.0; q.len()], q, ..State::default() };
    run(&model, model.params().values(), x, &controls, |_| ()).q
}

#[test]
fn integrators_converge_at_their_order() {
    for (integrator, order) in [(Integrator::Euler, 1.0), (Integrator::Midpoint, 2.0), (Integrator::Sdirk2, 2.0)] {
        for moving in [false, true] {
            let finals = [1.0, 2.0, 4.0, 8.0].map(|f| swing(integrator, 2e-3 / f, moving));
            let apart = |k: usize| finals[k].iter().zip(&finals[k + 1]).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
            let found = orders([apart(0), apart(1), apart(2)]);
            println!("{integrator:?}, moving hand {moving}: differences {:.1e} {:.1e}, orders {found:.2?}", apart(0), apart(2));
            assert!((found[1] - order).abs() < 0.15, "{integrator:?}: {found:?}");
        }
    }
}
