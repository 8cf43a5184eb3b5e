//! Result of a diagnosis: the object behind the JSON, the report and the text on the screen.
#![allow(rustdoc::broken_intra_doc_links)] // `[m]` is a unit here, and its escape would be read in the schema's descriptions

use super::next::NextExperiment;
use crate::causes::title;
use crate::log::Interpolation;
use crate::number::number_plain;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Version of the JSON.
pub const SCHEMA_VERSION: u32 = 2;

/// The verdict of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// One cause, or several jointly, are accepted; see `causes`.
    Named,
    /// Something is there, and several causes explain it equally well; see `alternatives`, and `causes` for what is accepted beside them.
    Ambiguous,
    /// Causes are accepted, one of them with another size in every record; see `causes` and their `sizes`.
    Varies,
    /// The remainder is the simulation's own error, of its step, its mesh or how it reads inputs; see `numerics`.
    Numerics,
    /// Something significant is there that no cause of the library explains; `extension` lists what helps most, as an approximation.
    NotInLibrary,
    /// Nothing significant is left to explain.
    Adequate,
    /// The analysis cannot be trusted; see `reason`.
    Withheld,
}

/// An estimated parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Estimate {
    /// Path, for example `cable.bend_damping`.
    pub path: String,
    /// Estimate, in the unit.
    pub estimate: f64,
    /// SI unit.
    pub unit: String,
    /// 90 % interval: the wider of the one by the noise model and the one by how the estimate moves without each record in turn, and wider
    /// still by what the simulation's own error makes of it; null where none was estimated: of values taken from a grid, and of the models on
    /// the way to the last.
    pub interval: Option<[f64; 2]>,
    /// Value in the scene.
    pub scene_value: f64,
}

/// A rival of an accepted cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Rival {
    /// Name of the other cause.
    pub name: String,
    /// The gripper it is about, where each has a cause of this name; null else.
    pub object: Option<String>,
    /// Cosine between the two effects on the measurements, fitted unknowns projected out, noise whitened [-].
    pub cosine: f64,
}

/// An accepted cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Cause {
    /// Name.
    pub name: String,
    /// The gripper it is about, where each has a cause of this name; null else.
    pub object: Option<String>,
    /// One sentence.
    pub meaning: String,
    /// Its parameters after the joint refit.
    pub parameters: Vec<Estimate>,
    /// −2 log likelihood ratio of taking it away, all else refitted [-]; where what is left is no noise, squares on records left out, in
    /// units of the sensors' scatter.
    pub statistic: f64,
    /// Part of the squares on records left out of the fit that it takes [-]; of a size that varies, on halves of records. Absent with a single
    /// fitted record.
    pub foretold: Option<f64>,
    /// p of the hypothesis that its size is the same in all parts of the records, for the record: it decides nothing.
    pub constancy_p: Option<f64>,
    /// Its size in each fitted record, where these surely differ.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sizes: Vec<RecordSize>,
    /// Causes it was held against, most similar first.
    pub rivals: Vec<Rival>,
}

/// Size of a cause's first parameter in one record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RecordSize {
    /// Record.
    pub record: String,
    /// Size there, in the unit of the parameter.
    pub size: f64,
}

/// A source of the simulation's own error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NumericsKind {
    /// The length of its steps.
    Step,
    /// The length of the edges of ropes.
    Mesh,
    /// How inputs are read between samples.
    Inputs,
}

/// The simulation's own error of one kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Numerics {
    /// Its source.
    pub kind: NumericsKind,
    /// Of inputs, how they are read instead; else null.
    pub interpolation: Option<Interpolation>,
    /// Root mean square change of the readings without it.
    pub rms: f64,
    /// Unit of `rms`.
    pub unit: String,
    /// The same over what is left [-].
    pub part: f64,
    /// Of the change what nothing takes up that was fitted, the records' starts among it, over what is left: both whitened by the noise [-].
    #[serde(default)]
    pub beyond: f64,
    /// Squares that it takes from what is left, whitened by its noise [-]: negative where a finer simulation is farther from the data. Of another
    /// reading of inputs that causes may make up for: what the model refitted without these gains, in units of −2 log likelihood.
    pub gain: f64,
    /// Refinement that would bring it to a tenth of what is left: the step [s], or the factor on the number of edges; null where none is
    /// needed.
    pub needed: Option<f64>,
    /// In words.
    pub note: String,
}

