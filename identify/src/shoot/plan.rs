//! What does not change while a record is shot again and again.

use crate::error::IdentifyError;
use crate::log::{Beginning, LogMistake, Logs, Record, Role, Setup};
use crate::shoot::start::{StartState, initial_guess};
use crate::unknown::Values;
use pliant_engine::model::{Model, ModelBuilder};
use std::sync::Arc;

/// An observed point as a weighted pair of nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarkerPlace {
    /// First node.
    pub node: usize,
    /// Second node.
    pub next: usize,
    /// Weight of the second node.
    pub weight: f64,
}

/// A record ready to be shot.
#[derive(Clone, Debug)]
pub struct RecordPlan {
    /// The record.
    pub record: Record,
    /// Inputs of each step, as measured.
    pub inputs: Vec<Vec<f64>>,
    /// Its initial state: prior and current estimate.
    pub start: StartState,
    /// States at segment starts, (step, x), estimated.
    pub nodes: Vec<(usize, pliant_engine::state::State)>,
    /// Number of the measured record this is (a piece of), among those of its role.
    pub parent: usize,
}

/// An experiment ready to be simulated.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The model of the scene.
    pub model: Arc<Model>,
    /// Values of the scene.
    pub scene_values: Values,
    /// Observed points.
    pub markers: Vec<MarkerPlace>,
    /// Grippers' inputs come from the sensor that sees the markers.
    pub shared_sensor: bool,
    /// Records start at rest.
    pub at_rest: bool,
    /// Initial states are taken from the data as they are.
    pub given: bool,
    /// Fitted records.
    pub fitted: Vec<RecordPlan>,
    /// Held-out records.
    pub held_out: Vec<RecordPlan>,
    /// Time from which the initial state of held-out records is estimated \[s\].
    pub lead_in: f64,
}

impl Plan {
    /// Builds the model and prepares every record.
    pub fn new(setup: &Setup, logs: &Logs) -> Result<Self, IdentifyError> {
        let model = Arc::new(ModelBuilder::new(&setup.scene).map_err(|error| error.located(&setup.source))?.build());
        let markers = setup.experiment.marker.iter().map(|m| place(&model, &m.rope, m.node, m.arc)).collect::<Option<Vec<_>>>();
        let markers = markers.ok_or_else(|| IdentifyError::Input("a marker lies on a rope that does not exist".to_owned()))?;
        let scene_values = Values { theta: model.params().values().to_vec(), sensor: setup.experiment.sensor.values() };
        let at_rest = setup.experiment.initial == Beginning::Rest;
        let mut plan = Self {
            model,
            scene_values,
            markers,
            shared_sensor: setup.experiment.gripper_sensor.is_some(),
            at_rest,
            given: setup.experiment.initial == Beginning::Given,
            fitted: Vec::new(),
            held_out: Vec::new(),
            lead_in: setup.experiment.lead_in,
        };
        for record in &logs.records {
            let mut prepared = plan.prepare(record)?;
            let list = if record.role == Role::Fit { &mut plan.fitted } else { &mut plan.held_out };
            prepared.parent = list.len();
            list.push(prepared);
        }
        if plan.fitted.is_empty() {
            return Err(setup.refuse("experiment.record[0].role", LogMistake::AllHeldOut).into());
        }
        Ok(plan)
    }

    /// Number of measured channels, three per marker.
    pub fn channels(&self) -> usize {
        3 * self.markers.len()
    }

    /// Number of measured records that are fitted, however many pieces they are cut into.
    pub fn fitted_records(&self) -> usize {
        self.fitted.last().map_or(0, |rec| rec.parent + 1)
    }

    fn prepare(&self, record: &Record) -> Result<RecordPlan, IdentifyError> {
        let h = self.model.step_length();
        let inputs = record.step_inputs(h, record.n_steps(h));
        let start = initial_guess(self, record)?;
        Ok(RecordPlan { record: record.clone(), inputs, start, nodes: Vec::new(), parent: 0 })
    }
}

fn place(model: &Model, rope: &str, node: Option<i64>, arc: Option<f64>) -> Option<MarkerPlace> {
    let rope = model.rope(rope)?;
    let (start, n) = (rope.nodes.start, rope.nodes.len());
    if let Some(node) = node {
        let k = start + if node < 0 { (node + n as i64) as usize } else { node as usize };
        return Some(MarkerPlace { node: k, next: k, weight: 0.0 });
    }
    let mut left = arc? / model.params().values()[rope.length];
    for (e, fraction) in rope.fractions.iter().enumerate() {
        if left <= *fraction || e + 2 == n {
            let weight = (left / fraction).clamp(0.0, 1.0);
            return Some(MarkerPlace { node: start + e, next: start + e + 1, weight });
        }
        left -= fraction;
    }
    None
}
