//! Frames that are missing although the time stamps do not say so, and frames written twice.
//!
//! Motion capture that loses frames and writes the rest at equal intervals leaves a signature no motion has: in one step all
//! points move m times as far as in the steps before and after, along the same directions, m near a whole number. With d_t
//! the displacements of all points and v their mean over the ordinary steps on both sides,
//!
//!   m = d_t·v / v·v,   accepted where |d_t − m v| is small against |d_t − v|;  m − 1 frames are missing (m ≈ 0: repeated).

use super::constants::AUDIT;
use super::record::Prepared;
use super::report::{Finding, Place, Severity};
use super::series::{quantile, rms};

struct Slip {
    step: usize,
    multiple: f64,
}

/// Reports, and returns the steps concerned.
pub(super) fn check(record: &Prepared, out: &mut Vec<Finding>) -> Vec<usize> {
    let slips = find(record);
    let missing: Vec<&Slip> = slips.iter().filter(|s| s.multiple > 1.0).collect();
    let repeated: Vec<&Slip> = slips.iter().filter(|s| s.multiple < 1.0).collect();
    let mut add = |severity, slip: &Slip, what: String, number: f64, advice| {
        let place = Place::Record;
        let time_s = record.at(slip.step);
        out.push(Finding { severity, record: record.index, place, time_s, what, number, unit: "frames", advice });
    };
    if let Some(worst) = missing.iter().max_by(|a, b| a.multiple.total_cmp(&b.multiple)) {
        let lost: f64 = missing.iter().map(|s| s.multiple.round() - 1.0).sum();
        let what = format!(
            "all points move on at once by {:.1} ordinary steps: about {lost:.0} frames are missing in {} places (first at {})",
            worst.multiple,
            missing.len(),
            record.at(missing[0].step).map_or("?".into(), |t| format!("{t:.2} s")),
        );
        let severity = if lost >= AUDIT.frames_faulty { Severity::Faulty } else { Severity::Warning };
        add(severity, worst, what, lost, "cut the record there: its clock is wrong and its inputs leap");
    }
    if let Some(first) = repeated.first() {
        let what = format!("all points stand still for one step in mid-motion, {} times: frames written twice", repeated.len());
        add(Severity::Warning, first, what, repeated.len() as f64, "drop the repeated frames or cut the record there");
    }
    slips.iter().map(|s| s.step).collect()
}

fn find(record: &Prepared) -> Vec<Slip> {
    let stride = record.layout.points * record.layout.dimension;
    // One or two points cannot tell a lost frame from a jump of their own.
    if record.layout.points < AUDIT.frame_points || record.times() < 2 * AUDIT.frame_reach {
        return Vec::new();
    }
    let steps: Vec<Vec<f64>> =
        record.points.windows(2 * stride).step_by(stride).map(|w| (0..stride).map(|c| w[stride + c] - w[c]).collect()).collect();
    let size: Vec<f64> = steps.iter().map(|d| rms(d)).collect();
    let sigma = rms(&record.sigma).max(rms(&record.quantum) / 12.0_f64.sqrt());
    (1..steps.len().saturating_sub(1)).filter_map(|t| slip_at(&steps, &size, sigma, t)).collect()
}

fn slip_at(steps: &[Vec<f64>], size: &[f64], sigma: f64, t: usize) -> Option<Slip> {
    // Several frames may be missing close together: ordinary steps are those near the lower half of their own side, because
    // the speed may well change across a long slip.
    let near = |range: std::ops::Range<usize>| {
        let typical = quantile(&size[range.clone()], AUDIT.frame_ordinary_quantile);
        range.filter(move |&i| size[i] > AUDIT.frame_ordinary.0 * typical && size[i] < AUDIT.frame_ordinary.1 * typical)
    };
    let before = near(t.saturating_sub(AUDIT.frame_reach)..t).next_back()?;
    let after = near(t + 1..(t + AUDIT.frame_reach + 1).min(steps.len())).next()?;
    let v: Vec<f64> = steps[before].iter().zip(&steps[after]).map(|(a, b)| 0.5 * (a + b)).collect();
    let power: f64 = v.iter().map(|x| x * x).sum();
    if power <= 0.0 {
        return None;
    }
    let multiple = steps[t].iter().zip(&v).map(|(d, v)| d * v).sum::<f64>() / power;
    let excess = rms(&steps[t].iter().zip(&v).map(|(d, v)| d - v).collect::<Vec<_>>());
    let across = rms(&steps[t].iter().zip(&v).map(|(d, v)| d - multiple * v).collect::<Vec<_>>());
    // A change of velocity (an impact, a stop) lies between its two sides; a slip lies far outside both.
    let change = rms(&steps[before].iter().zip(&steps[after]).map(|(a, b)| a - b).collect::<Vec<_>>());
    let clear = excess > AUDIT.frame_over_noise * sigma
        && across < AUDIT.frame_along * excess
        && excess > AUDIT.frame_over_change * change;
    let number = multiple > AUDIT.frame_missing || multiple.abs() < AUDIT.frame_repeated;
    (clear && number).then_some(Slip { step: t, multiple })
}
