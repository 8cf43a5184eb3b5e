//! Step 4: score tests of all causes from one linearization at the current fit.

use super::baseline::Prepared;
use super::policy::{Blocks, POLICY};
use crate::causes::{Cause, Situation, library};
use crate::error::IdentifyError;
use crate::fit::{FitOptions, Fitted, fit};
use crate::log::{Logs, Setup};
use crate::shooting::{Plan, RecordPlan, Shot, ShotWants, pieces_by_record, shoot};
use crate::stats::STATS;
use crate::stats::ar::ArModel;
use crate::stats::multiple::holm;
use crate::stats::naming::{Naming, NamingOptions, name};
use crate::stats::reduced::{RecordRows, Reduced, time_blocks};
use crate::stats::score::{Candidate, ScoreOptions, ScoreTest, Sign, score_test};
use crate::stats::sign_flip::sign_flip;
use crate::unknown::{Unknown, Values};
use rayon::prelude::*;
use std::ops::Range;

/// Score tests of the library against a fit.
#[derive(Clone, Debug)]
pub struct Scores {
    /// All causes of the library.
    pub causes: Vec<Cause>,
    /// Index into `causes` of each tested candidate.
    pub tested: Vec<usize>,
    /// The test; its candidates are those of `tested`.
    pub score: ScoreTest,
    /// Family-wise p of each tested candidate.
    pub adjusted: Vec<f64>,
}

impl Scores {
    /// Family-wise p of the cause with this title; `None` where it was not tested.
    pub fn p_value(&self, title: &str) -> Option<f64> {
        self.tested.iter().position(|&c| self.causes[c].title() == title).map(|j| self.adjusted[j])
    }

    /// Titles of the causes that the linear naming rule ([`mod@crate::stats::naming`]) leaves, best first: none, one, or several that it
    /// does not tell apart. A diagnosis refits them before it names one.
    pub fn leading(&self) -> Vec<String> {
        let title = |j: &usize| self.causes[self.tested[*j]].title();
        match name(&self.score, &self.adjusted, &NamingOptions::default()) {
            Naming::None => Vec::new(),
            Naming::Named(j) => vec![title(&j)],
            Naming::Ambiguous(set) => set.iter().map(title).collect(),
        }
    }
}

/// Fits the declared free parameters and tests every cause of the library, without refits: the first two steps of a diagnosis.
///
/// Errors: wrong input, or a baseline that cannot be simulated.
pub fn score_scene(setup: &Setup, logs: &Logs, seed: u64) -> Result<Scores, IdentifyError> {
    let mut plan = Plan::opened(setup, logs)?;
    let options = FitOptions::default();
    let (_, grids) = super::audit::check(setup, &plan, logs)?;
    let (prepared, near) = Prepared::begun(setup, &mut plan, &options, &grids)?;
    let plain = prepared.ended(&plan, near, &options)?;
    scores(&plan, &fit(&plan, &plain.records, &plain.values, &prepared.unknowns, None, &options)?, seed)
}

/// Tests every cause that can be tested at `fitted`.
pub(super) fn scores(plan: &Plan, fitted: &Fitted, seed: u64) -> Result<Scores, IdentifyError> {
    scores_in(plan, &Situation { plan, values: &fitted.values, free: &fitted.unknowns, together: false }, fitted, seed)
}

/// Tests every cause of the library as it stands in this situation.
pub(super) fn scores_in(plan: &Plan, at: &Situation, fitted: &Fitted, seed: u64) -> Result<Scores, IdentifyError> {
    Ok(scores_under(plan, at, fitted, None, seed)?.0)
}

/// The same under the noise of the fit, and from the same pass of sensitivities under another one.
pub(super) fn scores_under(
    plan: &Plan,
    at: &Situation,
    fitted: &Fitted,
    other: Option<&ArModel>,
    seed: u64,
) -> Result<(Scores, Option<Scores>), IdentifyError> {
    let causes = library(at);
    let columns = Columns::new(&causes, fitted);
    let k = columns.unknowns.len();
    let one = |_: usize, rec: &RecordPlan| shot_of(plan, rec, &columns.unknowns, &columns.passes);
    let both = |pieces: &[(&RecordPlan, Shot)]| {
        let other = other.map(|noise| reduce_shots(plan, noise, pieces, k, POLICY.score_blocks)).transpose()?;
        Ok((reduce_shots(plan, &fitted.noise, pieces, k, POLICY.score_blocks)?, other))
    };
    let (own, others): (Vec<Reduced>, Vec<Option<Reduced>>) = each(fitted, one, both)?.into_iter().unzip();
    let others: Option<Vec<Reduced>> = others.into_iter().collect();
    let test = |parts: &[Reduced]| tested(causes.clone(), columns.clone(), &Reduced::merge_all(parts)?, fitted, seed);
    Ok((test(&own)?, others.map(|parts| test(&parts)).transpose()?))
}

