//! What joints and motors remember, against closed forms.

use pliant_engine::model::{Model, ModelBuilder};
use pliant_engine::step::{StepOptions, Stepper};
use pliant_math::State;
use pliant_scene::{Actuator, ActuatorKind, Body, Integrator, Joint, JointKind, Presliding, Scene, Time, read_scene};

const INERTIA: f64 = 0.02;
const ALL: [Integrator; 3] = [Integrator::Euler, Integrator::Midpoint, Integrator::Sdirk2];

/// A flywheel about an upright axis.
fn flywheel(joint: Joint, actuators: Vec<Actuator>, step: f64, integrator: Integrator) -> Model {
    let joint = Joint { name: "axle".to_owned(), armature: joint.armature, ..joint };
    let inertia = [0.01, 0.01, INERTIA, 0.0, 0.0, 0.0];
    let body = Body { name: "wheel".to_owned(), mass: 1.0, inertia: Some(inertia), joint: vec![joint], ..Body::default() };
    let actuator = actuators.into_iter().map(|a| Actuator { joint: "axle".to_owned(), ..a }).collect();
    let time = Time { step, duration: 1.0, integrator };
    let scene: Scene = Scene { time, body: vec![body], actuator, ..Scene::default() };
    ModelBuilder::new(&scene).unwrap().build()
}

/// States after each of the commands.
fn run(model: &Model, x0: State, commands: &[f64]) -> Vec<State> {
    let theta = model.params().values().to_vec();
    let mut stepper = Stepper::new(model, &theta, StepOptions { record: false, max_halvings: Some(0) }).unwrap();
    let (mut x, mut out) = (x0, Vec::new());
    for &u in commands {
        let u = if model.nu() > 0 { vec![u] } else { Vec::new() };
        stepper.step(&mut x, &u).unwrap();
        out.push(x.clone());
    }
    out
}

fn near(found: f64, exact: f64, tolerance: f64) {
    assert!((found - exact).abs() <= tolerance * exact.abs().max(1.0), "{found} instead of {exact}");
}

/// The impulse of a lagging motor is that of its differential equation, under every integrator and at any step.
#[test]
fn the_step_response_of_a_lag_is_exact() {
    for integrator in ALL {
        for (h, lag) in [(0.005, 0.03), (0.02, 0.03), (0.02, 0.001), (0.02, 0.0)] {
            let motor = Actuator { lag: Some(lag), ..Actuator::default() };
            let model = flywheel(Joint::default(), vec![motor], h, integrator);
            assert_eq!(model.memory_names(), ["motor.lagged"]);
            for (k, x) in run(&model, model.initial_state(), &[0.3; 40]).iter().enumerate() {
                let t = h * (k + 1) as f64;
                let decayed = if lag > 0.0 { (-t / lag).exp() } else { 0.0 };
                near(x.z[0], 0.3 * (1.0 - decayed), 1e-12);
                near(x.v[0], 0.3 / INERTIA * (t - lag * (1.0 - decayed)), 1e-12);
            }
        }
    }
}

/// A delay of no whole number of steps: the impulse is that of the delayed command.
#[test]
fn a_delay_is_exact_whatever_it_is() {
    let h = 0.005;
    let commands: Vec<f64> = (0..30).map(|k| (1.3 * f64::from(k)).sin()).collect();
    let held = |t: f64| if t < 0.0 { 0.2 } else { commands[(t / h) as usize] };
    for integrator in ALL {
        for delay in [0.0, 0.0012, 0.0123, 0.02, 0.0499] {
            let motor = Actuator { delay: Some(delay), max_delay: Some(0.05), start: Some(0.2), ..Actuator::default() };
            let model = flywheel(Joint::default(), vec![motor], h, integrator);
            assert_eq!(model.nz(), 10);
            // the delayed command changes once within a step, `part` of it after its beginning
            let part = (delay / h).fract();
            let mut v = 0.0;
            for (k, x) in run(&model, model.initial_state(), &commands).iter().enumerate() {
                let begin = h * k as f64 - delay;
                v += h * (part * held(begin + 0.5 * part * h) + (1.0 - part) * held(begin + 0.5 * (1.0 + part) * h)) / INERTIA;
                near(x.v[0], v, 1e-12);
            }
        }
    }
}

