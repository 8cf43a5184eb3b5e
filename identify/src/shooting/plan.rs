//! Data that stay fixed over all simulations of a record.

use super::dormant::{followers, opened, rejoin, tied};
use super::observed::{JointPlace, MarkerPlace, NodePair, Observed, OrientationPlace};
use super::own_size::OwnSize;
use super::torque::drives_of;
use crate::error::IdentifyError;
use crate::journal::Journal;
use crate::log::{Beginning, Interpolation, JointQuantity, JointSensor, LogMistake, Logs, Marker, Record, Role, Setup};
use crate::shooting::start::{StartState, initial_guess};
use crate::unknown::{Unknown, Values};
use nalgebra::Vector3;
use pliant_engine::bodies::JointKind;
use pliant_engine::model::{Model, ModelBuilder};
use pliant_scene::Scene;
use std::sync::Arc;

/// A record ready to be shot.
#[derive(Clone, Debug)]
pub struct RecordPlan {
    /// The record.
    pub record: Record,
    /// Inputs of each step, as measured.
    pub inputs: Vec<Vec<f64>>,
    /// Inputs of the steps before, as far as motors may remember them; of a whole record that of its beginning.
    pub past: Vec<Vec<f64>>,
    /// The two as the other ways of reading between samples give them, in the order of [`Interpolation::others`]. Steps begin at those of the record,
    /// of which this may be a piece whose samples cannot give them again: they are read and cut together with the first.
    pub others: Arc<[OtherInputs; 2]>,
    /// Its initial state: prior and current estimate.
    pub start: StartState,
    /// Sizes of its own of numbers that are common otherwise.
    pub sizes: Vec<OwnSize>,
    /// States at segment starts, (step, x), estimated.
    pub nodes: Vec<(usize, pliant_math::State)>,
    /// Number of the measured record this is (a piece of), among those of its role.
    pub parent: usize,
    /// Added to the residuals, rows (time, channel): the known error of this simulation. Rows beyond it are not measured. Empty: none.
    pub correction: Arc<[f64]>,
    /// Factor of its residuals and their derivatives [-].
    pub weight: f64,
}

impl RecordPlan {
    /// The same record on the same steps, its inputs read in this of the other ways between the samples of the log.
    pub fn with_other_inputs(&self, way: usize) -> Self {
        let other = &self.others[way];
        let steps = self.inputs.len().min(other.inputs.len()); // a record may have been shortened since
        Self { inputs: other.inputs[..steps].to_vec(), past: other.past.clone(), ..self.clone() }
    }
}

/// The inputs of a record's steps, and of those before, read from its log in a way that its simulation does not use.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OtherInputs {
    /// Inputs of each step.
    pub inputs: Vec<Vec<f64>>,
    /// Inputs of the steps before.
    pub past: Vec<Vec<f64>>,
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
    /// Sensors at joints.
    pub joints: Vec<JointPlace>,
    /// Observed orientations.
    pub orientations: Vec<OrientationPlace>,
    /// Smallest believed standard deviation of a marker's coordinate \[m\].
    pub marker_floor: f64,
    /// Grippers' inputs come from the sensor that sees the markers.
    pub shared_sensor: bool,
    /// Records start at rest.
    pub at_rest: bool,
    /// Initial states are taken from the data as they are.
    pub given: bool,
    /// Course of the inputs between the samples of the logs.
    pub interpolation: Interpolation,
    /// Fitted records.
    pub fitted: Vec<RecordPlan>,
    /// Held-out records.
    pub held_out: Vec<RecordPlan>,
    /// Time from which the initial state of held-out records is estimated \[s\].
    pub lead_in: Option<f64>,
    /// The unit that errors are reported in. Channels of other units count in the fit alone.
    pub unit: &'static str,
    /// Entries of θ that follow others, (leader, follower).
    pub followers: Vec<(usize, usize)>,
    /// The measured records where the fitted ones are pieces of them, each begun anew; else empty.
    pub wholes: Arc<Vec<RecordPlan>>,
    /// Time over which records in pieces can be followed \[s\]; infinite where they are whole.
    pub followed: f64,
    /// Progress of the diagnosis that it belongs to.
    pub journal: Arc<Journal>,
}

