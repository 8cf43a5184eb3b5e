//! Which experiment to do next, where causes cannot be told apart.
//!
//! The menu are the fitted records done again, with another size, direction or pace of their commands, or from another start. Each is simulated
//! with each of the models. What model B cannot imitate of what A would give is the separation
//! ```text
//! λ(A, B) = min over δ, z of |W (y_A − y_B − J δ − J₀ z)|² + |z|² + δᵀ G δ
//! ```
//! W the whitening of the final model's noise, δ a change of B's numbers, G their curvature in the records there are, z the start of the new
//! record, which is measured as those of the old ones are. If A is right, its lead over B grows by a normal number of mean λ and variance 4 λ,
//! and A is told from B with the probability Φ((λ − lead)/(2 √λ)).

use super::beside::Beside;
use super::policy::POLICY;
use super::procedure::{Bench, Coarse, Found};
use super::scores::reduce;
use crate::error::IdentifyError;
use crate::fit::Fitted;
use crate::shooting::{Plan, RecordPlan, ShotWants, StartState, shoot};
use crate::stats::dist::normal_cdf;
use nalgebra::DMatrix;
use pliant_math::State;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A recorded experiment done again with a change, to tell causes that the data cannot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NextExperiment {
    /// The record it repeats.
    pub record: String,
    /// In words.
    pub what: String,
    /// Factor on how far the commands go from where they begin.
    pub commands: f64,
    /// Factor on their speed.
    pub pace: f64,
    /// Factor on how far the record begins from the scene's pose, and on its speed there.
    pub start: f64,
    /// Mean of what one of the alternatives cannot imitate of another, in units of −2 log likelihood.
    pub separation: f64,
    /// Probability that one alternative, if it is right, is then told from another; mean over the pairs.
    pub chance: f64,
    /// The same of each pair, the likeliest first.
    #[serde(default)]
    pub pairs: Vec<ToldPair>,
}

impl NextExperiment {
    /// Whether the chance of its likeliest pair is said as more than 0 %.
    fn tells(&self) -> bool {
        self.pairs.first().is_some_and(|pair| pair.chance >= 0.005)
    }
}

/// Two alternatives that an experiment is to tell apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ToldPair {
    /// Of each the causes that not all alternatives have, by their titles; empty where it has none.
    pub of: [String; 2],
    /// Probability that the one that is right is told from the other; mean over which of them it is.
    pub chance: f64,
}

/// How a recorded experiment is changed.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Change {
    /// Factor on how far the commands go from where they begin.
    commands: f64,
    /// Factor on their speed.
    pace: f64,
    /// Factor on how far the record begins from the scene's pose, and on its speed there.
    start: f64,
}

const AGAIN: Change = Change { commands: 1.0, pace: 1.0, start: 1.0 };

/// The menu.
const CHANGES: [Change; 11] = [
    AGAIN,
    Change { commands: 2.0, ..AGAIN },
    Change { commands: 0.5, ..AGAIN },
    Change { commands: -1.0, ..AGAIN },
    Change { commands: 0.0, ..AGAIN },
    Change { pace: 2.0, ..AGAIN },
    Change { pace: 0.5, ..AGAIN },
    Change { commands: 2.0, pace: 2.0, ..AGAIN },
    Change { start: 2.0, ..AGAIN },
    Change { start: -1.0, ..AGAIN },
    Change { commands: 0.0, start: 2.0, ..AGAIN },
];

impl Change {
    fn words(self, record: &str) -> String {
        let commands = match self.commands {
            1.0 => None,
            0.0 => Some("its commands held where they begin".to_owned()),
            -1.0 => Some("its commands reversed about where they begin".to_owned()),
            x => Some(format!("its commands going {x} times as far from where they begin")),
        };
        let pace = (self.pace != 1.0).then(|| format!("its commands {} times as fast", self.pace));
        let start = match self.start {
            1.0 => None,
            -1.0 => Some("its start on the other side of the scene's pose".to_owned()),
            x => Some(format!("its start {x} times as far from the scene's pose")),
        };
        let all: Vec<String> = [commands, pace, start].into_iter().flatten().collect();
        if all.is_empty() { format!("{record} once more as it was") } else { format!("{record} with {}", all.join(", ")) }
    }

    /// The record, so changed: begun where `from` was estimated to, its start known as well as that one's.
    fn of(self, plan: &Plan, from: &RecordPlan) -> RecordPlan {
        let steps = from.inputs.len();
        let first = from.inputs.first().cloned().unwrap_or_default();
        let at = |k: usize| -> Vec<f64> {
            let x = (k as f64 * self.pace).min((steps - 1) as f64);
            let (low, part) = (x.floor() as usize, x.fract());
            let high = (low + 1).min(steps - 1);
            let between = |j: usize| from.inputs[low][j] + part * (from.inputs[high][j] - from.inputs[low][j]);
            (0..first.len()).map(|j| first[j] + self.commands * (between(j) - first[j])).collect()
        };
        let z = vec![0.0; from.start.z.len()];
        let mean = if from.start.is_fixed() {
            from.start.mean.clone()
        } else {
            self.begun(plan, from.start.state(&plan.model, &plan.scene_values.joints))
        };
        RecordPlan {
            inputs: (0..steps).map(at).collect(),
            start: StartState { mean, z, ..from.start.clone() },
            nodes: Vec::new(),
            correction: Arc::default(),
            ..from.clone()
        }
    }

