//! Rods that twist, against closed forms and invariants; their gradients through contact, equilibria and every kind of clamp.
#![allow(clippy::unwrap_used)]

mod common;

use common::{Case, scene, with};
use pliant_adjoint::gradcheck::gradcheck;
use pliant_adjoint::{Seeds, equilibrium_tangent};
use pliant_engine::equilibrium::equilibrium;
use pliant_engine::model::ModelBuilder;
use pliant_engine::rollout::Rollout;
use pliant_engine::scene::{Clamp, End, Gripper, Initial, Integrator, Mode, Plane, Rest, Rope, Scene, Twist, resting_inputs};
use pliant_engine::step::StepOptions;
use std::sync::Arc;

fn passes(what: &str, scene: &Scene, steps: usize, switches: bool) {
    let case = Case::new(scene, steps);
    let report = gradcheck(&case.model, &case.theta, &case.x0, &case.u, 7).unwrap();
    println!("{what}: worst {:.1e}, slope {:?}", report.worst_relative_error, report.taylor_slope);
    let failed: Vec<_> = report.blocks.iter().filter(|b| !b.pass).collect();
    assert!(report.pass && failed.is_empty(), "{what}: {failed:#?}");
    assert!(switches || report.contact_switches == 0, "{what}");
}

#[test]
fn a_hundred_steps_of_a_twisting_rod_have_exact_gradients() {
    for integrator in [Integrator::Euler, Integrator::Midpoint, Integrator::Sdirk2] {
        passes(&format!("{integrator:?}"), &with("twisting_rod", integrator), 100, false);
    }
}

#[test]
fn so_has_every_kind_of_clamp() {
    let mut turning = scene("twisting_rod");
    turning.gripper[0].mode = Mode::Velocity;
    passes("angular velocity", &turning, 20, false);
    let mut nodes = scene("twisting_rod");
    (nodes.gripper[0].clamp, nodes.gripper[0].spin) = (Clamp::Nodes(vec![0, 1, 2]), 0.0);
    passes("nodes", &nodes, 20, false);
    let mut dragged = nodes;
    dragged.gripper[0].mode = Mode::Velocity;
    passes("dragged nodes", &dragged, 20, false);
}

#[test]
fn so_has_one_that_rests_on_a_floor_or_begins_curled() {
    let mut scene = with("twisting_rod", Integrator::Euler);
    scene.plane = vec![Plane { point: [0.0, 0.0, -0.02], ..Plane::default() }];
    passes("floor", &scene, 20, true);
    let mut curled = with("twisting_rod", Integrator::Midpoint);
    let rope = &mut curled.rope[0];
    let point = |k: usize| [0.08 * (0.7 * k as f64).cos(), 0.08 * (0.7 * k as f64).sin(), 0.03 * k as f64];
    let fractions = vec![1.0; 7];
    (rope.edge_fractions, rope.initial) = (Some(fractions), Initial::Points { points: (0..8).map(point).collect() });
    rope.length = 7.0 * 0.0625;
    rope.twist.as_mut().unwrap().rest = Rest::Initial;
    passes("curled", &curled, 20, false);
}

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

/// The equilibrium's derivatives by all parameters and controls, against differences of the states found.
#[test]
fn equilibria_have_exact_derivatives() {
    let scene = scene("twisting_rod");
    let case = Case::new(&scene, 0);
    let u = resting_inputs(&scene).unwrap();
    let solve = |u: &[f64], theta: &[f64]| equilibrium(&case.model, theta, &case.x0.q, u).unwrap();
    let found = solve(&u, &case.theta);
    let (nu, np) = (u.len(), case.theta.len());
    let mut seeds = Seeds::none(nu + np, nu, np);
    (0..nu).for_each(|k| seeds.add_u(k, k, 1.0));
    (0..np).for_each(|k| seeds.add_theta(k, nu + k, 1.0));
    let jacobian = equilibrium_tangent(&found, &seeds);
    for k in 0..nu + np {
        let moved = |by: f64| {
            let (mut u, mut theta) = (u.clone(), case.theta.clone());
            if k < nu {
                u[k] += by
            } else {
                theta[k - nu] += by
            }
            case.model.difference(&solve(&u, &theta).state(), &found.state())
        };
        let size = if k < nu { 1.0 } else { case.theta[k - nu].abs().max(1e-3) };
        if k >= nu && case.theta[k - nu] == case.model.params().info(k - nu).lower {
            continue; // a difference would leave the range
        }
        let step = 1e-5 * size;
        let (up, down) = (moved(step), moved(-step));
        let largest = (0..case.model.nv()).fold(0.0_f64, |m, r| m.max(jacobian[r * (nu + np) + k].abs()));
        for r in 0..case.model.nv() {
            let slope = (up[r] - down[r]) / (2.0 * step);
            let error = (jacobian[r * (nu + np) + k] - slope).abs();
            assert!(error <= 1e-6 * largest + 1e-9 / size, "input {k}, row {r}: {slope} {}", jacobian[r * (nu + np) + k]);
        }
    }
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
