//! Readings that no motion explains: one alone that leaves both its neighbours.
//!
//! With e_k = y_k − (−y_{k−2} + 4 y_{k−1} + 4 y_{k+1} − y_{k+2})/6, the distance from the cubic through four neighbours, and s its scatter over
//! the record (by the median), a reading is left out where |e_k| > 8 s, where it lies off the lines through the two readings before and through the two behind it to the same
//! side, and where no neighbour is off once it is gone. A kink of the motion, as by a blow, lies on one of the lines; fast motion is off in
//! several readings in a row. Of the first and the last two readings, which have no four neighbours, the distance from the parabola through the
//! three next to them is taken, five times its own scatter. One such reading at 30 times the noise would hide a third of what 1600 say.

use super::constants::LOG;
use super::record::{Record, period};
use crate::stats::MAD_TO_SIGMA;

/// A reading that was left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lone {
    /// The sensor that it is of.
    pub sensor: LoneSensor,
    /// When it was read \[s\].
    pub time: f64,
    /// Its distance from the curve through its neighbours [unit of the sensor].
    pub size: f64,
}

/// A sensor of points or numbers, as the experiment counts them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoneSensor {
    /// A marker, in any of its coordinates.
    Marker(usize),
    /// A sensor at a joint.
    Joint(usize),
}

/// Takes lone readings out of a record: they are NaN, as those that are missing, and listed in `left_out`. What several sensors see at once is
/// motion; a sensor that has many keeps them, for they are its noise.
pub(super) fn leave_out(record: &mut Record) {
    let mut found: Vec<(LoneSensor, usize, f64)> = Vec::new();
    for k in 0..record.joints.first().map_or(0, Vec::len) {
        let series: Vec<f64> = record.joints.iter().map(|row| row[k]).collect();
        found.extend(lone(&record.time, &series).into_iter().map(|(t, size)| (LoneSensor::Joint(k), t, size)));
    }
    for k in 0..record.markers.first().map_or(0, Vec::len) {
        let of = |a: usize| lone(&record.time, &record.markers.iter().map(|row| row[k][a]).collect::<Vec<f64>>());
        let mut own: Vec<(usize, f64)> = (0..3).flat_map(of).collect();
        own.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.abs().total_cmp(&a.1.abs())));
        own.dedup_by_key(|(t, _)| *t);
        found.extend(own.into_iter().map(|(t, size)| (LoneSensor::Marker(k), t, size)));
    }
    let most = (LOG.lone_share * record.time.len() as f64).ceil() as usize;
    let seldom = |sensor: LoneSensor| found.iter().filter(|(own, ..)| *own == sensor).count() <= most;
    let alone = |t: usize| found.iter().filter(|(_, at, _)| *at == t).count() == 1;
    for &(sensor, t, size) in found.iter().filter(|(sensor, t, _)| seldom(*sensor) && alone(*t)) {
        match sensor {
            LoneSensor::Joint(k) => record.joints[t][k] = f64::NAN,
            LoneSensor::Marker(k) => record.markers[t][k] = [f64::NAN; 3],
        }
        record.left_out.push(Lone { sensor, time: record.time[t], size });
    }
}

/// The parabola through three readings, one step beyond them: the weight of each, the nearest first.
const BEYOND: [f64; 3] = [3.0, -3.0, 1.0];

