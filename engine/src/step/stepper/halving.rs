//! Halving: a (sub)step that fails, creates energy or throws back what hits a shape is replaced.

use super::{StageKind, StepTrace, Stepper};
use crate::step::constants::STEP;
use crate::step::node_energy_check::SubstepResult;
use crate::step::{StageRecord, StepError};
use pliant_math::State;

/// Why a (sub)step was halved or taken by Euler.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Retry {
    /// No root was found, or none is defined.
    NotSolved,
    /// It created energy.
    Energy,
    /// By sdirk2, it would have thrown back what hits a shape.
    Rebound,
}

impl Retry {
    /// All reasons.
    pub const ALL: [Self; 3] = [Self::NotSolved, Self::Energy, Self::Rebound];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::NotSolved => "not solved",
            Self::Energy => "energy created",
            Self::Rebound => "rebound",
        }
    }
}

/// Policy of a (sub)step.
#[derive(Clone, Copy, Debug)]
pub(super) struct SubstepPolicy {
    /// How often it may be halved; where it may not, all starts of Newton's method are tried.
    pub halvings: usize,
    /// Whether sdirk2 is left for Euler, by which contact is not thrown back.
    pub by_euler: bool,
}

/// How a (sub)step ended.
#[derive(Clone, Copy, Debug)]
pub(super) enum Outcome {
    Sound,
    /// It created energy.
    Refused,
    /// It would throw back what hits a shape.
    Thrown,
}

impl Stepper<'_> {
    /// One (sub)step of length `h`, or two of half the length if it fails, creates energy, or throws back what hits a shape. After
    /// 4 max_iterations · 2^max_halvings iterations in all, steps are accepted unchecked, or fail.
    pub(super) fn substep(
        &mut self,
        state: &mut State,
        h: f64,
        v_cmd: &[f64],
        policy: SubstepPolicy,
        trace: &mut StepTrace,
        stages: &mut Vec<(StageKind, StageRecord)>,
    ) -> Result<(), StepError> {
        let policy = SubstepPolicy { halvings: if self.spent(trace) { 0 } else { policy.halvings }, ..policy };
        let (before, kept, warm, created_before) = (state.clone(), stages.len(), self.ws.warm.clone(), trace.energy_created);
        let mut result = self.integrate(state, h, v_cmd, policy, trace, stages);
        let guarded = policy.halvings > 0;
        let passed = SubstepResult { before: &before, after: state, h, by_euler: policy.by_euler };
        if matches!(result, Ok(Outcome::Sound))
            && let Some(created) = self.created_by_nodes(&passed, !guarded)
        {
            if guarded && self.is_too_much(&created, h) {
                result = Ok(Outcome::Refused);
            } else {
                trace.energy_created += created.energy.max(0.0);
            }
            if !guarded {
                trace.last_halves.add(created);
            }
        }
        let thrown = matches!(result, Ok(Outcome::Thrown));
        match result {
            Ok(Outcome::Thrown | Outcome::Refused)
            | Err(
                StepError::NotConverged { .. }
                | StepError::Singular { .. }
                | StepError::Geometry { .. }
                | StepError::NoNormal { .. }
                | StepError::ContactNotFinite { .. }
                | StepError::NotFinite { .. },
            ) if thrown || policy.halvings > 0 => {
                *state = before;
                stages.truncate(kept);
                trace.energy_created = created_before;
                self.set_warm_start(warm);
                trace.retries += 1;
                let reason = match result {
                    Ok(Outcome::Thrown) => Retry::Rebound,
                    Ok(_) => Retry::Energy,
                    Err(_) => Retry::NotSolved,
                };
                trace.retried_for[reason as usize] += 1;
                let by_euler = policy.by_euler || thrown;
                let Some(halvings) = policy.halvings.checked_sub(1) else {
                    return self.substep(state, h, v_cmd, SubstepPolicy { by_euler, ..policy }, trace, stages);
                };
                self.substep(state, 0.5 * h, v_cmd, SubstepPolicy { halvings, by_euler }, trace, stages)?;
                self.substep(state, 0.5 * h, v_cmd, SubstepPolicy { halvings, by_euler }, trace, stages)
            }
            other => other.map(|_| ()),
        }
    }

    /// Whether a step has taken so much work that more halves will not be better.
    fn spent(&self, trace: &StepTrace) -> bool {
        let solver = &self.model.solver;
        let shortest = 1 << solver.max_halvings.min(STEP.most_counted);
        trace.work.iterations > solver.max_iterations.saturating_mul(STEP.attempts * shortest)
    }
}
