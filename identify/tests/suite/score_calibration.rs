//! False alarms, power and wrong names by simulation, with fixed seeds.

use crate::stats_helpers::{ar1, directions, gaussians, reduced_of};
use nalgebra::{DMatrix, DVector};
use pliant_identify::stats::ar::{ArModel, ArOptions};
use pliant_identify::stats::multiple::holm;
use pliant_identify::stats::naming::{Naming, NamingOptions, name};
use pliant_identify::stats::reduced::{RecordRows, Reduced, time_blocks};
use pliant_identify::stats::score::{Candidate, ScoreOptions, ScoreTest, score_test};
use pliant_identify::stats::sign_flip::sign_flip;

const N: usize = 1000;
const CANDIDATES: usize = 13;
const NUISANCE: usize = 4;

/// Candidate responses as a mechanism makes them: smooth, of various frequencies, decaying or not.
fn smooth_columns() -> Vec<Vec<f64>> {
    let column = |j: usize| {
        let phase = gaussians(2, 900 + j as u64);
        move |t: usize| {
            let x = t as f64 / N as f64;
            let decay = if j.is_multiple_of(3) { (-3.0 * x).exp() } else { 1.0 };
            decay * ((2.0 + 3.7 * j as f64) * x * std::f64::consts::TAU / 2.0 + phase[0]).sin() + 0.1 * phase[1]
        }
    };
    (0..NUISANCE + CANDIDATES).map(|j| (0..N).map(column(j)).collect()).collect()
}

/// Least-squares residual after the nuisance columns, in plain coordinates.
fn refit(y: &[f64], columns: &[Vec<f64>]) -> Vec<f64> {
    let a = DMatrix::from_fn(y.len(), NUISANCE, |i, j| columns[j][i]);
    let q = a.qr().q();
    let y = DVector::from_column_slice(y);
    (&y - &q * (q.transpose() * &y)).as_slice().to_vec()
}

fn test_with(model: Option<&ArModel>, residual: &[f64], columns: &[Vec<f64>]) -> ScoreTest {
    let mut white = [vec![residual.to_vec()], columns.to_vec()].concat();
    let sigma = (residual.iter().map(|x| x * x).sum::<f64>() / N as f64).sqrt();
    for series in &mut white {
        match model {
            Some(m) => m.whiten(series, 1).unwrap(),
            None => series.iter_mut().for_each(|x| *x /= sigma),
        }
    }
    let reduced = reduced_of(&white[0], &white[1..], &time_blocks(N, 1, 100));
    let nuisance: Vec<usize> = (0..NUISANCE).collect();
    let candidates: Vec<Candidate> = (NUISANCE..NUISANCE + CANDIDATES).map(Candidate::scalar).collect();
    score_test(&reduced, &nuisance, &candidates, &ScoreOptions::default()).unwrap()
}

fn family_alarm(p: Vec<f64>) -> bool {
    holm(&p).iter().any(|p| *p < 0.05)
}

#[test]
fn family_wise_false_alarms_stay_nominal_under_colour() {
    let columns = smooth_columns();
    let repeats = 200;
    for (phi, white_at_least) in [(0.0, 0), (0.5, 60), (0.9, 160), (0.98, 180)] {
        let (mut naive, mut parametric, mut conservative) = (0, 0, 0);
        for seed in 0..repeats {
            let residual = refit(&ar1(phi, N, 5000 + seed), &columns);
            let model = ArModel::fit(&[&residual], 1, &ArOptions { lost_dof: NUISANCE, ..Default::default() }).unwrap();
            let plain = test_with(None, &residual, &columns);
            naive += usize::from(family_alarm(plain.candidates.iter().map(|c| c.p_parametric).collect()));
            let test = test_with(Some(&model), &residual, &columns);
            parametric += usize::from(family_alarm(test.candidates.iter().map(|c| c.p_parametric).collect()));
            conservative += usize::from(family_alarm(test.candidates.iter().map(|c| c.p).collect()));
        }
        println!("phi {phi}: white {naive}, AR {parametric}, conservative {conservative} of {repeats}");
        assert!(naive >= white_at_least, "phi {phi}: {naive}");
        // 5 % of 200 is 10, two standard deviations more are 16.
        assert!(parametric <= 16, "phi {phi}: {parametric}");
        assert!(conservative <= parametric, "phi {phi}: {conservative}");
    }
}

