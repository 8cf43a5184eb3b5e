//! Contact where nothing weighs anything: it still has a sharpness, and stops what comes.

use pliant_engine::model::ModelBuilder;
use pliant_engine::step::{StepOptions, Stepper};
use pliant_scene::{Nothing, parse_scene};

const SCENE: &str = r#"
schema_version = 1
[time]
step = 0.005
duration = 1.0
integrator = "euler"
[gravity]
magnitude = 0.0
[[rope]]
name = "rope"
nodes = 5
length = 0.4
linear_density = 0.05
stretch_stiffness = 500.0
bend_stiffness = 1e-3
radius = 0.005
initial = { shape = "straight", from = [0, 0, 0.2], direction = [1, 0, 0.2] }
[[plane]]
name = "wall"
normal = [0, 0, 1]
friction = 0.3
"#;

#[test]
fn what_flies_against_a_wall_is_stopped_by_it() {
    let model = ModelBuilder::new(&parse_scene::<Nothing>(SCENE, "weightless.toml").unwrap()).unwrap().build();
    let mut x = model.initial_state();
    (0..5).for_each(|node| x.v[3 * node + 2] = -1.0);
    let energy = |x: &pliant_math::State| {
        model.kinetic_energy(&x.q, &x.v, model.params().values()) + model.potential_energy(&x.q, &x.z, model.params().values())
    };
    let first = energy(&x);
    let mut stepper = Stepper::new(&model, model.params().values(), StepOptions::default()).unwrap();
    for _ in 0..200 {
        stepper.step(&mut x, &[]).unwrap();
        assert!((0..5).all(|node| x.q[3 * node + 2] > 0.005));
        assert!(energy(&x) <= first * (1.0 + 1e-9));
    }
    assert!(energy(&x) < 0.5 * first, "{first} {}", energy(&x));
}
