//! Records: measured runs in SI units.

use super::constants::LOG;
use super::curve::Curve;
use super::experiment::{Interpolation, Role};
use super::lone::Lone;

/// All records of an experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct Logs {
    /// The records, in the order of the scene, then of the command line.
    pub records: Vec<Record>,
    /// Origin of their roles.
    pub split: Split,
}

/// Origin of the records' roles; a report states it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// The scene gives them; records without role are fitted.
    Declared,
    /// Every fourth record, at least one, is held out.
    EveryFourth,
    /// There is a single record: it is fitted, and nothing is held out.
    NothingHeldOut,
}

impl Logs {
    /// Records that parameters are found from.
    pub fn fitted(&self) -> impl Iterator<Item = &Record> {
        self.records.iter().filter(|record| record.role == Role::Fit)
    }

    /// Records that results are judged by.
    pub fn held_out(&self) -> impl Iterator<Item = &Record> {
        self.records.iter().filter(|record| record.role == Role::HeldOut)
    }

    /// Gives every record its role.
    pub(super) fn split(mut records: Vec<Record>, declared: &[Option<Role>]) -> Self {
        let split = if declared.iter().any(Option::is_some) {
            Split::Declared
        } else if records.len() < 2 {
            Split::NothingHeldOut
        } else {
            Split::EveryFourth
        };
        let n = records.len();
        for (k, record) in records.iter_mut().enumerate() {
            let fourth = k % 4 == 3 || (n < 4 && k + 1 == n);
            record.role = match split {
                Split::Declared => declared.get(k).copied().flatten().unwrap_or_default(),
                Split::EveryFourth if fourth => Role::HeldOut,
                _ => Role::Fit,
            };
        }
        Self { records, split }
    }
}

/// One measured run. All lists over time are equally long.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Record {
    /// Name: file, and array and number in an npz file.
    pub name: String,
    /// Its role.
    pub role: Role,
    /// Times of the samples [s], increasing, the first one 0.
    pub time: Vec<f64>,
    /// Time in the whole record at which this part of it begins [s].
    pub from: f64,
    /// Position of each marker [m], per time; NaN where a marker that may be missing is.
    pub markers: Vec<Vec<[f64; 3]>>,
    /// Reading of each sensor at a joint [rad, rad/s, N·m; m, m/s, N], per time; NaN where it may be missing and is.
    pub joints: Vec<Vec<f64>>,
    /// Each observed orientation, a unit quaternion (w, x, y, z), per time; NaN where it may be missing and is.
    pub orientations: Vec<Vec<[f64; 4]>>,
    /// Inputs in the order of the model, in SI units, per time.
    pub inputs: Vec<Vec<f64>>,
    /// Readings that were taken out, since no motion explains them.
    pub left_out: Vec<Lone>,
    /// Per input the part of a step at which the step takes it: 1 for positions (at its end), ½ for velocities (its mean).
    pub phase: Vec<f64>,
}

/// A time as the simulation counts it: `part` of the way from the state before step `step` to the state after it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepTime {
    /// Step, counted from 0.
    pub step: usize,
    /// Part of the step, from 0 to 1.
    pub part: f64,
}

/// Period of a clock, in the unit of its times; 0 for fewer than two of them.
///
/// The whole time over the number of periods in it, where a spacing counts for the nearest number of them: a clock that shakes moves the
/// median of the spacings, and samples that are missing their mean.
pub fn period(times: &[f64]) -> f64 {
    let mut spacings: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    spacings.sort_by(f64::total_cmp);
    let median = spacings.get(spacings.len() / 2).copied().unwrap_or(0.0);
    let counted =
        |period: f64| (times[times.len() - 1] - times[0]) / spacings.iter().map(|d| (d / period).round().max(1.0)).sum::<f64>();
    // The second time with a period that a shaken median no longer moves.
    if median > 0.0 { counted(counted(median)) } else { median }
}

impl Record {
    /// Time from the first sample to the last [s].
    pub fn duration(&self) -> f64 {
        self.time.last().copied().unwrap_or(0.0)
    }

    /// Time between samples [s]; see [`period`].
    pub fn period(&self) -> f64 {
        period(&self.time)
    }

    /// Number of steps of h [s] that cover the record.
    pub fn n_steps(&self, h: f64) -> usize {
        // A last sample that jitter puts just behind a step does not need another one.
        (self.duration() / h - 1e-6).ceil().max(0.0) as usize
    }

