//! Step 4: score tests of all causes from one linearization at the current fit.

use crate::causes::{Cause, Situation, library};
use crate::error::IdentifyError;
use crate::fit::Fitted;
use crate::shoot::{Plan, RecordPlan, ShotWants, shoot};
use crate::stats::multiple::holm;
use crate::stats::reduced::{RecordRows, Reduced, time_blocks};
use crate::stats::score::{Candidate, ScoreOptions, ScoreTest, Sign, score_test};
use crate::stats::sign_flip::{MIN_RECORDS, sign_flip};
use crate::unknown::Unknown;
use rayon::prelude::*;

/// Fewest records for which flips resolve a family of a dozen causes.
const FLIP_RECORDS: usize = 10;
const FLIP_DRAWS: usize = 4000;
/// Time blocks of a record for variances robust to a wrong noise model, and the fewest samples of one.
const BLOCKS: usize = 8;
const SHORTEST_BLOCK: usize = 10;

/// Score tests of the library against a fit.
#[derive(Clone, Debug)]
pub(super) struct Tested {
    /// All causes of the library.
    pub causes: Vec<Cause>,
    /// Index into `causes` of each tested candidate.
    pub tested: Vec<usize>,
    /// The test.
    pub score: ScoreTest,
    /// Family-wise p of each tested candidate.
    pub adjusted: Vec<f64>,
}

/// Tests every cause that can be tested at `fitted`.
pub(super) fn test(plan: &Plan, fitted: &Fitted, seed: u64) -> Result<Tested, IdentifyError> {
    let causes = library(&Situation { plan, values: &fitted.values, free: &fitted.unknowns });
    let tested: Vec<usize> = (0..causes.len()).filter(|&c| causes[c].untestable.is_none()).collect();
    let mut unknowns = fitted.unknowns.clone();
    let mut candidates = Vec::new();
    for &c in &tested {
        let first = unknowns.len();
        unknowns.extend(causes[c].unknowns.iter().cloned());
        let sign = match causes[c].unknowns.as_slice() {
            [one] => one.sign(one.value(&fitted.values)),
            _ => Sign::Any,
        };
        candidates.push(Candidate { columns: (first..unknowns.len()).collect(), sign });
    }
    let reduced = reduce(plan, fitted, &unknowns)?;
    let nuisance: Vec<usize> = (0..fitted.unknowns.len()).collect();
    let score = score_test(&reduced, &nuisance, &candidates, &ScoreOptions::default())?;
    let p: Vec<f64> = score.candidates.iter().map(|c| c.p).collect();
    let mut adjusted = holm(&p);
    if reduced.records() >= FLIP_RECORDS.max(MIN_RECORDS) {
        let flips = sign_flip(&score, FLIP_DRAWS, seed)?;
        // the arbiter may only take significance away: with 2^R patterns it cannot resolve small p
        adjusted.iter_mut().zip(&flips.p_adjusted).for_each(|(a, f)| *a = a.max(*f));
    }
    Ok(Tested { causes, tested, score, adjusted })
}

/// Sufficient statistics of all records with `unknowns` as common columns.
pub(super) fn reduce(plan: &Plan, fitted: &Fitted, unknowns: &[Unknown]) -> Result<Reduced, IdentifyError> {
    reduce_in(plan, fitted, unknowns, BLOCKS)
}

/// As [`reduce`], with so many time blocks per record (or piece of one).
pub(super) fn reduce_in(plan: &Plan, fitted: &Fitted, unknowns: &[Unknown], blocks: usize) -> Result<Reduced, IdentifyError> {
    let one = |rec: &RecordPlan| reduce_record(plan, fitted, rec, unknowns, blocks);
    let parts: Vec<Reduced> = fitted.records.par_iter().map(one).collect::<Result<_, _>>()?;
    // pieces of one measured record are one record: they share its errors
    let mut whole: Vec<Reduced> = Vec::new();
    for (k, part) in parts.iter().enumerate() {
        match whole.last_mut() {
            Some(last) if fitted.records[k - 1].parent == fitted.records[k].parent => last.append(part)?,
            _ => whole.push(part.clone()),
        }
    }
    Ok(Reduced::merge_all(&whole)?)
}

fn reduce_record(
    plan: &Plan,
    fitted: &Fitted,
    rec: &RecordPlan,
    unknowns: &[Unknown],
    blocks: usize,
) -> Result<Reduced, IdentifyError> {
    let wants = ShotWants { unknowns, tangents: true, ..ShotWants::default() };
    let mut shot = shoot(plan, rec, &fitted.values, wants)
        .map_err(|source| IdentifyError::Simulation { record: rec.record.name.clone(), source })?;
    let (m, k, channels) = (shot.own_columns, unknowns.len(), plan.channels());
    fitted.noise.whiten(&mut shot.residual, channels)?;
    if m > 0 {
        fitted.noise.whiten_columns(&mut shot.own, channels, m)?;
    }
    if k > 0 {
        fitted.noise.whiten_columns(&mut shot.global, channels, k)?;
    }
    let times = shot.residual.len() / channels;
    let mut starts = time_blocks(times, channels, (times / blocks).max(SHORTEST_BLOCK));
    if m > 0 {
        // the prior on the record's own unknowns, rows of their own
        starts.push(shot.residual.len());
        for (c, z) in rec.start.z.iter().enumerate() {
            shot.residual.push(-z);
            shot.own.extend((0..m).map(|j| f64::from(u8::from(j == c))));
            shot.global.extend(std::iter::repeat_n(0.0, k));
        }
    }
    let rows = RecordRows {
        residual: &shot.residual,
        own: &shot.own,
        own_columns: m,
        global: &shot.global,
        global_columns: k,
        block_starts: &starts,
    };
    Ok(Reduced::of_record(&rows)?)
}
