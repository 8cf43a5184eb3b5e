//! Advances a state by steps of the model's integrator.

mod halving;

pub use halving::Retry;

use super::energy_check::CreatedByBodies;
use super::node_energy_check::{EnergyPoint, LastHalves, Run};
use super::{
    EULER, MIDPOINT, Masses, QUASI_STATIC, SDIRK_GAMMA, Scheme, SolverOptions, Stage, StageRecord, StepError, Warm, Workspace,
    end_positions,
};
use crate::bodies::tangent_maps::TangentMaps;
use crate::constraints::JointRow;
use crate::grasp::{Begin, Grasp, Grasping, Hold, Phase};
use crate::memory::Past;
use crate::model::Model;
use crate::rods::{Remembered, RodPast, RodPoint};
use crate::step::newton::{Work, solve_stage};
use crate::terms::joint::JointPoint;
use halving::{Outcome, SubstepPolicy};
use pliant_math::rotation::Map;
use pliant_math::{Input, State};
use pliant_scene::Integrator;
use std::borrow::Cow;
use std::ops::Deref;
use std::sync::Arc;

/// How steps are taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepOptions {
    /// Keep the record of each step for derivatives; costs one factorization per stage.
    pub record: bool,
    /// How often a failed step may be halved; `None` takes the scene's, `Some(0)` forbids it.
    pub max_halvings: Option<usize>,
}

impl Default for StepOptions {
    fn default() -> Self {
        Self { record: true, max_halvings: None }
    }
}

/// How a stage takes its reference state from what came before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StageKind {
    /// The whole (sub)step: the reference is the state before it.
    Single,
    /// First stage of sdirk2: as `Single`, but the state before the substep is needed once more.
    SdirkFirst,
    /// Second stage of sdirk2: `q_ref = q + (1−γ)h v₁`, `v_ref = v + ((1−γ)/γ)(v₁ − v)`.
    SdirkSecond,
}

/// Work and retries of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepTrace {
    /// Work of all its stages.
    pub work: Work,
    /// Halvings, and steps of sdirk2 taken by Euler: halving changes the discrete map.
    pub retries: usize,
    /// The retries by their reason, in the order of [`Retry::ALL`].
    pub retried_for: [usize; Retry::ALL.len()],
    /// Energy \[J\] that its (sub)steps created beside the work of hands, wind and weight, at most: of bodies that may
    /// touch the balance of docs/theory/step.md; of nodes that where their energy grows noticeably, elsewhere the growth, and nothing under
    /// `quasi_static`.
    pub energy_created: f64,
    /// The part of substeps at the halving limit.
    pub last_halves: LastHalves,
}

/// A step's stages in the order they were solved.
#[derive(Clone, Debug)]
pub struct StepRecord {
    /// Full step length h \[s\].
    pub h: f64,
    /// Stages and how each hangs on the one before.
    pub stages: Vec<(StageKind, StageRecord)>,
    /// ∂v_cmd: (row, input, derivative), shared by all stages.
    pub command: Vec<(usize, Input, f64)>,
    /// ∂/∂(u, z, θ) of what motors see, rows counted as controls; empty if that is u.
    pub signals: Vec<(usize, Input, f64)>,
    /// ∂z⁺/∂(u, z, θ) of the motors' part of z.
    pub memory: Vec<(usize, Input, f64)>,
}

/// The model of a stepper: borrowed from who steps, or shared with a stepper that outlives them.
#[derive(Clone, Debug)]
pub(super) enum ModelOf<'m> {
    Borrowed(&'m Model),
    Shared(Arc<Model>),
}

impl Deref for ModelOf<'_> {
    type Target = Model;

    fn deref(&self) -> &Model {
        match self {
            Self::Borrowed(model) => model,
            Self::Shared(model) => model,
        }
    }
}

