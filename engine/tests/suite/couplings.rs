//! Joints that follow others: where the rows that hold them leave the state, and which couplings are refused.

use crate::common::{Case, scene, with};
use pliant_engine::model::ModelBuilder;
use pliant_engine::step::StepOptions;
use pliant_scene::{Coupling, Integrator, Scene};

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
            s.body[0].joint[0] = pliant_scene::Joint {
                kind: pliant_scene::JointKind::Ball,
                start: vec![],
                velocity: vec![],
                ..s.body[0].joint[0].clone()
            }
        },
        ["coupling[0].to: joint \"pinion_axle\" has 3 degrees of freedom", "revolute or prismatic"],
    );
}
