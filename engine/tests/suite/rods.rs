//! Rods that twist, against closed forms and invariants.

use crate::common::{Case, with};
use pliant_engine::equilibrium::equilibrium;
use pliant_engine::model::ModelBuilder;
use pliant_engine::rollout::Rollout;
use pliant_engine::step::StepOptions;
use pliant_scene::{Clamp, End, Gripper, Integrator, Rope, Scene, Twist, resting_inputs};
use std::sync::Arc;

/// A straight rod between two clamps, twisted by `turn`; isotropic.
fn twisted(nodes: usize, turn: f64) -> Scene {
    let rope = Rope {
        nodes: Some(nodes),
        bend_stiffness: 0.2,
        twist: Some(Twist { stiffness: 0.05, initial: turn, director: Some([0.0, 0.0, 1.0]), ..Twist::default() }),
        ..Rope::default()
    };
    let clamp = |name: &str, end| Gripper { name: name.into(), clamp: Clamp::End(end), ..Gripper::default() };
    let mut scene =
        Scene { rope: vec![rope], gripper: vec![clamp("left", End::First), clamp("right", End::Last)], ..Scene::default() };
    scene.gravity.magnitude = 0.0;
    scene
}

#[test]
fn a_twisted_rod_resists_with_gj_times_twist_over_length() {
    for (nodes, turn) in [(5, 0.4), (12, 2.0), (30, 11.0)] {
        let mut scene = twisted(nodes, turn);
        let ring = |turn: f64, scene: &mut Scene| {
            scene.rope[0].twist.as_mut().unwrap().initial = turn;
            let model = ModelBuilder::new(scene).unwrap().build();
            let x = model.initial_state();
            model.potential_energy(&x.q, &x.z, model.params().values())
        };
        let energy = ring(turn, &mut scene);
        assert!((energy / (0.5 * 0.05 * turn * turn) - 1.0).abs() < 1e-12, "{energy}");
        let torque = (ring(turn + 1e-4, &mut scene) - ring(turn - 1e-4, &mut scene)) / 2e-4;
        assert!((torque / (0.05 * turn) - 1.0).abs() < 1e-8, "{torque}");
    }
}

/// The twist wanders from a clamp that is turned to the free end: at rest there is none left.
#[test]
fn a_free_end_carries_no_twist() {
    let mut scene = twisted(9, 3.0);
    scene.gripper.pop();
    let model = Arc::new(ModelBuilder::new(&scene).unwrap().build());
    let u = resting_inputs(&scene).unwrap();
    let found = equilibrium(&model, model.params().values(), model.initial_positions(), &u).unwrap();
    let state = found.state();
    let axes = model.material_axes(&state.q, &state.z);
    assert!(axes.iter().all(|d| (d - axes[0]).norm() < 1e-9), "{axes:?}");
    assert!(model.potential_energy(&state.q, &state.z, &found.theta) < 1e-16);
}

/// A free rod that tumbles, flat, curved at rest and spinning about itself.
fn tumbling(step: f64) -> Rollout {
    let mut scene = with("twisting_rod", Integrator::Midpoint);
    scene.gripper.clear();
    scene.gravity.magnitude = 0.0;
    let rope = &mut scene.rope[0];
    (rope.bend_damping, rope.stretch_damping) = (0.0, 0.0);
    rope.twist.as_mut().unwrap().damping = 0.0;
    scene.time.step = step;
    let mut case = Case::new(&scene, (0.25 / step).round() as usize);
    let n = case.model.n_nodes();
    for i in 0..n {
        case.x0.v[3 * i + 1] += 0.4 * i as f64 / n as f64;
    }
    (3 * n..case.x0.v.len()).for_each(|k| case.x0.v[k] = 5.0);
    case.run(StepOptions { record: false, max_halvings: Some(0) })
}

#[test]
fn a_free_rod_keeps_momentum_and_second_order_energy() {
    let drift = [2e-3, 1e-3, 5e-4].map(|step| {
        let run = tumbling(step);
        let (energy, mass) = (run.energy(), run.model.masses(&run.theta));
        let momentum =
            |v: &[f64]| (0..3).map(|a| (0..mass.len()).map(|i| mass[i] * v[3 * i + a]).sum::<f64>()).collect::<Vec<_>>();
        let (before, after) = (momentum(&run.states[0].v), momentum(&run.states[run.states.len() - 1].v));
        assert!(before.iter().zip(&after).all(|(a, b)| (a - b).abs() < 1e-10), "{before:?} {after:?}");
        energy.iter().map(|e| (e - energy[0]).abs()).fold(0.0, f64::max)
    });
    let orders: Vec<f64> = drift.windows(2).map(|d| (d[0] / d[1]).log2()).collect();
    println!("energy drift {drift:?} J, orders {orders:.2?}");
    assert!(orders.iter().all(|p| (p - 2.0).abs() < 0.3), "{drift:?}");
}
