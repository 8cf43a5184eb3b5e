//! The audit on invented logs: every injected fault is found where it is, and clean logs are not called faulty.

use crate::stats_helpers::gaussians;
use pliant_identify::audit::{AuditError, AuditReport, Finding, Layout, Place, RawRecord, Severity, audit};

const POINTS: usize = 8;
const TIMES: usize = 400;
const RATE: f64 = 100.0;
const NOISE: f64 = 3e-5;

#[derive(Clone)]
struct Log {
    time: Vec<f64>,
    points: Vec<f64>,
    inputs: Vec<f64>,
}

/// A swinging chain: edges of fixed length whose directions move smoothly, chords a few per cent shorter than the arcs.
fn log(record: u64) -> Log {
    warped(record, |s| s)
}

/// The same, where the motion's own time runs as told.
fn warped(record: u64, own_time: impl Fn(f64) -> f64) -> Log {
    let phases = gaussians(4 * POINTS, 100 + record);
    let white = gaussians(TIMES * POINTS * 3, 200 + record);
    let mut log = Log { time: Vec::new(), points: Vec::new(), inputs: Vec::new() };
    for t in 0..TIMES {
        log.time.push(t as f64 / RATE);
        let s = own_time(t as f64 / RATE);
        let hand = [0.2 * (1.3 * s + phases[0]).sin(), 0.1 * (2.1 * s + phases[1]).cos(), 1.0 + 0.05 * (1.7 * s).sin()];
        log.inputs.extend(hand);
        let mut x = hand;
        for p in 0..POINTS {
            if p > 0 {
                let swing = 0.5 * (4.0 * s + phases[p]).sin() + 0.2 * (9.0 * s + phases[POINTS + p]).sin();
                let yaw = 0.4 * (2.5 * s + phases[2 * POINTS + p]).sin();
                let chord = 0.1 * (1.0 - 0.03 * (3.0 * s + phases[3 * POINTS + p]).sin().powi(2));
                x[0] += chord * swing.sin() * yaw.cos();
                x[1] += chord * swing.sin() * yaw.sin();
                x[2] -= chord * swing.cos();
            }
            log.points.extend((0..3).map(|a| x[a] + NOISE * white[(t * POINTS + p) * 3 + a]));
        }
    }
    log
}

fn logs() -> Vec<Log> {
    (0..8).map(log).collect()
}

fn layout() -> Layout {
    Layout::rope(POINTS, 3)
}

fn run(logs: &[Log], layout: &Layout) -> AuditReport {
    let raw: Vec<RawRecord> = logs.iter().map(|l| RawRecord { time: &l.time, points: &l.points, inputs: &l.inputs }).collect();
    audit(&raw, layout).unwrap()
}

fn shift(log: &mut Log, times: std::ops::Range<usize>, point: usize, by: [f64; 3]) {
    for t in times {
        (0..3).for_each(|a| log.points[(t * POINTS + point) * 3 + a] += by[a]);
    }
}

fn find(report: &AuditReport, record: usize, place: Place, severity: Severity) -> &Finding {
    let found = report.findings.iter().find(|f| f.record == record && f.place == place && f.severity >= severity);
    found.unwrap_or_else(|| panic!("nothing at {place:?} in {record}: {:#?}", report.findings))
}

fn worst(report: &AuditReport) -> Vec<&Finding> {
    report.findings.iter().filter(|f| f.severity > Severity::Info).collect()
}

fn near(finding: &Finding, time: f64) {
    assert!((finding.time_s.unwrap() - time).abs() < 0.08, "{finding:?}");
}

