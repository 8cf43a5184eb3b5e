//! Random series and small linear problems for the tests of the statistics. Seeds explicit.

use nalgebra::{DMatrix, DVector};
use pliant_identify::stats::reduced::{RecordRows, Reduced};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Independent standard normal numbers.
pub fn gaussians(n: usize, seed: u64) -> Vec<f64> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut one = || -> f64 {
        let (u, w): (f64, f64) = (rng.random(), rng.random());
        (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * w).cos()
    };
    (0..n).map(|_| one()).collect()
}

/// Stationary AR(1) series of unit variance.
pub fn ar1(phi: f64, n: usize, seed: u64) -> Vec<f64> {
    let e = gaussians(n, seed);
    let mut x = vec![e[0]; n];
    for t in 1..n {
        x[t] = phi * x[t - 1] + (1.0 - phi * phi).sqrt() * e[t];
    }
    x
}

/// A record without own nuisance, G given by columns.
pub fn reduced_of(residual: &[f64], columns: &[Vec<f64>], block_starts: &[usize]) -> Reduced {
    let n = residual.len();
    let global: Vec<f64> = (0..n).flat_map(|i| columns.iter().map(move |c| c[i])).collect();
    let rows = RecordRows { residual, own: &[], own_columns: 0, global: &global, global_columns: columns.len(), block_starts };
    Reduced::of_record(&rows).unwrap()
}

/// Unit vectors in dimension n whose Gram matrix is the one given (n at least its size).
pub fn directions(gram: &DMatrix<f64>, n: usize) -> Vec<DVector<f64>> {
    let factor = gram.clone().cholesky().unwrap().l();
    (0..gram.nrows()).map(|j| DVector::from_fn(n, |i, _| if i < gram.nrows() { factor[(j, i)] } else { 0.0 })).collect()
}
