//! Cogging of a motor, against a closed form.

use pliant_engine::model::{Model, ModelBuilder};
use pliant_engine::step::{StepOptions, Stepper};
use pliant_math::State;
use pliant_scene::{Body, Cogging, Integrator, Joint, Scene, Time, parse_scene, to_toml};

const INERTIA: f64 = 0.02;
const CYCLES: u32 = 6;
/// Amplitude [N·m] and phase [rad]: f = A sin(n q + φ).
const AMPLITUDE: f64 = 0.3;
const PHASE: f64 = 0.7;

/// A flywheel about an upright axis with cogging alone.
fn scene(step: f64, integrator: Integrator) -> Scene {
    let (n, rate) = (f64::from(CYCLES), rate());
    let joint = Joint {
        name: "axle".to_owned(),
        cogging: Some(Cogging { cycles: CYCLES, sine: AMPLITUDE * PHASE.cos(), cosine: AMPLITUDE * PHASE.sin() }),
        start: vec![(std::f64::consts::PI - PHASE) / n],
        velocity: vec![2.0 * rate / n],
        ..Joint::default()
    };
    let inertia = Some([0.01, 0.01, INERTIA, 0.0, 0.0, 0.0]);
    let body = Body { name: "wheel".to_owned(), mass: 1.0, inertia, joint: vec![joint], ..Body::default() };
    Scene { time: Time { step, duration: 1.0, integrator }, body: vec![body], ..Scene::default() }
}

fn build(step: f64, integrator: Integrator) -> Model {
    ModelBuilder::new(&scene(step, integrator)).unwrap().build()
}

/// ω = √(n A/I) [1/s]: y = n q + φ − π obeys ÿ = −ω² sin y.
fn rate() -> f64 {
    (f64::from(CYCLES) * AMPLITUDE / INERTIA).sqrt()
}

fn run(model: &Model, steps: u32) -> State {
    let theta = model.params().values().to_vec();
    let mut stepper = Stepper::new(model, &theta, StepOptions { record: false, max_halvings: Some(0) }).unwrap();
    let mut x = model.initial_state();
    (0..steps).for_each(|_| drop(stepper.step(&mut x, &[]).unwrap()));
    x
}

/// From the middle of a valley, just fast enough to reach the next summit: y = 4 arctan(exp(ω t)) − π, ẏ = 2 ω/cosh(ω t).
#[test]
fn a_flywheel_climbs_to_the_next_summit() {
    let (n, until) = (f64::from(CYCLES), 0.2);
    let turn = rate() * until;
    let (q, v) = ((4.0 * turn.exp().atan() - PHASE) / n, 2.0 * rate() / n / turn.cosh());
    for (integrator, order) in [(Integrator::Euler, 1.0), (Integrator::Midpoint, 2.0), (Integrator::Sdirk2, 2.0)] {
        let errors = [400_u32, 800, 1600].map(|steps| {
            let x = run(&build(until / f64::from(steps), integrator), steps);
            (x.q[0] - q).hypot((x.v[0] - v) / rate())
        });
        let found = (errors[1] / errors[2]).log2();
        println!("{integrator:?}: errors {errors:?}, order {found:.2}");
        assert!((found - order).abs() < 0.15, "{integrator:?}: order {found}, errors {errors:?}");
    }
}

/// What it takes from the wheel's motion is its potential energy, A cos(n q + φ)/n.
#[test]
fn its_energy_is_potential() {
    let model = build(1e-3, Integrator::Midpoint);
    let theta = model.params().values();
    let energy = |x: &State| model.potential_energy(&x.q, &x.z, theta);
    let (first, last) = (model.initial_state(), run(&model, 100));
    let exact = |x: &State| AMPLITUDE / f64::from(CYCLES) * (f64::from(CYCLES) * x.q[0] + PHASE).cos();
    let (found, expected) = (energy(&last) - energy(&first), exact(&last) - exact(&first));
    assert!((found - expected).abs() < 1e-12 && found > 0.01, "{found} J instead of {expected} J");
}

/// Amplitudes of zero, which a fit may free, are entries of θ and no force; a scene that is written has them.
#[test]
fn it_sleeps_at_zero_and_is_written() {
    let mut scene = scene(1e-3, Integrator::Midpoint);
    let again: Scene = parse_scene(&to_toml(&scene, "again"), "again.toml").unwrap();
    assert_eq!(again.body[0].joint[0].cogging, scene.body[0].joint[0].cogging);
    scene.body[0].joint[0].cogging = Some(Cogging { cycles: CYCLES, sine: 0.0, cosine: 0.0 });
    let model = ModelBuilder::new(&scene).unwrap().build();
    let entries =
        ["axle.cogging_sine", "axle.cogging_cosine"].map(|path| model.params().find(path).map(|k| model.params().info(k)));
    assert!(entries.iter().all(|entry| entry.is_some_and(|info| info.unit == "N·m")));
    assert!((run(&model, 100).v[0] - model.initial_state().v[0]).abs() < 1e-12);
}
