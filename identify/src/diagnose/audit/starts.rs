//! Records that are said to begin at rest, and do not.
//!
//! A simulation that begins in equilibrium cannot follow readings that move from the first sample on, and a diagnosis would explain that
//! motion by forces. But readings of a record that does begin at rest move as well, where its inputs move at once: so they are compared
//! with each other, and with the simulation from the equilibrium.

use super::super::result::AuditFinding;
use super::place_of;
use crate::audit::{AUDIT, noise_sigma};
use crate::shooting::{Observed, Plan, RecordPlan, ShotWants, shoot};

/// How one number moves over the first samples of a record: along the straight line through them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Motion {
    /// From the first sample to the last.
    by: f64,
    /// Its standard error.
    error: f64,
}

impl Motion {
    fn is_sure(&self) -> bool {
        self.by.abs() > AUDIT.start_errors * self.error
    }
}

/// A channel over the first samples.
struct Channel {
    observed: Observed,
    /// Motion of the readings.
    read: Motion,
    /// Motion of what the simulation leaves of them.
    left: Motion,
}

impl Channel {
    /// Motion of the simulated readings.
    fn simulated(&self) -> f64 {
        (self.read.by - self.left.by).abs()
    }
}

/// A finding for every record, fitted or held out, that moves from the start and is said to begin at rest.
pub(super) fn moving(plan: &Plan) -> Vec<AuditFinding> {
    if !plan.at_rest {
        return Vec::new();
    }
    plan.fitted.iter().chain(&plan.held_out).filter_map(|rec| Some(finding(plan, rec, &fastest(plan, rec)?))).collect()
}

fn finding(plan: &Plan, rec: &RecordPlan, channel: &Channel) -> AuditFinding {
    let unit = plan.unit_of(channel.observed);
    let (by, seconds) = (channel.read.by.abs(), rec.record.time[AUDIT.start_samples - 1]);
    AuditFinding {
        severity: "warning".to_owned(),
        record: rec.record.name.clone(),
        place: place_of(plan, channel.observed),
        time_s: Some(0.0),
        what: format!(
            "is said to begin at rest, and its readings move from the start by {by:.2e} {unit} in {seconds:.3} s ({}); simulated from \
             rest they move by {:.2e} {unit}",
            plan.name_of(channel.observed),
            channel.simulated()
        ),
        number: by,
        unit: unit.to_owned(),
        advice: "set `initial = \"measured\"`, or cut the record where it is at rest".to_owned(),
    }
}

/// The channel that contradicts rest most, in its standard errors; none if the readings agree with rest, or cannot be judged.
fn fastest(plan: &Plan, rec: &RecordPlan) -> Option<Channel> {
    let channels = channels(plan, rec)?;
    let moves = |channel: &Channel| {
        let unit = plan.unit_of(channel.observed);
        let alike = channels.iter().filter(|other| plan.unit_of(other.observed) == unit);
        let simulated = alike.map(Channel::simulated).fold(0.0, f64::max);
        let beyond = channel.left.by.abs() > AUDIT.start_simulated * simulated && channel.read.by.abs() > channel.simulated();
        channel.read.is_sure() && channel.left.is_sure() && beyond
    };
    let sure = |channel: &Channel| channel.left.by.abs() / channel.left.error;
    let moving: Vec<bool> = channels.iter().map(moves).collect();
    let found = channels.into_iter().zip(moving).filter(|(_, moves)| *moves).map(|(channel, _)| channel);
    found.max_by(|a, b| sure(a).total_cmp(&sure(b)))
}