/// Takes steps of one model at one θ. Holds the solver's memory and the warm start of the contacts.
#[derive(Clone, Debug)]
pub struct Stepper<'m> {
    pub(super) model: ModelOf<'m>,
    pub(super) theta: Cow<'m, [f64]>,
    options: StepOptions,
    pub(super) rest_gap: f64,
    grasping: Grasping,
    pub(super) masses: Masses,
    joint_rows: Vec<JointRow>,
    u: Vec<f64>,
    q_past: Vec<f64>,
    z_past: Vec<f64>,
    pub(super) rod_past: RodPast,
    pub(super) rod_point: RodPoint,
    /// Where grippers that grasp find things as a (sub)step begins, what they do throughout it, and the springs of a stage.
    q_begin: Vec<f64>,
    phases: Vec<Phase>,
    holds: Vec<Hold>,
    elapsed: f64,
    v_cmd: Vec<f64>,
    pub(super) q_ref: Vec<f64>,
    pub(super) v_ref: Vec<f64>,
    /// Velocities after the first stage of sdirk2.
    pub(super) v_first: Vec<f64>,
    /// No velocity.
    pub(super) still: Vec<f64>,
    /// Where a (sub)step begins and ends, for the energy check and for sections that remember.
    pub(super) begin: EnergyPoint,
    pub(super) end: EnergyPoint,
    pub(super) frames: Vec<f64>,
    pub(super) ws: Workspace,
}

impl<'m> Stepper<'m> {
    /// Checks θ against its physical bounds and allocates.
    ///
    /// # Errors
    /// A θ of another size or out of its bounds; a matrix that cannot be analysed.
    pub fn new(model: &'m Model, theta: &'m [f64], options: StepOptions) -> Result<Self, StepError> {
        Self::of(ModelOf::Borrowed(model), Cow::Borrowed(theta), options)
    }

    fn of(model: ModelOf<'m>, theta: Cow<'m, [f64]>, options: StepOptions) -> Result<Self, StepError> {
        model.check_theta(&theta)?;
        let ws = Workspace::new(&model, &theta).map_err(|source| StepError::Singular { step: 0, source })?;
        let zeros = || vec![0.0; model.nv()];
        Ok(Self {
            options,
            rest_gap: model.contact.rest_gap,
            grasping: Grasping::Hard,
            masses: Masses::new(&model, &theta),
            joint_rows: model.active_rows(&theta),
            u: Vec::new(),
            q_past: Vec::new(),
            z_past: Vec::new(),
            rod_past: RodPast::default(),
            rod_point: RodPoint::default(),
            q_begin: Vec::new(),
            phases: Vec::new(),
            holds: Vec::new(),
            elapsed: 0.0,
            v_cmd: zeros(),
            q_ref: vec![0.0; model.nq()],
            v_ref: zeros(),
            v_first: Vec::new(),
            still: zeros(),
            begin: EnergyPoint::default(),
            end: EnergyPoint::default(),
            frames: Vec::new(),
            ws,
            model,
            theta,
        })
    }

    /// Takes steps of another rest gap δ \[m\] than the scene's: another contact, hence another simulation.
    pub fn with_rest_gap(mut self, rest_gap: f64) -> Result<Self, StepError> {
        let (path, lower, upper) = ("contact.rest_gap".to_string(), f64::MIN_POSITIVE, f64::MAX);
        if !(rest_gap >= lower && rest_gap <= upper) {
            return Err(StepError::Parameter { path, value: rest_gap, unit: "m", lower, upper });
        }
        self.rest_gap = rest_gap;
        Ok(self)
    }

    /// Takes steps of another grasp than the scene's: another simulation, too.
    pub fn with_grasping(mut self, grasping: Grasping) -> Self {
        self.grasping = grasping;
        self
    }

    /// The contacts' warm start: part of a checkpoint.
    pub fn warm_start(&self) -> Option<&Warm> {
        self.ws.warm.as_ref()
    }

    /// Restores a warm start, so that a replay is bitwise the same.
    pub fn set_warm_start(&mut self, warm: Option<Warm>) {
        self.ws.warm = warm;
    }

    /// Forgets the warm start: the next step is bitwise that of a new stepper.
    pub fn forget(&mut self) {
        self.ws.forget();
    }

