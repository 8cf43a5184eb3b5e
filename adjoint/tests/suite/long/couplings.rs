//! Joints that follow others: derivatives through the rows that hold them.

use crate::common::{Case, STEPS, scene, with};
use crate::judged;
use pliant_scene::{Coupling, Integrator};

/// Friction is zero here: it can only grow, and turns with the sign of a joint's velocity, so that its blocks are inconclusive. So are
/// the wheel's inertia, whose influence is small beside rounding, and initial positions of a joint that is held.
fn demand(what: &str, case: &Case, inconclusive: usize) {
    let report = judged::demand(what, case, inconclusive);
    assert_eq!(report.retries, 0, "{what}");
}

#[test]
fn derivatives_of_gears_and_a_cam() {
    for integrator in [Integrator::Euler, Integrator::Sdirk2] {
        for compliance in [None, Some(1e-3)] {
            let mut scene = with("gears", integrator);
            scene.coupling[0].compliance = compliance;
            demand(&format!("gears {integrator:?}, compliance {compliance:?}"), &Case::new(&scene, 2 * STEPS), 5);
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
    demand("a chain", &Case::new(&scene, STEPS), 4);
}

/// A joint that nobody leads stays where it is held.
#[test]
fn derivatives_where_a_joint_is_held() {
    let mut scene = scene("gears");
    scene.coupling = vec![held("rail", -0.00169)];
    demand("held", &Case::new(&scene, 60), 7);
}

fn held(joint: &str, at: f64) -> Coupling {
    let (name, joint) = ("held".to_owned(), joint.to_owned());
    Coupling { name, joint, to: None, coefficients: vec![at], reference: 0.0, compliance: None }
}
