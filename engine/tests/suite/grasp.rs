//! Grippers that grasp, and steps without momentum, against closed forms; and what is refused.

use pliant_engine::equilibrium::equilibrium;
use pliant_engine::grasp::Grasping;
use pliant_engine::model::{Model, ModelBuilder};
use pliant_engine::rollout::{Rollout, rollout};
use pliant_engine::step::{StepOptions, Stepper};
use pliant_scene::{
    Clamp, Cloth, Grasp, Grid, Gripper, Initial, Integrator, Mode, Motion, Nothing, Rope, Scene, Time, control_list,
    control_rows, parse_scene, resting_inputs,
};
use std::sync::Arc;

const G: f64 = 9.81;

/// A rope of two nodes that hangs down from the origin, 10 g, and a hand above its upper end.
fn hanging(at: [f64; 3], grasp: Grasp) -> Scene {
    let initial = Initial::Straight { from: [0.0; 3], direction: [0.0, 0.0, -1.0] };
    let rope = Rope {
        nodes: Some(2),
        length: 0.1,
        linear_density: 0.1,
        stretch_stiffness: 1e3,
        bend_stiffness: 0.0,
        bend_damping: 0.0,
        initial,
        ..Rope::default()
    };
    let hand = Gripper { clamp: Clamp::Grasp(Grasp { at, ..grasp }), ..Gripper::default() };
    let time = Time { step: 0.01, duration: 0.5, integrator: Integrator::QuasiStatic };
    Scene { rope: vec![rope], gripper: vec![hand], time, ..Scene::default() }
}

fn model(scene: &Scene) -> Arc<Model> {
    Arc::new(ModelBuilder::new(scene).unwrap().build())
}

fn simulated(scene: &Scene) -> Rollout {
    let (model, u) = (model(scene), control_rows(scene, scene.time.n_steps()).unwrap());
    rollout(&model, model.params().values(), &model.initial_state(), &u, StepOptions { record: false, ..Default::default() })
        .unwrap()
}

fn height(run: &Rollout, k: usize, node: usize) -> f64 {
    run.states[k].q[3 * node + 2]
}

#[test]
fn a_spring_carries_the_rope_by_its_weight_over_its_stiffness() {
    let grasp = Grasp { radius: 0.01, stiffness: 200.0, closing_time: 0.0, ..Grasp::default() };
    let mut scene = hanging([0.0, 0.0, 0.002], grasp);
    let run = simulated(&scene);
    let last = run.states.len() - 1;
    let sigma = 1.0 / (1.0 + (-7.5_f64).exp()); // steepness 15, c = 1
    let (weight, n) = (0.01 * G, run.model.grasps()[0].node);
    let extension = height(&run, last, n) - height(&run, last, 0);
    assert!((extension - weight / (200.0 * sigma)).abs() < 1e-12, "{extension}");
    // the rope's own: half its weight hangs on its edge
    let edge = height(&run, last, 0) - height(&run, last, 1);
    assert!((edge - 0.1 * (1.0 + 0.5 * weight / 1e3)).abs() < 1e-12, "{edge}");
    assert_eq!(run.model.grasps()[0].held(&run.states[last].z).unwrap()[0], (0, 1.0));

    // a softer hold of half a closing
    let Clamp::Grasp(grasp) = &mut scene.gripper[0].clamp else { unreachable!() };
    grasp.closing = vec![[0.0, 0.6]];
    let run = simulated(&scene);
    let softer = height(&run, last, n) - height(&run, last, 0);
    let sigma = 1.0 / (1.0 + (-1.5_f64).exp());
    assert!((softer - weight / (200.0 * sigma)).abs() < 1e-12, "{softer}");
}

#[test]
fn what_is_seized_is_drawn_in_exponentially() {
    let (h, tau) = (0.01, 0.07);
    let grasp = Grasp { radius: 0.03, stiffness: 1e5, closing_time: tau, ..Grasp::default() };
    let mut scene = hanging([0.012, -0.005, 0.01], grasp);
    scene.gravity.magnitude = 0.0;
    let run = simulated(&scene);
    let place = run.model.grasps()[0].memory + 2;
    for k in 1..run.states.len() {
        let left = (-(k as f64) * h / tau).exp();
        for (a, o) in [-0.012, 0.005, -0.01].into_iter().enumerate() {
            assert!((run.states[k].z[place + a] - o * left).abs() < 1e-15);
            // a stiff spring has it there at the end of the step, but for what accelerates it
            let off = run.states[k].q[a] - run.states[k].q[3 * run.model.grasps()[0].node + a];
            assert!((off - o * left).abs() < 2e-3 * 0.012, "{off} {}", o * left);
        }
    }
}

