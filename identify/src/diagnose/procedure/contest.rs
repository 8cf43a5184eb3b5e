//! Several models under one noise model: that of the best one's residual.
//!
//! The residual of a model that lacks something is no noise, and a noise model fitted to it takes slow errors for colour: rivals that
//! differ by half a million under the right noise differed by 47 under such a one. So the noise is an AR(2) of what the *best* model
//! leaves, and every rival is fitted and judged under it: by generalized least squares,
//! ```text
//! score = |W (y − ŷ)|² + Σ |z_r|² + c · numbers
//! ```
//! Where even the best leaves far more than the sensors' scatter there is no noise model, and models are compared by their errors on
//! records left out ([`super::across`]). A cause may need another size in every record: own sizes compete as well, at the price of their
//! numbers, so that a wrong law with one size does not beat the right one with several.

use super::super::policy::POLICY;
use super::across::{self, Across};
use super::coarse::Coarse;
use super::hypothesis::{Bench, Hypothesis, OwnSizes, squares};
use crate::error::IdentifyError;
use crate::fit::{Fitted, floors};
use crate::stats::ar::{ArModel, ArOptions, Order};
use crate::unknown::Unknown;
use rayon::prelude::*;
use std::cell::OnceCell;

/// Models that were held against each other.
pub(super) struct Contest {
    /// Whether even the best leaves more than noise.
    pub no_noise: bool,
    /// Each model as it is judged.
    pub fits: Vec<Fitted>,
    /// Each model's score: less is better.
    pub scores: Vec<f64>,
    /// What its numbers cost of that.
    pub prices: Vec<f64>,
    /// Whether the last cause of each surely has another size in every record; its score is then that with own sizes.
    pub varies: Vec<bool>,
    /// Each on longer steps and across records, where it was asked for.
    seen: Vec<OnceCell<Seen>>,
}

/// AR(2) of a fit's residual.
pub(super) fn noise_of(bench: &Bench, fitted: &Fitted) -> Result<ArModel, IdentifyError> {
    let slices: Vec<&[f64]> = fitted.residuals.iter().map(Vec::as_slice).collect();
    let lost = fitted.unknowns.len() + fitted.records.iter().map(|r| r.start.z.len()).sum::<usize>();
    let order = Order::Fixed(POLICY.noise_order);
    let options = ArOptions { order, sigma_floor: floors(bench.plan, 1e-3), lost_dof: lost };
    let model = ArModel::fit(&slices, bench.plan.channels(), &options)?;
    let ratio = model.stationary_ratio();
    let sigma = model.sigma().iter().zip(floors(bench.plan, 1.0)).map(|(s, floor)| s.max(floor / ratio)).collect();
    Ok(ArModel::from_reflection(model.reflection(), sigma)?)
}

/// A model as it is judged: under `noise`, or by least squares where it leaves more than `least` times the scatter, for then it is out of
/// the question under this noise, or what it leaves is none.
pub(super) fn judged(bench: &Bench, model: &Hypothesis, noise: &ArModel, least: f64) -> Result<Fitted, IdentifyError> {
    let plain = &model.fitted;
    if bench.over(plain) > least {
        return Ok(Fitted { noise: noise.clone(), ..plain.clone() });
    }
    bench.polished(&plain.records, &plain.values, &plain.unknowns, noise, &POLICY.fine)
}

/// A model on longer steps, for its sensitivities, and across records.
type Seen = (Coarse, Across);

fn seen(bench: &Bench, fitted: &Fitted, own: &[Unknown]) -> Result<Seen, IdentifyError> {
    let coarse = Coarse::of(bench, fitted)?;
    let across = Across::new(&coarse.plan, &coarse.fitted, own)?;
    Ok((coarse, across))
}

/// A model with own sizes of the numbers that are known to vary, and of those of its last cause if it is new and own sizes promise to leave no
/// more than `most` times the scatter; and what that was told from.
fn apart(bench: &Bench, model: &Hypothesis, new: bool, most: f64) -> Result<(Option<OwnSizes>, Option<Seen>), IdentifyError> {
    let last = model.causes.last().filter(|_| new).map_or(&[][..], |cause| &cause.unknowns);
    let own: Vec<Unknown> = model.varying.iter().chain(last).cloned().collect();
    if own.is_empty() {
        return Ok((None, None));
    }
    let seen = seen(bench, &model.fitted, &own)?;
    let (coarse, across) = &seen;
    let asked = !model.varying.is_empty() || across.own.promises(most);
    let sizes = asked.then(|| coarse.bench(bench).own_sizes(&coarse.fitted, &own, None)).transpose()?;
    Ok((sizes, Some(seen)))
}

