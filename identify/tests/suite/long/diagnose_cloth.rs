//! Hidden effects of a strip of cloth are named, by logs of another integrator and step.

use crate::cloth_logs::{Logged, setup};
use pliant_identify::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use tempfile::TempDir;

fn diagnosed(logged: &Logged) -> Diagnosis {
    let folder = TempDir::new().unwrap();
    let setup = setup(&folder, logged, "");
    let logs = setup.read_logs(&[]).unwrap();
    diagnose(&setup, &logs, &DiagnoseOptions::default(), &mut |_| {}).unwrap()
}

/// Diagnoses logs of a sheet with these keys; exactly this cause is named, with these estimates within a part of them.
#[track_caller]
fn named(logged: &Logged, title: &str, truth: &[(&str, f64)], within: f64) {
    let d = diagnosed(logged);
    let titles: Vec<String> = d.causes.iter().map(|c| c.title()).collect();
    assert_eq!((d.verdict, titles.as_slice()), (Verdict::Named, &[title.to_owned()][..]), "{}", d.reason);
    for (path, value) in truth {
        let found = d.causes[0].parameters.iter().find(|p| p.path == *path).unwrap();
        assert!((found.estimate / value - 1.0).abs() < within, "{found:?}, truth {value}");
    }
    let whole = d.gain.last().unwrap();
    assert!(whole.rmse_after < 0.8 * whole.rmse_before, "{whole:?}");
}

#[test]
fn nothing_is_claimed_where_nothing_is_hidden() {
    let d = diagnosed(&Logged::default());
    assert_eq!(d.verdict, Verdict::Adequate, "{}", d.reason);
    assert!(d.causes.is_empty());
}

#[test]
fn quadratic_drag_is_named_with_its_size() {
    named(
        &Logged { sheet: &[("drag_quadratic", 0.2)], ..Logged::default() },
        "quadratic_drag",
        &[("sheet.drag_quadratic", 0.2)],
        0.1,
    );
}

#[test]
fn damping_of_bending_is_named_with_its_size() {
    named(
        &Logged { sheet: &[("bend_damping", 4e-5)], ..Logged::default() },
        "internal_damping",
        &[("sheet.bend_damping", 4e-5)],
        0.1,
    );
}

#[test]
fn a_tilt_of_gravity_is_named_with_its_size() {
    let tilt = [("gravity.tilt[0]", 0.02), ("gravity.tilt[1]", -0.015)];
    named(&Logged { tilt: [0.02, -0.015], ..Logged::default() }, "gravity_tilt", &tilt, 0.1);
}