    /// Whether the steps from now on keep records.
    pub fn set_record(&mut self, record: bool) {
        self.options.record = record;
    }

    /// Step length h \[s\].
    pub fn step_length(&self) -> f64 {
        self.model.h
    }

    /// The parameters it steps with.
    pub fn theta(&self) -> &[f64] {
        &self.theta
    }

    /// Replaces `state` by the state one step later. On error the state is unchanged.
    pub fn step(&mut self, state: &mut State, u: &[f64]) -> Result<(StepTrace, Option<StepRecord>), StepError> {
        self.model.check_sizes(state)?;
        check_size("control", u.len(), self.model.nu())?;
        self.model.check_frames(state)?;
        self.model.signals(u, &state.z, &self.theta, &mut self.u);
        let h = self.model.h;
        let mut v_cmd = std::mem::take(&mut self.v_cmd);
        let result = self.command(state, u, h, &mut v_cmd).and_then(|()| {
            let mut trace = StepTrace::default();
            let mut stages = Vec::new();
            let mut next = state.clone();
            let halvings = self.most_halvings();
            self.substep(&mut next, h, &v_cmd, SubstepPolicy { halvings, by_euler: false }, &mut trace, &mut stages)?;
            // steps that may not be halved are wanted as they come
            if let Some(too_much) = Run::default().add(&trace.last_halves).filter(|_| self.halves()) {
                return Err(self.energy_error(&trace.last_halves, too_much, state, &next));
            }
            self.model.advance_signals(u, &mut next.z, &self.theta);
            let record = self.options.record.then(|| {
                let [signals, memory] = self.model.signal_partials(u, &state.z, &self.theta);
                let command =
                    StageRecord::command_inputs(&self.model, [&state.q, &state.z[self.model.ndz()..]], u, &self.theta, h);
                StepRecord { h, stages, command, signals, memory }
            });
            *state = next;
            Ok((trace, record))
        });
        self.v_cmd = v_cmd;
        result
    }

    fn most_halvings(&self) -> usize {
        self.options.max_halvings.unwrap_or(self.model.solver.max_halvings)
    }

    /// Whether steps may be halved; if not they are wanted as they come, whatever they create.
    pub(crate) fn halves(&self) -> bool {
        self.most_halvings() > 0
    }

    fn command(&self, state: &State, u: &[f64], h: f64, v_cmd: &mut [f64]) -> Result<(), StepError> {
        for drive in &self.model.drives {
            drive
                .command([&state.q, &state.z[self.model.ndz()..]], u, &self.theta, h, v_cmd)
                .map_err(|source| StepError::Command { step: 0, source })?;
        }
        Ok(())
    }

