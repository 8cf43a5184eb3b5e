//! Gradients of rods that stiffen and of rods with internal friction.

use crate::common::{Case, scene, with};
use crate::judged::demand;
use pliant_adjoint::{Seeds, equilibrium_jvp_columns, rollout_vjp};
use pliant_engine::equilibrium::equilibrium;
use pliant_engine::model::ModelBuilder;
use pliant_engine::rollout::rollout;
use pliant_engine::step::StepOptions;
use pliant_scene::{BendFriction, Creep, Integrator, Plasticity, Scene, Stiffening, resting_inputs};
use std::sync::Arc;

const INTEGRATORS: [Integrator; 4] = [Integrator::Euler, Integrator::Midpoint, Integrator::Sdirk2, Integrator::QuasiStatic];

fn passes(what: &str, scene: &Scene, steps: usize) {
    // of x0.z every difference switches: friction begins at a reversal
    demand(what, &Case::new(scene, steps), 1);
}

#[test]
fn a_hundred_steps_have_exact_gradients() {
    for integrator in INTEGRATORS {
        passes(&format!("{integrator:?}"), &with("rod_friction", integrator), 100);
    }
}

/// From a state in motion, where no joint of the rod is at a reversal, x0.z is judged too.
#[test]
fn so_has_one_that_begins_in_motion() {
    let case = Case::new(&with("rod_friction", Integrator::Midpoint), 60);
    let run = case.run(StepOptions::default());
    demand("in motion", &Case { x0: run.states[40].clone(), u: case.u[40..].to_vec(), ..case }, 0);
}

/// All that a section can do, in one.
#[test]
fn so_have_those_of_a_section_with_everything() {
    for integrator in [Integrator::Euler, Integrator::Midpoint, Integrator::Sdirk2] {
        let mut scene = with("rod_friction", integrator);
        let rope = &mut scene.rope[0];
        rope.stiffening = Some(Stiffening { coefficient: -0.02 });
        rope.plasticity = Some(Plasticity { yield_curvature: 1.5, time: 0.03 });
        rope.creep = Some(Creep { fraction: 0.2, twist_fraction: None, time: 0.1 });
        passes(&format!("{integrator:?}"), &scene, 50);
    }
}

/// The derivative of a rollout's sum by one parameter, and the sum as a function of it.
fn by_parameter(scene: &Scene, path: &str) -> (f64, impl Fn(f64) -> f64 + use<>) {
    let case = Case::new(scene, 20);
    let run = case.run(StepOptions::default());
    let k = case.model.params().find(path).unwrap();
    let (n, nodes) = (case.model.nv(), 3 * case.model.n_nodes());
    let mut weights = case.x_bar();
    for row in &mut weights {
        row.iter_mut().enumerate().filter(|(k, _)| !(*k < nodes || (n..n + nodes).contains(k))).for_each(|(_, w)| *w = 0.0);
    }
    let slope = rollout_vjp(&run, &weights).unwrap().theta[k];
    let sum = move |value: f64| {
        let mut theta = case.theta.clone();
        theta[k] = value;
        let run = rollout(&case.model, &theta, &case.x0, &case.u, StepOptions::default()).unwrap();
        let of = |(x, w): (&pliant_math::State, &Vec<f64>)| (0..nodes).map(|k| x.q[k] * w[k] + x.v[k] * w[n + k]).sum::<f64>();
        run.states.iter().zip(&weights).map(of).sum()
    };
    (slope, sum)
}

/// Dormant parameters leave the elastic rod as it is to the last bit, and have derivatives.
#[test]
fn without_size_it_is_the_elastic_rod_with_derivatives() {
    for integrator in INTEGRATORS {
        let mut plain = with("rod_friction", integrator);
        (plain.rope[0].stiffening, plain.rope[0].bend_friction) = (None, None);
        let mut opened = plain.clone();
        opened.rope[0].stiffening = Some(Stiffening { coefficient: 0.0 });
        opened.rope[0].bend_friction = Some(BendFriction { moment: 0.0, curvature: 0.8 });
        let [a, b] = [&plain, &opened].map(|scene| Case::new(scene, 20).run(StepOptions::default()));
        (0..=20)
            .for_each(|k| assert_eq!((&a.states[k].q, &a.states[k].v), (&b.states[k].q, &b.states[k].v), "{integrator:?}, {k}"));
        let (slope, sum) = by_parameter(&opened, "rod.stiffening");
        let difference = (sum(1e-5) - sum(-1e-5)) / 2e-5;
        assert!((difference / slope - 1.0).abs() < 1e-6, "{integrator:?}: {difference} {slope}");
        let (slope, sum) = by_parameter(&opened, "rod.friction_moment");
        // forwards, since there is no negative friction
        let difference = (-3.0 * sum(0.0) + 4.0 * sum(1e-6) - sum(2e-6)) / 2e-6;
        assert!((difference / slope - 1.0).abs() < 1e-6, "{integrator:?}: {difference} {slope}");
    }
}

/// An equilibrium includes stiffening, with the derivative, and no friction that has not been built up.
#[test]
fn an_equilibrium_stiffens_and_has_no_friction() {
    let rubbing = scene("rod_friction");
    let mut without = rubbing.clone();
    without.rope[0].bend_friction = None;
    let at_rest = |scene: &Scene, c: Option<f64>| {
        let model = Arc::new(ModelBuilder::new(scene).unwrap().build());
        let mut theta = model.params().values().to_vec();
        let k = model.params().find("rod.stiffening").unwrap();
        theta[k] = c.unwrap_or(theta[k]);
        equilibrium(&model, &theta, model.initial_positions(), &resting_inputs(scene).unwrap()).unwrap()
    };
    let [a, b] = [&rubbing, &without].map(|scene| at_rest(scene, None));
    assert!(a.q.iter().zip(&b.q).all(|(a, b)| (a - b).abs() < 1e-12));
    let (nu, np) = (resting_inputs(&without).unwrap().len(), b.model.params().len());
    let k = b.model.params().find("rod.stiffening").unwrap();
    let mut seeds = Seeds::none(1, nu, np);
    seeds.add_theta(k, 0, 1.0);
    let slope = equilibrium_jvp_columns(&b, &seeds);
    let [up, down] = [0.05 + 1e-5, 0.05 - 1e-5].map(|c| at_rest(&without, Some(c)).state());
    let difference = b.model.difference(&up, &down);
    let largest = (0..b.model.nv()).fold(0.0_f64, |m, r| m.max(slope[r].abs()));
    assert!(largest > 1e-3, "{largest}");
    (0..b.model.nv()).for_each(|r| assert!((difference[r] / 2e-5 - slope[r]).abs() < 1e-6 * largest, "{r}"));
}
