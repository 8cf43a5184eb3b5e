//! Damping of joints by the square of the speed, against a closed form.

use pliant_engine::model::{Model, ModelBuilder};
use pliant_engine::step::{StepOptions, Stepper};
use pliant_math::State;
use pliant_scene::{Body, Gravity, Integrator, Joint, JointKind, Scene, Time, parse_scene, to_toml};

/// Mass [kg], and inertia about every axis [kg·m²].
const MASS: f64 = 2.0;
const INERTIA: f64 = 0.02;
/// Speed at the start [m/s or rad/s]; of a ball the length of (2, −1, 2).
const SPEED: f64 = 3.0;

/// A body that moves freely by one joint, but for its damping.
fn scene(kind: JointKind, damping: f64, velocity: &[f64], step: f64, integrator: Integrator) -> Scene {
    let joint =
        Joint { name: "axle".to_owned(), kind, quadratic_damping: damping, velocity: velocity.to_vec(), ..Joint::default() };
    let inertia = Some([INERTIA, INERTIA, INERTIA, 0.0, 0.0, 0.0]);
    let body = Body { name: "wheel".to_owned(), mass: MASS, inertia, joint: vec![joint], ..Body::default() };
    let gravity = Gravity { magnitude: 0.0, ..Gravity::default() };
    Scene { gravity, time: Time { step, duration: 1.0, integrator }, body: vec![body], ..Scene::default() }
}

fn run(model: &Model, steps: u32) -> State {
    let theta = model.params().values().to_vec();
    let mut stepper = Stepper::new(model, &theta, StepOptions { record: false, max_halvings: Some(0) }).unwrap();
    let mut x = model.initial_state();
    (0..steps).for_each(|_| drop(stepper.step(&mut x, &[]).unwrap()));
    x
}

/// m v̇ = −k |v| v: v = v₀/(1 + r t) and q = v₀ ln(1 + r t)/r with r = k |v₀|/m, forwards and backwards; the axis of a ball stays.
#[test]
fn a_free_joint_slows_down_as_one_over_time() {
    let until = 0.8;
    let balls: [&[f64]; 2] = [&[2.0, -1.0, 2.0], &[-1.0, 2.0, 2.0]];
    let single: [&[f64]; 2] = [&[SPEED], &[-SPEED]];
    for (kind, size, starts) in
        [(JointKind::Prismatic, MASS, single), (JointKind::Revolute, INERTIA, single), (JointKind::Ball, INERTIA, balls)]
    {
        let rate = 2.0;
        let slower = 1.0 + rate * until;
        for (integrator, order) in [(Integrator::Euler, 1.0), (Integrator::Midpoint, 2.0), (Integrator::Sdirk2, 2.0)] {
            for start in starts {
                let errors = [100_u32, 200, 400].map(|steps| {
                    let scene = scene(kind, rate * size / SPEED, start, until / f64::from(steps), integrator);
                    let x = run(&ModelBuilder::new(&scene).unwrap().build(), steps);
                    let slow = x.v.iter().zip(start).map(|(v, v0)| (v - v0 / slower).powi(2)).sum::<f64>().sqrt();
                    let turned = SPEED * slower.ln() / rate;
                    let far = match kind {
                        JointKind::Ball => {
                            let half = 0.5 * turned;
                            let axis = start.iter().map(|v0| v0 / SPEED * half.sin());
                            let exact = std::iter::once(half.cos()).chain(axis);
                            x.q.iter().zip(exact).map(|(q, exact)| (q - exact).powi(2)).sum::<f64>().sqrt()
                        }
                        _ => x.q[0] - turned.copysign(start[0]),
                    };
                    slow.hypot(far)
                });
                let found = (errors[1] / errors[2]).log2();
                println!("{kind:?}, {integrator:?}: errors {errors:?}, order {found:.2}");
                assert!((found - order).abs() < 0.1, "{kind:?}, {integrator:?}: order {found}, errors {errors:?}");
            }
        }
    }
}

/// Along its own motion it takes power k |v|³, of a universal joint axis by axis, and nothing at rest.
#[test]
fn it_takes_power_from_every_axis() {
    let mut scene = scene(JointKind::Universal, 0.01, &[2.0, -1.0], 1e-4, Integrator::Midpoint);
    scene.body[0].joint[0].second_axis = Some([0.0, 1.0, 0.0]);
    let model = ModelBuilder::new(&scene).unwrap().build();
    let force = |v: &[f64]| {
        let mut still = model.initial_state();
        still.v.copy_from_slice(v);
        let theta = model.params().values().to_vec();
        let mut stepper = Stepper::new(&model, &theta, StepOptions { record: false, max_halvings: Some(0) }).unwrap();
        let mut x = still.clone();
        stepper.step(&mut x, &[]).unwrap();
        [0, 1].map(|k| INERTIA * (x.v[k] - still.v[k]) / 1e-4)
    };
    let found = force(&[2.0, -1.0]);
    assert!((found[0] + 0.04).abs() < 1e-5 && (found[1] - 0.01).abs() < 1e-5, "{found:?} N·m");
    assert_eq!(force(&[0.0, 0.0]), [0.0, 0.0]);
}

/// A number of zero, which a fit may free, is an entry of θ and no force; a scene that is written has its number.
#[test]
fn it_sleeps_at_zero_and_is_written() {
    for (kind, unit, velocity) in
        [(JointKind::Revolute, "N·m·s²/rad²", vec![SPEED]), (JointKind::Prismatic, "N·s²/m²", vec![SPEED])]
    {
        let given = scene(kind, 0.3, &velocity, 1e-3, Integrator::Midpoint);
        let again: Scene = parse_scene(&to_toml(&given, "again"), "again.toml").unwrap();
        assert_eq!(again.body[0].joint[0].quadratic_damping, 0.3);
        let model = ModelBuilder::new(&scene(kind, 0.0, &velocity, 1e-3, Integrator::Midpoint)).unwrap().build();
        let info = model.params().find("axle.quadratic_damping").map(|k| model.params().info(k)).unwrap();
        assert_eq!((info.unit, info.lower), (unit, 0.0));
        assert!((run(&model, 100).v[0] - SPEED).abs() < 1e-12);
    }
    // a free body has none
    let free = scene(JointKind::Free, 0.0, &[0.0; 6], 1e-3, Integrator::Midpoint);
    assert_eq!(ModelBuilder::new(&free).unwrap().build().params().find("axle.quadratic_damping"), None);
}