#[test]
fn clean_logs_are_clean_and_their_noise_is_measured() {
    let report = run(&logs(), &layout());
    assert_eq!(report.records_with(Severity::Warning), Vec::<usize>::new(), "{:#?}", worst(&report));
    for sigma in report.noise_floor() {
        assert!((sigma / NOISE - 1.0).abs() < 0.25, "{sigma}");
    }
    // Without noise and on a grid as well.
    let mut quiet = logs();
    quiet.iter_mut().for_each(|l| l.points.iter_mut().for_each(|x| *x = (*x / 1e-3).round() * 1e-3));
    let report = run(&quiet, &layout());
    assert_eq!(report.faulty_records(), Vec::<usize>::new(), "{:#?}", worst(&report));
    assert!(report.noise[0].quantum.iter().flatten().all(|q| (q / 1e-3 - 1.0).abs() < 1e-6));
    assert!(report.noise[0].quantum.iter().filter(|q| q.is_some()).count() > 2 * POINTS);
}

#[test]
fn a_hold_and_an_impact_are_not_faults() {
    let mut all = logs();
    // Everything stops dead for a second and goes on, with noise and without; another record is struck.
    all[0] = warped(0, |s| s.min(1.5) + (s - 2.5).max(0.0));
    all[2] = warped(2, |s| s.min(1.5) + (s - 2.5).max(0.0));
    let held = all[2].points[150 * POINTS * 3..151 * POINTS * 3].to_vec();
    for t in 150..=250 {
        all[2].points[t * POINTS * 3..(t + 1) * POINTS * 3].copy_from_slice(&held);
    }
    for t in 200..TIMES {
        for p in 0..POINTS {
            let kick = 0.01 * (t - 200).min(20) as f64;
            shift(&mut all[1], t..t + 1, p, [kick, 0.0, 0.0]);
        }
    }
    let report = run(&all, &layout());
    assert_eq!(report.faulty_records(), Vec::<usize>::new(), "{:#?}", worst(&report));
}

#[test]
fn clock_faults() {
    let mut all = logs();
    all[1].time[200] = all[1].time[199];
    all[2].time[150..].iter_mut().for_each(|t| *t += 0.05);
    let wobble = gaussians(TIMES, 7);
    all[3].time.iter_mut().zip(wobble).for_each(|(t, w)| *t += 2e-3 * w.clamp(-1.5, 1.5));
    let report = run(&all, &layout());
    find(&report, 1, Place::Clock, Severity::Faulty);
    let gap = find(&report, 2, Place::Clock, Severity::Warning);
    near(gap, 1.5);
    assert!((gap.number - 0.06).abs() < 1e-9);
    find(&report, 3, Place::Clock, Severity::Warning);
    assert_eq!(report.faulty_records(), vec![1], "{:#?}", worst(&report));
}

#[test]
fn lost_and_repeated_frames() {
    let mut all = logs();
    let stride = POINTS * 3;
    // Five frames lost at 1.80 s, stamps rewritten without a gap.
    all[0].points.drain(180 * stride..185 * stride);
    all[0].inputs.drain(180 * 3..185 * 3);
    all[0].time.truncate(TIMES - 5);
    let copy = all[1].points[100 * stride..101 * stride].to_vec();
    all[1].points.splice(100 * stride..100 * stride, copy);
    all[1].points.truncate(TIMES * stride);
    let report = run(&all, &layout());
    let lost = find(&report, 0, Place::Record, Severity::Faulty);
    assert!((lost.number - 5.0).abs() <= 1.0, "{lost:?}");
    near(lost, 1.8);
    near(find(&report, 1, Place::Record, Severity::Warning), 1.0);
    assert_eq!(report.faulty_records(), vec![0]);
}

#[test]
fn frozen_marker_jump_and_swap() {
    let mut all = logs();
    for t in 120..150 {
        for a in 0..3 {
            all[0].points[(t * POINTS + 5) * 3 + a] = all[0].points[(119 * POINTS + 5) * 3 + a];
        }
    }
    shift(&mut all[1], 222..224, 3, [0.01, 0.03, 0.0]);
    for t in 300..TIMES {
        for a in 0..3 {
            all[2].points.swap((t * POINTS + 2) * 3 + a, (t * POINTS + 3) * 3 + a);
        }
    }
    let report = run(&all, &layout());
    let frozen = find(&report, 0, Place::Point(5), Severity::Faulty);
    near(frozen, 1.19);
    assert_eq!(frozen.number, 30.0);
    let jump = find(&report, 1, Place::Point(3), Severity::Warning);
    near(jump, 2.22);
    assert!((jump.number - 0.0316).abs() < 0.006, "{jump:?}");
    near(find(&report, 2, Place::Pair(2, 3), Severity::Faulty), 3.0);
    assert_eq!(report.faulty_records(), vec![0, 2]);
}

