//! Gradients of rods that twist: through contact, of equilibria, with every kind of clamp.

use crate::common::{Case, scene, with};
use crate::judged::demand;
use pliant_adjoint::{Seeds, equilibrium_jvp_columns};
use pliant_engine::equilibrium::equilibrium;
use pliant_scene::{Clamp, Initial, Integrator, Mode, Plane, Rest, Scene, resting_inputs};

fn passes(what: &str, scene: &Scene, steps: usize, inconclusive: usize) {
    demand(what, &Case::new(scene, steps), inconclusive);
}

#[test]
fn a_hundred_steps_of_a_twisting_rod_have_exact_gradients() {
    for integrator in [Integrator::Euler, Integrator::Midpoint, Integrator::Sdirk2] {
        passes(&format!("{integrator:?}"), &with("twisting_rod", integrator), 100, 0);
    }
}

#[test]
fn so_has_every_kind_of_clamp() {
    let mut turning = scene("twisting_rod");
    turning.gripper[0].mode = Mode::Velocity;
    passes("angular velocity", &turning, 20, 0);
    let mut nodes = scene("twisting_rod");
    (nodes.gripper[0].clamp, nodes.gripper[0].spin) = (Clamp::Nodes(vec![0, 1, 2]), 0.0);
    passes("nodes", &nodes, 20, 0);
    let mut dragged = nodes;
    dragged.gripper[0].mode = Mode::Velocity;
    passes("dragged nodes", &dragged, 20, 0);
}

#[test]
fn so_has_one_that_rests_on_a_floor_or_begins_curled() {
    let mut scene = with("twisting_rod", Integrator::Euler);
    scene.plane = vec![Plane { point: [0.0, 0.0, -0.02], ..Plane::default() }];
    passes("floor", &scene, 20, 1);
    let mut curled = with("twisting_rod", Integrator::Midpoint);
    let rope = &mut curled.rope[0];
    let point = |k: usize| [0.08 * (0.7 * k as f64).cos(), 0.08 * (0.7 * k as f64).sin(), 0.03 * k as f64];
    let fractions = vec![1.0; 7];
    (rope.edge_fractions, rope.initial) = (Some(fractions), Initial::Points { points: (0..8).map(point).collect() });
    rope.length = 7.0 * 0.0625;
    rope.twist.as_mut().unwrap().rest = Rest::Initial;
    passes("curled", &curled, 20, 0);
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
    let jacobian = equilibrium_jvp_columns(&found, &seeds);
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
