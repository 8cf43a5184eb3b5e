//! Noise level and quantisation of every channel.

use super::constants::AUDIT;
use super::record::Prepared;
use super::report::{Finding, Place, RecordNoise, Severity};
use super::series::noise_sigma;

pub(super) fn check(record: &Prepared, out: &mut Vec<Finding>) -> RecordNoise {
    let channels = record.layout.points * record.layout.dimension;
    let series: Vec<Vec<f64>> = (0..channels).map(|c| record.channel(c)).collect();
    let sigma: Vec<f64> = series.iter().map(|s| noise_sigma(s)).collect();
    let quantum: Vec<Option<f64>> = series.iter().zip(&sigma).map(|(s, n)| grid_step(s, *n)).collect();
    // A grid below the noise is harmless; one above it is the noise.
    let coarse: Vec<usize> = (0..channels).filter(|&c| quantum[c].is_some_and(|q| q > sigma[c])).collect();
    let step = |c: usize| quantum[c].unwrap_or(0.0);
    if let Some(&worst) = coarse.iter().max_by(|a, b| step(**a).total_cmp(&step(**b))) {
        let d = record.layout.dimension;
        out.push(Finding {
            severity: Severity::Info,
            record: record.index,
            place: Place::Coordinate(worst / d, worst % d),
            time_s: None,
            what: format!("{} channels lie on a grid coarser than their noise; the coarsest step is given", coarse.len()),
            number: step(worst),
            unit: "m",
            advice: "use step/√12 as the floor of the noise; differences of positions are useless as velocities",
        });
    }
    RecordNoise { sigma, quantum }
}

/// The grid step: the smallest difference between distinct values, if nearly all others are its multiples.
/// Grids finer than a fiftieth of the noise are number formats, not sensors. On a grid readings repeat; those of a body that moves
/// uniformly lie at equal distances too, and do not.
fn grid_step(series: &[f64], sigma: f64) -> Option<f64> {
    let mut sorted = series.to_vec();
    sorted.sort_by(f64::total_cmp);
    let largest = sorted.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let resolution = 4.0 * f64::from(f32::EPSILON) * largest;
    let mut distinct: Vec<f64> = Vec::new();
    for x in sorted {
        if distinct.last().is_none_or(|last| x - last > resolution) {
            distinct.push(x);
        }
    }
    if distinct.len() < AUDIT.grid_distinct || distinct.len() == series.len() {
        return None;
    }
    let gaps: Vec<f64> = distinct.windows(2).map(|w| w[1] - w[0]).collect();
    let step = gaps.iter().copied().fold(f64::INFINITY, f64::min);
    let tolerance = AUDIT.grid_tolerance + 2.0 * resolution / step;
    let multiples = gaps.iter().filter(|g| ((*g / step).round() - *g / step).abs() < tolerance).count();
    let repeated = gaps.iter().filter(|g| (*g / step - 1.0).abs() < tolerance).count();
    let on_grid = tolerance < AUDIT.grid_loosest
        && multiples as f64 >= AUDIT.grid_share * gaps.len() as f64
        && repeated >= AUDIT.grid_repeats;
    (on_grid && step > AUDIT.grid_finest * sigma).then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::testing::gaussians;

    #[test]
    fn finds_grids_and_no_others() {
        let smooth: Vec<f64> = (0..400).map(|t| 0.3 * (f64::from(t) * 0.03).sin()).collect();
        let grid: Vec<f64> = smooth.iter().map(|x| (x / 1e-3).round() * 1e-3).collect();
        let found = grid_step(&grid, noise_sigma(&grid)).unwrap_or(0.0);
        assert!((found / 1e-3 - 1.0).abs() < 1e-6, "{found}");
        let noisy: Vec<f64> = smooth.iter().zip(gaussians(400, 1)).map(|(x, e)| x + 1e-4 * e).collect();
        assert_eq!(grid_step(&noisy, noise_sigma(&noisy)), None);
        let single: Vec<f64> = noisy.iter().map(|x| f64::from(*x as f32)).collect();
        assert_eq!(grid_step(&single, noise_sigma(&single)), None);
        assert_eq!(grid_step(&[1.0; 50], 0.0), None);
        let uniform: Vec<f64> = (0..50).map(|t| 1.0 + 6e-3 * f64::from(t)).collect();
        assert_eq!(grid_step(&uniform, noise_sigma(&uniform)), None);
    }
}
