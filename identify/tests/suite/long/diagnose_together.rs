//! Where even the best model leaves more than noise, causes are accepted by their gain on records left out, and none is named.

use crate::rod_logs::{Logged, setup};
use pliant_identify::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use tempfile::TempDir;

/// Markers drift smoothly by so much [m], sixty times their scatter, otherwise in every record: no cause of the library does that.
const DRIFT: f64 = 6e-3;

fn diagnosed(more: &str) -> Diagnosis {
    let folder = TempDir::new().unwrap();
    let logged = Logged { more, records: [14, 3], samples: 80, noise: 1e-4, drift: DRIFT, ..Logged::default() };
    let setup = setup(&folder, &logged);
    let logs = setup.read_logs(&[]).unwrap();
    diagnose(&setup, &logs, &DiagnoseOptions::default(), &mut |_| {}).unwrap()
}

#[test]
fn what_is_common_to_all_records_is_found_under_what_is_not() {
    let d = diagnosed("rest_curvature = [2.4, -1.5]");
    assert_eq!(d.verdict, Verdict::NotInLibrary, "{}", d.reason);
    assert!(d.causes.is_empty() && d.reason.contains("intrinsic_curvature takes"), "{}", d.reason);
    let titles: Vec<String> = d.extension.iter().map(|c| c.title()).collect();
    assert_eq!(titles, ["intrinsic_curvature"], "{}", d.reason);
    for (estimate, truth) in d.extension[0].parameters.iter().zip([2.4, -1.5]) {
        // a 90 % interval misses one time in ten, twice its width one time in a thousand
        let [low, high] = estimate.interval.unwrap();
        let half = 0.5 * (high - low);
        assert!((estimate.estimate - truth).abs() < 2.0 * half && half < 0.8, "{estimate:?}");
        assert!(low * high > 0.0 && estimate.estimate * truth > 0.0, "{estimate:?}");
    }
    let [before, after] = [&d.stages[0], &d.stages[1]].map(|stage| *stage.held_out.last().unwrap());
    // the remainder is the drift: waves of this amplitude
    let drift = 2.0 / std::f64::consts::PI * DRIFT;
    let left = [before, after].map(|e| e.mean_abs - drift);
    assert!(left[1].abs() < 0.25 * left[0], "{before:?} {after:?}");
}