    /// Takes one (sub)step, if it is sound.
    fn integrate(
        &mut self,
        state: &mut State,
        h: f64,
        v_cmd: &[f64],
        means: SubstepPolicy,
        trace: &mut StepTrace,
        stages: &mut Vec<(StageKind, StageRecord)>,
    ) -> Result<Outcome, StepError> {
        self.remember(state);
        self.reach(state, v_cmd);
        let (memory, thorough) = (self.model.ndz(), means.halvings == 0);
        self.frames.clear();
        self.frames.extend_from_slice(&state.z[memory..]);
        let single = match self.model.integrator {
            Integrator::Sdirk2 if means.by_euler => Some(EULER),
            Integrator::Euler => Some(EULER),
            Integrator::Midpoint => Some(MIDPOINT),
            Integrator::QuasiStatic => Some(QUASI_STATIC),
            Integrator::Sdirk2 => None,
        };
        if let Some(scheme) = single {
            self.q_ref.copy_from_slice(&state.q);
            self.v_ref.copy_from_slice(&state.v);
            if scheme.momentum == 0.0 {
                self.v_ref.fill(0.0);
            }
            self.elapsed = h * (scheme.free.a0 + scheme.free.a1);
            let outcome = self.stage(state, scheme, h, v_cmd, StageKind::Single, thorough, trace, stages)?;
            if matches!(outcome, Outcome::Sound) {
                self.advance(state, h, v_cmd, stages);
            }
            return Ok(outcome);
        }
        let (gamma, start) = (SDIRK_GAMMA, state.clone());
        self.q_ref.copy_from_slice(&start.q);
        self.v_ref.copy_from_slice(&start.v);
        self.elapsed = gamma * h;
        let outcome = self.stage(state, EULER, gamma * h, v_cmd, StageKind::SdirkFirst, thorough, trace, stages)?;
        if !matches!(outcome, Outcome::Sound) {
            return Ok(outcome);
        }
        let ratio = (1.0 - gamma) / gamma;
        let n = self.model.n_node_dofs();
        for k in 0..n {
            self.q_ref[k] = start.q[k] + (1.0 - gamma) * h * state.v[k];
        }
        let lead: Vec<f64> = state.v[n..].iter().map(|v| (1.0 - gamma) * h * v).collect();
        self.model.tree.add(Map::Exponential, &start.q[n..], &lead, &mut self.q_ref[n..]);
        for k in 0..start.v.len() {
            self.v_ref[k] = start.v[k] + ratio * (state.v[k] - start.v[k]);
        }
        self.v_first.clone_from(&state.v);
        self.model.rods.carry_frames(&start.q, &self.q_ref, &mut self.frames);
        let first = stages.len();
        self.elapsed = h;
        let outcome = self.stage(state, EULER, gamma * h, v_cmd, StageKind::SdirkSecond, thorough, trace, stages)?;
        if !matches!(outcome, Outcome::Sound) {
            return Ok(outcome);
        }
        if let Some((_, record)) = stages.get_mut(first) {
            let mut turns = TangentMaps::default();
            turns.evaluate(&self.model.tree, Map::Exponential, &lead);
            record.transport.lead = turns;
            record.transport.carry[2].evaluate(&self.model.rods, &start.q, &self.q_ref);
        }
        self.advance(state, h, v_cmd, stages);
        Ok(Outcome::Sound)
    }

    /// Keeps the beginning of a (sub)step for what remembers it.
    fn remember(&mut self, state: &State) {
        if self.model.n_materials() > 0 {
            self.q_past.clear();
            self.q_past.extend_from_slice(&state.q[self.model.n_node_dofs()..]);
            self.z_past.clear();
            self.z_past.extend_from_slice(&state.z);
        }
        if self.model.rods.remember() {
            self.begin_at(state);
            self.model.rods.begin(&self.begin.rods, &mut self.rod_past);
        }
    }

    /// Decides what grippers that grasp do in a (sub)step.
    fn reach(&mut self, state: &State, v_cmd: &[f64]) {
        if self.model.grasps.is_empty() {
            return;
        }
        self.q_begin.clear();
        self.q_begin.extend_from_slice(&state.q);
        let mut phases = std::mem::take(&mut self.phases);
        phases.clear();
        phases.extend(self.model.grasps.iter().map(|grasp| grasp.phase(&self.begin(v_cmd, 0.0))));
        self.phases = phases;
    }

    fn begin<'a>(&'a self, v_cmd: &'a [f64], elapsed: f64) -> Begin<'a> {
        let (theta, grasping) = (&*self.theta, self.grasping);
        Begin { q: &self.q_begin, z: &self.z_past, u: &self.u, v_cmd, theta, grasping, elapsed }
    }

    fn grasps(&self) -> impl Iterator<Item = (&Grasp, Phase)> {
        self.model.grasps.iter().zip(self.phases.iter().copied())
    }

