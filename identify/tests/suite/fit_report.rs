//! Statements of a fit beyond its estimates: undetermined combinations, and a residual that is not noise.

use pliant_identify::log::Setup;
use pliant_identify::{FitReport, fit_scene};
use pliant_scene::Source;
use std::path::{Path, PathBuf};

/// The example's fit with further free parameters.
fn fit(more: &str) -> FitReport {
    let folder: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/hidden_effect");
    let text = std::fs::read_to_string(folder.join("scene.toml")).unwrap();
    let stiffness = "upper = 1.0e-1 }";
    assert!(text.contains(stiffness));
    let text = text.replace(stiffness, &format!("{stiffness}{more}"));
    let setup = Setup::from_source(Source::new("scene.toml", text), folder).unwrap();
    let logs = setup.read_logs(&[]).unwrap();
    fit_scene(&setup, &logs, &mut |_| {}).unwrap()
}

/// Density and equal masses at all nodes are the same thing, but for the end nodes, which are held.
#[test]
fn what_the_data_do_not_determine_has_its_bounds_as_interval() {
    let density = r#"{ path = "cable.linear_density", lower = 0.01, upper = 0.2 }"#;
    let masses = r#"{ path = "cable.node[*].mass", lower = 0.0, upper = 0.02 }"#;
    let report = fit(&format!(", {density}, {masses}"));
    assert!(!report.unidentifiable.is_empty(), "{report}");
    assert_eq!(report.parameters[1].interval, Some([0.01, 0.2]), "{report}");
    assert_eq!(report.parameters[2].interval, Some([0.0, 0.02]), "{report}");
}

/// Too little damping leaves a slow residual. Whitened by its own colour, lengths that fit its fast part win, at three times the
/// error of the stiffness alone.
#[test]
fn a_fit_does_not_give_up_least_squares() {
    let stiffness = fit("");
    let scale = r#"{ path = "sensor.scale", lower = 0.9, upper = 1.1 }"#;
    let length = r#"{ path = "cable.length", lower = 0.5, upper = 0.9 }"#;
    let report = fit(&format!(", {scale}, {length}"));
    assert!(report.rmse_fit <= 1.01 * stiffness.rmse_fit, "{report}");
    assert!(report.warnings.iter().any(|w| w.contains("not noise") && w.contains("pliant diagnose")), "{report}");
    assert!(
        report.parameters.iter().all(|p| p.interval.is_some_and(|[low, high]| low < p.estimate && p.estimate < high)),
        "{report}"
    );
}

#[test]
fn a_model_that_lacks_nothing_is_not_warned_of() {
    let report = fit(r#", { path = "cable.bend_damping", lower = 0.0, upper = 1e-3 }"#);
    assert!(report.warnings.is_empty() && report.unidentifiable.is_empty() && report.converged, "{report}");
    assert!((report.parameters[1].estimate - 5e-5).abs() < 2e-6, "{report}");
}

#[test]
fn an_estimate_at_its_bound_is_pointed_out() {
    let report = fit(r#", { path = "cable.bend_damping", lower = 1e-5, upper = 3e-5 }"#);
    assert!(report.warnings.iter().any(|w| w.starts_with("cable.bend_damping ends at its upper bound, 3e-5 N·m²·s")), "{report}");
}