/// Outcome of a candidate's test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Its score was tested.
    Tested,
    /// Unknowns that are fitted anyway absorb its effect.
    Absorbed,
    /// It cannot be tested here; see `reason`.
    Untestable,
}

/// A candidate cause against the baseline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CandidateReport {
    /// Name.
    pub name: String,
    /// The gripper it is about, where each has a cause of this name; null else.
    pub object: Option<String>,
    /// Outcome of its test.
    pub status: Status,
    /// Score statistic, compared with χ² of `dof` degrees [-]; absent unless tested.
    pub statistic: Option<f64>,
    /// Degrees of freedom.
    pub dof: usize,
    /// p-value after Holm's correction; absent unless tested.
    pub p_value: Option<f64>,
    /// Part of its effect (squared) that the fitted unknowns absorb [-].
    pub absorbed_fraction: Option<f64>,
    /// Smallest size of its first parameter that would be seen with certainty, in `unit`.
    pub smallest_detectable: Option<f64>,
    /// One-step estimate of its parameters.
    pub one_step: Vec<f64>,
    /// Unit of its first parameter.
    pub unit: String,
    /// Why it is absorbed, untestable, or was rejected.
    pub reason: String,
}

/// Residual that no accepted cause explains.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Remainder {
    /// Whether it is more than noise.
    pub significant: bool,
    /// Root mean square over the sensors' scatter, all channels [-].
    pub over_scatter: f64,
    /// Part of its squares that a regression on motion and inputs takes on records left out [-]; absent with a single record.
    pub by_motion: Option<f64>,
    /// p of the hypothesis that it does not depend on the inputs' rates, for the record: it decides nothing.
    pub input_p: f64,
    /// Root mean square of the final residual on the fitted records, in `unit`.
    pub rmse: f64,
    /// Unit of `rmse`.
    pub unit: String,
    /// Part of the explainable baseline error that the accepted causes removed, (RMSE₀² − RMSE₁²)/(RMSE₀² − σ²) [-].
    pub explained_fraction: f64,
    /// In words.
    pub note: String,
    /// Hypotheses about it, those first that take most beyond what their numbers cost: no causes of the library.
    pub forms: Vec<RemainderForm>,
}

/// A hypothesis about what is left: a force at a joint or on a rope, or an error of a sensor, that depends on one variable.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RemainderForm {
    /// The joint, the rope or the sensor.
    pub object: String,
    /// In words.
    pub what: String,
    /// −2 log likelihood that it takes, linearized [-].
    pub taken: f64,
    /// Numbers that it has.
    pub numbers: usize,
    /// p under the noise of what is left, and robust to it, the larger of the two [-].
    pub p: f64,
    /// Where it is any function of its variable: values of that, and the force or the error there.
    pub values: Vec<[f64; 2]>,
    /// Unit of the force or the error.
    pub unit: String,
    /// Unit of the variable.
    pub variable_unit: String,
}

/// Error on held-out records before and after.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Gain {
    /// Horizon from the start of a record [s].
    pub horizon_s: f64,
    /// RMSE of the baseline [m].
    pub rmse_before: f64,
    /// RMSE with the accepted causes [m].
    pub rmse_after: f64,
    /// Unit.
    pub unit: String,
    /// 90 % interval of the difference of log RMSE, positive = better: over records; with a single one over its blocks, which says
    /// nothing about other records; null where it is unknown, because a single record is too short even for that.
    pub interval: Option<[f64; 2]>,
    /// Part of the explainable error removed [-].
    pub explained_fraction: f64,
    /// Mean |error| per coordinate before and after [m].
    pub mean_abs: [f64; 2],
}