#[test]
fn out_of_reach_or_open_nothing_is_pulled() {
    let grasp = Grasp { radius: 0.01, ..Grasp::default() };
    let far = simulated(&hanging([0.0, 0.0, 0.0101], grasp.clone()));
    let open = simulated(&hanging([0.0; 3], Grasp { closing: vec![[0.0, 0.499]], ..grasp.clone() }));
    for run in [far, open] {
        // each quasi-static step falls by h² g from rest
        let fallen = height(&run, 0, 1) - height(&run, 1, 1);
        assert!((fallen - 1e-4 * G).abs() < 1e-13, "{fallen}");
        assert!(run.states.iter().all(|x| run.model.grasps()[0].held(&x.z).is_none()));
    }
}

/// A point far down an edge is held where it was seized, however the rope is pulled along itself.
#[test]
fn what_is_held_does_not_slip() {
    let grasp = Grasp { at: [0.23, 0.001, 0.0], radius: 0.01, stiffness: 500.0, ..Grasp::default() };
    let rope =
        Rope { nodes: Some(5), length: 0.4, linear_density: 0.05, bend_stiffness: 0.0, bend_damping: 0.0, ..Rope::default() };
    let hand = Gripper { clamp: Clamp::Grasp(grasp), ..Gripper::default() };
    let time = Time { step: 0.05, duration: 20.0, integrator: Integrator::QuasiStatic };
    let scene = Scene { rope: vec![rope], gripper: vec![hand], time, ..Scene::default() };
    let run = simulated(&scene);
    let held = |k: usize| run.model.grasps()[0].held(&run.states[k].z).unwrap();
    for (node, weight) in held(400) {
        let expected = if node == 2 { 0.7 } else { 0.3 };
        assert!((weight - expected).abs() < 1e-12, "{node}: {weight}");
    }
    assert_eq!(held(1), held(400));
    // the edge held at 3 of its 10 cm stands upright, as the moments of the 2.5 and 1.5 nodal masses at its ends have it:
    // 2.5 * 3 cm < 1.5 * 7 cm
    for (node, z) in [(2, 0.03), (0, 0.03 - 0.2), (3, -0.07), (4, -0.07 - 0.1)] {
        assert!((height(&run, 400, node) - z).abs() < 1e-3, "{node}: {}", height(&run, 400, node));
    }
}

#[test]
fn a_sheet_is_seized_at_its_nearest_point() {
    let cloth = Cloth { grid: Some(Grid { nodes: [4, 4], size: [0.3, 0.3], ..Grid::default() }), ..Cloth::default() };
    let grasp = Grasp { at: [0.17, 0.12, 0.004], radius: 0.01, ..Grasp::default() };
    let hand = Gripper { rope: None, cloth: Some(cloth.name.clone()), clamp: Clamp::Grasp(grasp), ..Gripper::default() };
    let time = Time { step: 0.005, duration: 0.05, integrator: Integrator::Euler };
    let scene = Scene { cloth: vec![cloth], gripper: vec![hand], time, ..Scene::default() };
    let run = simulated(&scene);
    let rest = &run.states[0].q;
    let held = run.model.grasps()[0].held(&run.states[1].z).unwrap();
    let place: Vec<f64> = (0..3).map(|a| held.iter().map(|(node, w)| w * rest[3 * node + a]).sum()).collect();
    assert!((place[0] - 0.17).abs() < 1e-14 && (place[1] - 0.12).abs() < 1e-14 && place[2].abs() < 1e-14, "{place:?}");
    assert!(held.iter().all(|(_, w)| *w > 0.0));
}