#[test]
fn an_effect_of_lambda_forty_is_seen() {
    let columns = smooth_columns();
    let target = NUISANCE + 6;
    let mut seen = 0;
    let (mut sum, repeats) = (0.0, 100);
    for seed in 0..repeats {
        let noise = ar1(0.9, N, 8000 + seed);
        // Size from the true noise model: λ = 40.
        let truth = ArModel::from_reflection(&[0.9], vec![(1.0_f64 - 0.81).sqrt()]).unwrap();
        let se = test_with(Some(&truth), &noise, &columns).candidates[6].std_error[0];
        let size = 40.0_f64.sqrt() * se;
        let y: Vec<f64> = noise.iter().zip(&columns[target]).map(|(e, s)| e + size * s).collect();
        let residual = refit(&y, &columns);
        let model = ArModel::fit(&[&residual], 1, &ArOptions { lost_dof: NUISANCE, ..Default::default() }).unwrap();
        let test = test_with(Some(&model), &residual, &columns);
        let adjusted = holm(&test.candidates.iter().map(|c| c.p_parametric).collect::<Vec<_>>());
        seen += usize::from(adjusted[6] < 0.05);
        sum += test.candidates[6].theta[0] / size;
    }
    assert!(seen >= 95, "{seen}/{repeats}");
    assert!((sum / repeats as f64 - 1.0).abs() < 0.1, "mean size ratio {}", sum / repeats as f64);
}

/// Five channels with the very same noise: the parametric test thinks that it has five times the data.
#[test]
fn robust_variances_and_sign_flips_survive_correlated_channels() {
    let (records, times, channels, k) = (12, 60, 5, 6);
    let (mut parametric, mut robust, mut flips, repeats) = (0, 0, 0, 200);
    for seed in 0..repeats {
        let parts: Vec<Reduced> = (0..records)
            .map(|r| {
                let noise = gaussians(times, seed * 100 + r);
                let residual: Vec<f64> = noise.iter().flat_map(|e| std::iter::repeat_n(*e, channels)).collect();
                let bases = gaussians(times * k, 7_000_000 + r);
                let global: Vec<f64> =
                    (0..times * channels).flat_map(|i| bases[i / channels * k..(i / channels + 1) * k].to_vec()).collect();
                let starts = time_blocks(times, channels, 20);
                let rows = RecordRows {
                    residual: &residual,
                    own: &[],
                    own_columns: 0,
                    global: &global,
                    global_columns: k,
                    block_starts: &starts,
                };
                Reduced::of_record(&rows).unwrap()
            })
            .collect();
        let reduced = Reduced::merge_all(&parts).unwrap();
        let list: Vec<Candidate> = (1..4)
            .map(Candidate::scalar)
            .chain([Candidate { columns: vec![4, 5], sign: pliant_identify::stats::score::Sign::Any }])
            .collect();
        let test = score_test(&reduced, &[0], &list, &ScoreOptions::default()).unwrap();
        assert!(test.candidates.iter().all(|c| c.p_blocks.is_some() && c.p_records.is_some()));
        parametric += usize::from(family_alarm(test.candidates.iter().map(|c| c.p_parametric).collect()));
        robust += usize::from(family_alarm(test.candidates.iter().map(|c| c.p).collect()));
        flips += usize::from(sign_flip(&test, 999, seed).unwrap().p_adjusted.iter().any(|p| *p < 0.05));
    }
    println!("correlated channels: parametric {parametric}, robust {robust}, sign flips {flips} of {repeats}");
    assert!(parametric > 60, "{parametric}");
    assert!(robust <= 17, "{robust}");
    assert!(flips <= 18, "{flips}");
}

/// Draws r = √λ u_truth + e in the given directions and applies the rule with known noise.
fn draw_name(dirs: &[Vec<Vec<f64>>], truth: &[(usize, f64)], seed: u64) -> Naming {
    let n = dirs[0][0].len();
    let mut residual = gaussians(n, seed);
    for &(cause, lambda) in truth {
        let unit = &dirs[cause][0];
        residual.iter_mut().zip(unit).for_each(|(r, u)| *r += f64::sqrt(lambda) * u);
    }
    let columns: Vec<Vec<f64>> = dirs.iter().flatten().cloned().collect();
    let mut next = 0;
    let list: Vec<Candidate> = dirs
        .iter()
        .map(|d| {
            next += d.len();
            Candidate { columns: (next - d.len()..next).collect(), sign: pliant_identify::stats::score::Sign::Any }
        })
        .collect();
    let reduced = reduced_of(&residual, &columns, &[]);
    let test = score_test(&reduced, &[], &list, &ScoreOptions::default()).unwrap();
    let adjusted = holm(&test.candidates.iter().map(|c| c.p).collect::<Vec<_>>());
    name(&test, &adjusted, &NamingOptions::default())
}

#[derive(Debug, Default)]
struct Tally {
    right: usize,
    wrong: usize,
    ambiguous: usize,
    none: usize,
}