/// The tests, from the statistics of the columns.
fn tested(
    mut causes: Vec<Cause>,
    mut columns: Columns,
    reduced: &Reduced,
    fitted: &Fitted,
    seed: u64,
) -> Result<Scores, IdentifyError> {
    columns.drop_dead(&mut causes, reduced);
    let silent = |c: &Column| c.columns.iter().all(|&k| reduced.raw_norm(k) == 0.0);
    for (k, cause) in causes.iter_mut().enumerate().filter(|(_, cause)| cause.untestable.is_none()) {
        if columns.candidates.iter().filter(|c| c.cause == k).all(silent) {
            cause.untestable = Some("no reading of these records depends on it".to_owned());
        }
    }
    let nuisance: Vec<usize> = (0..fitted.unknowns.len()).collect();
    let trial = |chosen: &[&Column]| {
        let candidates: Vec<Candidate> =
            chosen.iter().map(|c| Candidate { columns: c.columns.clone(), sign: c.sign(&causes, fitted) }).collect();
        score_test(reduced, &nuisance, &candidates, &ScoreOptions::default())
    };
    let all: Vec<&Column> = columns.candidates.iter().filter(|c| causes[c.cause].untestable.is_none()).collect();
    let first = trial(&all)?;
    // of each cause the best point of its nuisance grid
    let mut best: Vec<usize> = Vec::new();
    for (k, column) in all.iter().enumerate() {
        match best.last_mut() {
            Some(last) if all[*last].cause == column.cause => {
                if first.candidates[k].lm > first.candidates[*last].lm {
                    *last = k;
                }
            }
            _ => best.push(k),
        }
    }
    let chosen: Vec<&Column> = best.iter().map(|&k| all[k]).collect();
    let score = if chosen.len() == all.len() { first } else { trial(&chosen)? };
    let tried = |c: &Column| causes[c.cause].nuisance_grid.len().max(1) as f64;
    let p: Vec<f64> = score.candidates.iter().zip(&chosen).map(|(s, c)| (s.p * tried(c)).min(1.0)).collect();
    let tested: Vec<usize> = chosen.iter().map(|c| c.cause).collect();
    let kept: Vec<(usize, Vec<(usize, f64)>)> = chosen.iter().map(|c| (c.cause, c.grid_point.clone())).collect();
    for (cause, grid_point) in kept {
        causes[cause].nuisance_grid = if grid_point.is_empty() { Vec::new() } else { vec![grid_point] };
    }
    let mut adjusted = holm(&p);
    if reduced.records() >= POLICY.flip_records.max(STATS.flip_records) {
        let flips = sign_flip(&score, POLICY.flip_draws, seed)?;
        // the arbiter may only take significance away: with 2^R patterns it cannot resolve small p
        adjusted.iter_mut().zip(&flips.p_adjusted).for_each(|(a, f)| *a = a.max(*f));
    }
    Ok(Scores { causes, tested, score, adjusted })
}

/// A candidate: a cause at one point of its nuisance grid, and its columns.
#[derive(Clone)]
struct Column {
    cause: usize,
    grid_point: Vec<(usize, f64)>,
    columns: Vec<usize>,
}

impl Column {
    fn sign(&self, causes: &[Cause], fitted: &Fitted) -> Sign {
        match causes[self.cause].unknowns.as_slice() {
            [one] => one.sign(one.value(&fitted.values)),
            _ => Sign::Any,
        }
    }
}

/// Columns of everything fitted and of all candidates, by the values they are taken at: those of the fit, or for laws that are
/// silent there, close by.
#[derive(Clone)]
struct Columns {
    unknowns: Vec<Unknown>,
    candidates: Vec<Column>,
    /// (values, columns taken there)
    passes: Vec<(Values, Vec<usize>)>,
}