#[test]
fn a_delayed_lag_is_exact() {
    let (h, delay, lag) = (0.01, 0.0234, 0.015);
    for integrator in ALL {
        let motor = Actuator { delay: Some(delay), lag: Some(lag), ..Actuator::default() };
        let model = flywheel(Joint::default(), vec![motor], h, integrator);
        for (k, x) in run(&model, model.initial_state(), &[1.0; 20]).iter().enumerate() {
            let t = (h * (k + 1) as f64 - delay).max(0.0);
            near(x.z[model.nz() - 1], 1.0 - (-t / lag).exp(), 1e-12);
            near(x.v[0], (t - lag * (1.0 - (-t / lag).exp())) / INERTIA, 1e-12);
        }
    }
}

/// Another step needs another line for the same delay.
#[test]
fn a_delay_line_is_as_long_as_its_step_needs() {
    let motor = Actuator { delay: Some(0.02), ..Actuator::default() };
    let model = flywheel(Joint::default(), vec![motor], 0.01, Integrator::Euler);
    let finer = model.with_step(0.0025);
    assert_eq!((model.nz(), finer.nz(), finer.initial_state().z.len()), (4, 16, 16));
    let [coarse, fine] = [(&model, 20), (&finer, 80)].map(|(m, n)| run(m, m.initial_state(), &vec![0.5; n])[n - 1].v[0]);
    near(coarse, fine, 1e-12);
    near(coarse, 0.5 * 0.18 / INERTIA, 1e-12);
}

/// What a motor remembers after a stretch of commands is the same whether they were simulated or only primed.
#[test]
fn priming_is_what_simulating_the_commands_leaves() {
    let h = 0.005;
    let commands: Vec<f64> = (0..40).map(|k| (0.4 * f64::from(k)).sin() + 0.5).collect();
    let past: Vec<Vec<f64>> = commands.iter().map(|u| vec![*u]).collect();
    for (delay, lag) in [(None, Some(0.02)), (Some(0.0123), None), (Some(0.0123), Some(0.008)), (Some(0.0), Some(0.0))] {
        let motor = Actuator { delay, max_delay: delay.map(|_| 0.05), lag, start: Some(commands[0]), ..Actuator::default() };
        let model = flywheel(Joint::default(), vec![motor], h, Integrator::Midpoint);
        let simulated = run(&model, model.initial_state(), &commands)[39].z.clone();
        let primed = |theta: &[f64]| {
            let mut z = vec![0.0; model.nz()];
            let slopes = model.prime_signals(&past, theta, &mut z);
            (z, slopes)
        };
        let theta = model.params().values().to_vec();
        let (z, slopes) = primed(&theta);
        z.iter().zip(&simulated).for_each(|(a, b)| near(*a, *b, 1e-12));
        for (name, value) in [("motor.delay", delay), ("motor.lag", lag)] {
            let Some(k) = model.params().find(name).filter(|_| value.is_some_and(|x| x > 0.0)) else { continue };
            let eps = 1e-6;
            let moved = [eps, -eps].map(|d| {
                let mut theta = theta.clone();
                theta[k] += d;
                primed(&theta).0
            });
            for (place, (above, below)) in moved[0].iter().zip(&moved[1]).enumerate() {
                let known = slopes.iter().find(|s| (s.0, s.1) == (place, k)).map_or(0.0, |s| s.2);
                near(known, (above - below) / (2.0 * eps), 1e-6);
            }
        }
    }
}

#[test]
fn a_motor_saturates_before_its_gear() {
    for (u, torque) in [(7.0, 0.3), (-7.0, -0.2), (0.1, 0.1)] {
        let motor = Actuator { gear: 5.0, saturation: Some([-0.2, 0.3]), ..Actuator::default() };
        let model = flywheel(Joint::default(), vec![motor], 0.01, Integrator::Midpoint);
        near(run(&model, model.initial_state(), &[u; 10])[9].v[0], 5.0 * torque * 0.1 / INERTIA, 1e-12);
    }
}

#[test]
fn a_target_moves_by_clipped_steps_from_where_the_joint_is() {
    let servo = Actuator {
        kind: ActuatorKind::Position,
        stiffness: 50.0,
        damping: 2.0,
        gear: 2.0,
        delta_scale: Some(0.1),
        ..Actuator::default()
    };
    let joint = Joint { start: vec![0.4], ..Joint::default() };
    let model = flywheel(joint, vec![servo], 0.01, Integrator::Euler);
    let mut commands = vec![0.5, 3.0, -0.2, -8.0];
    let states = run(&model, model.initial_state(), &commands);
    let targets: Vec<f64> = states.iter().map(|x| x.z[0]).collect();
    for (found, exact) in targets.iter().zip([0.85, 0.95, 0.93, 0.83]) {
        near(*found, exact, 1e-15);
    }
    commands.resize(400, 0.0);
    near(run(&model, model.initial_state(), &commands)[399].q[0], 0.83 / 2.0, 1e-9);
}