impl Plan {
    /// Builds the model and prepares every record.
    pub fn new(setup: &Setup, logs: &Logs) -> Result<Self, IdentifyError> {
        Self::of_scene(setup, &setup.scene, logs)
    }

    /// The same with everything in θ that a cause may free, at values that change nothing.
    pub fn opened(setup: &Setup, logs: &Logs) -> Result<Self, IdentifyError> {
        ModelBuilder::new(&setup.scene).map_err(|error| error.located(&setup.source))?;
        let mut plan = Self::of_scene(setup, &opened(&setup.scene), logs)?;
        plan.followers = followers(&setup.scene, &plan.model);
        Ok(plan)
    }

    /// Whether the fitted records are pieces that each begin anew: nothing that builds up over a record can be seen.
    pub fn in_pieces(&self) -> bool {
        !self.wholes.is_empty()
    }

    /// The unknowns, each setting its followers too unless another of them sets those.
    pub fn tied(&self, unknowns: Vec<Unknown>) -> Vec<Unknown> {
        tied(&self.followers, unknowns)
    }

    /// The unknowns without those of `out`, which go back into the ties they came from in `declared`, or else to the scene's values.
    pub(crate) fn taken_out(&self, declared: &[Unknown], now: &[Unknown], out: &[Unknown], values: &mut Values) -> Vec<Unknown> {
        out.iter().for_each(|u| u.set(values, u.value(&self.scene_values)));
        let known = |u: &Unknown, list: &[Unknown]| list.iter().any(|o| o.path == u.path);
        let others = now.iter().filter(|u| !known(u, out) && !known(u, declared));
        let unknowns = self.tied(declared.iter().chain(others).cloned().collect());
        let kept: Vec<Unknown> = now.iter().filter(|u| !known(u, out)).cloned().collect();
        rejoin(&kept, &unknowns, values);
        unknowns
    }

    /// Whether the entries that `free` sets beyond those of `own` are followers of `own`: if not, the two are a tie of several and one of
    /// them, which may differ from the others.
    pub(crate) fn only_followers(&self, free: &Unknown, own: &Unknown) -> bool {
        let (free, own) = (free.target.entries(), own.target.entries());
        let follows = |k: usize| own.iter().any(|(leader, _)| self.followers.contains(&(*leader, k)));
        free.iter().all(|(k, _)| own.iter().any(|(o, _)| o == k) || follows(*k))
    }

    fn of_scene(setup: &Setup, scene: &Scene, logs: &Logs) -> Result<Self, IdentifyError> {
        let model = Arc::new(ModelBuilder::new(scene).map_err(|error| error.located(&setup.source))?.build());
        let missing = |what: &str| IdentifyError::Input(format!("{what} that does not exist"));
        let markers = setup.experiment.marker.iter().map(|m| place(&model, m)).collect::<Option<Vec<_>>>();
        let joints = setup.experiment.joint.iter().map(|s| joint(setup, &model, s)).collect::<Option<Vec<_>>>();
        let turn =
            |o: &crate::log::Orientation| Some(OrientationPlace { body: model.tree().body(&o.body)?, floor: o.noise_floor });
        let orientations = setup.experiment.orientation.iter().map(turn).collect::<Option<Vec<_>>>();
        let scene_values = Values {
            theta: model.params().values().to_vec(),
            sensor: setup.experiment.sensor.values(),
            joints: setup.joint_values(),
            offsets: setup.marker_offsets(),
            late: vec![0.0; model.nu()],
        };
        let mut plan = Self {
            model,
            scene_values,
            markers: markers.ok_or_else(|| missing("a marker lies on a rope, cloth or body"))?,
            joints: joints.ok_or_else(|| missing("a sensor is at a joint"))?,
            orientations: orientations.ok_or_else(|| missing("an orientation is of a body"))?,
            marker_floor: setup.experiment.noise_floor,
            shared_sensor: setup.experiment.gripper_sensor.is_some(),
            at_rest: setup.experiment.initial == Beginning::Rest,
            given: setup.experiment.initial == Beginning::Given,
            interpolation: setup.experiment.interpolation,
            fitted: Vec::new(),
            held_out: Vec::new(),
            lead_in: setup.experiment.lead_in,
            unit: "m",
            followers: Vec::new(),
            wholes: Arc::default(),
            followed: f64::INFINITY,
            journal: Arc::default(),
        };
        plan.unit = plan.observed().first().map_or("m", |o| plan.unit_of(*o));
        let mut counts = [0; 2];
        for record in &logs.records {
            let held_out = usize::from(record.role != Role::Fit);
            // a part behind a gap, which is named after its start, does not begin at rest
            let parts = record.between_gaps().into_iter().filter(|part| !plan.at_rest || part.name == record.name);
            for part in parts.collect::<Vec<_>>() {
                let prepared = RecordPlan { parent: counts[held_out], ..plan.prepare(&part)? };
                if held_out == 1 { plan.held_out.push(prepared) } else { plan.fitted.push(prepared) }
            }
            counts[held_out] += 1;
        }
        if plan.fitted.is_empty() {
            return Err(setup.refuse("experiment.record[0].role", LogMistake::AllHeldOut).into());
        }
        Ok(plan)
    }

