//! One pass through a record: simulation, readings, and their derivatives.

use super::blend::Blend;
use super::constants::SHOOTING;
use super::marker_offset::{At, Beside};
use super::observe::{Instant, met};
use super::observed::Observed;
use super::own_size::beside;
use super::plan::{Plan, RecordPlan};
use super::start::Zero;
use crate::form::Place;
use crate::sensor::{BIAS, DELAY, TIME_OFFSET};
use crate::unknown::{Target, Unknown, Values};
use nalgebra::Vector3;
use pliant_adjoint::{Seeds, Tangent, TangentStepper, equilibrium_jvp_columns};
use pliant_engine::bodies::TangentMaps;
use pliant_engine::equilibrium::{equilibrium, place_clamped};
use pliant_engine::step::{StepError, StepOptions, Stepper};
use pliant_math::rotation::Map;
use pliant_math::{Input, State};
use std::borrow::Cow;

/// Results that a simulation of a record returns besides the readings.
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

/// A simulated record. Matrices are row-major over rows (time, channel).
#[derive(Clone, Debug, Default)]
pub struct Shot {
    /// Simulated readings, each channel in its unit; of an orientation, −(turn from simulated to measured).
    pub predicted: Vec<f64>,
    /// Measured − simulated, the accumulated defects taken off, times the record's weight, as are the derivatives; 0 where nothing was measured.
    pub residual: Vec<f64>,
    /// rows × own columns: ∂(reading)/∂z.
    pub own: Vec<f64>,
    /// Number of own columns.
    pub own_columns: usize,
    /// rows × unknowns: ∂(reading)/∂(coordinate).
    pub global: Vec<f64>,
    /// Tangents (own, unknowns, defect) at each segment start.
    pub boundary: Vec<Tangent>,
    /// Norm of the defects [m, rad] (velocities times the step).
    pub defect: f64,
    /// States at all steps, if wanted.
    pub states: Vec<State>,
}

pub(super) struct Pass<'a> {
    pub plan: &'a Plan,
    pub rec: &'a RecordPlan,
    pub values: &'a Values,
    pub wants: ShotWants<'a>,
    pub own: usize,
    pub columns: usize,
    pub h: f64,
    pub beside: Option<Beside>,
}

/// Everything that is read at the same shifted times, and where its samples fall: (step, part of it).
struct Timetable {
    observed: Vec<Observed>,
    samples: Vec<(usize, f64)>,
    next: usize,
}

/// Simulates a record from its current initial state and segment states.
pub fn shoot(plan: &Plan, rec: &RecordPlan, values: &Values, wants: ShotWants) -> Result<Shot, StepError> {
    if rec.sizes.is_empty() {
        return passed(plan, rec, values, wants);
    }
    let values = rec.values(values);
    if !wants.tangents || rec.own_sizes() == 0 {
        return passed(plan, rec, &values, wants);
    }
    let mut unknowns = wants.unknowns.to_vec();
    let mut place = |of: &Unknown| {
        unknowns.iter().position(|u| u.target.same(&of.target)).unwrap_or_else(|| {
            unknowns.push(of.clone());
            unknowns.len() - 1
        })
    };
    let free = rec.sizes.iter().filter_map(|own| Some((&own.of, own.spread?)));
    let sizes: Vec<Vec<(usize, f64)>> =
        free.map(|(of, spread)| of.iter().map(|(number, weight)| (place(number), spread * weight)).collect()).collect();
    let shot = passed(plan, rec, &values, ShotWants { unknowns: &unknowns, ..wants })?;
    Ok(beside(shot, wants.unknowns.len(), unknowns.len(), &sizes))
}

/// The same of a record whose sizes are these values.
fn passed(plan: &Plan, rec: &RecordPlan, values: &Values, wants: ShotWants) -> Result<Shot, StepError> {
    let own = if wants.tangents { rec.start.unknowns() } else { 0 };
    let columns = if wants.tangents { own + wants.unknowns.len() + 1 } else { 0 };
    let beside = Beside::new(plan, values, wants.unknowns);
    let pass = Pass { plan, rec, values, wants, own, columns, h: plan.model.step_length(), beside };
    pass.run()
}