/// A joint held where it is (by its inertia) forgets its deflection as e^{−t/τ}; with a yield, what is beyond it.
#[test]
fn relaxation_is_exponential() {
    for integrator in ALL {
        for (h, limit) in [(0.01, None), (0.1, None), (0.03, Some(0.1))] {
            let joint = Joint {
                armature: 1e15,
                stiffness: 3.0,
                plastic_time: Some(0.25),
                yield_at: limit,
                rest: 0.1,
                plastic_start: vec![0.2],
                start: vec![0.9],
                ..Joint::default()
            };
            let model = flywheel(joint, Vec::new(), h, integrator);
            assert_eq!(model.memory_names(), ["axle.plastic"]);
            let yielded = limit.unwrap_or(0.0);
            for (k, x) in run(&model, model.initial_state(), &[0.0; 20]).iter().enumerate() {
                let t = h * (k + 1) as f64;
                near(0.9 - 0.1 - x.z[0], yielded + (0.6 - yielded) * (-t / 0.25).exp(), 1e-12);
            }
        }
    }
}

/// A pair of torque and spring in the end creeps at the rate torque/(k τ + d), whatever the step.
#[test]
fn steady_creep_does_not_depend_on_the_step() {
    let (torque, k, tau, d) = (0.4, 3.0, 0.05, 0.01);
    for integrator in ALL {
        for h in [1.0 / 60.0, 1.0 / 240.0, 1.0 / 1000.0] {
            let joint = Joint { stiffness: k, damping: d, plastic_time: Some(tau), ..Joint::default() };
            let motor = Actuator { offset: torque, ..Actuator::default() };
            let model = flywheel(joint, vec![motor], h, integrator);
            let n = (8.0 / h) as usize;
            let x = run(&model, model.initial_state(), &vec![0.0; n]).pop().unwrap();
            let rate = torque / (k * tau + d);
            near(x.v[0], rate, 1e-9);
            near(x.q[0] - x.z[0], rate * tau, 1e-9);
        }
    }
}

/// I q̈ = T − k e − d q̇, ė = q̇ − R(e)/τ by Runge and Kutta's method at a tiny step.
fn creep_reference(torque: f64, [k, tau, d]: [f64; 3], limit: f64, until: f64) -> [f64; 3] {
    let slope = |[_, v, e]: [f64; 3]| {
        let beyond = e.signum() * (e.abs() - limit).max(0.0);
        [v, (torque - k * e - d * v) / INERTIA, v - beyond / tau]
    };
    by_runge_kutta([0.0; 3], &slope, until)
}

fn by_runge_kutta(start: [f64; 3], slope: &dyn Fn([f64; 3]) -> [f64; 3], until: f64) -> [f64; 3] {
    let add = |x: [f64; 3], s: f64, d: [f64; 3]| std::array::from_fn(|i| x[i] + s * d[i]);
    let n = 200_000;
    let h = until / f64::from(n);
    (0..n).fold(start, |x, _| {
        let a = slope(x);
        let b = slope(add(x, 0.5 * h, a));
        let c = slope(add(x, 0.5 * h, b));
        let e = slope(add(x, h, c));
        std::array::from_fn(|i| x[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + e[i]))
    })
}

/// Errors of q, v and p fall with the integrator's order, with and without yield.
#[test]
fn creep_converges_at_the_order_of_the_integrator() {
    let (torque, law, until) = (0.4, [3.0, 0.08, 0.02], 0.5);
    for limit in [None, Some(0.05)] {
        let [q, v, e] = creep_reference(torque, law, limit.unwrap_or(0.0), until);
        for (integrator, order) in ALL.into_iter().zip([1.0, 2.0, 2.0]) {
            let errors = [200_u16, 400, 800].map(|n| {
                let [k, tau, d] = law;
                let joint = Joint { stiffness: k, damping: d, plastic_time: Some(tau), yield_at: limit, ..Joint::default() };
                let motor = Actuator { offset: torque, ..Actuator::default() };
                let model = flywheel(joint, vec![motor], until / f64::from(n), integrator);
                let x = run(&model, model.initial_state(), &vec![0.0; usize::from(n)]).pop().unwrap();
                ((x.q[0] - q).powi(2) + (x.v[0] - v).powi(2) + (x.z[0] - (q - e)).powi(2)).sqrt()
            });
            let found = (errors[1] / errors[2]).log2();
            println!("{integrator:?}, yield {limit:?}: errors {errors:?}, order {found:.2}");
            assert!((found - order).abs() < 0.15, "{integrator:?}, yield {limit:?}: order {found}, errors {errors:?}");
        }
    }
}