    fn begun(self, plan: &Plan, state: State) -> State {
        if self.start == 1.0 {
            return state;
        }
        let pose = plan.model.initial_state().q;
        let q = state.q.iter().zip(&pose).map(|(q, pose)| pose + self.start * (q - pose)).collect();
        State { q, v: state.v.iter().map(|v| self.start * v).collect(), ..state }
    }
}

/// The changes that can be made to these records.
fn menu(plan: &Plan, records: &[RecordPlan]) -> Vec<Change> {
    let moves = |rec: &RecordPlan| rec.inputs.windows(2).any(|w| w[0].iter().zip(&w[1]).any(|(a, b)| a != b));
    let driven = records.iter().any(moves);
    // where a pose is a list of numbers, each of its own joint
    let placed =
        plan.model.n_nodes() == 0 && plan.model.nq() == plan.model.nv() && records.iter().all(|rec| !rec.start.is_fixed());
    let possible = |c: &Change| (driven || c.commands == 1.0 && c.pace == 1.0) && (placed || c.start == 1.0);
    CHANGES.into_iter().filter(possible).collect()
}

/// The experiments that tell the models best that could not be told apart, best first.
pub(super) fn experiments(bench: &Bench, found: &Found) -> Result<Vec<NextExperiment>, IdentifyError> {
    let leader = found.fitted.of_some(POLICY.repeated_records);
    let coarse = Coarse::of(bench, &leader)?;
    let plan = &coarse.plan;
    if plan.in_pieces() || coarse.fitted.records.is_empty() {
        return Ok(Vec::new());
    }
    let noise = &found.fitted.noise;
    let (causes, models): (Vec<_>, Vec<Fitted>) = found.alternatives(bench)?.into_iter().take(POLICY.told_rivals).unzip();
    let names = own_causes(&causes);
    let models: Vec<Fitted> = models.into_iter().map(|m| Fitted { noise: noise.clone(), ..m }).collect();
    let known = |model: &Fitted| -> Result<DMatrix<f64>, IdentifyError> {
        let coarse = Coarse::of(bench, model)?;
        Ok(reduce(&coarse.plan, &coarse.fitted, &model.unknowns)?.gram())
    };
    let known: Vec<DMatrix<f64>> = models.iter().map(known).collect::<Result<_, _>>()?;
    let menu = menu(plan, &coarse.fitted.records);
    let all: Vec<(&RecordPlan, Change)> =
        coarse.fitted.records.iter().flat_map(|rec| menu.iter().map(move |change| (rec, *change))).collect();
    let one = |(rec, change): &(&RecordPlan, Change)| {
        let separations = separations(plan, &models, &known, change.of(plan, rec))?;
        let pairs = pairs(&names, &separations);
        let number = pairs.len() as f64;
        (!pairs.is_empty()).then(|| NextExperiment {
            record: rec.record.name.clone(),
            what: change.words(&rec.record.name),
            commands: change.commands,
            pace: change.pace,
            start: change.start,
            separation: separations.iter().flatten().sum::<f64>() / (2.0 * number),
            chance: pairs.iter().map(|p| p.chance).sum::<f64>() / number,
            pairs,
        })
    };
    let mut out: Vec<NextExperiment> = all.par_iter().filter_map(one).filter(NextExperiment::tells).collect();
    out.sort_by(|a, b| b.chance.total_cmp(&a.chance).then(b.separation.total_cmp(&a.separation)));
    out.truncate(POLICY.next_experiments);
    Ok(out)
}

/// The causes of each model that not all of them have, in words.
fn own_causes(models: &[Vec<String>]) -> Vec<String> {
    let shared = |title: &String| models.iter().all(|causes| causes.contains(title));
    models.iter().map(|causes| causes.iter().filter(|title| !shared(title)).cloned().collect::<Vec<_>>().join(" and ")).collect()
}

/// What each model (column) cannot imitate of a record that another one (row) gives; none where one of them cannot be simulated.
fn separations(plan: &Plan, models: &[Fitted], known: &[DMatrix<f64>], rec: RecordPlan) -> Option<Vec<Vec<f64>>> {
    let residual = |model: &Fitted| Some(shoot(plan, &rec, &model.values, ShotWants::default()).ok()?.residual);
    let seen: Vec<Vec<f64>> = models.iter().map(residual).collect::<Option<_>>()?;
    let one = |a: usize, b: usize| {
        if a == b {
            return Some(0.0);
        }
        let apart: Vec<f64> = seen[b].iter().zip(&seen[a]).map(|(of_b, of_a)| of_b - of_a).collect();
        let there = Fitted { records: vec![rec.clone()], residuals: vec![apart.clone()], ..models[b].clone() };
        Some(Beside::new(plan, &there, &[&[apart]]).ok()?.beyond(0, &known[b]))
    };
    (0..models.len()).map(|a| (0..models.len()).map(|b| one(a, b)).collect()).collect()
}

