//! The reduced triangle against the direct dense computation.

use crate::stats_helpers::gaussians;
use approx::assert_relative_eq;
use nalgebra::{DMatrix, DVector};
use pliant_identify::stats::reduced::{RecordRows, Reduced, time_blocks};
use pliant_identify::stats::score::{Candidate, ScoreOptions, Sign, score_test};

const CHANNELS: usize = 3;
const OWN: usize = 4;
const GLOBAL: usize = 6;

struct Problem {
    parts: Vec<Reduced>,
    /// All rows; own nuisance of all records side by side, then the two global nuisance columns.
    nuisance: DMatrix<f64>,
    global: DMatrix<f64>,
    residual: DVector<f64>,
}

fn problem(times: &[usize]) -> Problem {
    let rows: usize = times.iter().sum::<usize>() * CHANNELS;
    let mut whole = Problem {
        parts: Vec::new(),
        nuisance: DMatrix::zeros(rows, OWN * times.len() + 2),
        global: DMatrix::zeros(rows, GLOBAL),
        residual: DVector::zeros(rows),
    };
    let mut start = 0;
    for (r, &t) in times.iter().enumerate() {
        let n = t * CHANNELS;
        let residual = gaussians(n, 10 + r as u64);
        let own = gaussians(n * OWN, 20 + r as u64);
        let mut global = gaussians(n * GLOBAL, 30 + r as u64);
        for i in 0..n {
            // Columns 3 and 4 overlap with each other, with the nuisance column 1 and with the record's own.
            global[i * GLOBAL + 3] += 2.0 * global[i * GLOBAL + 1] + own[i * OWN];
            global[i * GLOBAL + 4] += global[i * GLOBAL + 3];
        }
        let starts = time_blocks(t, CHANNELS, 10);
        let rows = RecordRows {
            residual: &residual,
            own: &own,
            own_columns: OWN,
            global: &global,
            global_columns: GLOBAL,
            block_starts: &starts,
        };
        whole.parts.push(Reduced::of_record(&rows).unwrap());
        let own = DMatrix::from_row_slice(n, OWN, &own);
        let global = DMatrix::from_row_slice(n, GLOBAL, &global);
        whole.nuisance.view_mut((start, r * OWN), (n, OWN)).copy_from(&own);
        whole.global.rows_mut(start, n).copy_from(&global);
        whole.residual.rows_mut(start, n).copy_from_slice(&residual);
        start += n;
    }
    let first_two = whole.global.columns(0, 2).into_owned();
    whole.nuisance.columns_mut(OWN * times.len(), 2).copy_from(&first_two);
    whole
}

fn candidates() -> Vec<Candidate> {
    vec![Candidate::scalar(2), Candidate { columns: vec![3, 4], sign: Sign::Any }, Candidate::scalar(5)]
}

#[test]
fn equals_the_direct_computation() {
    let problem = problem(&[40, 31, 25]);
    let reduced = Reduced::merge_all(&problem.parts).unwrap();
    let test = score_test(&reduced, &[0, 1], &candidates(), &ScoreOptions::default()).unwrap();

    let n = problem.residual.len();
    let pinv = problem.nuisance.clone().pseudo_inverse(1e-12).unwrap();
    let project = DMatrix::identity(n, n) - &problem.nuisance * pinv;
    let r = &project * &problem.residual;
    assert_relative_eq!(test.rss, r.norm_squared(), max_relative = 1e-10);
    assert_eq!(test.dof, (n - 3 * OWN - 2) as f64);

    for (candidate, found) in candidates().iter().zip(&test.candidates) {
        let s = problem.global.select_columns(&candidate.columns);
        let u = &project * &s;
        let inverse = (u.transpose() * &u).try_inverse().unwrap();
        let theta = &inverse * (u.transpose() * &r);
        let lm = (u.transpose() * &r).dot(&theta);
        assert_relative_eq!(found.lm, lm, max_relative = 1e-10);
        // all at once: the nuisance moves beside the candidate
        let mut all = problem.nuisance.clone().resize_horizontally(problem.nuisance.ncols() + s.ncols(), 0.0);
        all.columns_mut(problem.nuisance.ncols(), s.ncols()).copy_from(&s);
        let together = all.pseudo_inverse(1e-12).unwrap() * &problem.residual;
        let own = 3 * OWN;
        for (step, size) in found.beside.iter().zip(together.iter().skip(own)) {
            assert_relative_eq!(step, size, max_relative = 1e-9);
        }
        assert_eq!(found.beside.len(), 2);
        for (i, &size) in theta.iter().enumerate() {
            assert_relative_eq!(found.theta[i], size, max_relative = 1e-10);
            assert_relative_eq!(found.std_error[i], inverse[(i, i)].sqrt(), max_relative = 1e-10);
            assert_relative_eq!(found.detectable[i], 5.0 * found.std_error[i], max_relative = 1e-14);
            let share = 1.0 - u.column(i).norm_squared() / s.column(i).norm_squared();
            assert_relative_eq!(found.absorbed[i], share, max_relative = 1e-10);
        }
    }
    assert!(test.candidates[1].t.is_nan());
    let u = |c: usize| &project * problem.global.column(c);
    assert_relative_eq!(test.candidates[0].t, u(2).dot(&r) / u(2).norm(), max_relative = 1e-10);
    assert_relative_eq!(test.cosines[(0, 2)], u(2).dot(&u(5)) / (u(2).norm() * u(5).norm()), max_relative = 1e-9);
    let q = (&project * problem.global.select_columns(&[3, 4])).qr().q();
    let principal = (q.transpose() * u(2) / u(2).norm()).norm();
    assert_relative_eq!(test.cosines[(0, 1)], principal, max_relative = 1e-9);
}

