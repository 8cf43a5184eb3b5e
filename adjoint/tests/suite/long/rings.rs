//! Gradients of closed ropes and rods.

use crate::common::{Case, with};
use crate::judged::demand;
use pliant_scene::{Clamp, Gripper, Integrator, Scene};

fn passes(what: &str, scene: &Scene, steps: usize) {
    demand(what, &Case::new(scene, steps), 0);
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
