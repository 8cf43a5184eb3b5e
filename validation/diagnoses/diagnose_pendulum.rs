//! Further effects hidden in a pendulum, one whole diagnosis each.

use crate::pendulum::Truth;
use pliant_identify::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use tempfile::TempDir;

fn diagnosed(truth: &Truth) -> Diagnosis {
    let folder = TempDir::new().unwrap();
    let setup = crate::pendulum::setup(truth, &folder).unwrap();
    let logs = setup.read_logs(&[]).unwrap();
    diagnose(&setup, &logs, &DiagnoseOptions::default(), &mut |_| {}).unwrap()
}

/// Named alone, with this estimate.
fn estimated(truth: &Truth, cause: &str, path: &str, value: f64) -> Diagnosis {
    let d = diagnosed(truth);
    assert_eq!(d.verdict, Verdict::Named, "{}", d.reason);
    let titles: Vec<String> = d.causes.iter().map(|c| c.title()).collect();
    assert_eq!(titles, [cause], "{}", d.reason);
    let e = &d.causes[0].parameters[0];
    assert_eq!(e.path, path);
    assert!((e.estimate / value - 1.0).abs() < 0.03, "{e:?}");
    d
}

fn named(truth: &Truth, cause: &str, path: &str, value: f64) {
    let d = estimated(truth, cause, path, value);
    let whole = d.gain.last().unwrap();
    assert_eq!(whole.unit, "rad");
    assert!(whole.rmse_after < 0.5 * whole.rmse_before, "{whole:?}");
}

#[test]
fn dry_friction_is_named() {
    named(&Truth { friction: 0.02, ..Truth::default() }, "coulomb_friction (pivot)", "pivot.friction", 0.02);
}

#[test]
fn damping_by_the_square_of_the_speed_is_named() {
    let truth = Truth { quadratic: 0.005, ..Truth::default() };
    named(&truth, "quadratic_damping (pivot)", "pivot.quadratic_damping", 0.005);
}

#[test]
fn a_cubic_spring_is_named() {
    named(&Truth { cubic: 0.2, ..Truth::default() }, "cubic_stiffness (pivot)", "pivot.cubic_stiffness", 0.2);
}

/// No gain is asked for: the held-out pendulum turns over the top, where its first velocity decides as much as this cogging.
#[test]
fn cogging_is_named() {
    let d = estimated(&Truth { cogging: -0.05, ..Truth::default() }, "cogging_torque (pivot)", "pivot.cogging_sine", -0.05);
    let cosine = &d.causes[0].parameters[1];
    assert!(cosine.path == "pivot.cogging_cosine" && cosine.estimate.abs() < 0.002, "{cosine:?}");
}

#[test]
fn a_motor_that_saturates_is_named() {
    named(&Truth { limit: 0.5, ..Truth::default() }, "saturation (motor)", "motor.saturation", 0.5);
}

/// The angle a joint has crept by is known at the beginning of a record alone.
#[test]
fn a_spring_that_creeps_is_named() {
    let truth = Truth { spring: 1.0, creep: 2.0, ..Truth::default() };
    named(&truth, "joint_plasticity (pivot)", "pivot.plastic_time", 2.0);
}
