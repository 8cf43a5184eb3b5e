//! Surrogate gradients: of the smoothed rollout, and of smoothed steps along the hard one.

use crate::common::{Case, STEPS, with};
use pliant_adjoint::gradcheck::GRADCHECK;
use pliant_adjoint::{Along, Smoothing, Surrogate, linearize, rollout_jvp, rollout_vjp, surrogate_rollout};
use pliant_engine::grasp::Grasping;
use pliant_engine::rollout::{Rollout, RolloutOptions, rollout};
use pliant_engine::step::StepOptions;
use pliant_scene::Integrator;

const CONTACT: [&str; 4] = ["sliding", "resting", "sphere_drape", "capsule_drape"];

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Surrogates at this rest gap \[m\].
const SOFT: f64 = 1e-4;

fn surrogate(case: &Case, along: Along) -> Surrogate<Rollout> {
    let smoothing = Smoothing { rest_gap: SOFT, grasp: Grasping::Hard, along };
    surrogate_rollout(&case.model, &case.theta, &case.x0, &case.u, StepOptions::default(), smoothing).unwrap()
}

fn softened(name: &str) -> Case {
    let mut soft = with(name, Integrator::Euler);
    soft.contact.rest_gap = SOFT;
    Case::new(&soft, STEPS)
}

#[test]
fn a_smooth_surrogate_is_the_smoothed_scene() {
    let (hard, soft) = (Case::new(&with("sliding", Integrator::Euler), STEPS), softened("sliding"));
    let (surrogate, smoothed) = (surrogate(&hard, Along::Smooth), soft.run(StepOptions::default()));
    assert_eq!(surrogate.as_ref().states, smoothed.states);
    let x_bar = hard.x_bar();
    let gradient = surrogate.vjp(&x_bar).unwrap().into_unmarked();
    assert_eq!(gradient, rollout_vjp(&smoothed, &x_bar).unwrap());
    // and its derivative is that of the smoothed map, not of the hard one
    let k = hard.model.params().find("floor.friction").unwrap();
    let loss = |mu: f64| {
        let mut theta = hard.theta.clone();
        theta[k] = mu;
        let run = rollout(&soft.model, &theta, &hard.x0, &hard.u, StepOptions { record: false, ..Default::default() }).unwrap();
        run.states.iter().zip(&x_bar).map(|(x, w)| dot(&x.to_flat(), w)).sum::<f64>()
    };
    let (mu, eps) = (hard.theta[k], 1e-5);
    let difference = (8.0 * (loss(mu + eps) - loss(mu - eps)) - loss(mu + 2.0 * eps) + loss(mu - 2.0 * eps)) / (12.0 * eps);
    let by_hard = rollout_vjp(&hard.run(StepOptions::default()), &x_bar).unwrap().theta[k];
    println!("surrogate ∂L/∂μ {:.9e}, its difference {difference:.9e}, hard {by_hard:.9e}", gradient.theta[k]);
    assert!((gradient.theta[k] / difference - 1.0).abs() < 1e-7);
    assert!((by_hard / difference - 1.0).abs() > 1e-4);
}

#[test]
fn a_surrogate_along_the_hard_trajectory_is_the_smoothed_step_at_its_states() {
    for name in CONTACT {
        let (hard, soft) = (Case::new(&with(name, Integrator::Euler), STEPS), softened(name));
        let surrogate = surrogate(&hard, Along::Hard);
        assert_eq!(surrogate.as_ref().states, hard.run(StepOptions::default()).states, "{name}: forward stays hard");
        for k in [0, STEPS / 2, STEPS - 1] {
            let x = &surrogate.as_ref().states[k];
            let alone = rollout(&soft.model, &hard.theta, x, &hard.u[k..=k], StepOptions::default()).unwrap();
            let own = linearize(&soft.model, &hard.theta, &alone.records[0], true);
            let here = surrogate.linearize(k).unwrap().into_unmarked();
            for (part, here, own) in [("A", &here.a, &own.a), ("B", &here.b, &own.b), ("C", &here.c, &own.c)] {
                let scale = own.iter().fold(f64::MIN_POSITIVE, |m, x| m.max(x.abs()));
                let off = here.iter().zip(own).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs())) / scale;
                assert!(off < 1e-7, "{name}, step {k}, {part}: {off:e}"); // another warm start, the same root
            }
        }
        let (x_bar, x0_dot) = (hard.x_bar(), vec![1.0; hard.model.ndx()]);
        let tangent = surrogate.jvp(Some(&x0_dot), None, None).unwrap().into_unmarked();
        let by_jvp: f64 = tangent.iter().zip(&x_bar).map(|(t, w)| dot(t, w)).sum();
        let by_parts: f64 = tangent.iter().zip(&x_bar).flat_map(|(t, w)| t.iter().zip(w)).map(|(t, w)| (t * w).abs()).sum();
        let by_vjp = dot(&surrogate.vjp(&x_bar).unwrap().into_unmarked().x0, &x0_dot);
        assert!((by_jvp - by_vjp).abs() <= GRADCHECK.dot_test * by_parts, "{name}: {by_jvp:e} {by_vjp:e}");
    }
}

