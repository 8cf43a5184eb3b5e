//! A drift that differs from record to record is no effect: nothing is claimed where it is all there is.

use crate::rod_logs::{Logged, setup};
use pliant_identify::{DiagnoseOptions, Diagnosis, diagnose};
use tempfile::TempDir;

/// Markers drift smoothly by so much [m], sixty times what they scatter, otherwise in every record: no cause of the library does that.
const DRIFT: f64 = 6e-3;

fn diagnosed(more: &str) -> Diagnosis {
    let folder = TempDir::new().unwrap();
    let logged = Logged { more, records: [14, 3], samples: 80, noise: 1e-4, drift: DRIFT, ..Logged::default() };
    let setup = setup(&folder, &logged);
    let logs = setup.read_logs(&[]).unwrap();
    diagnose(&setup, &logs, &DiagnoseOptions::default(), &mut |_| {}).unwrap()
}

#[test]
fn what_differs_from_record_to_record_extends_nothing() {
    let d = diagnosed("");
    assert!(d.causes.is_empty() && d.extension.is_empty(), "{:?}: {}", d.verdict, d.reason);
}
