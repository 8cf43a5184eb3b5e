//! Hidden effects of a pendulum are named; effects that no log of it can tell apart are not.

use crate::pendulum::Truth;
use pliant_identify::diagnose::Status;
use pliant_identify::log::Interpolation;
use pliant_identify::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use tempfile::TempDir;

fn diagnosed(truth: &Truth) -> Diagnosis {
    diagnosed_at(truth, 0.00125)
}

fn diagnosed_at(truth: &Truth, step: f64) -> Diagnosis {
    diagnosed_but(truth, truth, &[], step)
}

/// The same with another truth in the held-out record, and an encoder that is dead in some records.
fn diagnosed_but(truth: &Truth, held_out: &Truth, dead: &[usize], step: f64) -> Diagnosis {
    let [folder, other] = [TempDir::new().unwrap(), TempDir::new().unwrap()];
    let mut setup = crate::pendulum::setup(truth, &folder).unwrap();
    held_out.logs(&other).unwrap();
    std::fs::copy(other.path().join("run3.csv"), folder.path().join("run3.csv")).unwrap();
    setup.scene.time.step = step;
    let mut logs = setup.read_logs(&[]).unwrap();
    for k in dead {
        logs.records[*k].joints.iter_mut().for_each(|row| row[0] = 0.0);
    }
    diagnose(&setup, &logs, &DiagnoseOptions::default(), &mut |_| {}).unwrap()
}

/// Records in which a sensor is said to stand still.
fn standing_still(d: &Diagnosis) -> usize {
    d.audit.iter().filter(|f| f.severity == "faulty" && f.what.contains("reads exactly 0 in every sample")).count()
}

fn named(truth: &Truth, cause: &str, path: &str, value: f64) {
    let d = diagnosed(truth);
    assert_eq!(d.verdict, Verdict::Named, "{}", d.reason);
    let titles: Vec<String> = d.causes.iter().map(|c| c.title()).collect();
    assert_eq!(titles, [cause], "{}", d.reason);
    let e = &d.causes[0].parameters[0];
    assert_eq!(e.path, path);
    assert!((e.estimate / value - 1.0).abs() < 0.03, "{e:?}");
    let whole = d.gain.last().unwrap();
    assert_eq!(whole.unit, "rad");
    assert!(whole.rmse_after < 0.5 * whole.rmse_before, "{whole:?}");
}

#[test]
fn nothing_is_claimed_where_nothing_is_hidden() {
    let d = diagnosed(&Truth::default());
    assert_eq!(d.verdict, Verdict::Adequate, "{}", d.reason);
    assert!((d.remainder.rmse / 1e-3 - 1.0).abs() < 0.1, "{:?}", d.remainder);
    // a pendulum swings by the ratio of weight and inertia alone, so a heavier one is no other one without its commands
    assert!(d.candidates.iter().any(|c| c.name == "payload" && c.status == Status::Tested));
}

#[test]
fn viscous_friction_is_named() {
    named(&Truth { damping: 0.01, ..Truth::default() }, "viscous_friction (pivot)", "pivot.damping", 0.01);
}

#[test]
fn a_record_with_a_dead_encoder_is_left_out() {
    let truth = Truth { damping: 0.01, ..Truth::default() };
    let d = diagnosed_but(&truth, &truth, &[1], 0.00125);
    assert_eq!((d.verdict, standing_still(&d), d.records.fit), (Verdict::Named, 1, 2), "{}", d.reason);
    assert!((d.causes[0].parameters[0].estimate / 0.01 - 1.0).abs() < 0.03, "{:?}", d.causes[0]);
}

#[test]
fn nothing_is_told_from_a_dead_encoder() {
    let truth = Truth { damping: 0.01, ..Truth::default() };
    let d = diagnosed_but(&truth, &truth, &[0, 1, 2, 3], 0.00125);
    assert_eq!((d.verdict, standing_still(&d)), (Verdict::Withheld, 4), "{}", d.reason);
    assert!(d.causes.is_empty() && d.extension.is_empty() && d.reason.contains("dead channel"), "{}", d.reason);
}

/// A command that is held comes half a sample later than one read as a straight line, which a delay or a lag would take up beside the cause.
#[test]
fn held_commands_are_no_delay_beside_a_cause() {
    let truth = Truth { damping: 0.01, held: true, noise: 1e-4, ..Truth::default() };
    let d = diagnosed(&truth);
    let titles: Vec<String> = d.causes.iter().map(|c| c.title()).collect();
    assert_eq!((d.verdict, titles), (Verdict::Named, vec!["viscous_friction (pivot)".to_owned()]), "{}", d.reason);
    assert_eq!(d.refined.map(|refined| refined.interpolation), Some(Interpolation::Held));
    assert!(d.reason.contains("nearer to commands that are read in another way"), "{}", d.reason);
    assert!((d.causes[0].parameters[0].estimate / 0.01 - 1.0).abs() < 0.01, "{:?}", d.causes[0]);
}