    /// Number of measured channels: three per marker, then one per sensor at a joint, then three per orientation.
    pub fn channels(&self) -> usize {
        3 * (self.markers.len() + self.orientations.len()) + self.joints.len()
    }

    /// Everything observed, in the order of the channels.
    pub fn observed(&self) -> Vec<Observed> {
        let markers = (0..self.markers.len()).map(Observed::Marker);
        let joints = (0..self.joints.len()).map(Observed::Joint);
        markers.chain(joints).chain((0..self.orientations.len()).map(Observed::Orientation)).collect()
    }

    /// The channels of something observed.
    pub fn channels_of(&self, observed: Observed) -> std::ops::Range<usize> {
        let joints = 3 * self.markers.len();
        let first = match observed {
            Observed::Marker(k) => 3 * k,
            Observed::Joint(k) => joints + k,
            Observed::Orientation(k) => joints + self.joints.len() + 3 * k,
        };
        first..first + observed.width()
    }

    /// Smallest believed standard deviation of every channel.
    pub fn floors(&self) -> Vec<f64> {
        let floor = |observed| match observed {
            Observed::Marker(_) => self.marker_floor,
            Observed::Joint(k) => self.joints[k].floor,
            Observed::Orientation(k) => self.orientations[k].floor,
        };
        self.observed().into_iter().flat_map(|o| std::iter::repeat_n(floor(o), o.width())).collect()
    }