    /// The inputs of n steps of h [s], read between the samples in this way; held where the log has ended.
    pub fn step_inputs(&self, h: f64, n_steps: usize, interpolation: Interpolation) -> Vec<Vec<f64>> {
        // a position is where a step ends: held, it would jump
        let way =
            |phase: f64| if phase == 1.0 && interpolation == Interpolation::Held { Interpolation::Linear } else { interpolation };
        let curve = |j: usize| Curve::new(&self.time, self.inputs.iter().map(|row| row[j]).collect(), way(self.phase[j]));
        let curves: Vec<Curve> = (0..self.phase.len()).map(curve).collect();
        let row = |k: usize| curves.iter().zip(&self.phase).map(|(curve, phase)| curve.at((k as f64 + phase) * h)).collect();
        (0..n_steps).map(row).collect()
    }

    /// Where each sample falls among the steps of h [s].
    pub fn samples_in_steps(&self, h: f64) -> Vec<StepTime> {
        let last = self.n_steps(h).saturating_sub(1);
        let place = |t: &f64| {
            let step = ((t / h + 1e-9).floor() as usize).min(last);
            StepTime { step, part: (t / h - step as f64).clamp(0.0, 1.0) }
        };
        self.time.iter().map(place).collect()
    }

    /// Its parts between gaps in its log: over a gap the inputs are unknown, and a simulation could not follow the readings behind it.
    /// Itself where there are none, or no inputs; short parts are left out.
    pub fn between_gaps(&self) -> Vec<Self> {
        let longest = LOG.gap.0.max(LOG.gap.1 * self.period());
        let gaps = (1..self.time.len()).filter(|&k| self.time[k] - self.time[k - 1] > longest);
        let ends: Vec<usize> = gaps.chain([self.time.len()]).collect();
        if ends.len() < 2 || self.phase.is_empty() {
            return vec![self.clone()];
        }
        let starts = std::iter::once(0).chain(ends.iter().copied());
        let part = |(start, end): (usize, &usize)| {
            let from = self.time[start];
            let name = if start == 0 { self.name.clone() } else { format!("{} from {from:.2} s", self.name) };
            Self { name, ..self.piece(start..*end, from) }
        };
        let parts: Vec<Self> = starts.zip(&ends).filter(|(start, end)| *end - start >= LOG.part).map(part).collect();
        if parts.is_empty() { vec![self.clone()] } else { parts }
    }

    /// Its first `n` samples.
    pub fn truncate(&mut self, n: usize) {
        self.time.truncate(n);
        self.markers.truncate(n);
        self.joints.truncate(n);
        self.orientations.truncate(n);
        self.inputs.truncate(n);
    }

    /// The samples of a range, with times from `start` [s] on.
    pub fn piece(&self, samples: std::ops::Range<usize>, start: f64) -> Self {
        Self {
            name: self.name.clone(),
            role: self.role,
            time: self.time[samples.clone()].iter().map(|t| t - start).collect(),
            from: self.from + start,
            markers: self.markers[samples.clone()].to_vec(),
            joints: self.joints[samples.clone()].to_vec(),
            orientations: self.orientations[samples.clone()].to_vec(),
            inputs: self.inputs[samples].to_vec(),
            left_out: Vec::new(),
            phase: self.phase.clone(),
        }
    }

