//! Static equilibrium: the configuration where all forces vanish.

use crate::kinematics::Input;
use crate::model::Model;
use crate::newton::{Work, solve_stage};
use crate::step::{STATIC, Stage, StageRecord, StepError, Workspace};
use std::sync::Arc;

/// First pseudo-time step [s]; it grows while Newton's method follows and ends at infinity.
const FIRST_STEP: f64 = 0.02;
const GROWTH: f64 = 3.0;
const LAST_STEP: f64 = 1e4;
const MAX_STEPS: usize = 400;

/// A configuration at rest, with the factorization its derivatives need.
#[derive(Clone, Debug)]
pub struct Equilibrium {
    /// The model.
    pub model: Arc<Model>,
    /// The parameters.
    pub theta: Vec<f64>,
    /// Node positions \[m\].
    pub q: Vec<f64>,
    /// The static root: K = −∂f/∂q.
    pub record: StageRecord,
    /// Derivatives of the clamped positions: (row, input, value).
    pub placement: Vec<(usize, Input, f64)>,
    /// Work done.
    pub work: Work,
}

/// Solves `f(q, v = 0; θ) = 0` for the free nodes, with prescribed grippers where `u` puts them and velocity-controlled ones
/// where `guess` has them.
///
/// Pseudo-time continuation: `m Δq/Δτ² − f(q + Δq) = 0` with growing Δτ follows the energy downhill, so that a stable
/// equilibrium is found; the last solve is without the mass. Errors: contact (see [`StepError::EquilibriumWithContact`]), no
/// convergence, or a free rope that nothing holds (the matrix is singular).
pub fn equilibrium(model: &Arc<Model>, theta: &[f64], guess: &[f64], u: &[f64]) -> Result<Equilibrium, StepError> {
    model.check_theta(theta)?;
    crate::step::check_size("position vector", guess.len(), model.nq())?;
    crate::step::check_size("control", u.len(), model.nu())?;
    if let Some(shape) = model.shape_names.first() {
        return Err(StepError::EquilibriumWithContact { shape: shape.clone() });
    }
    let placement = place_clamped(model, theta, u, guess)?;
    let mut q = placement.0;
    let mass = model.masses(theta);
    let zero = vec![0.0; model.nq()];
    let mut ws = Workspace::new(model, theta).map_err(|source| StepError::Singular { step: 0, source })?;
    let mut work = Work::default();
    let mut tau = FIRST_STEP;
    for _ in 0..MAX_STEPS {
        let last = tau >= LAST_STEP;
        let inertia = if last { 0.0 } else { 1.0 / (tau * tau) };
        match solve(model, theta, &mass, &zero, &q, inertia, &mut ws, &mut work) {
            Ok(()) => {
                q.iter_mut().zip(&ws.it.v).for_each(|(q, d)| *q += d);
                if last {
                    return finish(model, theta, &mass, &zero, q, placement.1, ws, work);
                }
                tau *= GROWTH;
            }
            Err(e) if tau < 1e-4 => return Err(e),
            Err(_) => tau *= 0.1,
        }
    }
    Err(StepError::NotConverged {
        step: 0,
        iterations: work.iterations,
        correction: f64::NAN,
        residual: f64::NAN,
        row: 0,
        term: "equilibrium".to_owned(),
    })
}

#[allow(clippy::too_many_arguments)] // the parts of one stage
fn stage<'a>(model: &'a Model, theta: &'a [f64], mass: &'a [f64], zero: &'a [f64], q: &'a [f64], inertia: f64) -> Stage<'a> {
    Stage {
        model,
        theta,
        mass,
        scheme: STATIC,
        h: 1.0,
        inertia,
        q_ref: q,
        v_ref: zero,
        v_cmd: zero,
        rest_gap: model.contact.rest_gap,
        damping: 0.0,
    }
}

#[allow(clippy::too_many_arguments)]
fn solve(
    model: &Model,
    theta: &[f64],
    mass: &[f64],
    zero: &[f64],
    q: &[f64],
    inertia: f64,
    ws: &mut Workspace,
    work: &mut Work,
) -> Result<(), StepError> {
    solve_stage(&stage(model, theta, mass, zero, q, inertia), ws, work)
}

#[allow(clippy::too_many_arguments)]
fn finish(
    model: &Arc<Model>,
    theta: &[f64],
    mass: &[f64],
    zero: &[f64],
    q: Vec<f64>,
    placement: Vec<(usize, Input, f64)>,
    mut ws: Workspace,
    mut work: Work,
) -> Result<Equilibrium, StepError> {
    ws.it.v.fill(0.0);
    work.factorizations += 1;
    let record = StageRecord::take(&stage(model, theta, mass, zero, &q, 0.0), &mut ws)?;
    Ok(Equilibrium { model: Arc::clone(model), theta: theta.to_vec(), q, record, placement, work })
}

/// Derivatives of clamped positions: (row of q, control or parameter, value).
pub type Placement = Vec<(usize, Input, f64)>;

/// Positions `guess` with the prescribed nodes moved to where `u` puts them, and the derivatives of those targets.
pub fn place_clamped(model: &Model, theta: &[f64], u: &[f64], guess: &[f64]) -> Result<(Vec<f64>, Placement), StepError> {
    let mut shift = vec![0.0; model.nq()];
    let mut derivatives = Vec::new();
    for drive in model.drives.iter().filter(|d| d.is_prescribed()) {
        drive.command(guess, u, theta, 1.0, &mut shift).map_err(|source| StepError::Command { step: 0, source })?;
        drive.visit(guess, u, theta, 1.0, &mut |row, input, value| {
            if !matches!(input, Input::Q(_)) {
                derivatives.push((row, input, value));
            }
        });
    }
    Ok((guess.iter().zip(&shift).map(|(q, d)| q + d).collect(), derivatives))
}