    /// SI unit of something observed.
    pub fn unit_of(&self, observed: Observed) -> &'static str {
        match observed {
            Observed::Marker(_) => "m",
            Observed::Joint(k) => self.joints[k].unit,
            Observed::Orientation(_) => "rad",
        }
    }

    /// Reports errors in metres or in radians, whichever positions have the larger of these errors (rows (time, channel), 0 where nothing was
    /// measured) over the channels' scatter: what a slide does wrong is not seen in the angles of other joints.
    pub fn report_worst(&mut self, errors: &[Vec<f64>], scatter: &[f64]) {
        let over: Vec<Vec<f64>> =
            errors.iter().map(|e| e.iter().zip(scatter.iter().cycle()).map(|(e, s)| e / s).collect()).collect();
        let mut worst = 0.0;
        for unit in ["m", "rad"] {
            let size = self.rms_in(unit, &over);
            if size > worst {
                (worst, self.unit) = (size, unit);
            }
        }
    }

    /// Whether each channel's errors are reported.
    pub fn reported(&self) -> Vec<bool> {
        self.in_unit(self.unit)
    }

    fn in_unit(&self, unit: &str) -> Vec<bool> {
        self.observed().into_iter().flat_map(|o| std::iter::repeat_n(self.unit_of(o) == unit, o.width())).collect()
    }

    /// The errors that are reported, of those over rows (time, channel).
    pub fn reported_errors(&self, errors: &[f64]) -> Vec<f64> {
        kept(&self.reported(), errors).collect()
    }

    /// Units that something is read in beside the reported one, each once.
    pub fn other_units(&self) -> Vec<&'static str> {
        let mut out: Vec<&'static str> =
            self.observed().into_iter().map(|o| self.unit_of(o)).filter(|u| *u != self.unit).collect();
        out.sort_unstable();
        out.dedup();
        out
    }

    /// Root mean square of the reported errors of all records; where nothing was measured an error is 0, and does not count.
    pub fn rms(&self, errors: &[Vec<f64>]) -> f64 {
        self.rms_in(self.unit, errors)
    }

    /// The same of the channels of another unit.
    pub fn rms_in(&self, unit: &str, errors: &[Vec<f64>]) -> f64 {
        self.mean(&self.in_unit(unit), errors, |e| e * e).sqrt()
    }

    /// Mean size of the reported errors of all records, likewise.
    pub fn mean_abs(&self, errors: &[Vec<f64>]) -> f64 {
        self.mean(&self.reported(), errors, f64::abs)
    }

    fn mean(&self, own: &[bool], errors: &[Vec<f64>], of: impl Fn(f64) -> f64) -> f64 {
        let kept = errors.iter().flat_map(|e| kept(own, e)).filter(|e| *e != 0.0);
        let (sum, count) = kept.fold((0.0, 0usize), |(sum, count), e| (sum + of(e), count + 1));
        sum / count.max(1) as f64
    }

    /// Reading of an observed quantity at a sample of a record, up to four numbers; NaN where it is missing.
    pub fn measured(&self, record: &Record, sample: usize, observed: Observed) -> Vec<f64> {
        match observed {
            Observed::Marker(k) => record.markers[sample][k].to_vec(),
            Observed::Joint(k) => vec![record.joints[sample][k]],
            Observed::Orientation(k) => record.orientations[sample][k].to_vec(),
        }
    }

    /// Name of something observed, for pictures and messages.
    pub fn name_of(&self, observed: Observed) -> String {
        match observed {
            Observed::Marker(k) => format!("marker {k}"),
            Observed::Joint(k) => self.joints[k].name.clone(),
            Observed::Orientation(k) => format!("orientation of {}", self.model.tree().bodies()[self.orientations[k].body].name),
        }
    }

    /// Number of measured records that are fitted, however many pieces they are cut into.
    pub fn fitted_records(&self) -> usize {
        self.fitted.last().map_or(0, |rec| rec.parent + 1)
    }

    fn prepare(&self, record: &Record) -> Result<RecordPlan, IdentifyError> {
        let h = self.model.step_length();
        let read = |interpolation| record.step_inputs(h, record.n_steps(h), interpolation);
        let before = |inputs: &[Vec<f64>]| inputs.first().cloned().into_iter().collect();
        let inputs = read(self.interpolation);
        let others = self.interpolation.others().map(read).map(|inputs| OtherInputs { past: before(&inputs), inputs });
        let past = before(&inputs);
        let start = initial_guess(self, record)?;
        Ok(RecordPlan {
            record: record.clone(),
            inputs,
            past,
            others: Arc::new(others),
            start,
            sizes: Vec::new(),
            nodes: Vec::new(),
            parent: 0,
            correction: Arc::default(),
            weight: 1.0,
        })
    }
}

fn joint(setup: &Setup, model: &Model, sensor: &JointSensor) -> Option<JointPlace> {
    let tree = model.tree();
    let joint = &tree.joints()[tree.joint(&sensor.joint)?];
    Some(JointPlace {
        name: format!("{} of {}", sensor.measures.name(), sensor.joint),
        joint: sensor.joint.clone(),
        quantity: sensor.measures,
        q: joint.q,
        v: joint.v,
        floor: sensor.floor(),
        unit: sensor.measures.unit(joint.kind == JointKind::Prismatic),
        drives: if sensor.measures == JointQuantity::Torque { drives_of(setup, model, &sensor.joint) } else { Vec::new() },
    })
}