/// Balanced on its top by commands that answer to where it is. Replayed, they answer to nothing, and it falls over within a second: no model follows the
/// held-out record as a whole, and which one goes astray further is chance. So it is asked in pieces, as the fitted records are.
#[test]
fn a_cause_of_a_motion_that_cannot_be_replayed_is_named() {
    let balanced = Truth { turned: 2.4, held: true, balanced: true, seconds: 8.0, ..Truth::default() };
    let truth = Truth { damping: 0.01, noise: 1e-4, ..balanced };
    let folder = TempDir::new().unwrap();
    let mut setup = crate::pendulum::setup(&truth, &folder).unwrap();
    setup.experiment.interpolation = Interpolation::Held;
    let logs = setup.read_logs(&[]).unwrap();
    let d = diagnose(&setup, &logs, &DiagnoseOptions::default(), &mut |_| {}).unwrap();
    let titles: Vec<String> = d.causes.iter().map(|c| c.title()).collect();
    assert_eq!((d.verdict, titles), (Verdict::Named, vec!["viscous_friction (pivot)".to_owned()]), "{}", d.reason);
    let e = &d.causes[0].parameters[0];
    assert!((e.estimate / 0.01 - 1.0).abs() < 0.01, "{e:?}");
    // and the gain is that of pieces, which the model follows to the scatter of the readings
    let gain = &d.gain[d.gain.len() - 1];
    assert!(d.audit.iter().any(|f| f.what.contains("judged in pieces")), "{:?}", d.audit);
    assert!(gain.horizon_s < 4.0 && gain.rmse_after < 1.1e-4 && gain.rmse_before > 2.0 * gain.rmse_after, "{gain:?}");
    assert!(gain.interval.is_some_and(|[low, _]| low > 0.0), "{gain:?}");
}

/// Verdict ambiguous, with these among the alternatives.
fn ambiguous(truth: &Truth, among: &[&str]) {
    let d = diagnosed(truth);
    assert_eq!(d.verdict, Verdict::Ambiguous, "{}", d.reason);
    let titles = d.alternative_titles().concat();
    for title in among {
        assert!(titles.iter().any(|t| t == title), "{titles:?}");
    }
}

/// The two are the same motion seen from another zero: whatever is found, it must not be one of them alone.
#[test]
fn an_encoder_zero_is_not_named_beside_a_tilt() {
    let d = diagnosed(&Truth { bias: 0.02, ..Truth::default() });
    assert_ne!(d.verdict, Verdict::Named, "{}", d.reason);
}

/// Held commands come half a sample later than straight lines between them say: the log's reading is at fault, and no delay is named.
#[test]
fn held_commands_are_no_delay() {
    let d = diagnosed(&Truth { held: true, ..Truth::default() });
    assert_eq!(d.verdict, Verdict::Numerics, "{}", d.reason);
    assert_eq!(d.refined.map(|refined| refined.interpolation), Some(Interpolation::Held), "{}", d.reason);
    // a motor that is later than that is
    let d = diagnosed(&Truth { held: true, late: 0.02, ..Truth::default() });
    let delayed = |title: &String| title.starts_with("actuator_delay");
    let told: Vec<String> = d.causes.iter().map(|c| c.title()).chain(d.alternative_titles().concat()).collect();
    assert!(told.iter().any(delayed), "{:?}: {}", d.verdict, d.reason);
}

/// What three records show barely is accepted where the held-out one does not speak against it.
#[test]
fn a_weak_cause_has_to_stand_on_held_out_records() {
    let [weak, against] = [3.4e-5, -3.4e-5].map(|damping| Truth { damping, ..Truth::default() });
    ambiguous(&weak, &["viscous_friction (pivot)", "coulomb_friction (pivot)"]);
    let d = diagnosed_but(&weak, &against, &[], 0.00125);
    assert!(d.causes.is_empty() && d.extension.is_empty() && d.alternatives.is_empty(), "{}", d.reason);
    let lost = |name: &str| d.candidates.iter().any(|c| c.name == name && c.reason.contains("with it the held-out records lose"));
    assert!(lost("viscous_friction") && lost("coulomb_friction"), "{:?}", d.candidates);
}

#[test]
fn a_late_sensor_is_not_told_from_a_late_motor() {
    ambiguous(&Truth { late: 0.006, ..Truth::default() }, &["sensor_delay", "actuator_delay"]);
}

#[test]
fn a_motor_gain_is_not_told_from_all_inertias_and_weights() {
    ambiguous(&Truth { gain: 0.95, ..Truth::default() }, &["torque_gain (motor)", "payload (link)"]);
}

/// A law that is right in every record, with another size in each: of three fitted records 0.008, 0.012 and 0.016.
#[test]
fn a_size_that_differs_from_record_to_record_is_said_to_vary() {
    let d = diagnosed(&Truth { damping: 0.008, growth: 0.5, ..Truth::default() });
    assert_eq!(d.verdict, Verdict::Varies, "{}", d.reason);
    let titles: Vec<String> = d.causes.iter().map(|c| c.title()).collect();
    assert_eq!(titles, ["viscous_friction (pivot)"], "{}", d.reason);
    let sizes: Vec<f64> = d.causes[0].sizes.iter().map(|s| s.size).collect();
    assert_eq!(sizes.len(), 3);
    for (size, truth) in sizes.iter().zip([0.008, 0.012, 0.016]) {
        assert!((size / truth - 1.0).abs() < 0.1, "{sizes:?}");
    }
    // the record held out has 0.020, and is judged with a size of its own
    let gain = &d.gain[d.gain.len() - 1];
    assert!(gain.rmse_after < 1.05 * d.noise.sensor_sigma, "{gain:?} {:?}", d.noise);
}

/// Steps as long as the time between samples leave several times the noise: no cause may make up for it, and a finer step is taken.
#[test]
fn a_step_too_coarse_is_not_told_as_physics() {
    let d = diagnosed_at(&Truth { noise: 1e-4, ..Truth::default() }, 0.01);
    assert_eq!(d.verdict, Verdict::Numerics, "{}", d.reason);
    assert!(d.causes.is_empty() && d.alternatives.is_empty());
    assert!(d.refined.is_some_and(|refined| refined.step <= 0.005), "{:?}", d.refined);
    assert!((d.remainder.rmse / 1e-4 - 1.0).abs() < 0.2, "{:?}", d.remainder);
}
