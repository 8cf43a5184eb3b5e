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
//! spread ([`super::spread`]), so that a wrong law with one size does not beat the right one with several.

use super::super::policy::POLICY;
use super::across;
use super::apart::{causes_apart, spread_of, uncertain};
use super::coarse::Coarse;
use super::hypothesis::{Bench, Hypothesis, squares};
use super::spread::Apart;
use super::unseen::{foretold, logs, sought_on_some, typical, unseen};
use crate::causes::Cause;
use crate::error::IdentifyError;
use crate::fit::{Fitted, floors};
use crate::shooting::own_unknowns;
use crate::stats::ar::{ArModel, ArOptions, Order};
use crate::unknown::Unknown;
use rayon::prelude::*;
use std::cell::OnceCell;

/// Models that were held against each other.
pub(super) struct Contest {
    /// Whether even the best leaves more than noise.
    pub no_noise: bool,
    /// Whether they are judged on records that they have not seen.
    pub unseen: bool,
    /// Each model as it is judged.
    pub fits: Vec<Fitted>,
    /// Each model's score: less is better.
    pub scores: Vec<f64>,
    /// What its numbers cost of that.
    pub prices: Vec<f64>,
    /// Whether the last cause of each surely has another size in every record; it is then judged with own sizes.
    pub varies: Vec<bool>,
    /// Each with own sizes of its last cause, where these were worth a fit.
    apart: Vec<Option<Fitted>>,
    /// Each on longer steps, and its squares on what was left out, where they were asked for.
    coarse: Vec<OnceCell<Coarse>>,
    left_out: Vec<OnceCell<Vec<f64>>>,
}

