//! Forces from outside as directions of tangents, beside the same forces by laws of the model.

use crate::common::{Case, with};
use pliant_adjoint::{Seeds, TangentStepper};
use pliant_engine::step::{StepOptions, Stepper};
use pliant_scene::{Integrator, Scene};

/// Largest difference of two columns of the tangents after some steps, over the largest entry of the first; and that entry. `seed`: of every
/// step anew.
fn apart(scene: &Scene, steps: usize, seed: impl Fn(&Case, &mut Seeds)) -> [f64; 2] {
    let case = Case::new(scene, steps);
    let seeds = Seeds::none(2, case.model.nu(), case.model.n_params());
    let mut tangents = TangentStepper::new(&case.model, &case.theta, seeds);
    let mut stepper = Stepper::new(&case.model, &case.theta, StepOptions { record: true, ..StepOptions::default() }).unwrap();
    let mut x = case.x0.clone();
    let (mut largest, mut miss) = (0.0f64, 0.0f64);
    for u in &case.u {
        tangents.seeds = Seeds::none(2, case.model.nu(), case.model.n_params());
        seed(&case, &mut tangents.seeds);
        let (_, record) = stepper.step(&mut x, u).unwrap();
        tangents.step(&record.unwrap());
        for pair in tangents.x.q.chunks_exact(2).chain(tangents.x.v.chunks_exact(2)) {
            largest = largest.max(pair[0].abs());
            miss = miss.max((pair[0] - pair[1]).abs());
        }
    }
    [miss / largest, largest]
}

const ALL: [Integrator; 3] = [Integrator::Euler, Integrator::Midpoint, Integrator::Sdirk2];

/// On every node its mass downwards is a metre per second squared more of gravity.
#[test]
fn a_force_on_every_node_is_gravity() {
    for integrator in ALL {
        let scene = with("free_swing", integrator);
        let [miss, largest] = apart(&scene, 20, |case, seeds| {
            let gravity = case.model.params().find("gravity.magnitude").unwrap();
            seeds.add_theta(gravity, 0, 1.0);
            let mass = case.model.row_masses(&case.theta);
            (0..case.model.n_nodes()).for_each(|i| seeds.add_force(3 * i + 2, 1, -mass[3 * i + 2]));
        });
        assert!(largest > 1e-4 && miss < 1e-9, "{integrator:?}: {miss:e} of {largest:e}");
    }
}

/// Of the elbow's motor, the first control.
const GEAR: f64 = 3.0;

/// At a joint it is the torque of its motor.
#[test]
fn a_force_at_a_joint_is_its_motor() {
    for integrator in ALL {
        let scene = with("arm_free", integrator);
        let [miss, largest] = apart(&scene, 20, |case, seeds| {
            let elbow = case.model.tree().joints().iter().find(|joint| joint.name == "elbow").unwrap();
            seeds.add_u(0, 0, 1.0);
            seeds.add_force(case.model.n_node_dofs() + elbow.v, 1, GEAR);
        });
        assert!(largest > 1e-4 && miss < 1e-9, "{integrator:?}: {miss:e} of {largest:e}");
    }
}