/// Every channel that has all of its first samples; none where the record is too short or cannot be simulated.
fn channels(plan: &Plan, rec: &RecordPlan) -> Option<Vec<Channel>> {
    let (n, width) = (AUDIT.start_samples, plan.channels());
    let time = rec.record.time.get(..n)?;
    let until = Some(time[n - 1] + 2.0 * plan.model.step_length());
    let shot = shoot(plan, rec, &plan.scene_values, ShotWants { until, ..ShotWants::default() }).ok()?;
    let left = shot.residual.get(..n * width)?;
    let mut out = Vec::with_capacity(width);
    for observed in plan.observed() {
        for (axis, channel) in plan.channels_of(observed).enumerate() {
            let readings = readings(plan, rec, observed, axis);
            if readings[..n].iter().any(|y| !y.is_finite()) {
                continue;
            }
            let seen: Vec<f64> = readings.iter().copied().filter(|y| y.is_finite()).collect();
            let least = noise_sigma(&seen).max(plan.floors()[channel]);
            let left: Vec<f64> = left.iter().skip(channel).step_by(width).copied().collect();
            out.push(Channel { observed, read: motion(time, &readings[..n], least), left: motion(time, &left, least) });
        }
    }
    Some(out)
}

/// One channel's readings over a record; of an orientation a part of the turn since the first sample, taken to be small.
fn readings(plan: &Plan, rec: &RecordPlan, observed: Observed, axis: usize) -> Vec<f64> {
    let read = |sample: usize| plan.measured(&rec.record, sample, observed);
    let samples = 0..rec.record.time.len();
    if !matches!(observed, Observed::Orientation(_)) {
        return samples.map(|sample| read(sample)[axis]).collect();
    }
    let first = read(0);
    samples.map(|sample| turn_since(&first, &read(sample))[axis]).collect()
}

/// Twice the vector part of p⁻¹ q, of quaternions (w, x, y, z): the turn from p to q in the axes of p, if it is small.
fn turn_since(p: &[f64], q: &[f64]) -> [f64; 3] {
    let real: f64 = p.iter().zip(q).map(|(p, q)| p * q).sum();
    let part = |a: usize, b: usize, c: usize| p[0] * q[a] - q[0] * p[a] - (p[b] * q[c] - p[c] * q[b]);
    [part(1, 2, 3), part(2, 3, 1), part(3, 1, 2)].map(|x| 2.0 * real.signum() * x)
}

