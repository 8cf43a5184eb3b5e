//! Gradients of closed ropes and rods.

use crate::common::{Case, with};
use pliant_adjoint::gradcheck::gradcheck;
use pliant_scene::{Clamp, Gripper, Integrator, Scene};

fn passes(what: &str, scene: &Scene, steps: usize) {
    let case = Case::new(scene, steps);
    let report = gradcheck(&case.model, &case.theta, &case.x0, &case.u, 7).unwrap();
    println!("{what}: worst {:.1e}, slope {:?}", report.worst_relative_error, report.taylor_slope);
    let failed: Vec<_> = report.blocks.iter().filter(|b| !b.pass).collect();
    assert!(report.pass && failed.is_empty(), "{what}: {failed:#?}");
}

#[test]
fn rings_have_exact_gradients() {
    for integrator in [Integrator::Euler, Integrator::Midpoint, Integrator::Sdirk2] {
        passes(&format!("{integrator:?}"), &with("ring", integrator), 30);
    }
    let mut plain = with("ring", Integrator::Midpoint);
    plain.rope[0].twist = None;
    passes("without twist", &plain, 30);
    let mut held = with("ring", Integrator::Euler);
    // both ends of the closing edge: its axes are held too
    held.gripper = vec![Gripper { rope: Some("ring".into()), clamp: Clamp::Nodes(vec![0, -1]), ..Gripper::default() }];
    let case = Case::new(&held, 1);
    assert_eq!(case.model.drives()[0].held.len(), 1);
    passes("held", &held, 30);
}
