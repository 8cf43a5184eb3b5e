//! One pass through a record: simulation, readings, and their derivatives.

use super::plan::{Plan, RecordPlan};
use crate::sensor::TIME_OFFSET;
use crate::unknown::{Target, Unknown, Values};
use nalgebra::{Matrix3, Vector3};
use pliant_adjoint::{Seeds, Tangent, TangentStepper, equilibrium_tangent};
use pliant_engine::equilibrium::{equilibrium, place_clamped};
use pliant_engine::kinematics::Input;
use pliant_engine::state::State;
use pliant_engine::step::{StepError, StepOptions, Stepper};

/// What a shot shall compute besides the readings.
#[derive(Clone, Copy, Debug, Default)]
pub struct ShotWants<'a> {
    /// Unknowns to differentiate by.
    pub unknowns: &'a [Unknown],
    /// Derivatives at all (by the record's initial state and by `unknowns`).
    pub tangents: bool,
    /// Stop after this time \[s\].
    pub until: Option<f64>,
    /// Keep the states.
    pub states: bool,
}

/// A simulated record. Matrices are row-major over rows (time, marker, axis).
#[derive(Clone, Debug, Default)]
pub struct Shot {
    /// Simulated readings \[m\].
    pub predicted: Vec<f64>,
    /// Measured − simulated, the accumulated defects taken off \[m\]; 0 where nothing was measured.
    pub residual: Vec<f64>,
    /// rows × own columns: ∂(reading)/∂z.
    pub own: Vec<f64>,
    /// Number of own columns.
    pub own_columns: usize,
    /// rows × unknowns: ∂(reading)/∂(coordinate).
    pub global: Vec<f64>,
    /// Tangents (own, unknowns, defect) at each segment start.
    pub boundary: Vec<Tangent>,
    /// Norm of the defects \[m\] (velocities times the step).
    pub defect: f64,
    /// States at all steps, if wanted.
    pub states: Vec<State>,
}

struct Pass<'a> {
    plan: &'a Plan,
    rec: &'a RecordPlan,
    values: &'a Values,
    wants: ShotWants<'a>,
    own: usize,
    columns: usize,
    h: f64,
}

/// Simulates a record from its current initial state and segment states.
pub fn shoot(plan: &Plan, rec: &RecordPlan, values: &Values, wants: ShotWants) -> Result<Shot, StepError> {
    let own = if wants.tangents { rec.start.unknowns() } else { 0 };
    let columns = if wants.tangents { own + wants.unknowns.len() + 1 } else { 0 };
    let pass = Pass { plan, rec, values, wants, own, columns, h: plan.model.step_length() };
    pass.run()
}

