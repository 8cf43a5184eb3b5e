//! Random series for tests, with explicit seeds.

pub use super::dist::gaussian;
use rand::SeedableRng;
use rand_pcg::Pcg64;

/// Independent standard normal numbers.
pub fn gaussians(n: usize, seed: u64) -> Vec<f64> {
    let mut rng = Pcg64::seed_from_u64(seed);
    (0..n).map(|_| gaussian(&mut rng)).collect()
}

/// Stationary AR series, row-major time × channel, after a burn-in.
pub fn ar_series(phi: &[f64], times: usize, sigma: &[f64], seed: u64) -> Vec<f64> {
    let (channels, burn) = (sigma.len(), 600);
    let mut x = gaussians((times + burn) * channels, seed);
    for t in 0..times + burn {
        for c in 0..channels {
            let memory: f64 =
                phi.iter().enumerate().filter(|(i, _)| *i < t).map(|(i, f)| f * x[(t - 1 - i) * channels + c]).sum();
            x[t * channels + c] = memory + sigma[c] * x[t * channels + c];
        }
    }
    x.split_off(burn * channels)
}