#[test]
fn slipped_marker_and_other_clamp() {
    let mut all = logs();
    let along = |log: &Log, t: usize, p: usize| -> [f64; 3] {
        let at = |p: usize, a: usize| log.points[(t * POINTS + p) * 3 + a];
        [0, 1, 2].map(|a| 0.25 * (at(p + 1, a) - at(p, a)))
    };
    for t in 250..TIMES {
        let by = along(&all[4], t, 4);
        shift(&mut all[4], t..t + 1, 4, by);
    }
    for t in 0..TIMES {
        let by = along(&all[6], t, 4);
        shift(&mut all[6], t..t + 1, 4, by);
    }
    let report = run(&all, &layout());
    near(find(&report, 4, Place::Pair(3, 4), Severity::Faulty), 2.5);
    let other = find(&report, 6, Place::Pair(3, 4), Severity::Faulty);
    assert!((other.number - 0.025).abs() < 0.004, "{other:?}");
    assert_eq!(report.faulty_records(), vec![4, 6]);
}

#[test]
fn saturation_missing_samples_inputs_and_rigid_pairs() {
    let mut all = logs();
    let top = 0.12;
    all[0].points.iter_mut().skip(7 * 3).step_by(POINTS * 3).for_each(|x| *x = x.clamp(-top, top));
    for t in 10..40 {
        all[1].points[(t * POINTS + 6) * 3] = f64::NAN;
    }
    for t in 0..200 {
        all[2].points[(t * POINTS + 6) * 3 + 1] = f64::NAN;
    }
    all[3].inputs[150 * 3] += 0.05;
    all[4].inputs[200 * 3 + 1] = f64::NAN;
    let rigid = Layout { rigid: vec![(0, 1)], ..layout() };
    let report = run(&all, &rigid);
    find(&report, 0, Place::Coordinate(7, 0), Severity::Warning);
    assert!(report.findings.iter().any(|f| f.record == 1 && f.place == Place::Point(6) && f.severity == Severity::Warning));
    find(&report, 2, Place::Point(6), Severity::Faulty);
    near(find(&report, 3, Place::Input(0), Severity::Warning), 1.5);
    find(&report, 4, Place::Input(1), Severity::Faulty);
    // (The clamped coordinate also breaks the length of its pair.)
    assert_eq!(report.faulty_records(), vec![0, 2, 4], "{:#?}", worst(&report));
    // The chord of the pair declared rigid varies by its bending.
    assert!(report.findings.iter().any(|f| f.place == Place::Pair(0, 1) && f.severity == Severity::Warning));
}

#[test]
fn shapes_are_checked_and_short_records_survive() {
    let log = log(0);
    let raw = RawRecord { time: &log.time, points: &log.points[1..], inputs: &log.inputs };
    assert!(matches!(audit(&[raw], &layout()), Err(AuditError::Length { record: 0, what: "points", .. })));
    let wrong = Layout { chords: vec![(0, POINTS)], ..layout() };
    assert!(matches!(audit(&[], &wrong), Err(AuditError::Pair { .. })));
    for times in [0, 1, 2, 5, 12] {
        let raw =
            RawRecord { time: &log.time[..times], points: &log.points[..times * POINTS * 3], inputs: &log.inputs[..times * 3] };
        assert!(audit(&[raw, raw, raw, raw, raw, raw], &layout()).unwrap().faulty_records().is_empty(), "{times}");
    }
}