impl Pass<'_> {
    fn run(&self) -> Result<Shot, StepError> {
        let model = &self.plan.model;
        let steps = self.wants.until.map_or(usize::MAX, |t| (t / self.h).ceil() as usize).min(self.rec.inputs.len());
        let mut shot = Shot { own_columns: self.own, ..Shot::default() };
        let mut tangent = TangentStepper::new(model, &self.values.theta, self.seeds());
        let mut state = self.start(&mut tangent)?;
        let options = StepOptions { record: self.wants.tangents, ..StepOptions::default() };
        let mut stepper = Stepper::new(model, &self.values.theta, options)?;
        let samples = self.samples(steps);
        let mut next_sample = 0;
        for (k, measured) in self.rec.inputs[..steps].iter().enumerate() {
            self.enter_segment(k, &mut state, &mut tangent, &mut shot);
            let u = self.inputs(measured, &mut tangent.seeds);
            let due = self.wants.tangents && samples.get(next_sample).is_some_and(|s| s.0 == k);
            let (before, tangent_before) = (state.clone(), if due { tangent.x.clone() } else { Tangent::default() });
            let (_, record) = stepper.step(&mut state, &u).map_err(|e| e.at_step(k))?;
            if let Some(record) = record {
                tangent.step(&record);
            }
            while samples.get(next_sample).is_some_and(|s| s.0 == k) {
                let blend = Blend::new(samples[next_sample].1, self.h);
                self.observe(next_sample, &blend, [&before, &state], [&tangent_before, &tangent.x], &mut shot);
                next_sample += 1;
            }
            if self.wants.states {
                if k == 0 {
                    shot.states.push(before);
                }
                shot.states.push(state.clone());
            }
        }
        Ok(shot)
    }

    fn seeds(&self) -> Seeds {
        let model = &self.plan.model;
        let mut seeds = Seeds::none(self.columns, model.nu(), model.n_params());
        if self.wants.tangents {
            for (j, unknown) in self.wants.unknowns.iter().enumerate() {
                if let Target::Theta(entries) = &unknown.target {
                    let slope = unknown.slope(unknown.value(self.values));
                    entries.iter().for_each(|&k| seeds.add_theta(k, self.own + j, slope));
                }
            }
        }
        seeds
    }

    /// The state at t = 0 and its tangents.
    fn start(&self, tangent: &mut TangentStepper) -> Result<State, StepError> {
        let model = &self.plan.model;
        let u0 = self.inputs(&self.rec.record.inputs[0], &mut tangent.seeds);
        if self.plan.at_rest {
            let rest = equilibrium(model, &self.values.theta, &self.rec.start.mean.q, &u0)?;
            if self.wants.tangents {
                tangent.x.q = equilibrium_tangent(&rest, &tangent.seeds);
            }
            return Ok(State { v: vec![0.0; rest.q.len()], q: rest.q, z: model.initial_memory() });
        }
        let mut state = self.rec.start.state();
        let (q, placement) = place_clamped(model, &self.values.theta, &u0, &state.q)?;
        state.q = q;
        if self.wants.tangents {
            let m = self.columns;
            let start = &self.rec.start;
            let n = start.dofs.len();
            for (row, &dof) in start.dofs.iter().enumerate() {
                for c in 0..n {
                    tangent.x.q[dof * m + c] = start.position[(row, c)];
                    tangent.x.v[dof * m + n + c] = start.velocity[(row, c)];
                }
            }
            for (row, input, value) in placement {
                let columns = match input {
                    Input::U(k) => tangent.seeds.u(k),
                    Input::Theta(k) => tangent.seeds.theta(k),
                    _ => &[],
                };
                columns.iter().for_each(|&(c, w)| tangent.x.q[row * m + c] += value * w);
            }
        }
        Ok(state)
    }

    /// At a segment start the state becomes the estimated one, and the defect joins the last column.
    fn enter_segment(&self, k: usize, state: &mut State, tangent: &mut TangentStepper, shot: &mut Shot) {
        let Some((_, node)) = self.rec.nodes.iter().find(|(step, _)| *step == k) else { return };
        let mut defect2 = 0.0;
        let last = self.columns.wrapping_sub(1);
        for i in 0..state.q.len() {
            let (dq, dv) = (state.q[i] - node.q[i], state.v[i] - node.v[i]);
            defect2 += dq * dq + (dv * self.h).powi(2);
            if self.wants.tangents {
                tangent.x.q[i * self.columns + last] += dq;
                tangent.x.v[i * self.columns + last] += dv;
            }
        }
        for i in 0..state.z.len() {
            let dz = state.z[i] - node.z[i];
            defect2 += dz * dz;
            if self.wants.tangents {
                tangent.x.z[i * self.columns + last] += dz;
            }
        }
        shot.defect += defect2.sqrt();
        *state = node.clone();
        if self.wants.tangents {
            shot.boundary.push(tangent.x.clone());
        }
    }

    /// Inputs of a step; where the sensor measured them too, freed of its errors, with the derivatives by its unknowns.
    fn inputs(&self, measured: &[f64], seeds: &mut Seeds) -> Vec<f64> {
        seeds.clear_u();
        let sensor = &self.values.sensor;
        if !self.plan.shared_sensor {
            return measured.to_vec();
        }
        let mut u = measured.to_vec();
        for drive in self.plan.model.drives().iter().filter(|d| d.is_prescribed()) {
            let edge = drive.nodes().len() == 2 && drive.n_controls() == 6 && self.is_edge(drive);
            for first in (drive.first_u..drive.first_u + drive.n_controls()).step_by(3) {
                let y = Vector3::new(measured[first], measured[first + 1], measured[first + 2]);
                let is_axis = edge && first > drive.first_u;
                let (p, by) = if is_axis { sensor.locate_direction(y) } else { sensor.locate(y) };
                u[first..first + 3].copy_from_slice(p.as_slice());
                self.seed_inputs(first, &by, seeds);
            }
        }
        u
    }

    fn is_edge(&self, drive: &pliant_engine::kinematics::Drive) -> bool {
        matches!(drive.kind, pliant_engine::kinematics::DriveKind::PrescribedEdge(_))
    }

    fn seed_inputs(&self, first: usize, by: &[Vector3<f64>; 7], seeds: &mut Seeds) {
        if !self.wants.tangents {
            return;
        }
        for (j, unknown) in self.wants.unknowns.iter().enumerate() {
            if let Target::Sensor(entry) = unknown.target
                && entry < TIME_OFFSET
            {
                let slope = unknown.slope(unknown.value(self.values));
                (0..3).for_each(|a| seeds.add_u(first + a, self.own + j, by[entry][a] * slope));
            }
        }
    }

    /// (step, part of it) of every sample that the simulated steps cover.
    fn samples(&self, steps: usize) -> Vec<(usize, f64)> {
        let shift = self.values.sensor.time_offset();
        let place = |t: &f64| {
            let x = (t - shift) / self.h;
            let step = ((x + 1e-9).floor().max(0.0) as usize).min(self.rec.inputs.len() - 1);
            (step, x - step as f64)
        };
        self.rec.record.time.iter().map(place).take_while(|(step, part)| *step < steps && *part < 2.0).collect()
    }

    fn observe(&self, sample: usize, blend: &Blend, x: [&State; 2], t: [&Tangent; 2], shot: &mut Shot) {
        let m = self.columns;
        let mut point = vec![0.0; 3 * m];
        for (marker, place) in self.plan.markers.iter().enumerate() {
            let parts = [(place.node, 1.0 - place.weight), (place.next, place.weight)];
            let p: Vector3<f64> = parts.iter().map(|&(n, w)| blend.position(x, n) * w).sum();
            let (y, dy_dp, by) = self.values.sensor.read(p);
            let measured = self.rec.record.markers[sample][marker];
            let seen = measured.iter().all(|c| c.is_finite());
            shot.predicted.extend(y.iter());
            let mut residual = if seen { Vector3::from(measured) - y } else { Vector3::zeros() };
            if self.wants.tangents {
                point.fill(0.0);
                for &(node, w) in parts.iter().filter(|(_, w)| *w != 0.0) {
                    blend.tangent(t, node, m, w, &mut point);
                }
                let speed: Vector3<f64> = parts.iter().map(|&(n, w)| blend.velocity(x, n) * w).sum();
                let rows = turn(&dy_dp, &point, m);
                if seen {
                    (0..3).for_each(|a| residual[a] -= rows[a * m + m - 1]);
                }
                for a in 0..3 {
                    let row = &rows[a * m..(a + 1) * m];
                    let visible = f64::from(u8::from(seen));
                    shot.own.extend(row[..self.own].iter().map(|d| d * visible));
                    for (j, unknown) in self.wants.unknowns.iter().enumerate() {
                        let direct = self.sensor_part(unknown, a, &by, &dy_dp, &speed);
                        shot.global.push((row[self.own + j] + direct) * visible);
                    }
                }
            }
            shot.residual.extend(residual.iter());
        }
    }

    /// Direct dependence of a reading on the sensor's own unknowns.
    fn sensor_part(
        &self,
        unknown: &Unknown,
        axis: usize,
        by: &[Vector3<f64>; 7],
        dy_dp: &Matrix3<f64>,
        speed: &Vector3<f64>,
    ) -> f64 {
        let Target::Sensor(entry) = unknown.target else { return 0.0 };
        let slope = unknown.slope(unknown.value(self.values));
        if entry == TIME_OFFSET { -(dy_dp * speed)[axis] * slope } else { by[entry][axis] * slope }
    }
}