    /// Moves what materials and grippers remember on to the end of the (sub)step of length `h`.
    fn advance(&mut self, state: &mut State, h: f64, v_cmd: &[f64], stages: &mut [(StageKind, StageRecord)]) {
        if self.model.n_materials() == 0 {
            return;
        }
        let n = self.model.n_node_dofs();
        let past = Past { q: &self.q_past, z: &self.z_past, elapsed: h };
        let (q, v) = (&state.q[n..], &state.v[n..]);
        let end = JointPoint { tree: &self.model.tree, q, v, u: &self.u, theta: &self.theta, past };
        self.model.advance_materials(&end, &mut state.z);
        let begin = self.begin(v_cmd, h);
        self.grasps().for_each(|(grasp, phase)| grasp.advance(phase, &begin, &mut state.z));
        if let (true, Some((_, record))) = (self.options.record, stages.last_mut()) {
            record.memory = self.model.material_partials(&end);
            let mut visit = |place, input, value| record.memory.push((place, input, value));
            self.grasps().for_each(|(grasp, phase)| grasp.visit_advance(phase, &begin, &mut visit));
        }
        self.advance_rods(state, h, stages);
    }

    /// The same of what rods' sections remember.
    fn advance_rods(&mut self, state: &mut State, h: f64, stages: &mut [(StageKind, StageRecord)]) {
        let rods = &self.model.rods;
        if !rods.remember() {
            return;
        }
        let mut end = std::mem::take(&mut self.end);
        self.evaluate_energy(state, &mut end);
        self.end = end;
        let before = Remembered { past: &self.rod_past, z: &self.z_past, elapsed: h };
        rods.advance(&self.end.rods, &self.theta, before, &mut state.z);
        if let (true, Some((_, record))) = (self.options.record, stages.last_mut()) {
            rods.visit_advance(&self.end.rods, &self.theta, before, &mut |place, input, value| {
                record.memory.push((place, input, value));
            });
        }
    }

    /// Solves one stage from `q_ref`, `v_ref`; `state` becomes its end, unless the stage is refused (false).
    #[allow(clippy::too_many_arguments)] // the trace and the records of a step are gathered through all its stages
    fn stage(
        &mut self,
        state: &mut State,
        scheme: Scheme,
        h: f64,
        v_cmd: &[f64],
        link: StageKind,
        thorough: bool,
        trace: &mut StepTrace,
        stages: &mut Vec<(StageKind, StageRecord)>,
    ) -> Result<Outcome, StepError> {
        let mut holds = std::mem::take(&mut self.holds);
        holds.clear();
        holds.extend(self.grasps().filter_map(|(grasp, phase)| grasp.hold(phase, &self.begin(v_cmd, self.elapsed))));
        self.holds = holds;
        let stage = Stage {
            model: &self.model,
            theta: &self.theta,
            masses: &self.masses,
            joint_rows: &self.joint_rows,
            u: &self.u,
            holds: &self.holds,
            past: Past { q: &self.q_past, z: &self.z_past, elapsed: self.elapsed },
            rod_past: &self.rod_past,
            scheme,
            h,
            inertia: 1.0 / h,
            q_ref: &self.q_ref,
            frames: &self.frames,
            v_ref: &self.v_ref,
            v_start: if scheme.momentum == 0.0 { &state.v } else { &self.v_ref },
            v_cmd,
            options: SolverOptions::new(self.rest_gap, thorough),
        };
        let mut work = Work::default();
        let solved = solve_stage(&stage, &mut self.ws, &mut work);
        trace.work.add(work);
        solved?;
        let mut work = Work::default();
        if link != StageKind::Single && stage.is_impact(link == StageKind::SdirkFirst, &self.ws) {
            return Ok(Outcome::Thrown);
        }
        if let Some(CreatedByBodies { energy: created, kinetic: at_hand, too_much }) = stage.created_by_bodies(&mut self.ws)? {
            if too_much && !thorough {
                return Ok(Outcome::Refused);
            }
            // steps that may not be halved are wanted as they come
            if too_much && self.halves() {
                return Err(StepError::EnergyCreated { step: 0, created, at_hand, term: "contact of bodies".to_owned() });
            }
            trace.energy_created += created.max(0.0);
        }
        if self.options.record {
            work.factorizations += 1;
            let mut record = StageRecord::take(&stage, &mut self.ws)?;
            self.record_grasps(v_cmd, &mut record);
            stages.push((link, record));
        }
        trace.work.add(work);
        for (k, &prescribed) in self.model.prescribed_rows.iter().enumerate() {
            let w = if prescribed { &scheme.prescribed } else { &scheme.free };
            state.q[k] = self.q_ref[k] + h * (w.d0 * self.v_ref[k] + w.d1 * self.ws.it.v[k]);
        }
        let (rods, memory) = (&self.model.rods, self.model.ndz());
        state.z[memory..].copy_from_slice(&self.frames);
        rods.carry_frames_by(&mut self.rod_point, &self.q_ref, &state.q, &mut state.z[memory..]);
        if let (true, Some((_, record))) = (self.options.record, stages.last_mut()) {
            record.transport.carry[1].evaluate(rods, &self.q_ref, &state.q);
        }
        let n = self.model.n_node_dofs();
        let (q_ref, v_ref, v) = (&self.q_ref[n..], &self.v_ref[n..], &self.ws.it.v[n..]);
        end_positions(&self.model.tree, &scheme, h, q_ref, v_ref, v, &mut state.q[n..]);
        state.v.copy_from_slice(&self.ws.it.v);
        Ok(Outcome::Sound)
    }
}

