//! Gradients of rods that creep and yield.

use crate::common::{Case, with};
use crate::judged::demand;
use pliant_adjoint::rollout_vjp;
use pliant_engine::rollout::{Rollout, rollout};
use pliant_engine::step::StepOptions;
use pliant_scene::{Creep, Integrator, Scene};

const INTEGRATORS: [Integrator; 3] = [Integrator::Euler, Integrator::Midpoint, Integrator::Sdirk2];

fn passes(what: &str, scene: &Scene, steps: usize) {
    demand(what, &Case::new(scene, steps), 0);
}

#[test]
fn a_hundred_steps_of_a_creeping_rod_have_exact_gradients() {
    for integrator in INTEGRATORS {
        passes(&format!("{integrator:?}"), &with("rod_creep", integrator), 100);
    }
}

#[test]
fn so_have_those_of_a_plastic_one() {
    for integrator in INTEGRATORS {
        passes(&format!("{integrator:?}"), &with("rod_plastic", integrator), 100);
    }
}

/// A diagnosis takes the derivative by a dormant fraction.
#[test]
fn a_fraction_of_zero_has_a_derivative() {
    let mut scene = with("rod_creep", Integrator::Midpoint);
    scene.rope[0].creep = Some(Creep { fraction: 0.0, twist_fraction: None, time: 0.05 });
    let case = Case::new(&scene, 20);
    let run = case.run(StepOptions::default());
    let theta_bar = gradient(&run, &case);
    let k = case.model.params().find("rod.creep_fraction").unwrap();
    let loss = |fraction: f64| {
        let mut theta = case.theta.clone();
        theta[k] = fraction;
        let run = rollout(&case.model, &theta, &case.x0, &case.u, StepOptions::default()).unwrap();
        sum(&run, &case)
    };
    // forwards, since there are no negative fractions; of third order, so that the steps are wide enough to be above rounding
    let h = 1e-4;
    let slope = (-11.0 * loss(0.0) + 18.0 * loss(h) - 9.0 * loss(2.0 * h) + 2.0 * loss(3.0 * h)) / (6.0 * h);
    assert!((slope / theta_bar[k] - 1.0).abs() < 1e-6, "{slope} {}", theta_bar[k]);
    // without it the rod is the elastic one, bit for bit
    scene.rope[0].creep = None;
    let plain = Case::new(&scene, 20);
    let elastic = plain.run(StepOptions::default());
    assert_eq!(elastic.states[20].q, run.states[20].q);
}

fn sum(run: &Rollout, case: &Case) -> f64 {
    let weights = case.x_bar();
    let n = case.model.nv();
    run.states
        .iter()
        .zip(&weights)
        .map(|(x, w)| (0..3 * case.model.n_nodes()).map(|k| x.q[k] * w[k] + x.v[k] * w[n + k]).sum::<f64>())
        .sum()
}

/// Cotangent of θ of the weighted sum of all nodes' positions and velocities.
fn gradient(run: &Rollout, case: &Case) -> Vec<f64> {
    let (n, nodes) = (case.model.nv(), 3 * case.model.n_nodes());
    let mut x_bar = case.x_bar();
    for row in &mut x_bar {
        row.iter_mut().enumerate().filter(|(k, _)| !(*k < nodes || (n..n + nodes).contains(k))).for_each(|(_, w)| *w = 0.0);
    }
    rollout_vjp(run, &x_bar).unwrap().theta
}