    /// Whether times, readings and inputs are those of another record, bit by bit: the same measurement.
    pub fn is_copy_of(&self, other: &Self) -> bool {
        let same = |a: &[f64], b: &[f64]| a.len() == b.len() && a.iter().zip(b).all(|(x, y)| x.to_bits() == y.to_bits());
        let markers = || self.markers.iter().zip(&other.markers).all(|(a, b)| same(a.as_flattened(), b.as_flattened()));
        let inputs = || self.inputs.iter().zip(&other.inputs).all(|(a, b)| same(a, b));
        let joints = || self.joints.iter().zip(&other.joints).all(|(a, b)| same(a, b));
        let turns = || self.orientations.iter().zip(&other.orientations).all(|(a, b)| same(a.as_flattened(), b.as_flattened()));
        same(&self.time, &other.time) && markers() && joints() && turns() && inputs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record() -> Record {
        let time = vec![0.0, 0.021, 0.04, 0.06];
        let inputs = time.iter().map(|t| vec![10.0 * t, 1.0 - t]).collect();
        Record { time, inputs, phase: vec![1.0, 0.5], ..Record::default() }
    }

    #[test]
    fn inputs_are_interpolated_to_the_steps() {
        for interpolation in [Interpolation::Linear, Interpolation::Smooth] {
            let rows = record().step_inputs(0.01, 7, interpolation);
            for (k, row) in rows.iter().take(6).enumerate() {
                let end = 0.01 * (k + 1) as f64;
                assert!((row[0] - 10.0 * end).abs() < 1e-12 && (row[1] - (1.0 - (end - 0.005))).abs() < 1e-12, "{row:?}");
            }
            assert_eq!(rows[6][0], 0.6);
        }
    }

    #[test]
    fn held_inputs_stay_until_the_next_sample_and_positions_do_not_jump() {
        let rows = record().step_inputs(0.01, 6, Interpolation::Held);
        let [straight, held]: [Vec<f64>; 2] = [0, 1].map(|j| rows.iter().map(|row| row[j]).collect());
        assert!(straight.iter().enumerate().all(|(k, x)| (x - 0.1 * (k + 1) as f64).abs() < 1e-12), "{straight:?}");
        // at 5, 15, 25 ms ... of samples at 0, 21, 40 and 60 ms
        assert_eq!(held, [1.0, 1.0, 0.979, 0.979, 0.96, 0.96]);
    }

    #[test]
    fn a_record_is_cut_where_inputs_are_unknown() {
        let mut time: Vec<f64> = (0..60).map(|k| 0.01 * k as f64).collect();
        time.iter_mut().skip(25).for_each(|t| *t += 0.3);
        time.iter_mut().skip(55).for_each(|t| *t += 0.2);
        let rows = |n: usize| vec![vec![n as f64]; 60];
        let whole = Record { name: "run".to_owned(), time, joints: rows(1), inputs: rows(2), ..Record::default() };
        assert_eq!(whole.between_gaps(), std::slice::from_ref(&whole));
        let parts = Record { phase: vec![0.5], markers: vec![Vec::new(); 60], orientations: vec![Vec::new(); 60], ..whole }
            .between_gaps();
        // the last five samples are too few
        let said: Vec<_> = parts.iter().map(|p| (p.name.as_str(), p.time.len(), p.inputs.len())).collect();
        assert_eq!(said, [("run", 25, 25), ("run from 0.55 s", 30, 30)]);
        assert!(parts[1].time[0] == 0.0 && (parts[1].time[29] - 0.29).abs() < 1e-12);
        let from = [parts[0].from, parts[1].from, parts[1].piece(2..9, 0.02).from];
        assert!(from.iter().zip([0.0, 0.55, 0.57]).all(|(a, b)| (a - b).abs() < 1e-12), "{from:?}");
    }

    #[test]
    fn samples_fall_into_steps() {
        let record = record();
        assert_eq!((record.n_steps(0.01), record.n_steps(0.02)), (6, 3));
        let samples = record.samples_in_steps(0.02);
        assert_eq!(samples[0], StepTime { step: 0, part: 0.0 });
        assert!(samples[1].step == 1 && (samples[1].part - 0.05).abs() < 1e-9);
        assert!(samples[3].step == 2 && (samples[3].part - 1.0).abs() < 1e-9);
        assert!((record.period() - 0.02).abs() < 1e-9);
    }

    #[test]
    fn a_clock_that_shakes_or_drops_samples_keeps_its_period() {
        // Shaken by up to a seventh of the period, by the parts of multiples of the golden ratio; every seventh sample is missing.
        let shaken = |k: usize| 0.02 * (k as f64 + ((k as f64 * 0.618_034).fract() - 0.5) * 2.0 / 7.0);
        let times: Vec<f64> = (0..400).filter(|k| k % 7 != 3).map(shaken).collect();
        assert!((period(&times) / 0.02 - 1.0).abs() < 1e-3, "{}", period(&times));
        assert_eq!((period(&[0.0, 1.0, 2.0, 7.0]), period(&[3.0]), period(&[])), (1.0, 0.0, 0.0));
    }

    #[test]
    fn whole_records_are_held_out() {
        let roles = |n: usize| {
            let logs = Logs::split(vec![Record::default(); n], &vec![None; n]);
            (logs.split, logs.records.iter().map(|r| r.role == Role::HeldOut).collect::<Vec<_>>())
        };
        assert_eq!(roles(1), (Split::NothingHeldOut, vec![false]));
        assert_eq!(roles(2), (Split::EveryFourth, vec![false, true]));
        assert_eq!(roles(3).1, [false, false, true]);
        assert_eq!(roles(9).1, [false, false, false, true, false, false, false, true, false]);
        let logs = Logs::split(vec![Record::default(); 2], &[Some(Role::HeldOut), None]);
        assert_eq!((logs.split, logs.fitted().count(), logs.held_out().count()), (Split::Declared, 1, 1));
    }
}