impl Columns {
    fn new(causes: &[Cause], fitted: &Fitted) -> Self {
        let mut unknowns = fitted.unknowns.clone();
        let mut candidates = Vec::new();
        let mut passes = vec![(fitted.values.clone(), (0..unknowns.len()).collect::<Vec<usize>>())];
        let mut probed = (fitted.values.clone(), Vec::new());
        for (c, cause) in causes.iter().enumerate().filter(|(_, cause)| cause.untestable.is_none()) {
            let plain = vec![Vec::new()];
            for grid_point in if cause.nuisance_grid.is_empty() { &plain } else { &cause.nuisance_grid } {
                let columns: Vec<usize> = (unknowns.len()..unknowns.len() + cause.unknowns.len()).collect();
                unknowns.extend(cause.unknowns.iter().cloned());
                let silent = cause.unknowns.iter().any(|u| u.silent(&fitted.values).is_some());
                if !grid_point.is_empty() {
                    let mut values = fitted.values.clone();
                    grid_point.iter().for_each(|&(entry, value)| values.theta[entry] = value);
                    probe(&cause.unknowns, &fitted.values, &mut values);
                    passes.push((values, columns.clone()));
                } else if silent {
                    probe(&cause.unknowns, &fitted.values, &mut probed.0);
                    probed.1.extend(columns.clone());
                } else {
                    passes[0].1.extend(columns.clone());
                }
                candidates.push(Column { cause: c, grid_point: grid_point.clone(), columns });
            }
        }
        if !probed.1.is_empty() {
            passes.push(probed);
        }
        Self { unknowns, candidates, passes }
    }

    /// Takes out of a cause of several numbers those that move no reading (a tilt across an arm's plane): in a refit they would make
    /// the equations singular, and the cause would pay for numbers it does not use.
    fn drop_dead(&mut self, causes: &mut [Cause], reduced: &Reduced) {
        for column in self.candidates.iter_mut().filter(|c| c.grid_point.is_empty()) {
            let norms: Vec<f64> = column.columns.iter().map(|&k| reduced.raw_norm(k)).collect();
            let largest = norms.iter().copied().fold(0.0, f64::max);
            if largest == 0.0 {
                continue;
            }
            let mut acts = norms.iter().map(|norm| *norm > POLICY.dead_number * largest).cycle();
            column.columns.retain(|_| acts.next().unwrap_or(true));
            causes[column.cause].unknowns.retain(|_| acts.next().unwrap_or(true));
        }
    }
}

fn probe(unknowns: &[Unknown], at: &Values, values: &mut Values) {
    for u in unknowns {
        if let Some(probe) = u.silent(at) {
            u.set(values, probe.small);
        }
    }
}

/// Sufficient statistics of all records with `unknowns` as common columns.
pub(super) fn reduce(plan: &Plan, fitted: &Fitted, unknowns: &[Unknown]) -> Result<Reduced, IdentifyError> {
    Ok(Reduced::merge_all(&reduce_each(plan, fitted, unknowns)?)?)
}

/// The same of every measured record on its own.
pub(super) fn reduce_each(plan: &Plan, fitted: &Fitted, unknowns: &[Unknown]) -> Result<Vec<Reduced>, IdentifyError> {
    let passes = [(fitted.values.clone(), (0..unknowns.len()).collect())];
    let one = |_: usize, rec: &RecordPlan| shot_of(plan, rec, unknowns, &passes);
    each(fitted, one, |pieces| reduce_shots(plan, &fitted.noise, pieces, unknowns.len(), POLICY.score_blocks))
}

