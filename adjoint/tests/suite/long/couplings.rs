//! Joints that follow others: derivatives through the rows that hold them.

use crate::common::{Case, STEPS, scene, with};
use pliant_adjoint::gradcheck::{DOT_TEST, FLOOR_FACTOR, RELATIVE_ERROR, gradcheck};
use pliant_scene::{Coupling, Integrator};

/// Demands the dot test, and differences of every block but those of friction: its size is zero here, where it can only grow, and the sign
/// of a joint's velocity, which it would turn with, is what counts as a switch.
fn demand(what: &str, case: &Case) {
    let report = gradcheck(&case.model, &case.theta, &case.x0, &case.u, 7).unwrap();
    let of_friction = |name: &str| ["friction", "stiction", "stribeck_velocity"].iter().any(|q| name.ends_with(q));
    let judged = || report.blocks.iter().filter(|b| !of_friction(&b.name));
    let worst = judged().fold(0.0_f64, |a, b| a.max(b.relative_error));
    println!("{what}: worst {worst:.1e}, dot {:.1e}, judged {}/{}", report.dot_test, judged().count(), report.blocks.len());
    let wrong: Vec<_> = judged().filter(|b| b.relative_error > RELATIVE_ERROR.max(FLOOR_FACTOR * b.floor)).collect();
    assert!(wrong.is_empty(), "{what}: {wrong:#?}");
    assert!(report.dot_test <= DOT_TEST, "{what}");
    assert_eq!(report.retries, 0, "{what}");
}

#[test]
fn derivatives_of_gears_and_a_cam() {
    for integrator in [Integrator::Euler, Integrator::Sdirk2] {
        for compliance in [None, Some(1e-3)] {
            let mut scene = with("gears", integrator);
            scene.coupling[0].compliance = compliance;
            demand(&format!("gears {integrator:?}, compliance {compliance:?}"), &Case::new(&scene, 2 * STEPS));
        }
    }
}

/// The leading coordinate of a cam hangs below the one that follows a joint further up: every entry of the rows is in use.
#[test]
fn derivatives_along_a_chain_that_couples_itself() {
    let mut scene = scene("gears");
    let d = scene.body[2].joint[0].start[0] - 0.001;
    scene.coupling = vec![Coupling {
        name: "bend".to_owned(),
        joint: "wheel_axle".to_owned(),
        to: Some("rail".to_owned()),
        coefficients: vec![-0.1 - (2.0 * d + 30.0 * d * d), 2.0, 30.0],
        reference: 0.001,
        compliance: Some(1e-4),
    }];
    demand("a chain", &Case::new(&scene, STEPS));
}

/// A joint that nobody leads stays where it is held.
#[test]
fn derivatives_where_a_joint_is_held() {
    let mut scene = scene("gears");
    scene.coupling = vec![held("rail", -0.00169)];
    demand("held", &Case::new(&scene, 60));
}

fn held(joint: &str, at: f64) -> Coupling {
    let (name, joint) = ("held".to_owned(), joint.to_owned());
    Coupling { name, joint, to: None, coefficients: vec![at], reference: 0.0, compliance: None }
}
