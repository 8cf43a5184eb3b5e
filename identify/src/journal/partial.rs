//! The object that says how far a diagnosis is.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Version of [`Partial`].
pub(super) const VERSION: u32 = 1;

/// A diagnosis that is not finished: the file `progress.json` of its report's folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Partial {
    /// Version of this object.
    pub schema_version: u32,
    /// Inputs of the diagnosis: name of each, and its hash. With others it begins anew.
    pub inputs: BTreeMap<String, String>,
    /// Time so far, that of interrupted runs included \[s\].
    pub seconds: f64,
    /// The present stage.
    pub stage: String,
    /// The time left as far as it is known, in words; empty where nothing is.
    pub left: String,
    /// The finer simulation that the diagnosis is made with once more; absent while it is the scene's own.
    pub finer: Option<String>,
    /// The baseline, once it is fitted.
    pub baseline: Option<BaselineSoFar>,
    /// Causes accepted so far, in the order of their acceptance. Later ones may make one of them superfluous, and what is left may take its name.
    pub causes: Vec<CauseSoFar>,
    /// Seconds of each round of the search that is finished; of one that was made again the longer time.
    pub rounds: Vec<f64>,
    /// States that it can go on from, for pliant itself: words of 64 bits, sixteen hexadecimal digits each.
    pub states: BTreeMap<String, String>,
}

impl Default for Partial {
    fn default() -> Self {
        Self {
            schema_version: VERSION,
            inputs: BTreeMap::new(),
            seconds: 0.0,
            stage: String::new(),
            left: String::new(),
            finer: None,
            baseline: None,
            causes: Vec::new(),
            rounds: Vec::new(),
            states: BTreeMap::new(),
        }
    }
}

impl Partial {
    /// The part that a diagnosis goes on from: the rest is told again on the way, its simulation first.
    pub(super) fn gone_on_from(self) -> Self {
        let Self { inputs, seconds, rounds, states, .. } = self;
        Self { inputs, seconds, rounds, states, ..Self::default() }
    }

    /// A round (counted from 1) took so long. One that is made again from kept fits takes no time, and that says nothing of the next one.
    pub(super) fn finished_round(&mut self, number: usize, seconds: f64) {
        self.rounds.resize(self.rounds.len().max(number), 0.0);
        if let Some(round) = self.rounds.get_mut(number.wrapping_sub(1)) {
            *round = round.max(seconds);
        }
    }
}

/// The fit of the declared parameters alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BaselineSoFar {
    /// Root mean square residual on the fitted records.
    pub rmse: f64,
    /// Its unit.
    pub unit: String,
}

/// A cause that was accepted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CauseSoFar {
    /// Name.
    pub name: String,
    /// The object that it is about, where there may be several.
    pub object: Option<String>,
    /// Squares that it took when it was accepted, over the noise; absent where an interrupted run accepted it.
    pub statistic: Option<f64>,
    /// Its numbers, as they are fitted now.
    pub sizes: Vec<NumberSoFar>,
}

/// A number of a cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NumberSoFar {
    /// Path.
    pub path: String,
    /// Estimate.
    pub estimate: f64,
    /// SI unit.
    pub unit: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_round_made_again_took_what_it_took_first() {
        let mut partial = Partial { rounds: vec![40.0, 50.0], ..Partial::default() };
        partial.finished_round(1, 2.0);
        partial.finished_round(3, 7.0);
        assert_eq!(partial.rounds, [40.0, 50.0, 7.0]);
    }
}