fn place(model: &Model, marker: &Marker) -> Option<MarkerPlace> {
    if let Some(body) = &marker.body {
        let point = Vector3::from(marker.point.unwrap_or_default());
        return Some(MarkerPlace::Body { body: model.tree().body(body)?, point });
    }
    if let Some(node) = marker.node {
        let name = marker.rope.as_ref().or(marker.cloth.as_ref())?;
        let nodes = model.node_spans().find_map(|(other, nodes)| (other == name).then_some(nodes))?;
        let k = nodes.start + if node < 0 { (node + nodes.len() as i64) as usize } else { node as usize };
        return Some(MarkerPlace::Nodes(NodePair { node: k, next: k, weight: 0.0 }));
    }
    let rope = model.rope(marker.rope.as_deref()?)?;
    let mut left = marker.arc? / model.params().values()[rope.length];
    for (e, fraction) in rope.fractions.iter().enumerate() {
        if left <= *fraction || e + 1 == rope.fractions.len() {
            let weight = (left / fraction).clamp(0.0, 1.0);
            let [node, next] = rope.edge(e);
            return Some(MarkerPlace::Nodes(NodePair { node, next, weight }));
        }
        left -= fraction;
    }
    None
}

/// Numbers of these channels, of those over rows (time, channel).
fn kept<'a>(own: &'a [bool], rows: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
    rows.iter().zip(own.iter().cycle()).filter(|(_, own)| **own).map(|(x, _)| *x)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::log::Split;
    use pliant_scene::Source;

    /// A slide on a turning arm: what the slide does wrong is not seen in the arm's angle, which is the first that is read.
    #[test]
    fn errors_are_reported_where_they_are_largest_over_the_scatter() {
        let body = |name: &str, parent: &str, kind: &str| {
            format!(
                "[[body]]\nname = \"{name}\"\n{parent}mass = 1.0\ninertia = [0.1, 0.1, 0.1, 0, 0, 0]\n\
                 [[body.joint]]\nname = \"{name}_joint\"\nkind = \"{kind}\"\naxis = [0, 0, 1]\n"
            )
        };
        let sensor =
            |name: &str| format!("[[experiment.joint]]\njoint = \"{name}_joint\"\ncolumn = \"{name}\"\nnoise_floor = 1e-5\n");
        let text = [
            "schema_version = 1\n[time]\nstep = 0.01\nduration = 1.0\n".to_owned(),
            body("arm", "", "revolute"),
            body("lift", "parent = \"arm\"\n", "prismatic"),
            "[experiment]\ntime = { column = \"t\" }\n".to_owned(),
            sensor("arm"),
            sensor("lift"),
            "[[experiment.record]]\nfile = \"run.csv\"\nrole = \"fit\"\n".to_owned(),
        ];
        let source = Source { file: "scene.toml".to_owned(), text: text.concat() };
        let setup = Setup::from_source(source, std::path::PathBuf::new()).unwrap();
        let time: Vec<f64> = (0..20).map(|k| 0.01 * f64::from(k)).collect();
        let n = time.len();
        let record = Record {
            time,
            inputs: vec![Vec::new(); n],
            markers: vec![Vec::new(); n],
            joints: vec![vec![0.0; 2]; n],
            orientations: vec![Vec::new(); n],
            ..Record::default()
        };
        let mut plan = Plan::new(&setup, &Logs { records: vec![record], split: Split::Declared }).unwrap();
        assert_eq!(plan.unit, "rad");
        // of the second sample the angle was not read
        let errors = [vec![2e-3, 1e-4, 0.0, 1e-4]];
        plan.report_worst(&errors, &[1e-3, 1e-5]);
        assert_eq!((plan.unit, plan.rms(&errors)), ("m", 1e-4));
        assert_eq!((plan.other_units(), plan.rms_in("rad", &errors)), (vec!["rad"], 2e-3));
        plan.report_worst(&errors, &[1e-4, 1e-5]);
        assert_eq!((plan.unit, plan.rms(&errors)), ("rad", 2e-3));
    }
}