/// Rows of `dy_dp · point`, three rows of `m` columns.
fn turn(dy_dp: &Matrix3<f64>, point: &[f64], m: usize) -> Vec<f64> {
    if *dy_dp == Matrix3::identity() {
        return point.to_vec();
    }
    let mut out = vec![0.0; 3 * m];
    for a in 0..3 {
        for b in 0..3 {
            let c = dy_dp[(a, b)];
            out[a * m..(a + 1) * m].iter_mut().zip(&point[b * m..(b + 1) * m]).for_each(|(o, p)| *o += c * p);
        }
    }
    out
}

/// Cubic Hermite interpolation within a step.
struct Blend {
    position: [f64; 4],
    velocity: [f64; 4],
}

impl Blend {
    /// At the part `a` of a step of length `h`; weights of q, v before and q, v after.
    fn new(a: f64, h: f64) -> Self {
        let b = 1.0 - a;
        let a = if a.abs() < 1e-9 {
            0.0
        } else if b.abs() < 1e-9 {
            1.0
        } else {
            a
        };
        let b = 1.0 - a;
        Self {
            position: [b * b * (1.0 + 2.0 * a), a * b * b * h, a * a * (1.0 + 2.0 * b), -a * a * b * h],
            velocity: [-6.0 * a * b / h, b * (1.0 - 3.0 * a), 6.0 * a * b / h, a * (3.0 * a - 2.0)],
        }
    }

    fn sum(weights: &[f64; 4], x: [&State; 2], node: usize) -> Vector3<f64> {
        let at = |s: &[f64]| Vector3::new(s[3 * node], s[3 * node + 1], s[3 * node + 2]);
        at(&x[0].q) * weights[0] + at(&x[0].v) * weights[1] + at(&x[1].q) * weights[2] + at(&x[1].v) * weights[3]
    }

    fn position(&self, x: [&State; 2], node: usize) -> Vector3<f64> {
        Self::sum(&self.position, x, node)
    }

    fn velocity(&self, x: [&State; 2], node: usize) -> Vector3<f64> {
        Self::sum(&self.velocity, x, node)
    }

    fn tangent(&self, t: [&Tangent; 2], node: usize, m: usize, scale: f64, out: &mut [f64]) {
        let range = 3 * node * m..3 * (node + 1) * m;
        for (weight, from) in self.position.iter().zip([&t[0].q, &t[0].v, &t[1].q, &t[1].v]) {
            if *weight != 0.0 {
                out.iter_mut().zip(&from[range.clone()]).for_each(|(o, x)| *o += scale * weight * x);
            }
        }
    }
}
