//! Records in segments and in pieces.

use crate::pendulum::Truth;
use pliant_identify::fit::{Cut, FitOptions, cut, fit, followable};
use pliant_identify::log::{Interpolation, Setup};
use pliant_identify::sensor::DELAY;
use pliant_identify::shooting::{Plan, RecordPlan, ShotWants, shoot};
use pliant_identify::unknown::Unknown;
use pliant_scene::Source;
use tempfile::TempDir;

fn plan(truth: Truth, motor: &str) -> Plan {
    let folder = TempDir::new().unwrap();
    truth.logs(&folder).unwrap();
    let text = crate::pendulum::SCENE.replace("name = \"motor\"", &format!("name = \"motor\"\n{motor}"));
    let setup = Setup::from_source(Source { file: "scene.toml".to_owned(), text }, folder.path().to_owned()).unwrap();
    Plan::new(&setup, &setup.read_logs(&[]).unwrap()).unwrap()
}

#[test]
fn what_is_remembered_goes_on_through_segments() {
    let plan = plan(Truth::default(), "lag = 0.02");
    let mut rec = plan.fitted[0].clone();
    let wants = ShotWants { states: true, ..ShotWants::default() };
    let whole = shoot(&plan, &rec, &plan.scene_values, wants).unwrap();
    let node = |change: f64| {
        let mut state = whole.states[800].clone();
        assert!(!state.z.is_empty());
        state.z.fill(change);
        state
    };
    rec.nodes = vec![(800, node(1e4))];
    let joined = shoot(&plan, &rec, &plan.scene_values, wants).unwrap();
    assert!(joined.defect == 0.0 && joined.predicted == whole.predicted);
    let mut moved = node(0.0);
    moved.q[0] += 1e-3;
    rec.nodes = vec![(800, moved)];
    let joined = shoot(&plan, &rec, &plan.scene_values, wants).unwrap();
    assert!((joined.defect - 1e-3).abs() < 1e-12 && joined.predicted != whole.predicted);
}

/// A record is asked for as long as it can be followed: in pieces over which a disturbance grows a thousandfold, one after the other, where the fitted
/// ones are pieces over which it grows e-fold.
#[test]
fn a_motion_that_grows_is_followed_in_pieces() {
    let mut plan = plan(Truth { turned: 2.4, balanced: true, noise: 1e-5, seconds: 8.0, ..Truth::default() }, "");
    let whole = vec![plan.fitted[0].clone()];
    assert_eq!(followable(&plan, &whole).unwrap().len(), 1);
    let values = plan.scene_values.clone();
    assert!(matches!(cut(&mut plan, &values, None, std::f64::consts::E).unwrap(), Cut::Pieces(_)));
    // at its very top a pendulum's disturbance grows e-fold in √(J/m g l) = 0.175 s, a thousandfold in 1.2 s
    assert!(plan.followed > 1.2 && plan.followed < 2.4, "{}", plan.followed);
    let followed = followable(&plan, &whole).unwrap();
    let duration = |rec: &RecordPlan| rec.inputs.len() as f64 * plan.model.step_length();
    assert!(followed.len() > 1 && followed.iter().all(|rec| duration(rec) < 1.1 * plan.followed), "{}", followed.len());
    let read: usize = followed.iter().map(|rec| rec.record.time.len()).sum();
    assert_eq!(read, whole[0].record.time.len() + followed.len() - 1);
}

/// Steps of a piece may begin before its first sample, and no sample tells what its inputs were there.
#[test]
fn pieces_know_their_inputs_read_the_other_way() {
    let mut plan = plan(Truth { turned: 2.4, noise: 1e-5, ..Truth::default() }, "");
    let (h, whole) = (plan.model.step_length(), plan.fitted[0].clone());
    let read = |interpolation| whole.record.step_inputs(h, whole.inputs.len(), interpolation);
    let straight = read(Interpolation::Linear);
    let others = Interpolation::Linear.others().map(read);
    assert!(plan.interpolation == Interpolation::Linear && straight == whole.inputs);
    assert!(straight != others[0] && straight != others[1] && others[0] != others[1]);
    assert!([0, 1].into_iter().all(|way| whole.with_other_inputs(way).inputs == others[way]));
    let values = plan.scene_values.clone();
    assert!(matches!(cut(&mut plan, &values, None, std::f64::consts::E).unwrap(), Cut::Pieces(_)));
    let pieces: Vec<_> = plan.fitted.iter().filter(|rec| rec.parent == 0).collect();
    assert!(pieces.iter().any(|rec| rec.record.time[0] > 0.0));
    let mut first = 0;
    for rec in pieces {
        let steps = rec.inputs.len();
        first += straight[first..].windows(steps).position(|rows| rows == rec.inputs).unwrap();
        for (way, whole) in others.iter().enumerate() {
            let other = rec.with_other_inputs(way);
            assert_eq!(other.inputs, whole[first..first + steps]);
            if first > 0 {
                assert_eq!(other.past, whole[first - rec.past.len()..first]);
            }
        }
    }
}

/// A sensor 20 ms late, before a pendulum that starts near the top and is too sensitive to be followed: the first readings of a piece are
/// of states from before them.
#[test]
fn a_late_sensor_is_found_in_pieces() {
    let late = 0.02;
    let mut plan = plan(Truth { late, turned: 2.4, noise: 1e-5, ..Truth::default() }, "");
    let values = plan.scene_values.clone();
    assert!(matches!(cut(&mut plan, &values, None, std::f64::consts::E).unwrap(), Cut::Pieces(_)));
    let began = plan.fitted.iter().filter(|rec| rec.record.time[0] > 0.0).count();
    assert!(began > 0 && plan.fitted.iter().all(|rec| rec.record.time[0] == 0.0 || rec.record.time[0] >= 0.03 - 1e-9));
    let unknown = Unknown::of_joint("pivot.delay".to_owned(), "s", (0, DELAY), 1e-3, (-0.1, 0.1));
    let fitted = fit(&plan, &plan.fitted, &values, &[unknown], None, &FitOptions::default()).unwrap();
    let found = fitted.values.joints[0][DELAY];
    assert!((found - late).abs() < 2e-6 && fitted.rmse < 1.05e-5, "{found} s, {} rad", fitted.rmse);
}
