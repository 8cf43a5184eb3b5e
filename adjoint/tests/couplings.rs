//! Joints that follow others: derivatives through the rows that hold them, and where those leave the state.
#![allow(clippy::unwrap_used, clippy::panic)]

mod common;

use common::{Case, STEPS, scene, with};
use pliant_adjoint::gradcheck::{DOT_TEST, FLOOR_FACTOR, RELATIVE_ERROR, gradcheck};
use pliant_engine::model::ModelBuilder;
use pliant_engine::scene::{Coupling, Integrator, Scene};
use pliant_engine::step::StepOptions;

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

#[test]
fn gears_stay_in_mesh() {
    let case = Case::new(&scene("gears"), 120);
    let run = case.run(StepOptions::default());
    let moved = run.states.last().unwrap().q[0] - run.states[0].q[0];
    assert!(moved.abs() > 0.3, "{moved}");
    for state in &run.states {
        let [pinion, wheel, rail] = state.q[..] else { panic!("three joints") };
        // a rest gap under the weight of what is coupled, and up to fifty times that load
        assert!((wheel + 0.5 * pinion).abs() < 5e-8, "{}", wheel + 0.5 * pinion);
        let cam = 0.02 * wheel + 0.03 * wheel * wheel - 0.01 * wheel * wheel * wheel;
        // 1e-6 m/N under less than 20 N
        assert!((rail - cam).abs() < 2e-5, "{}", rail - cam);
    }
}

/// A joint that nobody leads stays where it is held.
#[test]
fn a_joint_is_held() {
    let mut scene = scene("gears");
    scene.coupling = vec![held("rail", -0.00169)];
    let case = Case::new(&scene, 60);
    let rail = |k: usize| case.run(StepOptions::default()).states[k].q[2];
    assert!((rail(60) + 0.00169).abs() < 1e-8, "{}", rail(60));
    demand("held", &case);
}

fn held(joint: &str, at: f64) -> Coupling {
    let (name, joint) = ("held".to_owned(), joint.to_owned());
    Coupling { name, joint, to: None, coefficients: vec![at], reference: 0.0, compliance: None }
}

/// The torque that a coupling carries, by its compliance: a wheel on a soft gear hangs where the spring has it.
#[test]
fn compliance_is_what_gives_way() {
    let mut scene = with("gears", Integrator::Euler);
    scene.coupling = vec![Coupling { compliance: Some(0.2), ..held("pinion_axle", 0.2) }];
    scene.body[0].joint[0].damping = 0.05;
    scene.body[0].joint[0].velocity = vec![0.0];
    let case = Case::new(&scene, 4000);
    let q = case.run(StepOptions::default()).states[4000].q[0];
    // 0.3 kg at 0.04 m; about +y a weight at +x turns it forward
    let (torque, inertia) = (0.3 * 9.81 * 0.04 * q.cos(), 0.0003 + 0.3 * 0.04 * 0.04 + 0.0001);
    let compliance = 0.2 + scene.contact.rest_gap / (10.0 * inertia);
    assert!((q - 0.2 - compliance * torque).abs() < 1e-11, "{q} {torque}");
}

#[test]
fn couplings_that_cannot_be_are_refused() {
    let refused = |change: &dyn Fn(&mut Scene)| {
        let mut scene = scene("gears");
        change(&mut scene);
        ModelBuilder::new(&scene).unwrap_err().to_string()
    };
    let demand = |change: &dyn Fn(&mut Scene), words: [&str; 2]| {
        let message = refused(change);
        assert!(words.iter().all(|w| message.contains(w)), "{message}");
    };
    demand(
        &|s| s.coupling[0].to = Some("pinion_axel".into()),
        ["coupling[0].to: there is no joint", "did you mean \"pinion_axle\""],
    );
    demand(&|s| s.coupling[0].to = Some("wheel_axle".into()), ["coupling[0].to: joint \"wheel_axle\" follows itself", "leads"]);
    demand(&|s| s.coupling[0].coefficients = vec![0.01, -0.5], ["starts at -0.1, but follows to -0.09", "start = [-0.09"]);
    demand(&|s| s.coupling[1].coefficients = vec![], ["coupling[1].coefficients: has 0 coefficients", "[0, -2]"]);
    demand(&|s| s.coupling[1].coefficients = vec![0.0; 6], ["has 6 coefficients, not 1 to 5", "cause"]);
    demand(&|s| s.coupling[1].to = None, ["coupling[1].coefficients: no joint leads", "write `to = …`"]);
    demand(&|s| s.coupling[0].compliance = Some(-1.0), ["coupling[0].compliance: is -1", "negative"]);
    demand(&|s| s.coupling[0].name = "cam".into(), ["coupling[1].name: the name \"cam\" is taken by coupling[0]", "own name"]);
    demand(
        &|s| s.time.integrator = Integrator::Midpoint,
        ["cannot be used with closures and couplings, and the scene has 2", "sdirk2"],
    );
    demand(
        &|s| {
            s.body[0].joint[0] = pliant_engine::scene::Joint {
                kind: pliant_engine::scene::JointKind::Ball,
                start: vec![],
                velocity: vec![],
                ..s.body[0].joint[0].clone()
            }
        },
        ["coupling[0].to: joint \"pinion_axle\" has 3 degrees of freedom", "revolute or prismatic"],
    );
}
