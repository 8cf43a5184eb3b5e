//! The derivative by a friction coefficient of zero is the one-sided one.

use crate::common::{Case, scene};
use pliant_adjoint::rollout_jvp;
use pliant_engine::step::StepOptions;

/// A ball that falls and moves sideways, and a rope that slides, on a floor without friction: nothing but friction slows them, and it
/// does so from zero on in proportion to the coefficient.
#[test]
fn friction_of_zero_has_the_derivative_of_a_little_friction() {
    for (name, steps) in [("ball_v", 100), ("sliding", 20)] {
        let mut scene = scene(name);
        scene.plane.iter_mut().for_each(|plane| plane.friction = 0.0);
        let mut case = Case::new(&scene, steps);
        let path = format!("{}.friction", scene.plane[0].name);
        let k = case.model.params().infos().iter().position(|info| info.path == path).unwrap();
        let mut theta_dot = vec![0.0; case.theta.len()];
        theta_dot[k] = 1.0;
        let run = case.run(StepOptions::default());
        let exact = rollout_jvp(&run, None, None, Some(&theta_dot)).unwrap().pop().unwrap();
        let end = run.states.last().unwrap().clone();
        let little = 1e-5;
        case.theta[k] = little;
        let other = case.run(StepOptions { record: false, ..StepOptions::default() }).states.pop().unwrap();
        let n = case.model.nv();
        let (size, differs) = (0..n).fold((0.0_f64, 0.0_f64), |(size, differs), row| {
            let difference = (other.v[row] - end.v[row]) / little;
            let derivative = exact[exact.len() - n - case.model.ndz() + row];
            (size.max(difference.abs()), differs.max((difference - derivative).abs()))
        });
        println!("{name}: forward difference {size:.3e}, the derivative differs by {differs:.1e}");
        assert!(size > 0.1, "{name}: friction does nothing here");
        assert!(differs < 1e-3 * size, "{name}: {differs} of {size}");
    }
}
