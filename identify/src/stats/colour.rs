//! Test whether a cause makes the residual coloured: likelihood ratios with the noise refitted, their law simulated.
//!
//! A score test takes its noise from the residual with the cause still in it. A slow cause (an encoder's zero) makes that residual
//! slow; the noise model is then slow too, slow directions weigh next to nothing, and the score misses the cause of the colour.
//! Here every hypothesis has a noise model of its own. With P the projection off everything fitted and P_c the one off the cause c
//! too (least squares, each channel's rows divided by its stationary σ),
//! ```text
//! T_c = D(P r) − D(P_c r),     D(x) = min over AR models of order p ≤ 4 of −2 log L(x) + p log n
//! ```
//! T has no χ² law: a slow column fits slow noise far better than independent noise (spurious regression: Granger & Newbold 1974),
//! and every rope with coloured noise would be called wrong. So its law is simulated. Series of the noise model of `P r`,
//! the residual without a cause, go through the same steps; the p of a cause is the share of series whose largest T is
//! not below its own, (1 + count)/(1 + draws). That counts the choice among all candidates: p is family-wise.
//!
//! Short series of slow noise look less slow than they are, and how slow the noise is decides how large T becomes. Each series has
//! therefore partial autocorrelations of its own: those of the model, corrected by the bias and spread by the error that the same
//! estimate shows on series of the model (both of artanh k).

use super::ar::{ArModel, ArOptions, Order};
use super::basis::Basis;
use super::constants::STATS;
use super::dist::gaussian;
use super::error::{StatsError, check_slice};
use super::score::{Candidate, Sign};
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_pcg::Pcg64;
use rayon::prelude::*;

/// One record as it was read, not whitened. Rows are (time, channel); matrices are row-major.
#[derive(Debug, Clone, Copy)]
pub struct RawRows<'a> {
    /// Measured − simulated; 0 where nothing was measured.
    pub residual: &'a [f64],
    /// rows × `own_columns`: by the record's own initial state.
    pub own: &'a [f64],
    /// Number of own columns.
    pub own_columns: usize,
    /// rows × `global_columns`: by the fitted unknowns, and by the candidates.
    pub global: &'a [f64],
    /// Number of global columns.
    pub global_columns: usize,
}

/// Options of the test.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ColourOptions {
    /// Candidates of which T is computed, in every series: those that take the largest part of its square.
    pub tried: usize,
    /// Simulated series; the smallest p is 1/(1 + draws).
    pub draws: usize,
    /// Of the series.
    pub seed: u64,
}

impl Default for ColourOptions {
    fn default() -> Self {
        Self { tried: 6, draws: 399, seed: 1 }
    }
}

/// Result for one candidate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coloured {
    /// Its index.
    pub candidate: usize,
    /// T.
    pub statistic: f64,
    /// Family-wise p.
    pub p: f64,
}

/// Tests the candidates, and returns those that were tried, best first.
///
/// `noise` is the model of the residual; its σ_c are the channels' scales.
///
/// # Errors
/// Shapes that contradict each other, numbers that are not finite, no rows.
pub fn colour_test(
    records: &[RawRows],
    noise: &ArModel,
    nuisance: &[usize],
    candidates: &[Candidate],
    options: &ColourOptions,
) -> Result<Vec<Coloured>, StatsError> {
    let (problem, residual) = Problem::new(records, noise, nuisance, candidates)?;
    let found = problem.best(&residual, options.tried)?;
    let spread = problem.uncertainty(options.seed)?;
    let draw = |k: usize| -> Result<f64, StatsError> {
        let mut rng = Pcg64::seed_from_u64(options.seed.wrapping_add((STATS.pilots + k) as u64));
        let model = problem.perturbed(&spread, &mut rng)?;
        let best = problem.best(&problem.simulate(&model, &mut rng)?, options.tried)?;
        Ok(best.first().map_or(f64::NEG_INFINITY, |b| b.standard))
    };
    let largest: Vec<f64> = (0..options.draws).into_par_iter().map(draw).collect::<Result<_, _>>()?;
    let p = |standard: f64| {
        let beyond = largest.iter().filter(|x| **x >= standard).count();
        (1 + beyond) as f64 / (1 + options.draws) as f64
    };
    Ok(found.iter().map(|f| Coloured { candidate: f.candidate, statistic: f.statistic, p: p(f.standard) }).collect())
}

/// T of a candidate, and T in units in which candidates of any number of columns compare: (T − d)/√(2d).
struct Found {
    candidate: usize,
    statistic: f64,
    standard: f64,
}

/// The columns of all records, in units of the channels' stationary σ.
struct Problem {
    /// Rows of each record.
    rows: Vec<usize>,
    /// Where something was measured.
    seen: Vec<bool>,
    own: Vec<Basis>,
    nuisance: Basis,
    causes: Vec<(Basis, Sign)>,
    /// The residual's noise in these units.
    noise: ArModel,
}