/// The probability that each pair is told apart, the likeliest first.
fn pairs(names: &[String], separations: &[Vec<f64>]) -> Vec<ToldPair> {
    let one = |a: usize, b: usize| ToldPair {
        of: [names[a].clone(), names[b].clone()],
        chance: 0.5 * (told_with(separations[a][b]) + told_with(separations[b][a])),
    };
    let mut out: Vec<ToldPair> = (0..names.len()).flat_map(|a| (a + 1..names.len()).map(move |b| one(a, b))).collect();
    out.sort_by(|p, q| q.chance.total_cmp(&p.chance));
    out
}

/// Probability that a lead is reached whose growth has this mean, and four times this variance.
fn told_with(separation: f64) -> f64 {
    normal_cdf((separation - POLICY.lead) / (2.0 * separation.max(f64::MIN_POSITIVE).sqrt()))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::audit::starts::tests::{experiment, pendulum};
    use super::*;
    use crate::fit::fit;
    use crate::stats::ar::ArModel;

    #[test]
    fn a_chance_is_even_where_the_mean_is_the_lead() {
        assert!((told_with(POLICY.lead) - 0.5).abs() < 1e-12);
        assert!(told_with(0.0) < 1e-12 && told_with(60.0) > 0.99);
    }

    /// The part of a damped swing that a model without damping cannot imitate grows with the square of a small swing; a copy of it imitates all.
    #[test]
    fn a_wider_swing_tells_damping_better() {
        let readings: Vec<f64> = (0..40).map(|k| 0.05 * (5.7 * 0.01 * f64::from(k)).cos()).collect();
        let plan = experiment(&pendulum("measured"), &[readings.clone(), readings]).0;
        let white = ArModel::white(vec![1e-4]).unwrap();
        let plain = fit(&plan, &plan.fitted, &plan.scene_values, &[], Some(&white), &POLICY.fine).unwrap();
        let mut damped = plain.clone();
        damped.values.theta[plan.model.params().find("pivot.damping").unwrap()] += 0.002;
        let known = || vec![DMatrix::zeros(0, 0), DMatrix::zeros(0, 0)];
        let separation = |models: &[Fitted], start| {
            separations(&plan, models, &known(), Change { start, ..AGAIN }.of(&plan, &plain.records[0])).unwrap()[1][0]
        };
        assert!(separation(&[plain.clone(), plain.clone()], 1.0) < 1e-12);
        let both = [plain.clone(), damped];
        let [once, twice] = [1.0, 2.0].map(|start| separation(&both, start));
        assert!(once > 0.0 && (twice / once - 4.0).abs() < 0.4, "{once} {twice}");
    }

    /// Models are named by what not all of them have, and the pair that is told best comes first.
    #[test]
    fn pairs_say_what_they_differ_in() {
        let model = |causes: &[&str]| causes.iter().map(|c| (*c).to_owned()).collect::<Vec<_>>();
        let names = own_causes(&[model(&["payload", "wind"]), model(&["payload", "drag", "tilt"]), model(&["payload"])]);
        assert_eq!(names, ["wind", "drag and tilt", ""]);
        let even = POLICY.lead;
        let pairs = pairs(&names, &[vec![0.0, even, 1e4], vec![even, 0.0, 0.0], vec![1e4, 0.0, 0.0]]);
        assert_eq!(pairs.iter().map(|p| (p.chance * 2.0).round() as usize).collect::<Vec<_>>(), [2, 1, 0]);
        assert_eq!((pairs[1].of[0].as_str(), pairs[1].of[1].as_str()), ("wind", "drag and tilt"));
        let experiment = |pairs: &[ToldPair]| NextExperiment {
            record: String::new(),
            what: String::new(),
            commands: 1.0,
            pace: 1.0,
            start: 1.0,
            separation: 0.0,
            chance: 0.0,
            pairs: pairs.to_vec(),
        };
        // what tells none of them is no experiment to do
        assert!(experiment(&pairs).tells() && !experiment(&pairs[2..]).tells());
    }

    #[test]
    fn a_change_is_said_in_words() {
        assert_eq!(AGAIN.words("run1.csv"), "run1.csv once more as it was");
        let other = Change { commands: 0.0, start: 2.0, ..AGAIN };
        let said = "run1.csv with its commands held where they begin, its start 2 times as far from the scene's pose";
        assert_eq!(other.words("run1.csv"), said);
    }
}