/// The same with changes of the readings as further columns, behind those of the unknowns, each given by record; 0 where nothing was measured.
pub(super) fn reduce_beside(
    plan: &Plan,
    fitted: &Fitted,
    unknowns: &[Unknown],
    changes: &[&[Vec<f64>]],
    blocks: Blocks,
) -> Result<Reduced, IdentifyError> {
    let (k, all) = (unknowns.len(), unknowns.len() + changes.len());
    let passes = [(fitted.values.clone(), (0..k).collect())];
    let one = |r: usize, rec: &RecordPlan| {
        let mut shot = shot_of(plan, rec, unknowns, &passes)?;
        let change =
            |row: usize, change: &&[Vec<f64>]| change[r].get(row).copied().filter(|_| shot.residual[row] != 0.0).unwrap_or(0.0);
        let row = |row: usize| {
            let changes = changes.iter().map(move |c| change(row, c));
            shot.global[row * k..(row + 1) * k].iter().copied().chain(changes)
        };
        shot.global = (0..shot.residual.len()).flat_map(row).collect();
        Ok(shot)
    };
    let parts = each(fitted, one, |pieces| reduce_shots(plan, &fitted.noise, pieces, all, blocks))?;
    Ok(Reduced::merge_all(&parts)?)
}

/// Shoots every piece of each measured record with `one`, and makes one thing of a record's shots with `then`.
fn each<T: Send>(
    fitted: &Fitted,
    one: impl Fn(usize, &RecordPlan) -> Result<Shot, IdentifyError> + Sync + Send,
    then: impl Fn(&[(&RecordPlan, Shot)]) -> Result<T, IdentifyError> + Sync + Send,
) -> Result<Vec<T>, IdentifyError> {
    let of = |pieces: Range<usize>| {
        let shots = pieces.into_par_iter().map(|k| Ok((&fitted.records[k], one(k, &fitted.records[k])?)));
        then(&shots.collect::<Result<Vec<_>, IdentifyError>>()?)
    };
    pieces_by_record(&fitted.records).into_par_iter().map(of).collect()
}

/// A record's readings and columns, whitened and reduced, from the shots of its pieces. There is a prior on each piece's initial state, and one on
/// the sizes that they share.
fn reduce_shots(
    plan: &Plan,
    noise: &ArModel,
    pieces: &[(&RecordPlan, Shot)],
    k: usize,
    blocks: Blocks,
) -> Result<Reduced, IdentifyError> {
    let sizes = pieces[0].0.own_sizes();
    if sizes == 0 && pieces.len() > 1 {
        // nothing is shared: each is reduced on its own
        let parts = pieces.chunks(1).map(|one| reduce_shots(plan, noise, one, k, blocks));
        let parts: Vec<Reduced> = parts.collect::<Result<_, _>>()?;
        let mut whole = parts[0].clone();
        parts[1..].iter().try_for_each(|part| whole.append(part))?;
        return Ok(whole);
    }
    let channels = plan.channels();
    let starts: usize = pieces.iter().map(|(_, shot)| shot.own_columns - sizes).sum();
    let columns = starts + sizes;
    let (mut residual, mut own, mut global) = (Vec::new(), Vec::new(), Vec::new());
    let (mut ends, mut first) = (Vec::new(), 0);
    let prior = |column: usize| (0..columns).map(move |j| f64::from(u8::from(j == column)));
    for (rec, shot) in pieces {
        let (m, mut shot) = (shot.own_columns, shot.clone());
        noise.whiten(&mut shot.residual, channels)?;
        if m > 0 {
            noise.whiten_columns(&mut shot.own, channels, m)?;
        }
        if k > 0 {
            noise.whiten_columns(&mut shot.global, channels, k)?;
        }
        let times = shot.residual.len() / channels;
        let before = residual.len();
        let blocks = time_blocks(times, channels, (times / blocks.most).max(blocks.samples));
        ends.extend(blocks.into_iter().map(|start| before + start));
        residual.extend_from_slice(&shot.residual);
        global.extend_from_slice(&shot.global);
        let start = m - sizes;
        for row in 0..shot.residual.len() {
            let of = &shot.own[row * m..(row + 1) * m];
            let place = |j: usize| match j {
                j if j >= starts => of[start + j - starts],
                j if (first..first + start).contains(&j) => of[j - first],
                _ => 0.0,
            };
            own.extend((0..columns).map(place));
        }
        if start > 0 {
            ends.push(residual.len());
        }
        for (c, z) in rec.start.z.iter().enumerate() {
            residual.push(-z);
            own.extend(prior(first + c));
            global.extend(std::iter::repeat_n(0.0, k));
        }
        first += start;
    }
    let (rec, _) = &pieces[0];
    if sizes > 0 {
        ends.push(residual.len());
    }
    for (c, z) in rec.z()[rec.start.z.len()..].iter().enumerate() {
        residual.push(-z);
        own.extend(prior(starts + c));
        global.extend(std::iter::repeat_n(0.0, k));
    }
    let rows = RecordRows {
        residual: &residual,
        own: &own,
        own_columns: columns,
        global: &global,
        global_columns: k,
        block_starts: &ends,
    };
    Ok(Reduced::of_record(&rows)?)
}