impl Contest {
    /// The models that others extend come first, `beam` of them.
    pub fn new(bench: &Bench, models: &[&Hypothesis], beam: usize) -> Result<Self, IdentifyError> {
        // a model whose own sizes would leave far more than the best one leaves with common sizes need not be fitted with them
        let common = models.iter().map(|m| bench.over(&m.fitted)).fold(f64::INFINITY, f64::min).max(1.0);
        let most = POLICY.no_noise.min(POLICY.out_of_question * common);
        let all = models.par_iter().enumerate().map(|(k, m)| apart(bench, m, k >= beam, most));
        let (own, before): (Vec<Option<OwnSizes>>, Vec<Option<Seen>>) =
            all.collect::<Result<Vec<_>, IdentifyError>>()?.into_iter().unzip();
        // every model with common sizes and with own ones, and the numbers of each
        let numbers = |k: usize| models[k].numbers() as f64;
        let common = models.iter().enumerate().map(|(k, m)| (&m.fitted, numbers(k)));
        let apart = own.iter().enumerate().filter_map(|(k, own)| own.as_ref().map(|o| (&o.fitted, numbers(k) + o.more())));
        let all: Vec<(&Fitted, f64)> = common.chain(apart).collect();
        let over = all.iter().map(|(f, _)| bench.over(f)).fold(f64::INFINITY, f64::min).max(1.0);
        let mut best = (f64::INFINITY, all[0].0);
        for (fitted, numbers) in &all {
            let rough = squares(bench.plan, fitted, &bench.white)? / (over * over) + POLICY.per_number * numbers;
            if rough < best.0 {
                best = (rough, fitted);
            }
        }
        let no_noise = bench.no_noise(best.1);
        let noise = noise_of(bench, best.1)?;
        let least = POLICY.out_of_question * over;
        let fit = |(k, before): (usize, Option<Seen>)| -> Result<(Fitted, Option<Seen>, Option<OwnSizes>), IdentifyError> {
            if no_noise {
                let seen = before.map_or_else(|| seen(bench, &models[k].fitted, &[]), Ok)?;
                return Ok((models[k].fitted.clone(), Some(seen), None));
            }
            let fitted = judged(bench, models[k], &noise, least)?;
            let asked = own[k].as_ref().filter(|o| bench.over(&o.fitted) <= least);
            let own = asked.map(|o| bench.own_sizes(&fitted, &o.unknowns, Some(&noise))).transpose()?;
            Ok((fitted, None, own))
        };
        let judged: Vec<_> = before.into_par_iter().enumerate().map(fit).collect::<Result<_, _>>()?;
        let mut out =
            Self { no_noise, fits: Vec::new(), scores: Vec::new(), prices: Vec::new(), varies: Vec::new(), seen: Vec::new() };
        for (k, ((fitted, seen, own), model)) in judged.into_iter().zip(models).enumerate() {
            let price = POLICY.per_number * numbers(k);
            let score = match &seen {
                Some((_, across)) => across.left_out.iter().sum(),
                None => squares(bench.plan, &fitted, &noise)? + price,
            };
            let with_own = match own {
                Some(own) => {
                    let price = POLICY.per_number * (numbers(k) + own.more());
                    let score = squares(bench.plan, &own.fitted, &noise)? + price;
                    let new = model.causes.last().filter(|_| k >= beam).map_or(&[][..], |cause| &cause.unknowns);
                    (own.differ(bench.plan, new) || !model.varying.is_empty()).then_some((score, price))
                }
                None => None,
            };
            let varies = with_own.is_some_and(|(own, _)| own < score - POLICY.lead);
            let (score, price) = with_own.filter(|_| varies).unwrap_or((score, price));
            out.fits.push(fitted);
            out.seen.push(seen.map_or_else(OnceCell::new, OnceCell::from));
            out.scores.push(score);
            out.prices.push(price);
            out.varies.push(varies && k >= beam);
        }
        Ok(out)
    }

    fn seen(&self, bench: &Bench, k: usize) -> Result<&Seen, IdentifyError> {
        if let Some(seen) = self.seen[k].get() {
            return Ok(seen);
        }
        let now = seen(bench, &self.fits[k], &[])?;
        Ok(self.seen[k].get_or_init(|| now))
    }

    /// A model as it is judged on longer steps, for its sensitivities.
    pub fn coarse(&self, bench: &Bench, k: usize) -> Result<&Coarse, IdentifyError> {
        Ok(&self.seen(bench, k)?.0)
    }

    /// Squares of a model on every record with it left out.
    pub fn left_out(&self, bench: &Bench, k: usize) -> Result<&[f64], IdentifyError> {
        Ok(&self.seen(bench, k)?.1.left_out)
    }

    /// Whether model `k` cannot be told from the better model `best`. What its numbers cost more tells nothing: that a tilt has two and a turn of
    /// the camera three makes neither likelier.
    pub fn ties(&self, best: usize, k: usize) -> bool {
        if self.no_noise {
            // the scores were made of these
            let left_out = |k: usize| self.seen[k].get().map_or(&[][..], |(_, across)| across.left_out.as_slice());
            return !across::better(left_out(k), left_out(best));
        }
        let more = (self.prices[k] - self.prices[best]).max(0.0);
        self.scores[k] - self.scores[best] - more < POLICY.lead
    }

    /// Whether neither model can be told from the other, whichever is better.
    pub fn alike(&self, a: usize, b: usize) -> bool {
        self.ties(a, b) && self.ties(b, a)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of models that are as near to the data the one with fewer numbers is better, and not told from the other.
    #[test]
    fn what_numbers_cost_tells_nothing() {
        let mut contest = Contest {
            no_noise: false,
            fits: Vec::new(),
            scores: vec![130.0, 146.0, 160.5],
            prices: vec![30.0, 45.0, 30.0],
            varies: Vec::new(),
            seen: Vec::new(),
        };
        assert!(contest.ties(0, 1) && !contest.ties(0, 2));
        // a worse one is always behind a better one, and is like it only where that one is hardly better
        assert!(contest.ties(2, 0) && !contest.alike(0, 2) && !contest.alike(2, 0) && contest.alike(1, 0));
        // nor is a rival told from it that is as much farther from the data as the leader's own further number cost
        contest.prices[1] = 15.0;
        contest.scores[1] = 144.0;
        assert!(contest.ties(0, 1));
    }
}