/// A joint that its inertia keeps at its speed meets the friction F (1 − exp(−x/d)) after the way x, whatever the step.
#[test]
fn presliding_grows_along_the_way() {
    let (friction, distance, speed) = (0.3, 0.02, -0.4);
    for integrator in ALL {
        for h in [0.003, 0.05, 0.4] {
            let joint = Joint {
                armature: 1e15,
                velocity: vec![speed],
                presliding: Some(Presliding { friction, distance }),
                ..Joint::default()
            };
            let model = flywheel(joint, Vec::new(), h, integrator);
            assert_eq!(model.memory_names(), ["axle.presliding"]);
            for (k, x) in run(&model, model.initial_state(), &[0.0; 20]).iter().enumerate() {
                let way = speed.abs() * h * (k + 1) as f64;
                near(x.z[0], -distance * (1.0 - (-way / distance).exp()), 1e-9);
            }
        }
    }
}

/// I q̈ = T − F e/d, ė = q̇ − |q̇| e/d by Runge and Kutta's method at a tiny step, from a speed against the torque.
fn presliding_reference(torque: f64, [friction, distance]: [f64; 2], speed: f64, until: f64) -> [f64; 3] {
    let slope = |[_, v, e]: [f64; 3]| [v, (torque - friction * e / distance) / INERTIA, v - v.abs() * e / distance];
    by_runge_kutta([0.0, speed, 0.0], &slope, until)
}

/// Errors of q, v and e fall with the integrator's order, the turn of the motion within.
#[test]
fn presliding_converges_at_the_order_of_the_integrator() {
    let (torque, law, speed, until) = (0.4, [0.3, 0.5], -1.0, 0.5);
    let exact = presliding_reference(torque, law, speed, until);
    assert!(exact[1] > 0.0, "it turns round");
    for (integrator, order) in ALL.into_iter().zip([1.0, 2.0, 2.0]) {
        let errors = [200_u16, 400, 800].map(|n| {
            let [friction, distance] = law;
            let presliding = Some(Presliding { friction, distance });
            let joint = Joint { presliding, velocity: vec![speed], ..Joint::default() };
            let motor = Actuator { offset: torque, ..Actuator::default() };
            let model = flywheel(joint, vec![motor], until / f64::from(n), integrator);
            let x = run(&model, model.initial_state(), &vec![0.0; usize::from(n)]).pop().unwrap();
            let found = [x.q[0], x.v[0], x.z[0]];
            found.iter().zip(exact).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
        });
        let found = (errors[1] / errors[2]).log2();
        println!("{integrator:?}: errors {errors:?}, order {found:.2}");
        assert!((found - order).abs() < 0.15, "{integrator:?}: order {found}, errors {errors:?}");
    }
}

/// Pushed by less than the friction a joint stays where the force has grown to the push, and let go it comes back, but not all the way.
#[test]
fn presliding_holds_and_gives_part_of_the_way_back() {
    let (friction, distance, torque) = (0.3, 0.02, 0.2);
    for integrator in ALL {
        let joint = Joint { presliding: Some(Presliding { friction, distance }), damping: 0.6, ..Joint::default() };
        let model = flywheel(joint, vec![Actuator { gain: torque, ..Actuator::default() }], 1e-3, integrator);
        let commands: Vec<f64> = (0..8000).map(|k| f64::from(k < 4000).min(f64::from(k) / 2000.0)).collect();
        let states = run(&model, model.initial_state(), &commands);
        let (held, released) = (&states[3999], &states[7999]);
        near(held.z[0], distance * torque / friction, 1e-3 * distance);
        near(held.q[0], -distance * (1.0 - torque / friction).ln(), 1e-3 * distance);
        near(released.z[0], 0.0, 1e-3 * distance);
        assert!(released.q[0] > 0.4 * held.q[0] && released.q[0] < 0.6 * held.q[0], "{} of {}", released.q[0], held.q[0]);
    }
}