/// F = k σ a(d) d at a distance, a(d) as documented, seen in the acceleration of a rope without weight.
#[test]
fn the_smoothed_pull_is_the_documented_one() {
    let (d, r, eps, tail, far) = (0.06, 0.02, 0.005, 0.3, 0.04);
    let grasp =
        Grasp { radius: r, stiffness: 2.0, smoothing: eps, tail, tail_reach: Some(far), steepness: 4.0, ..Grasp::default() };
    let mut scene = hanging([0.0, 0.0, d], grasp);
    (scene.gravity.magnitude, scene.time.integrator) = (0.0, Integrator::Euler);
    let model = model(&scene);
    let (theta, u) = (model.params().values(), control_rows(&scene, 1).unwrap());
    let mut stepper = Stepper::new(&model, theta, StepOptions::default()).unwrap().with_grasping(Grasping::Smooth);
    let mut x = model.initial_state();
    stepper.step(&mut x, &u[0]).unwrap();
    let sigma = 1.0 / (1.0 + (-2.0_f64).exp());
    let a = (1.0 - tail) / (1.0 + ((d - r) / eps).exp()) + tail / (1.0 + (d / far).powi(2));
    // momentum of both nodes = h F at the end of the step
    let momentum = 0.005 * (x.v[2] + x.v[5]);
    let force = 2.0 * sigma * a * (d - x.q[2]);
    assert!((momentum / (0.01 * force) - 1.0).abs() < 1e-12, "{momentum} {force}");
    assert!(model.grasps()[0].held(&x.z).is_none());
}

#[test]
fn controls_names_and_schedules() {
    let grasp = Grasp { closing: vec![[0.1, 0.0], [0.2, 1.0]], ..Grasp::default() };
    let mut scene = hanging([0.1, 0.2, 0.3], grasp);
    let points = vec![[0.1, 0.0, 0.0, 0.0], [0.3, 0.0, 0.2, 0.0], [0.4, 0.0, 0.2, 0.1]];
    (scene.gripper[0].motion, scene.gripper[0].offset) = (Motion::Path { points }, [0.0, 0.0, 0.05]);
    let names = |scene: &Scene| control_list(scene).into_iter().map(|c| (c.name, c.unit)).collect::<Vec<_>>();
    assert_eq!(names(&scene)[2..], [("hand.position.z".to_owned(), "m"), ("hand.closing".to_owned(), "-")]);
    assert_eq!(resting_inputs(&scene).unwrap(), [0.1, 0.2, 0.25, 0.0]);
    let rows = control_rows(&scene, 50).unwrap();
    assert!((rows[19][1] - 0.3).abs() < 1e-12, "half way at 0.2 s: {}", rows[19][1]);
    assert!((rows[49][1] - 0.4).abs() < 1e-15 && (rows[49][2] - 0.35).abs() < 1e-15);
    assert!((rows[14][3] - 0.45).abs() < 1e-12, "the middle of its step: {}", rows[14][3]);
    scene.gripper[0].mode = Mode::Velocity;
    assert_eq!(names(&scene)[2].0, "hand.velocity.z");
    let way: f64 = control_rows(&scene, 50).unwrap().iter().map(|u| 0.01 * u[1]).sum();
    assert!((way - 0.2).abs() < 1e-12);
    let model = model(&scene);
    let expected = ["hand.held", "hand.held_weight[1]", "hand.held_offset.x", "hand.held_offset.y", "hand.held_offset.z"];
    assert_eq!(model.memory_names(), expected);
    for (key, unit) in [("stiffness", "N/m"), ("radius", "m"), ("smoothing", "m"), ("tail", "-"), ("closing_time", "s")] {
        let info = model.params().info(model.params().find(&format!("hand.{key}")).unwrap());
        assert_eq!((info.unit, info.lower >= 0.0), (unit, true), "{key}");
    }
    assert_eq!(scene.refined().inputs.len(), 4);
}

/// A rope between two hands, one of which moves slowly, is where it would be at rest; its own time is 1/(h ω²).
#[test]
fn a_slowly_moved_rope_follows_its_equilibrium() {
    let initial = Initial::Between { from: [0.0; 3], to: [0.4, 0.0, 0.0], sag: Default::default() };
    let rope = Rope {
        nodes: Some(13),
        length: 0.5,
        linear_density: 0.06,
        stretch_stiffness: 500.0,
        bend_stiffness: 1e-4,
        initial,
        ..Rope::default()
    };
    let left = Gripper { name: "left".into(), ..Gripper::default() };
    let motion = Motion::Path { points: vec![[0.0; 4], [4.0, -0.05, 0.02, 0.06]] };
    let right = Gripper { name: "right".into(), clamp: Clamp::Nodes(vec![-1]), motion, ..Gripper::default() };
    let time = Time { step: 0.05, duration: 40.0, integrator: Integrator::QuasiStatic };
    let scene = Scene { rope: vec![rope], gripper: vec![left, right], time, ..Scene::default() };
    let run = simulated(&scene);
    let rest = equilibrium(&run.model, run.model.params().values(), &run.states[0].q, run.controls.last().unwrap()).unwrap();
    let off = |k: usize| rest.q.iter().zip(&run.states[k].q).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
    let [start, near, end] = [0, 400, 800].map(off);
    println!("off by {start:.1e}, after 20 s {near:.1e}, after 40 s {end:.1e}");
    assert!(start > 0.01 && near < 1e-10 && end < 1e-10);
}