/// A node 5 mm above the floor does not feel it, and neither does its hard gradient.
#[test]
fn a_surrogate_feels_contacts_before_they_are_made() {
    let mut case = Case::new(&with("resting", Integrator::Euler), 1);
    case.x0.q.iter_mut().skip(2).step_by(3).for_each(|z| *z += 5e-3);
    let height = case.model.params().find("floor.height").unwrap();
    let x_bar = vec![vec![1.0; case.model.ndx()]; 2];
    let hard = rollout_vjp(&case.run(StepOptions::default()), &x_bar).unwrap().theta[height];
    let soft = surrogate(&case, Along::Hard).vjp(&x_bar).unwrap().into_unmarked().theta[height];
    println!("∂L/∂(floor height): hard {hard:.2e}, surrogate {soft:.2e}");
    assert!(soft > 1.0 && soft > 1e3 * hard.abs());
}

#[test]
fn a_rest_gap_that_is_no_length_is_refused() {
    let case = Case::new(&with("sliding", Integrator::Euler), STEPS);
    for rest_gap in [0.0, -1e-4, f64::NAN, f64::INFINITY] {
        let smoothing = Smoothing { rest_gap, grasp: Grasping::Hard, along: Along::Hard };
        let refused = surrogate_rollout(&case.model, &case.theta, &case.x0, &case.u, StepOptions::default(), smoothing);
        assert!(refused.unwrap_err().to_string().contains("contact.rest_gap"));
    }
}

#[test]
fn checkpoints_give_the_same_bits() {
    let case = Case::new(&with("sphere_drape", Integrator::Sdirk2), STEPS);
    for along in [Along::Hard, Along::Smooth].into_iter() {
        let stored = surrogate(&case, along).vjp(&case.x_bar()).unwrap();
        let smoothing = stored.smoothing();
        let few = RolloutOptions { max_records: Some(7), ..RolloutOptions::default() };
        let checkpointed = surrogate_rollout(&case.model, &case.theta, &case.x0, &case.u, few, smoothing);
        assert_eq!(checkpointed.unwrap().vjp(&case.x_bar()).unwrap(), stored, "{along:?}");
    }
}

/// Nodes and bodies that rest within a surrogate's rest gap, or slide there, are lifted by it, and nothing more: products of A along the
/// hard states stay of the size of the exact ones. (They were 1e76 for `resting`.)
#[test]
fn surrogates_of_resting_contacts_do_not_grow() {
    for name in ["resting", "sliding", "block_slides", "arm_pushes"] {
        let case = Case::new(&with(name, Integrator::Euler), 100);
        let largest = |products: &[Vec<f64>]| products.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
        let n = case.model.ndx();
        let smoothing = Smoothing { rest_gap: 1e-3, grasp: Grasping::Hard, along: Along::Hard };
        let smooth = surrogate_rollout(&case.model, &case.theta, &case.x0, &case.u, StepOptions::default(), smoothing).unwrap();
        let hard = case.run(StepOptions::default());
        assert_eq!(smooth.as_ref().traces.iter().map(|t| t.retries).sum::<usize>(), hard.retries(), "{name}");
        let (mut exact, mut soft) = (0.0_f64, 0.0_f64);
        for k in 0..n {
            let seed: Vec<f64> = (0..n).map(|i| f64::from(u8::from(i == k))).collect();
            exact = exact.max(largest(&rollout_jvp(&hard, Some(&seed), None, None).unwrap()));
            soft = soft.max(largest(&smooth.jvp(Some(&seed), None, None).unwrap().into_unmarked()));
        }
        println!("{name}: exact {exact:.2e}, surrogate {soft:.2e}");
        assert!(soft < 3.0 * exact, "{name}: {soft:e} beside {exact:e}");
    }
}
