//! Derivatives of steps of copies: those of the rollouts that they are, to the bit.

use crate::common::{Case, scene};
use pliant_adjoint::{rollout_jvp, rollout_linearize, rollout_vjp};
use pliant_engine::step::StepOptions;
use pliant_engine::vector::VectorStepper;

#[test]
fn derivatives_of_a_recorded_step_are_those_of_the_rollout() {
    for name in ["sliding", "windy", "pile_gains", "arm_actuators", "rod_plastic", "cloth_sphere"] {
        let case = Case::new(&scene(name), 12);
        let whole = case.run(StepOptions::default());
        let mut vector = VectorStepper::new(&case.model, 2).unwrap();
        let x_bar = case.x_bar();
        let (mut x0_bar, mut theta_bar) = (x_bar[12].clone(), vec![0.0; case.theta.len()]);
        let mut steps = Vec::new();
        for (k, u) in case.u.iter().enumerate() {
            // steps without records between those with: they must not lose anything
            vector.step(&u.repeat(2), k != 3).unwrap();
            if k == 3 {
                continue;
            }
            let step = vector.record(1).unwrap().clone();
            assert_eq!(rollout_linearize(&step, 0).unwrap(), rollout_linearize(&whole, k).unwrap(), "{name}, step {k}");
            steps.push(step);
        }
        // pulled back step by step from the last, as the rollout's own vjp does
        let mut last = whole.clone();
        last.records.drain(..4);
        last.controls.drain(..4);
        last.states.drain(..4);
        let rows: Vec<Vec<f64>> =
            (0..last.states.len()).map(|k| if k == 8 { x_bar[12].clone() } else { vec![0.0; x0_bar.len()] }).collect();
        let expected = rollout_vjp(&last, &rows).unwrap();
        let tangents = rollout_jvp(&last, Some(&x_bar[0]), None, None).unwrap();
        let mut x_dot = x_bar[0].clone();
        for step in &steps[3..] {
            x_dot = rollout_jvp(step, Some(&x_dot), None, None).unwrap().remove(1);
        }
        assert_eq!(&x_dot, tangents.last().unwrap(), "{name}");
        for step in steps[3..].iter().rev() {
            let bar = rollout_vjp(step, &[vec![0.0; x0_bar.len()], x0_bar]).unwrap();
            x0_bar = bar.x0;
            theta_bar.iter_mut().zip(bar.theta).for_each(|(sum, part)| *sum += part);
        }
        assert_eq!(x0_bar, expected.x0, "{name}");
        let size = expected.theta.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let apart = theta_bar.iter().zip(&expected.theta).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
        assert!(size > 0.0 && apart <= 1e-12 * size, "{name}: {apart:e} of {size:e}");
    }
}
