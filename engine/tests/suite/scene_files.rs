//! Scenes are read as written, and written as read.

use pliant_scene::{
    Clamp, End, Gripper, Initial, Integrator, Mode, Nothing, Plane, Rope, Scene, Sphere, check, control_list, control_rows,
    initial_state, parse_scene, read_scene,
};

#[test]
fn a_scene_survives_a_round_trip() {
    let between = Initial::Between { from: [0.0; 3], to: [0.5, 0.0, 0.1], sag: Some(0.2) };
    let mut scene = Scene::<Nothing> {
        rope: vec![
            Rope { name: "a".into(), nodes: None, edge_fractions: Some(vec![0.2, 0.3, 0.5]), ..Rope::default() },
            Rope { name: "b".into(), initial: between, ..Rope::default() },
        ],
        gripper: vec![
            Gripper {
                name: "g".into(),
                rope: Some("a".into()),
                clamp: Clamp::End(End::Last),
                mode: Mode::Velocity,
                ..Gripper::default()
            },
            Gripper { name: "k".into(), rope: Some("b".into()), clamp: Clamp::Nodes(vec![0, -1]), ..Gripper::default() },
        ],
        plane: vec![Plane { point: [0.0, 0.0, -1.0], ..Plane::default() }],
        sphere: vec![Sphere { name: "ball".into(), center: [9.0; 3], radius: 0.5, friction: 0.1 }],
        ..Scene::default()
    };
    scene.time.integrator = Integrator::Sdirk2;
    check(&scene).unwrap();
    let text = toml::to_string(&scene).unwrap();
    assert_eq!(parse_scene::<Nothing>(&text, "written.toml").unwrap(), scene, "{text}");
}

#[test]
fn an_experiment_is_not_looked_into() {
    let text = "schema_version = 1\n[time]\nstep = 0.01\n[[rope]]\nname = \"r\"\nnodes = 3\nlength = 1\nlinear_density = 0.1\n\
        stretch_stiffness = 10\ninitial = { shape = \"straight\", from = [0, 0, 0], direction = [0, 0, 1] }\n\
        [experiment]\nanything = [1, 2]\n";
    assert_eq!(parse_scene::<Nothing>(text, "s.toml").unwrap().experiment, Some(Nothing {}));
}

#[test]
fn every_shared_scene_is_accepted() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/scenes");
    let Ok(entries) = std::fs::read_dir(&folder) else { return };
    for path in entries.map(|entry| entry.unwrap().path()).filter(|path| path.extension().is_some_and(|e| e == "toml")) {
        let scene = read_scene::<Nothing>(&path).unwrap_or_else(|error| panic!("{error}"));
        let (q, v) = initial_state(&scene).unwrap();
        assert_eq!(q.len(), v.len());
        let rows = control_rows(&scene, scene.time.n_steps()).unwrap();
        assert!(rows.iter().all(|row| row.len() == control_list(&scene).len()), "{}", path.display());
    }
}