/// AR(2) of a fit's residual.
pub(super) fn noise_of(bench: &Bench, fitted: &Fitted) -> Result<ArModel, IdentifyError> {
    let slices: Vec<&[f64]> = fitted.residuals.iter().map(Vec::as_slice).collect();
    let lost = fitted.unknowns.len() + own_unknowns(&fitted.records);
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

/// A model as it is judged: its score, and what its numbers cost of that.
struct Scored {
    fitted: Fitted,
    score: f64,
    price: f64,
}

/// A fit under the noise that it was fitted under. Own sizes cost their spreads, and what the deviations are uncertain by.
fn scored(bench: &Bench, fitted: Fitted, numbers: usize) -> Result<Scored, IdentifyError> {
    let price = POLICY.per_number * (numbers + causes_apart(&fitted).len()) as f64 + uncertain(bench, &fitted)?;
    let score = squares(bench.plan, &fitted, &fitted.noise)? + price;
    Ok(Scored { fitted, score, price })
}

/// A model under the noise of the best with own sizes of its last cause, if it varies: these lead, differ without pointing both
/// ways, and one half of a record foretells the other better by its own size than by the common one.
fn varying(bench: &Bench, common: &Scored, apart: &Fitted, model: &Hypothesis) -> Result<Option<Scored>, IdentifyError> {
    let last = model.causes.last().map_or(&[][..], |cause| &cause.unknowns);
    let noise = &common.fitted.noise;
    let begun = bench.spread_anew(&Fitted { noise: noise.clone(), ..apart.clone() })?;
    if spread_of(&begun, last) == 0.0 {
        return Ok(None);
    }
    let fitted = bench.polished(&begun.records, &begun.values, &begun.unknowns, noise, &POLICY.fine)?;
    let own = scored(bench, fitted, model.numbers())?;
    if own.score >= common.score - POLICY.lead {
        return Ok(None);
    }
    let [together, apart] = [&common.fitted, &own.fitted].map(|fitted| halves(bench, fitted, last, &own.fitted));
    let (together, apart) = (together?, apart?);
    let carries = across::better(&together.halves(), &apart.left_out(&[spread_of(&own.fitted, last)]), POLICY.nothing);
    Ok((carries && apart.differ() && !apart.points_both_ways()).then_some(own))
}

/// A fit's halves of records beside own sizes of the cause with these numbers, as it varies in the fit `by`; on longer steps.
fn halves(bench: &Bench, fitted: &Fitted, numbers: &[Unknown], by: &Fitted) -> Result<Apart, IdentifyError> {
    let coarse = Coarse::of(bench, fitted)?;
    let mut causes = causes_apart(by);
    causes.retain(|of| of.iter().any(|(u, _)| numbers.iter().any(|n| n.target.same(&u.target))));
    Apart::new(&coarse.bench(bench), &coarse.fitted, &causes)
}

impl Contest {
    /// The models that others extend come first, `beam` of them.
    pub fn new(bench: &Bench, models: &[&Hypothesis], beam: usize) -> Result<Self, IdentifyError> {
        let apart = |(k, model): (usize, &&Hypothesis)| match model.causes.last() {
            Some(last) if k >= beam => bench.apart(&model.fitted, &last.unknowns),
            _ => Ok(None),
        };
        let apart: Vec<Option<Fitted>> = models.par_iter().enumerate().map(apart).collect::<Result<_, _>>()?;
        // every model with common sizes and with own ones
        let all: Vec<(&Fitted, usize)> = models
            .iter()
            .zip(&apart)
            .flat_map(|(m, own)| [Some((&m.fitted, m.numbers())), own.as_ref().map(|own| (own, m.numbers()))])
            .flatten()
            .collect();
        let over = all.iter().map(|(f, _)| bench.over(f)).fold(f64::INFINITY, f64::min).max(1.0);
        let mut best = (f64::INFINITY, all[0].0);
        for (fitted, numbers) in &all {
            let numbers = (numbers + causes_apart(fitted).len()) as f64;
            let rough = squares(bench.plan, fitted, &bench.white)? / (over * over) + POLICY.per_number * numbers;
            if rough < best.0 {
                best = (rough, fitted);
            }
        }
        let no_noise = bench.no_noise(best.1);
        let unseen = no_noise && sought_on_some(bench.plan, best.1);
        let noise = noise_of(bench, best.1)?;
        let least = POLICY.out_of_question * over;
        let fit = |k: usize| -> Result<(Scored, bool), IdentifyError> {
            if no_noise {
                return Ok((Scored { fitted: models[k].fitted.clone(), score: f64::NAN, price: 0.0 }, false));
            }
            let common = scored(bench, judged(bench, models[k], &noise, least)?, models[k].numbers())?;
            let own = apart[k].as_ref().filter(|own| bench.over(own) <= least);
            let own = own.map(|own| varying(bench, &common, own, models[k])).transpose()?.flatten();
            let varies = own.is_some();
            Ok((own.unwrap_or(common), varies))
        };
        let (journal, beside) = (&bench.plan.journal, if no_noise { 1 } else { rayon::current_num_threads() });
        journal.counts("models to be judged", models.len(), beside);
        let judged = (0..models.len()).into_par_iter().map(fit).inspect(|_| {
            if !no_noise {
                journal.one_done()
            }
        });
        let judged: Vec<_> = judged.collect::<Result<_, _>>()?;
        let mut out = Self {
            no_noise,
            unseen,
            fits: Vec::new(),
            scores: Vec::new(),
            prices: Vec::new(),
            varies: judged.iter().map(|(_, varies)| *varies).collect(),
            apart,
            coarse: models.iter().map(|_| OnceCell::new()).collect(),
            left_out: vec![OnceCell::new(); models.len()],
        };
        for (scored, _) in judged {
            out.fits.push(scored.fitted);
            out.scores.push(scored.score);
            out.prices.push(scored.price);
        }
        for k in (0..models.len()).filter(|_| no_noise) {
            let left_out = out.of_records(bench, k)?;
            out.scores[k] = if unseen { typical(left_out) } else { left_out.iter().sum() };
            journal.one_done();
        }
        Ok(out)
    }

    /// A model as the next cause is tried on it: with own sizes of its last cause where these vary.
    pub fn adopted(&self, k: usize, model: &Hypothesis) -> Hypothesis {
        let mut out = model.clone();
        if let (true, Some(own)) = (self.varies[k], &self.apart[k]) {
            out.fitted = own.clone();
            out.trail.pop();
            out.trail.push(own.clone());
        }
        out
    }

    /// Squares of two models on what was left out: on every record, or, where the second one's last cause has another size in each, on both
    /// halves of every record, the size being told from the other half.
    pub fn left_out(&self, bench: &Bench, before: usize, after: usize, cause: &Cause) -> Result<[Vec<f64>; 2], IdentifyError> {
        if !self.varies[after] {
            return Ok([self.of_records(bench, before)?.clone(), self.of_records(bench, after)?.clone()]);
        }
        let halves = |k: usize| halves(bench, &self.fits[k], &cause.unknowns, &self.fits[after]);
        Ok([halves(before)?.halves(), halves(after)?.left_out(&[spread_of(&self.fits[after], &cause.unknowns)])])
    }

    /// Whether the second of two models is better on what was left out, and the part of the squares that it takes there.
    pub fn gain(&self, [before, after]: &[Vec<f64>; 2]) -> (bool, f64) {
        match self.unseen {
            true => (across::better(&logs(before), &logs(after), 0.0), across::share(&[typical(before)], &[typical(after)])),
            false => (across::better(before, after, POLICY.nothing), across::share(before, after)),
        }
    }

    /// A model's squares on the records that it has not seen, or else on every record with it left out.
    fn of_records(&self, bench: &Bench, k: usize) -> Result<&Vec<f64>, IdentifyError> {
        if let Some(left_out) = self.left_out[k].get() {
            return Ok(left_out);
        }
        let fitted = &self.fits[k];
        let left_out = match sought_on_some(bench.plan, fitted) {
            true => foretold(bench, fitted, &unseen(bench.plan, fitted, POLICY.judged_records)),
            false => {
                let coarse = self.coarse(bench, k)?;
                across::left_out(&coarse.plan, &coarse.fitted)?
            }
        };
        Ok(self.left_out[k].get_or_init(|| left_out))
    }

    /// A model as it is judged on longer steps, for its sensitivities.
    pub fn coarse(&self, bench: &Bench, k: usize) -> Result<&Coarse, IdentifyError> {
        if let Some(coarse) = self.coarse[k].get() {
            return Ok(coarse);
        }
        let coarse = Coarse::of(bench, &self.fits[k])?;
        Ok(self.coarse[k].get_or_init(|| coarse))
    }

    /// Whether model `k` cannot be told from the better model `best`. What its numbers cost more tells nothing beyond what they take by chance: that
    /// a tilt has two and a turn of the camera three makes neither likelier.
    pub fn ties(&self, best: usize, k: usize) -> bool {
        if self.no_noise {
            // the scores were made of these
            let left_out = |k: usize| self.left_out[k].get().map_or(&[][..], Vec::as_slice);
            return !self.gain(&[left_out(k).to_vec(), left_out(best).to_vec()]).0;
        }
        self.scores[k] - self.scores[best] - self.pardoned(best, k) < POLICY.lead
    }

    /// What of the price of its further numbers does not count against a model beside another.
    pub fn pardoned(&self, best: usize, k: usize) -> f64 {
        (self.prices[k] - self.prices[best]).max(0.0) * (1.0 - POLICY.by_chance / POLICY.per_number)
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
            unseen: false,
            fits: Vec::new(),
            scores: vec![130.0, 146.0, 160.5],
            prices: vec![30.0, 45.0, 30.0],
            varies: Vec::new(),
            apart: Vec::new(),
            coarse: Vec::new(),
            left_out: Vec::new(),
        };
        assert!(contest.ties(0, 1) && !contest.ties(0, 2));
        // a worse one is always behind a better one, and is like it only where that one is hardly better
        assert!(contest.ties(2, 0) && !contest.alike(0, 2) && !contest.alike(2, 0) && contest.alike(1, 0));
        // nor is a rival told from it that is as much farther from the data as the leader's own further number cost
        contest.prices[1] = 15.0;
        contest.scores[1] = 144.0;
        assert!(contest.ties(0, 1));
        // eight numbers more take eight units by chance: as near as the leader is not enough
        contest.prices = vec![30.0, 150.0, 30.0];
        contest.scores[1] = 250.0;
        assert!(!contest.ties(0, 1));
        contest.scores[1] = 248.0;
        assert!(contest.ties(0, 1));
    }
}