impl Pass<'_> {
    fn run(&self) -> Result<Shot, StepError> {
        let model = &self.plan.model;
        let mut tables = self.timetables();
        let all = self.steps(&tables);
        let steps = self.wants.until.map_or(all, |t| ((t / self.h).ceil() as usize).min(all));
        tables.iter_mut().for_each(|table| table.samples.truncate(table.samples.partition_point(|(step, _)| *step < steps)));
        let mut shot = Shot { own_columns: self.own, ..Shot::default() };
        let mut tangent = TangentStepper::new(model, &self.values.theta, self.seeds());
        let mut state = self.start(&mut tangent)?;
        let options = StepOptions { record: self.wants.tangents, ..StepOptions::default() };
        let mut stepper = Stepper::new(model, &self.values.theta, options)?;
        let complete = tables.iter().map(|t| t.samples.len()).min().unwrap_or(0);
        self.reserve(&mut shot, complete);
        for k in 0..steps {
            self.enter_segment(k, &mut state, &mut tangent, &mut shot);
            let u = self.inputs(k, &self.measured(k), &mut tangent.seeds);
            let due = |t: &Timetable| t.next < complete && t.samples[t.next].0 == k;
            let keep = self.wants.tangents && tables.iter().any(due);
            let (before, tangent_before) = (state.clone(), if keep { tangent.x.clone() } else { Tangent::default() });
            let (_, record) = stepper.step(&mut state, &u).map_err(|e| e.at_step(k))?;
            if let Some(record) = record {
                self.seed_forces((k as f64 + 0.5) * self.h, [&before, &state], &mut tangent.seeds);
                tangent.step(&record);
            }
            for table in &mut tables {
                while due(table) {
                    let part = table.samples[table.next].1;
                    let at =
                        Instant::new(self, k, Blend::new(part, self.h), part, [&before, &state], [&tangent_before, &tangent.x]);
                    table.observed.iter().for_each(|o| self.observe(table.next, *o, &at, &mut shot));
                    table.next += 1;
                }
            }
            if self.wants.states {
                if k == 0 {
                    shot.states.push(before);
                }
                shot.states.push(state.clone());
            }
        }
        self.correct(&mut shot.residual);
        [&mut shot.residual, &mut shot.own, &mut shot.global].into_iter().flatten().for_each(|x| *x *= self.rec.weight);
        Ok(shot)
    }

    /// Takes the record's known error off the residuals.
    fn correct(&self, residual: &mut [f64]) {
        let known = &self.rec.correction;
        if known.is_empty() {
            return;
        }
        for (row, r) in residual.iter_mut().enumerate().filter(|(_, r)| **r != 0.0) {
            *r = known.get(row).map_or(0.0, |error| met(*r + error));
        }
    }

    fn seeds(&self) -> Seeds {
        let model = &self.plan.model;
        let mut seeds = Seeds::none(self.columns, model.nu(), model.n_params());
        if self.wants.tangents {
            for (j, unknown) in self.wants.unknowns.iter().enumerate() {
                let slope = unknown.slope(unknown.value(self.values));
                unknown.target.entries().into_iter().for_each(|(k, part)| seeds.add_theta(k, self.own + j, part * slope));
            }
        }
        seeds
    }

    /// The state at t = 0 and its tangents.
    fn start(&self, tangent: &mut TangentStepper) -> Result<State, StepError> {
        let model = &self.plan.model;
        let u0 = self.inputs(0, &self.rec.record.inputs[0], &mut tangent.seeds);
        if self.plan.at_rest {
            let rest = equilibrium(model, &self.values.theta, &self.rec.start.mean.q, &u0)?;
            let mut state = rest.state();
            if self.wants.tangents {
                self.seed_forces(0.0, [&state, &state], &mut tangent.seeds);
                tangent.x.q = equilibrium_jvp_columns(&rest, &tangent.seeds);
            }
            state.z[..model.ndz()].copy_from_slice(&self.memory(tangent)[..model.ndz()]);
            return Ok(state);
        }
        let mut state = self.rec.start.state(model, &self.values.joints);
        state.z[..model.ndz()].copy_from_slice(&self.memory(tangent)[..model.ndz()]);
        let (placed, placement) = place_clamped(model, &self.values.theta, &u0, [&state.q, &state.z[model.ndz()..]])?;
        let mut shift = vec![0.0; model.ndx()];
        (0..model.n_node_dofs()).for_each(|k| shift[k] = placed[k] - state.q[k]);
        let following = &self.rec.start.following;
        following.iter().for_each(|&(row, lead, weight)| shift[row] += weight * shift[lead]);
        state = model.displaced(&state, &shift);
        model.take_out_turns(&mut state);
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
            for (j, unknown) in self.wants.unknowns.iter().enumerate() {
                let of = |zero: &&Zero| unknown.target == Target::Joint(zero.sensor, BIAS);
                let slope = unknown.slope(unknown.value(self.values));
                for zero in start.zeros.iter().filter(of) {
                    for dof in 0..model.nv() {
                        tangent.x.q[dof * m + self.own + j] += slope * zero.change[dof];
                        tangent.x.v[dof * m + self.own + j] += slope * zero.change[model.nv() + dof];
                    }
                }
            }
            // x₀ = mean ⊕ L z: balls turn on from where z has taken them
            let bodies = model.n_node_dofs();
            let mut turns = TangentMaps::default();
            turns.evaluate(model.tree(), Map::Exponential, &start.change(model, &self.values.joints)[bodies..model.nv()]);
            turns.jacobian(&mut tangent.x.q[bodies * m..], m);
            for (row, input, value) in placement {
                let columns = match input {
                    Input::U(k) => tangent.seeds.u(k),
                    Input::Theta(k) => tangent.seeds.theta(k),
                    _ => &[],
                };
                let followers = following.iter().filter(|f| f.1 == row).map(|&(row, _, weight)| (row, weight));
                for (row, weight) in std::iter::once((row, 1.0)).chain(followers) {
                    columns.iter().for_each(|&(c, w)| tangent.x.q[row * m + c] += weight * value * w);
                }
            }
        }
        Ok(self.on_centrelines(state, tangent))
    }

    /// The start that the data have, moved to where the centrelines of rods are.
    fn on_centrelines(&self, state: State, tangent: &mut TangentStepper) -> State {
        let Some(beside) = &self.beside else { return state };
        let before = self.wants.tangents.then(|| tangent.x.clone());
        let at = At { model: &self.plan.model, x: &state, tangent: before.as_ref().map(|x| (x, self.columns)) };
        let unknowns: Vec<(usize, &Unknown)> = self.wants.unknowns.iter().enumerate().map(|(j, u)| (self.own + j, u)).collect();
        beside.start(self.values, &unknowns, at, &mut tangent.x)
    }

    /// History variables at t = 0 and their tangents: those of motors from the inputs before the record, those of joints from the scene.
    fn memory(&self, tangent: &mut TangentStepper) -> Vec<f64> {
        let model = &self.plan.model;
        let mut z = model.initial_memory();
        let slopes = model.prime_signals(&self.late_past(), &self.values.theta, &mut z);
        if self.wants.tangents {
            for (place, k, slope) in slopes {
                for &(column, weight) in tangent.seeds.theta(k) {
                    tangent.x.z[place * self.columns + column] += slope * weight;
                }
            }
            self.seed_late_memory(&z, tangent);
        }
        z
    }

    /// At a segment start coordinates and velocities become the estimated ones, and the defect joins the last column. What is
    /// remembered goes on as it is: commands, and loads of 10⁴ N beside coordinates of 0.1 m, which as defects would drown these.
    fn enter_segment(&self, k: usize, state: &mut State, tangent: &mut TangentStepper, shot: &mut Shot) {
        let Some((_, node)) = self.rec.nodes.iter().find(|(step, _)| *step == k) else { return };
        let (mut defect2, nv) = (0.0, self.plan.model.nv());
        let last = self.columns.wrapping_sub(1);
        let gap = self.plan.model.difference(state, node);
        for i in 0..nv {
            let (dq, dv) = (gap[i], gap[nv + i]);
            defect2 += dq * dq + (dv * self.h).powi(2);
            if self.wants.tangents {
                tangent.x.q[i * self.columns + last] += dq;
                tangent.x.v[i * self.columns + last] += dv;
            }
        }
        shot.defect += defect2.sqrt();
        (state.q, state.v) = (node.q.clone(), node.v.clone());
        let memory = self.plan.model.ndz();
        state.z[memory..].copy_from_slice(&node.z[memory..]);
        if self.wants.tangents {
            shot.boundary.push(tangent.x.clone());
        }
    }

    /// Inputs of a step: as late as they reach the motors; where the sensor measured them too, freed of its errors; with the derivatives
    /// by the unknowns of both.
    fn inputs(&self, k: usize, measured: &[f64], seeds: &mut Seeds) -> Vec<f64> {
        seeds.clear_u();
        let sensor = &self.values.sensor;
        let mut u = measured.to_vec();
        self.make_late(k, &mut u, seeds);
        if !self.plan.shared_sensor {
            return u;
        }
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

    /// Forces that no law describes, at a time in the middle between these states.
    fn seed_forces(&self, time: f64, [before, after]: [&State; 2], seeds: &mut Seeds) {
        seeds.clear_forces();
        let model = &self.plan.model;
        let bodies = model.n_node_dofs();
        let middle = |of: &dyn Fn(&State) -> f64| 0.5 * (of(before) + of(after));
        for (j, unknown) in self.wants.unknowns.iter().enumerate() {
            let Target::Form(form) = &unknown.target else { continue };
            let column = self.own + j;
            if let Place::Bends(bends) = form.place {
                let rope = &model.ropes()[bends.rope];
                let row = |of: &dyn Fn(usize) -> f64| Vector3::from([0, 1, 2].map(of));
                // a gripper moves its nodes uniformly over the step
                let node = |node: usize| {
                    let early = if model.prescribed()[node] { after } else { before };
                    let at = 3 * node;
                    [row(&|a| 0.5 * (before.q[at + a] + after.q[at + a])), row(&|a| 0.5 * (early.v[at + a] + after.v[at + a]))]
                };
                bends.forces(form, (rope, self.values.theta[rope.length]), time, node, |node, f| {
                    [f.x, f.y, f.z].into_iter().enumerate().for_each(|(axis, f)| seeds.add_force(3 * node + axis, column, f));
                });
                continue;
            }
            let q = middle(&|state| form.place.position(&state.q[bodies..]));
            let v = middle(&|state| form.place.velocity(&state.v[bodies..]));
            let weight = form.value(time, q, v);
            if weight != 0.0 {
                form.place.dofs(bodies).for_each(|dof| seeds.add_force(dof, column, weight));
            }
        }
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

    /// Inputs of a step, which may come after those of the record: grippers move on, motors are commanded what they were last.
    fn measured(&self, k: usize) -> Cow<'_, [f64]> {
        let rows = &self.rec.inputs;
        if let Some(row) = rows.get(k) {
            return Cow::Borrowed(row);
        }
        let (before, mut out) = (&rows[rows.len().saturating_sub(2)], rows[rows.len() - 1].clone());
        let further = (k + 1 - rows.len()) as f64;
        for drive in self.plan.model.drives().iter().filter(|d| d.is_prescribed()) {
            for j in drive.first_u..drive.first_u + drive.n_controls() {
                out[j] += further * (out[j] - before[j]);
            }
        }
        Cow::Owned(out)
    }

    /// Steps to all samples: more than the record has inputs for where its sensors read ahead of its clock.
    fn steps(&self, tables: &[Timetable]) -> usize {
        let last = tables.iter().filter_map(|table| table.samples.last()).map(|(step, _)| step + 1);
        last.fold(self.rec.inputs.len(), usize::max)
    }

    /// Observed quantities with their times, grouped by equal time shift.
    fn timetables(&self) -> Vec<Timetable> {
        let offset = self.values.sensor.time_offset();
        let mut shifts: Vec<(f64, Vec<Observed>)> = Vec::new();
        for observed in self.plan.observed() {
            let own = if let Observed::Joint(k) = observed { self.values.joints[k][DELAY] } else { 0.0 };
            match shifts.iter_mut().find(|(shift, _)| *shift == offset + own) {
                Some((_, list)) => list.push(observed),
                None => shifts.push((offset + own, vec![observed])),
            }
        }
        shifts.into_iter().map(|(shift, observed)| Timetable { observed, samples: self.samples(shift), next: 0 }).collect()
    }

    /// (step, part of it) of every sample, read `shift` late \[s\].
    fn samples(&self, shift: f64) -> Vec<(usize, f64)> {
        let ahead = shift < 0.0;
        let place = |t: &f64| {
            let x = (t - shift) / self.h;
            let step = (x + SHOOTING.same_time).floor().max(0.0) as usize;
            let step = if ahead { step } else { step.min(self.rec.inputs.len() - 1) };
            (step, x - step as f64)
        };
        self.rec.record.time.iter().map(place).collect()
    }

    fn reserve(&self, shot: &mut Shot, samples: usize) {
        let rows = samples * self.plan.channels();
        (shot.predicted, shot.residual) = (vec![0.0; rows], vec![0.0; rows]);
        if self.wants.tangents {
            (shot.own, shot.global) = (vec![0.0; rows * self.own], vec![0.0; rows * self.wants.unknowns.len()]);
        }
    }
}