const GOOD: &str = r#"schema_version = 1
[time]
step = 0.01
integrator = "quasi_static"
[[rope]]
name = "cable"
nodes = 5
length = 1.0
linear_density = 0.05
stretch_stiffness = 1.0e4
initial = { shape = "straight", from = [0, 0, 0.5], direction = [1, 0, 0] }
[[gripper]]
name = "hand"
rope = "cable"
grasp = { at = [0.5, 0, 0.5], radius = 0.01, stiffness = 800.0, smoothing = 1e-3, closing = [[0.0, 0.0], [0.1, 1.0]] }
motion = { kind = "path", points = [[0.0, 0, 0, 0], [0.2, 0, 0, 0.1]] }
"#;

#[track_caller]
fn refused(old: &str, new: &str, place: &str, parts: &[&str]) {
    crate::common::refused(GOOD, (old, new), place, parts);
}

#[test]
fn mistakes_are_told() {
    assert!(parse_scene::<Nothing>(GOOD, "scene.toml").is_ok());
    let grasp = "15: gripper[0].grasp";
    refused("grasp = {", "nodes = [0]\ngrasp = {", "12: gripper[0]", &["more than one of the keys", "`nodes`", "`grasp`"]);
    refused("stiffness = 800.0", "stiffness = -800.0", &format!("{grasp}.stiffness"), &["-800 N/m", "must not be negative"]);
    refused("radius = 0.01", "radius = 0.0", &format!("{grasp}.radius"), &["must be positive"]);
    refused("radius = 0.01", "radius = 15", &format!("{grasp}.radius"), &["15 m", "mm", "0.015"]);
    refused("radius = 0.01", "radius = \"15 mm\"", &format!("{grasp}.radius"), &["not a number"]);
    refused("smoothing = 1e-3", "smoothing = 0", &format!("{grasp}.smoothing"), &["must be positive"]);
    refused("smoothing = 1e-3", "smothing = 1e-3", &format!("{grasp}.smothing"), &["unknown key", "did you mean `smoothing`"]);
    refused("smoothing = 1e-3", "tail = 2.0", &format!("{grasp}.tail"), &["between 0 and 1"]);
    refused("smoothing = 1e-3", "tail_reach = 0.0", &format!("{grasp}.tail_reach"), &["must be positive"]);
    refused("smoothing = 1e-3", "steepness = -1.0", &format!("{grasp}.steepness"), &["must be positive"]);
    refused("smoothing = 1e-3", "closing_time = -0.1", &format!("{grasp}.closing_time"), &["must not be negative"]);
    refused("[0.1, 1.0]]", "[0.0, 1.0]]", &format!("{grasp}.closing[1]"), &["at 0 s, not after", "order of their times"]);
    refused("[0.1, 1.0]]", "[0.1]]", &format!("{grasp}.closing[1]"), &["1 entries instead of 2"]);
    refused("[0.2, 0, 0, 0.1]", "[-0.2, 0, 0, 0.1]", "16: gripper[0].motion.points[1]", &["not after"]);
    refused("rope = \"cable\"", "rope = \"cabel\"", "14: gripper[0].rope", &["no rope \"cabel\"", "did you mean \"cable\""]);
    refused("rope = \"cable\"", "cloth = \"cable\"", "14: gripper[0].cloth", &["no cloth \"cable\""]);
    refused("rope = \"cable\"\n", "", "12: gripper[0]", &["none of the keys"]);
    refused("rope = \"cable\"", "rope = \"cable\"\nroll = 0.1", "15: gripper[0].roll", &["cannot be turned"]);
    refused("\"quasi_static\"", "\"quasistatic\"", "4: time.integrator", &["quasi_static"]);
}
