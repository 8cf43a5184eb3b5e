//! Hidden effects of a rod between two grippers are named, and derivatives of readings cover grippers and sections.

use crate::rod_logs::{Logged, setup};
use pliant_identify::log::Setup;
use pliant_identify::shooting::{Plan, ShotWants, shoot};
use pliant_identify::unknown::Unknown;
use pliant_identify::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use pliant_scene::Source;
use tempfile::TempDir;

fn diagnosed(logged: &Logged) -> Diagnosis {
    let folder = TempDir::new().unwrap();
    let setup = setup(&folder, logged);
    let logs = setup.read_logs(&[]).unwrap();
    diagnose(&setup, &logs, &DiagnoseOptions::default(), &mut |_| {}).unwrap()
}

#[test]
fn nothing_is_claimed_where_nothing_is_hidden() {
    let d = diagnosed(&Logged::default());
    assert_eq!(d.verdict, Verdict::Adequate, "{}", d.reason);
    assert!(d.causes.is_empty());
}

#[test]
fn curvature_by_nature_is_named_with_its_size() {
    let d = diagnosed(&Logged { more: "rest_curvature = [0.9, -0.6]", ..Logged::default() });
    assert_eq!(d.verdict, Verdict::Named, "{}", d.reason);
    let titles: Vec<String> = d.causes.iter().map(|c| c.title()).collect();
    assert_eq!(titles, ["intrinsic_curvature"], "{}", d.reason);
    for (estimate, truth) in d.causes[0].parameters.iter().zip([0.9, -0.6]) {
        assert!((estimate.estimate - truth).abs() < 0.05, "{estimate:?}");
    }
    let whole = d.gain.last().unwrap();
    assert!(whole.rmse_after < 0.5 * whole.rmse_before, "{whole:?}");
}

/// Of records that begin as the data have them, with twist nobody sees.
#[test]
fn readings_know_what_grippers_and_sections_hide() {
    let folder = TempDir::new().unwrap();
    let setup = setup(&folder, &Logged::default());
    let text = setup.source.text.replace("initial = \"rest\"", "initial = \"given\"");
    let setup = Setup::from_source(Source::new("scene.toml", &text), folder.path().to_owned()).unwrap();
    let plan = Plan::opened(&setup, &setup.read_logs(&[]).unwrap()).unwrap();
    let paths = [
        "rod.rest_curvature[0]",
        "rod.rest_curvature[1]",
        "rod.rest_twist",
        "rod.node[3].rest_curvature[0]",
        "rod.node[4..5].bend_factor",
        "rod.twist_stiffness",
        "rod.creep_fraction",
        "rod.edge[4].rest_strain",
        "rod.yield_curvature",
        "rod.plastic_time",
        "rod.stiffening",
        "rod.friction_moment",
        "rod.friction_curvature",
        "left.offset[1]",
        "right.roll",
        "left.roll_by_direction[1]",
        "right.roll_by_position[0]",
    ];
    let of_rod = paths.iter().map(|path| Unknown::of_theta(&plan.model, path, 1.0).unwrap());
    let beside = |k: usize, axis| Unknown::beside(format!("marker[{k}].offset[{axis}]"), vec![k], axis, 1e-2);
    let unknowns: Vec<Unknown> = of_rod.chain([beside(0, 0), beside(2, 1)]).collect();
    let mut values = plan.scene_values.clone();
    for (u, x) in unknowns
        .iter()
        .zip([0.4, -0.3, 0.5, 0.2, 0.9, 8e-4, 0.2, 0.01, 0.3, 0.5, 0.02, 1e-3, 0.5, 2e-3, 0.3, 0.4, -0.5, 4e-3, -3e-3])
    {
        u.set(&mut values, x);
    }
    let rec = &plan.fitted[1];
    let wants = ShotWants { unknowns: &unknowns, tangents: true, until: Some(0.15), states: false };
    let shot = shoot(&plan, rec, &values, wants).unwrap();
    for (j, unknown) in unknowns.iter().enumerate() {
        let slope = unknown.slope(unknown.value(&values));
        let at = |by: f64| {
            let mut moved = values.clone();
            unknown.set(&mut moved, unknown.value(&values) + by);
            shoot(&plan, rec, &moved, ShotWants { until: Some(0.15), ..ShotWants::default() }).unwrap().predicted
        };
        let e = 1e-5 * unknown.scale.min(1.0);
        let (up, down) = (at(e), at(-e));
        let columns = unknowns.len();
        let size = (0..up.len()).map(|r| shot.global[r * columns + j].abs()).fold(0.0, f64::max);
        assert!(size > 0.0, "{}", unknown.path);
        for r in 0..up.len() {
            let difference = (up[r] - down[r]) / (2.0 * e) * slope;
            assert!(
                (shot.global[r * columns + j] - difference).abs() < 2e-5 * size,
                "{} {r}: {}",
                unknown.path,
                difference / size
            );
        }
    }
}
