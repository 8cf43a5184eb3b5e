//! Forces written as formulas, against laws of the engine.

use crate::common::{Case, scene};
use pliant_engine::model::{Model, ModelBuilder};
use pliant_engine::step::{StepError, StepOptions, Stepper};
use pliant_math::State;
use pliant_scene::{Force, Formulas, Joint, JointKind, Scene};
use std::collections::BTreeMap;

fn three(text: [&str; 3]) -> Formulas {
    Formulas::Three(text.map(str::to_owned))
}

fn force(formula: Formulas, parameters: &[(&str, f64)]) -> Force {
    let parameters: BTreeMap<String, f64> = parameters.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
    Force { name: "own".to_owned(), joint: None, rope: None, cloth: None, nodes: None, formula, parameters }
}

fn last(scene: &Scene, steps: usize) -> State {
    let case = Case::new(scene, steps);
    case.run(StepOptions { record: false, max_halvings: Some(0) }).states.pop().unwrap()
}

/// Largest difference over the largest entry, of positions and of velocities.
fn apart(a: &State, b: &State) -> f64 {
    let of = |a: &[f64], b: &[f64]| {
        let size = b.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / size
    };
    of(&a.q, &b.q).max(of(&a.v, &b.v))
}

/// The arm with forces of its own alone.
fn arm(forces: Vec<Force>, change: impl Fn(&mut Joint)) -> Scene {
    let mut scene = scene("arm_own");
    scene.force = forces;
    scene.body.iter_mut().flat_map(|body| &mut body.joint).for_each(|joint| {
        joint.damping = 0.0;
        change(joint);
    });
    scene
}

#[test]
fn at_joints_it_is_the_law_that_it_writes() {
    let at = |joint: &str, formula, parameters: &[(&str, f64)]| Force {
        name: format!("own_{joint}"),
        joint: Some(joint.to_owned()),
        ..force(formula, parameters)
    };
    let one = |text: &str| Formulas::One(text.to_owned());
    let own = vec![
        at("shoulder", one("-c*v - d*abs(v)*v"), &[("c", 0.05), ("d", 0.02)]),
        at("wrist", three(["-c*vx - k*qx", "-c*vy - k*qy", "-c*vz - k*qz"]), &[("c", 0.003), ("k", 0.2)]),
        at("slide", one("-k*q**3 - c*v"), &[("k", 400.0), ("c", 0.1)]),
    ];
    let built_in = |joint: &mut Joint| match joint.kind {
        JointKind::Revolute => (joint.damping, joint.quadratic_damping) = (0.05, 0.02),
        JointKind::Ball => (joint.damping, joint.stiffness) = (0.003, 0.2),
        _ => (joint.cubic_stiffness, joint.damping) = (400.0, 0.1),
    };
    let (formulas, laws) = (last(&arm(own, |_| {}), 40), last(&arm(Vec::new(), built_in), 40));
    assert!(apart(&formulas, &laws) < 1e-11, "{}", apart(&formulas, &laws));
    assert!(apart(&formulas, &last(&arm(Vec::new(), |_| {}), 40)) > 1e-2, "the laws do something");
}

/// As a density on the whole of a rope or a sheet: drag, and weight.
#[test]
fn on_nodes_it_is_the_law_that_it_writes() {
    let mut laws = scene("windy");
    laws.rope.retain(|rope| rope.name == "cord");
    laws.gripper.retain(|gripper| gripper.name == "ring");
    let mut formulas = laws.clone();
    (formulas.rope[0].drag_linear, formulas.rope[0].drag_quadratic) = (0.0, 0.0);
    let speed = "hypot(hypot(vx - 2, vy + 1), vz - 0.4)";
    let along = |u: &str| format!("-(c + k*{speed})*({u})");
    let [x, y, z] = ["vx - 2", "vy + 1", "vz - 0.4"].map(along);
    let own = force(three([&x, &y, &z]), &[("c", 0.02), ("k", 0.03)]);
    formulas.force = vec![Force { rope: Some("cord".to_owned()), ..own }];
    let (formulas, laws) = (last(&formulas, 15), last(&laws, 15));
    assert!(apart(&formulas, &laws) < 1e-9, "{}", apart(&formulas, &laws));

    let laws = scene("cloth_hung");
    let mut formulas = laws.clone();
    formulas.gravity.magnitude = 0.0;
    let weight = format!("-{}*g", laws.cloth[0].mass_per_area());
    let own = force(three(["0", "0", &weight]), &[("g", laws.gravity.magnitude)]);
    formulas.force = vec![Force { cloth: Some(laws.cloth[0].name.clone()), ..own }];
    assert_eq!(laws.gravity.tilt, [0.0; 2]);
    let (formulas, laws) = (last(&formulas, 5), last(&laws, 5));
    assert!(apart(&formulas, &laws) < 1e-9, "{}", apart(&formulas, &laws));
}