/// The motion along the least-squares line; noise is what is left of it, and at least `least`: a few samples may lie on a line by chance.
fn motion(time: &[f64], y: &[f64], least: f64) -> Motion {
    let n = time.len() as f64;
    let (middle, mean) = (time.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let spread: f64 = time.iter().map(|t| (t - middle) * (t - middle)).sum();
    let slope = time.iter().zip(y).map(|(t, y)| (t - middle) * (y - mean)).sum::<f64>() / spread;
    let off: f64 = time.iter().zip(y).map(|(t, y)| (y - mean - slope * (t - middle)).powi(2)).sum();
    let sigma = (off / (n - 2.0)).sqrt().max(least);
    let lasts = time[time.len() - 1] - time[0];
    Motion { by: slope * lasts, error: sigma / spread.sqrt() * lasts }
}

#[cfg(test)]
pub(crate) mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::log::{Logs, Record, Role, Setup, Split};
    use crate::sensor::SCALE;
    use crate::stats::testing::gaussians;
    use pliant_scene::Source;
    use std::path::PathBuf;

    const SAMPLES: usize = 40;
    const NOISE: f64 = 2e-4;

    fn time() -> Vec<f64> {
        (0..SAMPLES).map(|k| 0.01 * k as f64).collect()
    }

    /// A pendulum with a motor and an encoder.
    pub fn pendulum(initial: &str) -> String {
        format!(
            "schema_version = 1\n[time]\nstep = 0.005\nduration = 1.0\nintegrator = \"midpoint\"\n[[body]]\nname = \"link\"\n\
             mass = 0.5\ncenter_of_mass = [0, 0, -0.3]\ninertia = [1e-3, 1e-3, 1e-3, 0, 0, 0]\n[[body.joint]]\nname = \"pivot\"\n\
             kind = \"revolute\"\naxis = [0, 1, 0]\n[[actuator]]\nname = \"motor\"\njoint = \"pivot\"\nkind = \"torque\"\n\
             [experiment]\ninitial = \"{initial}\"\ntime = {{ column = \"t\" }}\n[[experiment.joint]]\njoint = \"pivot\"\n\
             column = \"angle\"\n[[experiment.input]]\nactuator = \"motor\"\ncolumns = [\"command\"]\n\
             [[experiment.record]]\nfile = \"run.csv\"\n"
        )
    }

    /// Records of this experiment, the last one held out.
    pub fn plan_of(text: &str, mut records: Vec<Record>) -> (Plan, Logs) {
        let setup = Setup::from_source(Source::new("scene.toml", text), PathBuf::new()).unwrap();
        records.last_mut().unwrap().role = Role::HeldOut;
        let logs = Logs { records, split: Split::Declared };
        (Plan::opened(&setup, &logs).unwrap(), logs)
    }

    fn encoded(k: usize, angles: &[f64]) -> Record {
        Record {
            name: format!("run{k}"),
            joints: angles.iter().map(|angle| vec![*angle]).collect(),
            inputs: vec![vec![0.0]; SAMPLES],
            phase: vec![0.5],
            markers: vec![Vec::new(); SAMPLES],
            orientations: vec![Vec::new(); SAMPLES],
            time: time(),
            ..Record::default()
        }
    }

    /// The pendulum without commands, with these readings in each record.
    pub fn experiment(text: &str, readings: &[Vec<f64>]) -> (Plan, Logs) {
        plan_of(text, readings.iter().enumerate().map(|(k, angles)| encoded(k, angles)).collect())
    }

    /// Readings of an angle that grows from 0 at these speeds [rad/s].
    pub fn turning(speeds: &[f64], noise: f64, seed: u64) -> Vec<Vec<f64>> {
        let one = |(k, speed): (usize, &f64)| {
            time().iter().zip(gaussians(SAMPLES, seed + 1000 * k as u64)).map(|(t, e)| speed * t + noise * e).collect()
        };
        speeds.iter().enumerate().map(one).collect()
    }

    #[test]
    fn records_in_motion_do_not_begin_at_rest() {
        let speeds = [0.0, 0.3, -0.3];
        let found = moving(&experiment(&pendulum("rest"), &turning(&speeds, NOISE, 1)).0);
        let said: Vec<_> = found.iter().map(|f| (f.record.as_str(), f.place.as_str(), f.severity.as_str())).collect();
        assert_eq!(said, [("run1", "position of pivot", "warning"), ("run2", "position of pivot", "warning")]);
        let begins = "is said to begin at rest, and its readings move from the start by 1.";
        assert!((found[0].number - 0.012).abs() < 1e-3 && found[0].what.starts_with(begins), "{:?}", found[0]);
        assert!(found[0].advice.contains("initial = \"measured\""));
        for initial in ["measured", "given"] {
            assert_eq!(moving(&experiment(&pendulum(initial), &turning(&speeds, NOISE, 1)).0), []);
        }
    }

    #[test]
    fn noise_at_rest_is_no_motion() {
        for seed in 0..200 {
            let mut readings = turning(&[0.0; 3], NOISE, seed);
            // a wrong zero of the encoder is no motion either
            readings.iter_mut().flatten().for_each(|y| *y += 0.02);
            assert_eq!(moving(&experiment(&pendulum("rest"), &readings).0), [], "seed {seed}");
        }
    }

    /// A rope that hangs from a gripper, with two markers.
    fn rope() -> String {
        let marker =
            |node: usize| format!("[[experiment.marker]]\nrope = \"cable\"\nnode = {node}\ncolumns = [\"x\", \"y\", \"z\"]\n");
        format!(
            "schema_version = 1\n[time]\nstep = 0.005\nduration = 1.0\nintegrator = \"midpoint\"\n[[rope]]\nname = \"cable\"\nnodes = 5\n\
             length = 0.5\nlinear_density = 0.03\nstretch_stiffness = 300.0\nstretch_damping = 1.0\n\
             initial = {{ shape = \"straight\", from = [0, 0, 1], direction = [0, 0, -1] }}\n[[gripper]]\nname = \"hand\"\n\
             rope = \"cable\"\nnodes = [0]\n[experiment]\ninitial = \"rest\"\ntime = {{ column = \"t\" }}\n{}{}\
             [[experiment.input]]\ngripper = \"hand\"\ncolumns = [\"hx\", \"hy\", \"hz\"]\n[[experiment.record]]\nfile = \"run.csv\"\n",
            marker(2),
            marker(4)
        )
    }

    /// A record in which the hand, and with it the whole rope, moves at this velocity from the start.
    fn carried(k: usize, [x, z]: [f64; 2]) -> Record {
        Record {
            name: format!("run{k}"),
            markers: time().iter().map(|t| [0.75, 0.5].map(|from| [x * t, 0.0, from + z * t]).to_vec()).collect(),
            inputs: time().iter().map(|t| vec![x * t, 0.0, 1.0 + z * t]).collect(),
            phase: vec![1.0; 3],
            joints: vec![Vec::new(); SAMPLES],
            orientations: vec![Vec::new(); SAMPLES],
            time: time(),
            ..Record::default()
        }
    }

    #[test]
    fn a_rope_that_is_carried_along_does_not_begin_at_rest() {
        let found = moving(&plan_of(&rope(), vec![carried(0, [0.0, 0.0]), carried(1, [0.4, 0.0])]).0);
        assert_eq!(found.iter().map(|f| (f.record.as_str(), f.place.as_str())).collect::<Vec<_>>(), [("run1", "Point(1)")]);
    }

    /// A hand that lifts the rope moves all of it at once, and a sensor of another scale than the scene's sees it move further.
    #[test]
    fn what_the_inputs_move_is_not_held_against_rest() {
        let (plan, _) = plan_of(&rope(), vec![carried(0, [0.0, 0.4]); 2]);
        let mut truth = plan.scene_values.clone();
        truth.sensor.0[SCALE] = 1.3;
        let clean = shoot(&plan, &plan.fitted[0], &truth, ShotWants::default()).unwrap().predicted;
        for seed in 0..200 {
            let read: Vec<f64> = clean.iter().zip(gaussians(clean.len(), seed)).map(|(y, e)| y + NOISE * e).collect();
            let marker = |p: &[f64]| [p[0], p[1], p[2]];
            let markers = read.chunks_exact(6).map(|row| vec![marker(row), marker(&row[3..])]).collect();
            let record = Record { markers, ..carried(0, [0.0, 0.4]) };
            let plan = plan_of(&rope(), vec![record; 2]).0;
            assert_eq!(moving(&plan), [], "seed {seed}");
            // the readings do move, and surely further than the simulation's
            let height = &channels(&plan, &plan.fitted[0]).unwrap()[2];
            assert!(height.read.is_sure() && height.left.by > 3.0 * height.left.error, "{:?} {:?}", height.read, height.left);
        }
    }

    #[test]
    fn turns_are_those_between_two_orientations() {
        let about = |axis: [f64; 3], angle: f64| {
            let (sin, cos) = (0.5 * angle).sin_cos();
            [cos, sin * axis[0], sin * axis[1], sin * axis[2]]
        };
        let (p, q) = (about([0.0, 0.6, 0.8], 1.0), about([0.0, 0.6, 0.8], 1.01));
        let turn = turn_since(&p, &q.map(|x| -x));
        for (found, wanted) in turn.iter().zip([0.0, 0.006, 0.008]) {
            assert!((found - wanted).abs() < 1e-6, "{turn:?}");
        }
    }
}