/// Held-out error over whole records that a flexible statistical correction takes, learnt on the fitted records: a yardstick for
/// the causes, and no explanation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Ceiling {
    /// RMSE of the baseline with the correction [m].
    pub rmse: f64,
    /// RMSE of the final model with a correction of its own [m].
    pub rmse_on_top: f64,
    /// Unit.
    pub unit: String,
    /// Part of the explainable error that the correction takes from the baseline [-].
    pub explained_fraction: f64,
    /// Error taken by the accepted causes over that taken by the correction [-]; above 1 they carry over better. Absent where it
    /// takes none.
    pub share: Option<f64>,
}

/// The noise model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Noise {
    /// Autoregressive coefficients of what is left, common to all channels.
    pub ar: Vec<f64>,
    /// Root mean square of the channels' stationary standard deviation [m].
    pub sigma: f64,
    /// Scatter of the readings from one to the next (divided differences of orders 2 to 6) [m].
    pub sensor_sigma: f64,
    /// Effective number of independent samples.
    pub effective_samples: f64,
}

/// Numbers of records.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct RecordCount {
    /// Fitted.
    pub fit: usize,
    /// Held out.
    pub held_out: usize,
}

impl Cause {
    /// Name and object, which tell it from all others: `gripper_offset (left)`.
    pub fn title(&self) -> String {
        title(&self.name, self.object.as_deref())
    }

    /// Its size in every record, where these differ: `0.9 in run1.csv, 1.1 in run2.csv`.
    pub fn sizes_by_record(&self) -> String {
        self.sizes.iter().map(|s| format!("{} in {}", number_plain(s.size), s.record)).collect::<Vec<_>>().join(", ")
    }
}

impl Diagnosis {
    /// The causes that cannot be told apart, as sets of titles.
    pub fn alternative_titles(&self) -> Vec<Vec<String>> {
        let object = |set: usize, k: usize| self.alternative_objects.get(set)?.get(k)?.as_deref();
        let one = |(i, set): (usize, &Vec<String>)| set.iter().enumerate().map(|(k, name)| title(name, object(i, k))).collect();
        self.alternatives.iter().enumerate().map(one).collect()
    }
}

/// A finding of the audit of the data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AuditFinding {
    /// `info`, `warning` or `faulty`.
    pub severity: String,
    /// Record.
    pub record: String,
    /// Where in the record.
    pub place: String,
    /// When it is worst, or begins [s].
    pub time_s: Option<f64>,
    /// What.
    pub what: String,
    /// The size.
    pub number: f64,
    /// Its unit.
    pub unit: String,
    /// Advice.
    pub advice: String,
}

/// One accepted step of the forward selection, for the story of the report.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Stage {
    /// `baseline` or the cause accepted.
    pub name: String,
    /// RMSE on the fitted records [m].
    pub rmse_fit: f64,
    /// RMSE over the held-out records [m].
    pub rmse_held_out: f64,
    /// Mean |error| per coordinate over the held-out records [m].
    pub mean_abs_held_out: f64,
    /// Errors over the held-out records up to several horizons.
    pub held_out: Vec<HorizonError>,
    /// Parameters fitted at this stage.
    pub parameters: Vec<Estimate>,
}

/// Mean |error| per coordinate over held-out records up to a horizon [m].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct HorizonError {
    /// Horizon from the start of a record [s].
    pub horizon_s: f64,
    /// Over all records.
    pub mean_abs: f64,
    /// Of the median record.
    pub median_record: f64,
    /// Over all but the worst record; that of the only one.
    pub without_worst: f64,
}

/// Measured and simulated positions of one marker of one record, for pictures.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Curve {
    /// Record.
    pub record: String,
    /// Marker.
    pub marker: usize,
    /// Name of the quantity, if it is no marker's position: then its numbers are the first of each three.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub quantity: String,
    /// Unit of the numbers.
    pub unit: String,
    /// Times [s].
    pub time: Vec<f64>,
    /// Measured positions [m].
    #[serde(deserialize_with = "points")]
    pub measured: Vec<[f64; 3]>,
    /// Simulated by the baseline [m].
    #[serde(deserialize_with = "points")]
    pub before: Vec<[f64; 3]>,
    /// Simulated with the accepted causes [m].
    #[serde(deserialize_with = "points")]
    pub after: Vec<[f64; 3]>,
}