fn tally(dirs: &[Vec<Vec<f64>>], truth: &[(usize, f64)], repeats: u64, seed: u64) -> Tally {
    let mut tally = Tally::default();
    for s in 0..repeats {
        match draw_name(dirs, truth, seed * 100_000 + s) {
            Naming::Named(j) if truth.iter().any(|t| t.0 == j) => tally.right += 1,
            Naming::Named(_) => tally.wrong += 1,
            Naming::Ambiguous(_) => tally.ambiguous += 1,
            Naming::None => tally.none += 1,
        }
    }
    tally
}

fn singles(gram: &DMatrix<f64>, n: usize) -> Vec<Vec<Vec<f64>>> {
    directions(gram, n).iter().map(|d| vec![d.as_slice().to_vec()]).collect()
}

#[test]
fn wrong_names_stay_below_five_percent_at_rho_nine_tenths() {
    for rivals in [1, 3, 6] {
        let m = rivals + 1;
        let gram = DMatrix::from_fn(m, m, |i, j| if i == j { 1.0 } else { 0.9 });
        let dirs = singles(&gram, m + 2);
        for lambda in [0.0, 10.0, 30.0, 100.0, 1000.0] {
            let tally = tally(&dirs, &[(0, lambda)], 1000, rivals as u64);
            println!("rivals {rivals}, lambda {lambda}: {tally:?}");
            let wrong = tally.wrong + if lambda == 0.0 { tally.right } else { 0 };
            assert!(wrong <= 50, "rivals {rivals}, lambda {lambda}: {tally:?}");
            if lambda * 0.1 > 50.0 {
                assert!(tally.right > 900, "rivals {rivals}, lambda {lambda}: {tally:?}");
            }
        }
    }
}

#[test]
fn symmetric_pairs_are_never_named_singly() {
    let rho = 0.9996;
    let gram = DMatrix::from_row_slice(3, 3, &[1.0, -rho, 0.3, -rho, 1.0, -0.3, 0.3, -0.3, 1.0]);
    let tally = tally(&singles(&gram, 5), &[(0, 1e6)], 200, 77);
    assert_eq!((tally.right, tally.wrong, tally.ambiguous), (0, 0, 200));
}

#[test]
fn two_separable_causes_do_not_block_each_other() {
    let gram = DMatrix::from_row_slice(3, 3, &[1.0, 0.3, 0.2, 0.3, 1.0, 0.1, 0.2, 0.1, 1.0]);
    let tally = tally(&singles(&gram, 5), &[(0, 100.0), (1, 100.0)], 500, 78);
    assert!(tally.right >= 490, "{tally:?}");
    // But a cause that is just their imitation by two others stays ambiguous or right, not wrong.
    let gram = DMatrix::from_row_slice(3, 3, &[1.0, 0.9, 0.9, 0.9, 1.0, 0.64, 0.9, 0.64, 1.0]);
    for lambda in [30.0, 100.0, 300.0] {
        let tally = self::tally(&singles(&gram, 5), &[(0, lambda)], 1000, 79);
        println!("imitated by two, lambda {lambda}: {tally:?}");
        assert!(tally.wrong <= 50, "lambda {lambda}: {tally:?}");
    }
}

/// A two-parameter cause against a one-parameter one with principal cosine 0.9, either being the truth.
#[test]
fn causes_of_different_dimension_are_compared_fairly() {
    let n = 8;
    let unit = |i: usize| (0..n).map(|l| if l == i { 1.0 } else { 0.0 }).collect::<Vec<f64>>();
    let tilted: Vec<f64> = (0..n).map(|l| [0.9, 0.0, (1.0_f64 - 0.81).sqrt()].get(l).copied().unwrap_or(0.0)).collect();
    let dirs = vec![vec![unit(0), unit(1)], vec![tilted], vec![unit(4), unit(5), unit(6)]];
    for (truth, lambda) in [(0, 30.0), (1, 30.0), (0, 300.0), (1, 300.0), (2, 100.0), (0, 0.0)] {
        let tally = tally(&dirs, &[(truth, lambda)], 1000, 90 + truth as u64);
        println!("dimension: truth {truth}, lambda {lambda}: {tally:?}");
        let wrong = tally.wrong + if lambda == 0.0 { tally.right } else { 0 };
        assert!(wrong <= 50, "truth {truth}, lambda {lambda}: {tally:?}");
        if lambda >= 300.0 {
            assert!(tally.right >= 800, "truth {truth}, lambda {lambda}: {tally:?}");
        }
    }
    // Containment: the plane holds the line exactly, so the line is never named alone.
    let dirs = vec![vec![unit(0), unit(1)], vec![unit(0)]];
    let tally = tally(&dirs, &[(1, 1000.0)], 200, 95);
    assert_eq!(tally.right + tally.wrong, 0, "{tally:?}");
}