impl Problem {
    fn new(
        records: &[RawRows],
        noise: &ArModel,
        nuisance: &[usize],
        candidates: &[Candidate],
    ) -> Result<(Self, DVector<f64>), StatsError> {
        let channels = noise.sigma().len();
        let scale: Vec<f64> = noise.sigma().iter().map(|s| s * noise.stationary_ratio()).collect();
        let weighted = |data: &[f64], columns: usize, rows: usize| {
            DMatrix::from_fn(rows, columns, |i, j| data[i * columns + j] / scale[i % channels])
        };
        let (mut own, mut parts, mut lengths, mut seen) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for record in records {
            let rows = record.residual.len();
            check_slice("residual", record.residual, rows)?;
            check_slice("own nuisance matrix", record.own, rows * record.own_columns)?;
            check_slice("global matrix", record.global, rows * record.global_columns)?;
            let start = weighted(record.own, record.own_columns, rows);
            let norms: Vec<f64> = start.column_iter().map(|c| c.norm()).collect();
            let basis = Basis::new(&start, &norms, STATS.dead);
            let mut data = weighted(record.global, record.global_columns, rows);
            let last = data.ncols();
            data = data.insert_column(last, 0.0);
            data.column_mut(last).copy_from(&weighted(record.residual, 1, rows));
            basis.project_out(&mut data);
            seen.extend(record.residual.iter().map(|x| *x != 0.0));
            lengths.push(rows);
            own.push(basis);
            parts.push(data);
        }
        let columns = parts.first().map_or(0, DMatrix::ncols);
        if columns == 0 {
            return Err(StatsError::TooFew { what: "records", found: 0, needed: 1 });
        }
        let mut all = DMatrix::zeros(seen.len(), columns);
        let mut at = 0;
        for part in &parts {
            all.rows_mut(at, part.nrows()).copy_from(part);
            at += part.nrows();
        }
        let norms: Vec<f64> = all.column_iter().map(|c| c.norm()).collect();
        let of = |chosen: &[usize]| chosen.iter().map(|&c| norms[c]).collect::<Vec<f64>>();
        let nuisance = Basis::new(&all.select_columns(nuisance), &of(nuisance), STATS.dead);
        nuisance.project_out(&mut all);
        let cause = |c: &Candidate| (Basis::new(&all.select_columns(&c.columns), &of(&c.columns), STATS.dead), c.sign);
        let causes = candidates.iter().map(cause).collect();
        let unit = ArModel::from_reflection(noise.reflection(), vec![1.0 / noise.stationary_ratio(); channels])?;
        let residual = all.column(columns - 1).into_owned();
        Ok((Self { rows: lengths, seen, own, nuisance, causes, noise: unit }, residual))
    }

    /// Bias and standard error of artanh of every partial autocorrelation, on series of the model.
    fn uncertainty(&self, seed: u64) -> Result<Vec<(f64, f64)>, StatsError> {
        let pilot = |k: usize| -> Result<Vec<f64>, StatsError> {
            let mut rng = Pcg64::seed_from_u64(seed.wrapping_add(k as u64));
            let series = self.simulate(&self.noise, &mut rng)?;
            let model = self.model(&series, Order::Fixed(self.noise.order()))?;
            Ok(model.reflection().iter().map(|k| k.atanh()).collect())
        };
        let pilots: Vec<Vec<f64>> = (0..STATS.pilots).into_par_iter().map(pilot).collect::<Result<_, _>>()?;
        let n = STATS.pilots as f64;
        let one = |(i, k): (usize, &f64)| {
            let mean = pilots.iter().map(|p| p[i]).sum::<f64>() / n;
            let square = pilots.iter().map(|p| (p[i] - mean).powi(2)).sum::<f64>() / n;
            (mean - k.atanh(), square.sqrt())
        };
        Ok(self.noise.reflection().iter().enumerate().map(one).collect())
    }

    /// The noise model as it may be: its bias taken off, with an error of its standard size.
    fn perturbed(&self, spread: &[(f64, f64)], rng: &mut Pcg64) -> Result<ArModel, StatsError> {
        let one = |(k, (bias, error)): (&f64, &(f64, f64))| {
            (k.atanh() - bias + error * gaussian(rng)).tanh().clamp(-STATS.simulated_reflection, STATS.simulated_reflection)
        };
        let reflection: Vec<f64> = self.noise.reflection().iter().zip(spread).map(one).collect();
        let unit = ArModel::from_reflection(&reflection, vec![1.0; self.noise.sigma().len()])?;
        let sigma = vec![1.0 / unit.stationary_ratio(); self.noise.sigma().len()];
        ArModel::from_reflection(&reflection, sigma)
    }

