//! Further effects hidden in a rod between two grippers, one whole diagnosis each.

use crate::rod_logs::{Logged, setup};
use pliant_identify::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use tempfile::TempDir;

fn diagnosed(logged: &Logged) -> Diagnosis {
    let folder = TempDir::new().unwrap();
    let setup = setup(&folder, logged);
    let logs = setup.read_logs(&[]).unwrap();
    diagnose(&setup, &logs, &DiagnoseOptions::default(), &mut |_| {}).unwrap()
}

/// The one cause that a diagnosis names.
fn only(logged: &Logged, title: &str) -> Diagnosis {
    let d = diagnosed(logged);
    let titles: Vec<String> = d.causes.iter().map(|c| c.title()).collect();
    assert_eq!((d.verdict, titles.as_slice()), (Verdict::Named, [title.to_owned()].as_slice()), "{}", d.reason);
    d
}

#[test]
fn markers_beside_the_centreline_are_named_with_their_distance() {
    let d = only(&Logged { offset: [4e-3, -3e-3], ..Logged::default() }, "marker_offset");
    for (k, estimate) in d.causes[0].parameters.iter().enumerate() {
        assert!((estimate.estimate - [4e-3, -3e-3][k % 2]).abs() < 5e-4, "{estimate:?}");
    }
}

#[test]
fn edges_of_other_lengths_are_named_with_their_strains() {
    let strains = [0.0, 0.02, -0.03, 0.0, 0.025, -0.01, 0.0, 0.0];
    let rope = format!("edge_rest_strains = {strains:?}");
    let d = only(&Logged { rope: &rope, ..Logged::default() }, "edge_lengths");
    for (estimate, truth) in d.causes[0].parameters.iter().zip(&strains[1..7]) {
        assert!((estimate.estimate - truth).abs() < 3e-3, "{estimate:?}");
    }
}

#[test]
fn a_rod_that_stays_bent_is_named() {
    let d = diagnosed(&Logged { more: "[rope.plasticity]\nyield_curvature = 0.5\ntime = 0.3", ..Logged::default() });
    let titles: Vec<String> = d.causes.iter().map(|c| c.title()).collect();
    assert_eq!((d.verdict, titles.as_slice()), (Verdict::Named, ["rod_plasticity".to_owned()].as_slice()), "{}", d.reason);
    let [time, limit] = [0, 1].map(|k| d.causes[0].parameters[k].estimate);
    assert!((time - 0.3).abs() < 0.01 && (limit - 0.5).abs() < 0.06, "{:?}", d.causes[0].parameters);
}

#[test]
fn a_rod_that_creeps_is_named() {
    only(&Logged { more: "[rope.creep]\nfraction = 0.6\ntime = 0.4", ..Logged::default() }, "rod_creep");
}

#[test]
fn a_rod_that_stiffens_is_named() {
    let d = only(&Logged { more: "[rope.stiffening]\ncoefficient = 4e-3", ..Logged::default() }, "bend_stiffening");
    assert!((d.causes[0].parameters[0].estimate - 4e-3).abs() < 4e-4, "{:?}", d.causes[0].parameters);
}

#[test]
fn friction_inside_a_rod_is_named() {
    only(&Logged { more: "[rope.bend_friction]\nmoment = 1e-3\ncurvature = 0.5", ..Logged::default() }, "bend_friction");
}

#[test]
fn a_gripper_that_turns_the_rod_as_it_goes_is_named() {
    only(
        &Logged {
            hand: "roll_by_direction = [0.0, 1.2, 0.0]",
            more: "rest_curvature = [0.9, -0.6]",
            known: true,
            ..Logged::default()
        },
        "clamp_roll_by_direction (left)",
    );
}