/// At listed nodes: the weight of what is tied there.
#[test]
fn listed_nodes_have_the_whole_force() {
    let mut scene = scene("own_force");
    let own = force(three(["w*gx", "w*gy", "w*gz"]), &[("w", 0.004), ("gx", 0.0), ("gy", 0.0), ("gz", -9.7)]);
    scene.force = vec![Force { rope: Some("cord".to_owned()), nodes: Some(vec![-1, 3]), ..own }];
    let model = ModelBuilder::new(&scene).unwrap().build();
    let theta = model.params().values();
    let sum = |nodes: &[usize]| {
        let (x, term) = (model.initial_state(), model.terms().last().unwrap());
        let mut f = vec![0.0; x.q.len()];
        term.add_force(&pliant_engine::terms::Point { q: &x.q, v: &x.v, theta }, &mut f);
        nodes.iter().map(|node| f[3 * node + 2]).sum::<f64>()
    };
    assert_eq!(sum(&[3]), -0.004 * 9.7);
    assert_eq!(sum(&[0, 1, 2, 3, 4, 5]), -0.008 * 9.7);
}

/// The refined scene's total force on a whole rope is the scene's.
#[test]
fn a_density_does_not_depend_on_the_mesh() {
    let mut coarse = scene("own_force");
    let own = force(three(["a", "0", "0"]), &[("a", 3.0)]);
    coarse.force = vec![Force { rope: Some("cord".to_owned()), ..own }];
    let total = |scene: &Scene| {
        let model = ModelBuilder::new(scene).unwrap().build();
        let (x, mut f) = (model.initial_state(), vec![0.0; model.nq()]);
        let at = pliant_engine::terms::Point { q: &x.q, v: &x.v, theta: model.params().values() };
        model.terms().last().unwrap().add_force(&at, &mut f);
        f.iter().sum::<f64>()
    };
    let totals = [total(&coarse), total(&coarse.refined().scene)];
    assert!(totals.iter().all(|total| (total - 3.0 * 0.4).abs() < 1e-14), "{totals:?}");
}

fn model_of(forces: Vec<Force>) -> Model {
    ModelBuilder::new(&arm(forces, |_| {})).unwrap().build()
}

/// A parameter of zero is an entry of θ that changes nothing, and has a derivative.
#[test]
fn zero_is_no_force_but_an_entry_with_a_slope() {
    let own = force(Formulas::One("c*q".to_owned()), &[("c", 0.0)]);
    let model = model_of(vec![Force { joint: Some("shoulder".to_owned()), ..own }]);
    let entry = model.params().find("own.c").unwrap();
    let info = model.params().info(entry);
    assert_eq!((info.unit, info.lower, info.upper), ("SI", f64::NEG_INFINITY, f64::INFINITY));
    let run = |theta: &[f64]| {
        let (mut x, mut stepper) = (model.initial_state(), Stepper::new(&model, theta, StepOptions::default()).unwrap());
        (0..10).for_each(|_| drop(stepper.step(&mut x, &[]).unwrap()));
        x
    };
    let theta = model.params().values().to_vec();
    let silent = run(&theta);
    assert_eq!(silent, last(&arm(Vec::new(), |_| {}), 10));
    let mut moved = theta.clone();
    moved[entry] = 1e-3;
    assert!((run(&moved).v[0] - silent.v[0]).abs() > 1e-7);
}

/// Where a formula is not defined the step stops and names the force and the place.
#[test]
fn what_is_not_defined_is_named() {
    let stopped = |scene: &Scene| {
        let model = ModelBuilder::new(scene).unwrap().build();
        let theta = model.params().values().to_vec();
        let mut stepper = Stepper::new(&model, &theta, StepOptions::default()).unwrap();
        stepper.step(&mut model.initial_state(), &vec![0.0; model.nu()]).unwrap_err()
    };
    let own = force(Formulas::One("c*log(q - 3)".to_owned()), &[("c", 0.1)]);
    let error = stopped(&arm(vec![Force { joint: Some("shoulder".to_owned()), ..own }], |_| {}));
    let StepError::NotFinite { term, place, value, .. } = &error else { panic!("{error}") };
    assert_eq!((term.as_str(), place.as_str()), ("force \"own\"", "joint `shoulder`"));
    assert!(value.is_nan() && error.to_string().contains("`force \"own\"` gives NaN at joint `shoulder`"), "{error}");

    let mut scene = scene("own_force");
    let own = force(three(["0", "c/(z - z)", "0"]), &[("c", 0.1)]);
    scene.force = vec![Force { rope: Some("cord".to_owned()), nodes: Some(vec![2]), ..own }];
    let error = stopped(&scene);
    assert!(error.to_string().contains("`force \"own\"` gives inf at") && error.to_string().contains("node 2"), "{error}");
}