/// Shapes of ropes, and rims of sheets, at one instant, for the picture of measured against simulated.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Snapshot {
    /// Record.
    pub record: String,
    /// Time [s].
    pub time: f64,
    /// Measured markers [m].
    #[serde(deserialize_with = "points")]
    pub measured: Vec<[f64; 3]>,
    /// Nodes simulated by the baseline, line by line, with a point of no numbers after each [m].
    #[serde(deserialize_with = "points")]
    pub before: Vec<[f64; 3]>,
    /// The same with the accepted causes [m].
    #[serde(deserialize_with = "points")]
    pub after: Vec<[f64; 3]>,
}

/// Points in which a number that is missing, which JSON writes as null, is no number.
fn points<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Vec<[f64; 3]>, D::Error> {
    let read = Vec::<[Option<f64>; 3]>::deserialize(from)?;
    Ok(read.into_iter().map(|p| p.map(|x| x.unwrap_or(f64::NAN))).collect())
}

/// A finer simulation than the scene's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Refined {
    /// Its step [s].
    pub step: f64,
    /// How it reads inputs between samples.
    pub interpolation: Interpolation,
}

/// Time that a part of a diagnosis took.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PartTime {
    /// The part.
    pub part: String,
    /// Wall-clock time [s].
    pub seconds: f64,
}

/// A diagnosis.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct Diagnosis {
    /// Version of this object.
    pub schema_version: u32,
    /// Scene file.
    pub scene: String,
    /// The verdict.
    pub verdict: Verdict,
    /// Why, in one or two sentences.
    pub reason: String,
    /// Causes accepted jointly; where some cannot be told from others, those that stand whichever of the `alternatives` is right.
    pub causes: Vec<Cause>,
    /// Causes that extend the model as an approximation, without being named: they carry over to records they were not fitted to, while so
    /// much remains that each may stand for something outside the library. Beside `causes`, those to which this much remains.
    pub extension: Vec<Cause>,
    /// Sets of causes that cannot be told apart.
    pub alternatives: Vec<Vec<String>>,
    /// The grippers that `alternatives` are about, in the same order; null where there is none.
    pub alternative_objects: Vec<Vec<Option<String>>>,
    /// Experiments that would tell them apart, one for each of them.
    pub advice: Vec<String>,
    /// Records done again with a change, which tell them apart best, best first.
    #[serde(default)]
    pub next: Vec<NextExperiment>,
    /// The remaining residual.
    pub remainder: Remainder,
    /// Every candidate against the baseline, under the noise of the final model: a cause once, or once per object.
    pub candidates: Vec<CandidateReport>,
    /// Held-out errors.
    pub gain: Vec<Gain>,
    /// The yardstick; absent where nothing is held out.
    pub ceiling: Option<Ceiling>,
    /// The simulation's own errors at the final model.
    pub numerics: Vec<Numerics>,
    /// Sources of the simulation's own error that a cause would only have made up for.
    pub imitated: Vec<NumericsKind>,
    /// How the simulation was refined, where the scene's own was too coarse for these data: everything here is of the finer one. `parts`
    /// has all passes, one after the other.
    pub refined: Option<Refined>,
    /// The noise model.
    pub noise: Noise,
    /// Reservations about the estimates: at a bound, or not determined.
    pub warnings: Vec<String>,
    /// Numbers of records.
    pub records: RecordCount,
    /// Findings in the data themselves.
    pub audit: Vec<AuditFinding>,
    /// The declared free parameters after the baseline fit.
    pub baseline: Vec<Estimate>,
    /// Combinations of them that the data do not determine, weights in the fit's coordinates; the intervals of the parameters in
    /// them are their bounds.
    pub unidentifiable: Vec<String>,
    /// Forward selection, step by step.
    pub stages: Vec<Stage>,
    /// Curves of held-out (or, without any, fitted) records.
    pub curves: Vec<Curve>,
    /// Shapes of the rope at the instant of the largest baseline error.
    pub snapshots: Vec<Snapshot>,
    /// Seconds it took.
    pub wall_s: f64,
    /// Seconds of each part of it, in order.
    pub parts: Vec<PartTime>,
}