/// Samples that are lone in a series, and their sizes.
fn lone(time: &[f64], y: &[f64]) -> Vec<(usize, f64)> {
    let n = y.len();
    let span = LOG.lone_span * period(time);
    let even = |k: usize| time[k + 2] - time[k - 2] < span;
    let off = |y: &[f64], k: usize| y[k] - (4.0 * (y[k - 1] + y[k + 1]) - y[k - 2] - y[k + 2]) / 6.0;
    let inner = || (2..n.saturating_sub(2)).filter(|&k| even(k));
    // a quantized sensor at rest has no scatter of its own
    let step = y.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|d| *d > 0.0).fold(f64::INFINITY, f64::min);
    let bar = |times: f64, distances: &mut dyn Iterator<Item = f64>| {
        let mut all: Vec<f64> = distances.map(f64::abs).filter(|e| e.is_finite()).collect();
        all.sort_by(f64::total_cmp);
        times * (MAD_TO_SIGMA * all.get(all.len() / 2).copied().unwrap_or(f64::INFINITY)).max(step)
    };
    let inner_bar = bar(LOG.lone, &mut inner().map(|k| off(y, k)));
    let far = |k: &usize| {
        let (size, k) = (off(y, *k), *k);
        let (before, behind) = (y[k] - (2.0 * y[k - 1] - y[k - 2]), y[k] - (2.0 * y[k + 1] - y[k + 2]));
        if !(size.abs() > inner_bar && before * behind > 0.0 && before.abs().min(behind.abs()) > 0.5 * size.abs()) {
            return false;
        }
        let mut without = y[k.saturating_sub(4)..(k + 5).min(n)].to_vec();
        let own = k - k.saturating_sub(4);
        without[own] -= size;
        (own - 2..=own + 2).all(|j| j < 2 || j + 2 >= without.len() || off(&without, j).abs() <= inner_bar)
    };
    let mut out: Vec<(usize, f64)> = inner().filter(far).map(|k| (k, off(y, k))).collect();
    // the ends: of two at one, the inner one first; where that is in doubt the outer one cannot be judged
    let beyond = |k: usize, step: isize| -> f64 {
        let next = |j: isize| y[(k as isize + step * j) as usize];
        y[k] - BEYOND.iter().zip(1..).map(|(w, j)| w * next(j)).sum::<f64>()
    };
    if n > 2 * BEYOND.len() {
        for (step, inside, ends) in [(1, 0..n - 3, [1, 0]), (-1, 3..n, [n - 2, n - 1])] {
            let bar = bar(LOG.lone_end, &mut inside.map(|k| beyond(k, step)));
            // a lone reading moves the parabola to the one behind it by three times as much
            let [inner, outer] = ends.map(|k| (k, beyond(k, step)));
            out.extend(Some(inner).filter(|(_, size)| size.abs() > bar));
            out.extend(Some(outer).filter(|(_, size)| size.abs() > bar && inner.1.abs() < bar / BEYOND[0]));
        }
        out.sort_by_key(|(k, _)| *k);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::testing::gaussians;

    const NOISE: f64 = 1e-3;

    /// 200 readings at 100 Hz of a motion, with noise.
    fn read(seed: u64, motion: impl Fn(f64) -> f64) -> Record {
        let time: Vec<f64> = (0..200).map(|k| 0.01 * f64::from(k)).collect();
        let joints = time.iter().zip(gaussians(200, seed)).map(|(t, e)| vec![motion(*t) + NOISE * e]).collect();
        Record { time, joints, markers: vec![Vec::new(); 200], ..Record::default() }
    }

    #[test]
    fn lone_readings_are_left_out_and_motion_is_not() {
        let swing = |t: f64| (6.0 * t).sin();
        // a wall that throws it back at 5 rad/s, a whip of 25 Hz for a moment, a step of the command
        let motions: [&dyn Fn(f64) -> f64; 4] =
            [&swing, &|t| (5.0 * (t - 1.003)).abs(), &|t| 0.2 * (-((t - 1.0) / 0.03).powi(2)).exp() * (157.0 * t).sin(), &|t| {
                if t < 0.995 { 0.0 } else { 0.5 }
            }];
        for seed in 0..50 {
            for motion in motions {
                let mut record = read(seed, motion);
                leave_out(&mut record);
                assert_eq!(record.left_out, [], "seed {seed}");
            }
            let mut record = read(seed, swing);
            record.joints[77][0] += 30.0 * NOISE;
            record.joints[150][0] -= 30.0 * NOISE;
            leave_out(&mut record);
            let times: Vec<f64> = record.left_out.iter().map(|lone| lone.time).collect();
            assert!(times == [0.77, 1.5] && record.joints[77][0].is_nan() && record.joints[150][0].is_nan(), "{times:?}");
            let sizes: Vec<f64> = record.left_out.iter().map(|lone| lone.size / NOISE).collect();
            assert!((sizes[0] - 30.0).abs() < 6.0 && (sizes[1] + 30.0).abs() < 6.0, "{sizes:?}");
        }
    }

    /// Found in most cases, and never another one in its place.
    #[test]
    fn the_first_and_the_last_readings_may_be_lone_too() {
        for end in [0, 1, 198, 199] {
            let found = |seed: u64| {
                let mut record = read(seed, |t| (6.0 * t).sin());
                record.joints[end][0] += 45.0 * NOISE;
                leave_out(&mut record);
                let times: Vec<f64> = record.left_out.iter().map(|lone| lone.time).collect();
                assert!(times.is_empty() || times == [record.time[end]], "{end}: {times:?}");
                !times.is_empty()
            };
            assert!((0..50).filter(|seed| found(*seed)).count() > 40, "{end}");
        }
    }

    #[test]
    fn what_is_often_off_is_noise() {
        let mut record = read(1, |t| (6.0 * t).sin());
        (10..190).step_by(20).for_each(|k| record.joints[k][0] += 30.0 * NOISE);
        leave_out(&mut record);
        assert_eq!(record.left_out, []);
    }

    #[test]
    fn of_a_marker_all_coordinates_go() {
        let mut record = read(2, |t| t);
        record.markers = record.joints.iter().map(|row| vec![[0.0, row[0], 1.0], [row[0]; 3]]).collect();
        record.joints = vec![Vec::new(); 200];
        record.markers[50][1][2] += 0.05;
        record.markers[50][1][0] += 0.04;
        // a blow moves both markers at once
        record.markers[120].iter_mut().for_each(|point| point[1] -= 0.05);
        leave_out(&mut record);
        assert!(record.markers[50][1].iter().all(|x| x.is_nan()) && record.markers[50][0][1].is_finite());
        assert_eq!(record.left_out.len(), 1);
        assert!(record.left_out[0].sensor == LoneSensor::Marker(1) && (record.left_out[0].size - 0.05).abs() < 0.005);
    }
}