impl Stepper<'static> {
    /// As [`Stepper::new`], of a model that it shares and parameters of its own: it may be kept beside what owns the model.
    ///
    /// # Errors
    /// Those of [`Stepper::new`].
    pub fn shared(model: Arc<Model>, theta: Vec<f64>, options: StepOptions) -> Result<Self, StepError> {
        Self::of(ModelOf::Shared(model), Cow::Owned(theta), options)
    }
}

impl Stepper<'_> {
    /// Derivatives of what grippers that grasp pull with in a stage.
    fn record_grasps(&self, v_cmd: &[f64], record: &mut StageRecord) {
        if self.phases.iter().all(|phase| *phase == Phase::Open) {
            record.grasp_modes.extend(self.phases.iter().flat_map(|phase| phase.modes()));
            return;
        }
        let (q_bar, _) = record.evaluation_point(&self.model);
        let (begin, prescribed) = (self.begin(v_cmd, self.elapsed), &self.model.prescribed_rows);
        for (grasp, phase) in self.grasps() {
            record.grasp_modes.extend(phase.modes());
            grasp.visit_force(phase, &begin, &q_bar, &mut |row, input, value| {
                if !prescribed[row] {
                    record.grasps.push((row, input, value));
                }
            });
        }
    }
}

pub(crate) fn check_size(what: &'static str, got: usize, expected: usize) -> Result<(), StepError> {
    if got == expected { Ok(()) } else { Err(StepError::Size { what, got, expected }) }
}

impl Model {
    /// Refuses a state of another model.
    pub(crate) fn check_sizes(&self, state: &State) -> Result<(), StepError> {
        check_size("position vector", state.q.len(), self.nq())?;
        check_size("velocity vector", state.v.len(), self.nv())?;
        check_size("internal variables", state.z.len(), self.nz())
    }

    /// Refuses reference axes that do not belong to the state's positions.
    pub(crate) fn check_frames(&self, state: &State) -> Result<(), StepError> {
        match self.rods.misplaced(&state.q, &state.z[self.ndz()..]) {
            Some(edge) => Err(StepError::Frames { step: 0, place: self.row_name(self.rods.row(edge)) }),
            None => Ok(()),
        }
    }

    /// Refuses a θ of the wrong size, or with an entry that is not finite or outside its physical range.
    pub fn check_theta(&self, theta: &[f64]) -> Result<(), StepError> {
        check_size("parameter vector", theta.len(), self.n_params())?;
        for (info, &value) in self.params.infos().iter().zip(theta) {
            if !(value.is_finite() && value >= info.lower && value <= info.upper) {
                let (path, unit) = (info.path.clone(), info.unit);
                return Err(StepError::Parameter { path, value, unit, lower: info.lower, upper: info.upper });
            }
        }
        Ok(())
    }
}