/// Gain 1 at every joint, ball included, carries an arm: it stays where it is and at rest.
#[test]
fn gravity_compensation_holds_an_arm_still() {
    let mut scene: Scene = read_scene(format!("{}/../tests/scenes/arm_free.toml", env!("CARGO_MANIFEST_DIR"))).unwrap();
    scene.actuator.clear();
    (scene.air.density, scene.air.viscosity) = (0.0, 0.0);
    scene.body.retain(|b| b.joint.iter().all(|j| j.kind != JointKind::Free));
    for joint in scene.body.iter_mut().flat_map(|b| &mut b.joint) {
        (joint.gravity_compensation, joint.stiffness, joint.cubic_stiffness) = (Some(1.0), 0.0, 0.0);
        joint.velocity.clear();
    }
    for integrator in ALL {
        scene.time.integrator = integrator;
        let model = ModelBuilder::new(&scene).unwrap().build();
        let start = model.initial_state();
        assert!(model.bias_forces(&start.q, &start.v, model.params().values()).iter().any(|f| f.abs() > 1.0));
        let end = run(&model, start.clone(), &[0.0; 200]).pop().unwrap();
        let moved = model.difference(&end, &start).iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        println!("{integrator:?}: moved by {moved:.1e}");
        assert!(moved < 1e-12, "{integrator:?}: {moved:e}");
    }
}

#[test]
fn friction_differs_by_direction() {
    let h = 0.005;
    for integrator in ALL {
        for (v0, torque) in [(3.0, -0.1), (-3.0, 0.25)] {
            let joint = Joint { friction: 0.1, friction_backward: Some(0.25), velocity: vec![v0], ..Joint::default() };
            let model = flywheel(joint, Vec::new(), h, integrator);
            for (k, x) in run(&model, model.initial_state(), &[0.0; 40]).iter().enumerate() {
                // what the smoothing leaves of the bound is the rest gap over the way of a step
                near(x.v[0], v0 + torque / INERTIA * h * (k + 1) as f64, 1e-6);
            }
        }
    }
}

/// Friction of the load of the step before: the first step knows that of the start.
#[test]
fn friction_grows_with_the_load() {
    let (h, torque, c, part) = (0.005, 0.4, 0.05, 0.3);
    let joint = Joint { friction: c, load_friction: Some(part), ..Joint::default() };
    let model = flywheel(joint, vec![Actuator { gain: torque, ..Actuator::default() }], h, Integrator::Euler);
    assert_eq!((model.memory_names(), model.initial_state().z), (vec!["axle.load".to_owned()], vec![0.0]));
    for (k, x) in run(&model, model.initial_state(), &[1.0; 30]).iter().enumerate() {
        near(x.v[0], h / INERTIA * ((torque - c) + k as f64 * (torque - c - part * torque)), 1e-6);
        near(x.z[0], torque, 1e-15);
    }
}

/// What fails at a joint is named by the joint.
#[test]
fn errors_name_the_joint() {
    let scene: Scene = read_scene(format!("{}/../tests/scenes/arm_free.toml", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let model = ModelBuilder::new(&scene).unwrap().build();
    let theta = model.params().values().to_vec();
    let mut stepper = Stepper::new(&model, &theta, StepOptions::default()).unwrap();
    let u = vec![0.0; model.nu()];
    let mut fails = |x: &State, u: &[f64]| stepper.step(&mut x.clone(), u).unwrap_err().to_string();
    let start = model.initial_state();
    let mut bad = start.clone();
    bad.q[2] = f64::NAN;
    assert!(fails(&bad, &u).contains("`state` gives NaN at joint `elbow`"), "{}", fails(&bad, &u));
    bad = start.clone();
    bad.v[4] = f64::NAN;
    assert!(fails(&bad, &u).contains("at joint `wrist`, axis y"), "{}", fails(&bad, &u));
    bad = start.clone();
    bad.v[7] = 1e160; // the stone's
    assert!(fails(&bad, &u).contains("`air drag` gives"), "{}", fails(&bad, &u));
    assert!(fails(&start, &[f64::NAN, 0.0]).contains("`torque drive` gives NaN at joint `elbow`"));
    assert_eq!((model.row_name(0), model.row_name(6)), ("joint `shoulder[0]`".to_owned(), "joint `slide`".to_owned()));
}
