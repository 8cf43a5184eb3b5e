//! The audit on motion capture of two real cables: which records are faulty, found without being told.

use ndarray::{Array4, Axis};
use pliant_identify::audit::{AuditReport, Finding, Layout, Place, RawRecord, Severity, audit};

/// Audits all records of an array; the first and last two points are clamped by the grippers and serve as inputs.
fn run(cable: &str, array: &str) -> Option<AuditReport> {
    let data: Array4<f64> = crate::measured_data::records(&format!("deform_dlo/{cable}.npz"), array)?;
    let (_, times, points, _) = data.dim();
    let time: Vec<f64> = (0..times).map(|t| t as f64 / 100.0).collect();
    let flat: Vec<Vec<f64>> = data.axis_iter(Axis(0)).map(|r| r.iter().copied().collect()).collect();
    let clamped = [0, 1, points - 2, points - 1];
    let inputs: Vec<Vec<f64>> = flat
        .iter()
        .map(|r| {
            r.chunks_exact(3 * points).flat_map(|row| clamped.iter().flat_map(|&p| row[3 * p..3 * p + 3].to_vec())).collect()
        })
        .collect();
    let records: Vec<RawRecord> =
        flat.iter().zip(&inputs).map(|(p, u)| RawRecord { time: &time, points: p, inputs: u }).collect();
    let layout = Layout { rigid: vec![(0, 1), (points - 2, points - 1)], ..Layout::rope(points, 12) };
    let report = audit(&records, &layout).unwrap();
    for f in report.findings.iter().filter(|f| f.severity >= Severity::Warning) {
        println!(
            "{cable} {array} {:3} {:?} {:?} t={:?} {} [{:.4} {}]",
            f.record, f.severity, f.place, f.time_s, f.what, f.number, f.unit
        );
    }
    println!("{cable} {array}: faulty {:?}", report.faulty_records());
    println!("{cable} {array}: noise {:.2e}", report.noise_floor().iter().sum::<f64>() / report.noise_floor().len() as f64);
    Some(report)
}

fn faulty_at(report: &AuditReport, record: usize, place: Place) -> Option<&Finding> {
    report.findings.iter().find(|f| f.severity == Severity::Faulty && f.record == record && f.place == place)
}

#[test]
fn first_cable() {
    let Some(train) = run("DLO1", "train") else { return };
    // A marker two from the end sits 26 mm further in along the cable from 4.3 s of record 28 on, and all through record 29.
    let moved = faulty_at(&train, 29, Place::Pair(10, 11)).unwrap();
    assert!((moved.number - 0.025).abs() < 0.004, "{moved:?}");
    assert!(faulty_at(&train, 28, Place::Pair(10, 11)).is_some());
    // Frames are missing although the stamps are regular: whole runs of them in these.
    for record in [11, 21, 26, 27, 28, 36] {
        assert!(faulty_at(&train, record, Place::Record).is_some(), "record {record}");
    }
    assert!(train.faulty_records().len() < 14, "{:?}", train.faulty_records());
    let Some(eval) = run("DLO1", "eval") else { return };
    assert_eq!(eval.faulty_records(), vec![5, 9]);
}

#[test]
fn second_cable() {
    let Some(train) = run("DLO2", "train") else { return };
    // The left clamp holds the cable 5 to 9 mm closer to its end in three neighbouring records.
    for record in [47, 48, 49] {
        assert!(faulty_at(&train, record, Place::Pair(0, 1)).is_some(), "record {record}");
    }
    let Some(eval) = run("DLO2", "eval") else { return };
    for record in [10, 11] {
        assert!(faulty_at(&eval, record, Place::Pair(0, 1)).is_some(), "record {record}");
    }
    assert!(faulty_at(&eval, 5, Place::Record).is_some());
    assert!(train.faulty_records().len() < 6 && eval.faulty_records().len() < 4);
}