#[test]
fn blocks_sum_to_the_whole_and_order_of_merging_is_the_callers() {
    let problem = problem(&[40, 31, 25]);
    let reduced = Reduced::merge_all(&problem.parts).unwrap();
    assert_eq!(reduced.records(), 3);
    assert_eq!(reduced.own_rank(), 3 * OWN);
    let gram = reduced.blocks().iter().fold(DMatrix::zeros(GLOBAL, GLOBAL), |sum, b| sum + &b.gram);
    let score = reduced.blocks().iter().fold(DVector::zeros(GLOBAL), |sum, b| sum + &b.score);
    assert_relative_eq!(gram, reduced.gram(), epsilon = 1e-10);
    assert_relative_eq!(score, reduced.score(), epsilon = 1e-10);
    assert_eq!(reduced.blocks().iter().map(|b| b.rows).sum::<usize>(), reduced.rows());
    assert_eq!(reduced.blocks().iter().map(|b| b.record).max(), Some(2));
    let again = Reduced::merge_all(&problem.parts).unwrap();
    assert_eq!(again.gram(), reduced.gram());
}

#[test]
fn absorbed_dead_and_conditioned_candidates() {
    let n = 60;
    let base: Vec<Vec<f64>> = (0..3).map(|s| gaussians(n, 50 + s)).collect();
    let imitation: Vec<f64> = base[0].iter().map(|x| 1e6 * x).collect();
    let zero = vec![0.0; n];
    let residual = gaussians(n, 60);
    let columns = [base[0].clone(), imitation, base[1].clone(), base[1].clone(), base[2].clone(), zero.clone(), zero];
    let reduced = crate::stats_helpers::reduced_of(&residual, &columns, &[]);
    let list = [Candidate::scalar(1), Candidate { columns: vec![2, 3, 4], sign: Sign::Any }, Candidate::scalar(5)];
    let test = score_test(&reduced, &[0, 6], &list, &ScoreOptions::default()).unwrap();
    assert_eq!(test.dead_nuisance, vec![6]);
    assert_eq!(test.candidates[0].rank, 0);
    assert_relative_eq!(test.candidates[0].absorbed[0], 1.0, epsilon = 1e-12);
    assert_eq!(test.candidates[0].p, 1.0);
    assert_eq!((test.candidates[1].rank, test.candidates[1].dead.len()), (2, 1));
    assert_eq!(test.candidates[2].rank, 0);
    assert!(test.candidates[2].detectable[0].is_infinite());
    assert_eq!(test.cosines[(0, 1)], 0.0);

    // Conditioning on a candidate is the same as adding it to the nuisance.
    let list = [Candidate::scalar(2), Candidate::scalar(4)];
    let pair = score_test(&reduced, &[0], &list, &ScoreOptions::default()).unwrap();
    let given = score_test(&reduced, &[0, 4], &list[..1], &ScoreOptions::default()).unwrap();
    assert_relative_eq!(pair.conditional(0, 1).0, given.candidates[0].lm, max_relative = 1e-9);

    assert!(score_test(&reduced, &[2], &list, &ScoreOptions::default()).is_err());
    assert!(score_test(&reduced, &[99], &list, &ScoreOptions::default()).is_err());
}

#[test]
fn inadmissible_signs_are_refused() {
    let n = 50;
    let column = gaussians(n, 1);
    let residual: Vec<f64> = column.iter().zip(gaussians(n, 2)).map(|(u, e)| e - u).collect();
    let reduced = crate::stats_helpers::reduced_of(&residual, &[column], &[]);
    let run = |sign| {
        let list = [Candidate { columns: vec![0], sign }];
        score_test(&reduced, &[], &list, &ScoreOptions::default()).unwrap().candidates[0].clone()
    };
    assert!(!run(Sign::NonNegative).admissible);
    assert_eq!(run(Sign::NonNegative).p, 1.0);
    assert_relative_eq!(run(Sign::NonPositive).p, 0.5 * run(Sign::Any).p, max_relative = 1e-12);
    assert_relative_eq!(run(Sign::Any).theta[0], -1.0, epsilon = 0.4);
}