    /// A series of a noise model, measured where the records were, with everything fitted projected out.
    fn simulate(&self, model: &ArModel, rng: &mut Pcg64) -> Result<DVector<f64>, StatsError> {
        let channels = self.noise.sigma().len();
        let mut all = DMatrix::zeros(self.seen.len(), 1);
        let mut at = 0;
        for (rows, own) in self.rows.iter().zip(&self.own) {
            let series = model.sample(rows / channels, rng);
            let mut part = DMatrix::from_column_slice(*rows, 1, &series);
            part.iter_mut().zip(&self.seen[at..]).filter(|(_, seen)| !**seen).for_each(|(x, _)| *x = 0.0);
            own.project_out(&mut part);
            all.rows_mut(at, *rows).copy_from(&part);
            at += rows;
        }
        self.nuisance.project_out(&mut all);
        Ok(all.column(0).into_owned())
    }

    /// T of the candidates that take the largest part of the square, largest T first.
    fn best(&self, r: &DVector<f64>, tried: usize) -> Result<Vec<Found>, StatsError> {
        let mut sized: Vec<(usize, DVector<f64>, f64)> = Vec::new();
        for (k, (basis, sign)) in self.causes.iter().enumerate().filter(|(_, c)| c.0.rank() > 0) {
            let overlap = basis.q.tr_mul(r);
            let wrong = match sign {
                Sign::Any => false,
                Sign::NonNegative => overlap[0] < 0.0,
                Sign::NonPositive => overlap[0] > 0.0,
            };
            if !wrong {
                let size = overlap.norm_squared() / basis.rank() as f64;
                sized.push((k, overlap, size));
            }
        }
        sized.sort_by(|a, b| b.2.total_cmp(&a.2));
        let before = self.cost(r)?;
        let mut found = Vec::new();
        for (candidate, overlap, _) in sized.into_iter().take(tried) {
            let basis = &self.causes[candidate].0;
            let statistic = before - self.cost(&(r - &basis.q * overlap))?;
            let d = basis.rank() as f64;
            found.push(Found { candidate, statistic, standard: (statistic - d) / (2.0 * d).sqrt() });
        }
        found.sort_by(|a, b| b.standard.total_cmp(&a.standard));
        Ok(found)
    }

    /// D of a series.
    fn cost(&self, x: &DVector<f64>) -> Result<f64, StatsError> {
        let model = self.model(x, Order::Bic { max: STATS.noise_order })?;
        Ok(model.minus_two_log_likelihood(&self.records(x))? + model.order() as f64 * (x.len() as f64).ln())
    }

    fn model(&self, x: &DVector<f64>, order: Order) -> Result<ArModel, StatsError> {
        let channels = self.noise.sigma().len();
        ArModel::fit(
            &self.records(x),
            channels,
            &ArOptions { order, sigma_floor: vec![STATS.least_sigma; channels], lost_dof: 0 },
        )
    }

    fn records<'a>(&self, x: &'a DVector<f64>) -> Vec<&'a [f64]> {
        let mut rest = x.as_slice();
        let mut next = |rows: &usize| {
            let (head, tail) = rest.split_at(*rows);
            rest = tail;
            head
        };
        self.rows.iter().map(&mut next).collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::stats::testing::{ar_series, gaussians};

    const TIMES: usize = 150;

    /// Rows of one record: a constant, a ramp, and an oscillation.
    fn columns() -> Vec<f64> {
        let row = |t: usize| {
            let s = t as f64 / TIMES as f64;
            [1.0, s, (40.0 * s).sin()]
        };
        (0..TIMES).flat_map(row).collect()
    }

    fn verdict(series: &[Vec<f64>], seed: u64) -> Vec<Coloured> {
        let global = columns();
        let slices: Vec<&[f64]> = series.iter().map(Vec::as_slice).collect();
        let options = ArOptions { order: Order::Bic { max: 4 }, ..Default::default() };
        let noise = ArModel::fit(&slices, 1, &options).unwrap();
        let records: Vec<RawRows> = series
            .iter()
            .map(|residual| RawRows { residual, own: &[], own_columns: 0, global: &global, global_columns: 3 })
            .collect();
        let candidates: Vec<Candidate> = (0..3).map(|c| Candidate { columns: vec![c], sign: Sign::Any }).collect();
        colour_test(&records, &noise, &[], &candidates, &ColourOptions { tried: 3, draws: 99, seed }).unwrap()
    }

    #[test]
    fn a_constant_that_made_the_colour_is_found() {
        let series: Vec<Vec<f64>> =
            (0..3).map(|k| gaussians(TIMES, k).into_iter().map(|x| 8.0 + x).collect::<Vec<f64>>()).collect();
        let found = verdict(&series, 1);
        assert_eq!(found[0].candidate, 0);
        assert!(found[0].p <= 0.01 + 1e-12 && found[0].statistic > 50.0, "{found:?}");
    }

    #[test]
    fn coloured_noise_is_called_wrong_as_often_as_the_level_says() {
        let trials = 60;
        let wrong = (0..trials)
            .filter(|k| {
                let series: Vec<Vec<f64>> = (0..3).map(|r| ar_series(&[0.97], TIMES, &[1.0], 1000 + 10 * k + r)).collect();
                verdict(&series, *k)[0].p <= 0.05
            })
            .count();
        // 3 expected; 10 or more have probability 1e-3
        assert!(wrong < 10, "{wrong} of {trials}");
    }
}