/// Residual and own columns of the first pass, and of every pass its columns.
fn shot_of(plan: &Plan, rec: &RecordPlan, unknowns: &[Unknown], passes: &[(Values, Vec<usize>)]) -> Result<Shot, IdentifyError> {
    let k = unknowns.len();
    let run = |(values, columns): &(Values, Vec<usize>)| {
        let own: Vec<Unknown> = columns.iter().map(|&c| unknowns[c].clone()).collect();
        let wants = ShotWants { unknowns: &own, tangents: true, ..ShotWants::default() };
        shoot(plan, rec, values, wants).map_err(|source| IdentifyError::Simulation { record: rec.record.name.clone(), source })
    };
    let mut out = run(&passes[0])?;
    let rows = out.residual.len();
    let mut global = vec![0.0; rows * k];
    let mut place = |shot: &Shot, columns: &[usize]| {
        let n = columns.len();
        for r in 0..rows.min(shot.residual.len()) {
            columns.iter().enumerate().for_each(|(i, &c)| global[r * k + c] = shot.global[r * n + i]);
        }
    };
    place(&out, &passes[0].1);
    for pass in &passes[1..] {
        place(&run(pass)?, &pass.1);
    }
    out.global = global;
    Ok(out)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::audit::starts::tests::{experiment, pendulum};
    use super::*;
    use crate::shooting::OwnSize;
    use nalgebra::DMatrix;

    /// Of two pieces that share a size, what is left of a column is what no start of a piece and no size of the record takes, all with their priors.
    #[test]
    fn a_size_that_pieces_share_is_projected_off_them_together() {
        let (plan, _) = experiment(&pendulum("measured"), &[vec![0.3; 40], vec![0.5; 40], vec![0.2; 40]]);
        let of = |path: &str| Unknown::of_theta(&plan.model, path, 0.1).unwrap();
        let (number, other) = (of("pivot.damping"), of("link.mass"));
        let mut fitted = fit(&plan, &plan.fitted, &plan.scene_values, &[], None, &POLICY.fine).unwrap();
        for rec in &mut fitted.records {
            rec.parent = 0;
            rec.sizes = vec![OwnSize { of: vec![(number.clone(), 1.0)], beyond: 0.2, spread: Some(0.5) }];
        }
        let reduced = reduce(&plan, &fitted, std::slice::from_ref(&other)).unwrap();
        assert_eq!(reduced.records(), 1);
        let wants = ShotWants { unknowns: std::slice::from_ref(&other), tangents: true, ..ShotWants::default() };
        let (m, rows) = (fitted.records[0].start.z.len(), 40);
        let columns = 2 * m + 1;
        let mut own = DMatrix::zeros(2 * rows + columns, columns);
        let mut column = DMatrix::zeros(2 * rows + columns, 1);
        for (p, rec) in fitted.records.iter().enumerate() {
            let shot = shoot(&plan, rec, &fitted.values, wants).unwrap();
            let whitened = |x: &[f64]| {
                let mut x = x.to_vec();
                fitted.noise.whiten(&mut x, 1).unwrap();
                x
            };
            for c in 0..=m {
                let of: Vec<f64> = shot.own.iter().skip(c).step_by(m + 1).copied().collect();
                let place = if c == m { 2 * m } else { p * m + c };
                whitened(&of).iter().enumerate().for_each(|(r, x)| own[(p * rows + r, place)] = *x);
            }
            whitened(&shot.global).iter().enumerate().for_each(|(r, x)| column[(p * rows + r, 0)] = *x);
        }
        (0..columns).for_each(|c| own[(2 * rows + c, c)] = 1.0);
        let taken = (own.transpose() * &own).cholesky().unwrap().solve(&(own.transpose() * &column));
        let left = (&column - own * taken).norm_squared();
        assert!((reduced.gram()[(0, 0)] / left - 1.0).abs() < 1e-8, "{} {left}", reduced.gram()[(0, 0)]);
    }
}
