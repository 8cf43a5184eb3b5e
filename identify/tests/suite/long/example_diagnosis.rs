//! The example's logs come from another simulator (see `validation/blind/make_example.py`), which hides internal damping:
//! 5e-5 N·m²·s where the scene believes 2e-5, and a bending stiffness of 1.5e-3 N·m² where it guesses 1.2e-3.

use pliant_identify::log::Setup;
use pliant_identify::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use pliant_scene::Source;
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/hidden_effect")
}

fn run(change: impl Fn(String) -> String) -> Diagnosis {
    let text = std::fs::read_to_string(folder().join("scene.toml")).unwrap();
    let setup = Setup::from_source(Source::new("scene.toml", change(text)), folder()).unwrap();
    let logs = setup.read_logs(&[]).unwrap();
    diagnose(&setup, &logs, &DiagnoseOptions::default(), &mut |_| {}).unwrap()
}

#[test]
fn the_hidden_effect_is_named_with_its_size() {
    let d = run(|text| text);
    assert_eq!(d.verdict, Verdict::Named, "{}", d.reason);
    let names: Vec<&str> = d.causes.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["internal_damping"]);
    let damping = &d.causes[0].parameters[0];
    assert!((damping.estimate - 5e-5).abs() < 2e-6, "{damping:?}");
    let [low, high] = damping.interval.unwrap();
    assert!(low < damping.estimate && damping.estimate < high);
    let stiffness = d.stages.last().unwrap().parameters.iter().find(|p| p.path == "cable.bend_stiffness").unwrap();
    assert!((stiffness.estimate - 1.5e-3).abs() < 3e-5, "{stiffness:?}");
    let offsets = d.candidates.iter().filter(|c| c.name == "gripper_offset").map(|c| c.object.as_deref());
    assert_eq!(offsets.collect::<Vec<_>>(), [Some("left"), Some("right")]);
    assert!(d.candidates.iter().filter(|c| c.name != "gripper_offset").all(|c| c.object.is_none()));
    let whole = d.gain.last().unwrap();
    assert!(whole.rmse_after < 0.4 * whole.rmse_before, "{whole:?}");
}

#[test]
fn nothing_is_claimed_where_nothing_is_hidden() {
    let d = run(|text| text.replace("bend_damping = 2.0000e-05", "bend_damping = 5.0e-05"));
    assert!(!d.audit.iter().any(|f| f.what.contains("gripper holds")));
    assert_eq!(d.verdict, Verdict::Adequate, "{} {:?}", d.reason, d.causes);
    assert!(d.causes.is_empty() && d.alternatives.is_empty());
}

/// The gripper's own log as a marker: fitted to rounding, and said.
#[test]
fn a_marker_on_a_held_node_is_pointed_out() {
    let marker =
        "[[experiment.marker]]\nrope = \"cable\"\nnode = -1\ncolumns = [\"right12_x\", \"right12_y\", \"right12_z\"]\n\n";
    let first = "[[experiment.input]]\ngripper = \"left\"";
    let d = run(|text| text.replacen(first, &format!("{marker}{first}"), 1));
    let found: Vec<_> =
        d.audit.iter().filter(|f| f.what == "marker 4 is on node 12 of \"cable\", which a gripper holds").collect();
    assert_eq!((found.len(), found[0].severity.as_str(), found[0].place.as_str()), (1, "info", "Point(4)"));
}
