//! Static equilibrium: the configuration where all forces vanish.

mod constants;

use crate::constraints::JointRow;
use crate::memory::Past;
use crate::model::Model;
use crate::rods::RodPast;
use crate::step::newton::{Work, solve_stage};
use crate::step::{Masses, STATIC, SolverOptions, Stage, StageRecord, StepError, Workspace};
use constants::EQUILIBRIUM;
use pliant_math::{Input, State};
use std::sync::Arc;

/// A configuration at rest, with the factorization its derivatives need.
#[derive(Clone, Debug)]
pub struct Equilibrium {
    /// The model.
    pub model: Arc<Model>,
    /// The parameters.
    pub theta: Vec<f64>,
    /// Node positions \[m\], twists \[rad\], joint coordinates.
    pub q: Vec<f64>,
    /// z's part of rods there.
    pub frames: Vec<f64>,
    /// The static root: K = −∂f/∂q.
    pub record: StageRecord,
    /// Derivatives of the clamped positions: (row, input, value).
    pub placement: Vec<(usize, Input, f64)>,
    /// ∂/∂u of what motors see: (control, input, value).
    pub signals: Vec<(usize, Input, f64)>,
    /// Work done.
    pub work: Work,
}

impl Equilibrium {
    /// The state at rest there; joints and motors remember what they do as the scene begins.
    pub fn state(&self) -> State {
        let mut z = self.model.initial_memory();
        z[self.model.ndz()..].copy_from_slice(&self.frames);
        State { q: self.q.clone(), v: vec![0.0; self.model.nv()], z }
    }
}

/// Solves `f(q, v = 0; θ) = 0` for the free nodes, with prescribed grippers where `u` puts them and velocity-controlled ones
/// where `guess` has them.
///
/// Grippers that grasp hold nothing. What joints remember stays as the scene begins with; motors see commands held for ever (a target stays where it begins).
///
/// Pseudo-time continuation: `m Δq/Δτ² − f(q + Δq) = 0` with growing Δτ follows the energy downhill, so that a stable
/// equilibrium is found; the last solve is without the mass. Errors: contact (see [`StepError::EquilibriumWithContact`]), no
/// convergence, or a free rope that nothing holds (the matrix is singular).
pub fn equilibrium(model: &Arc<Model>, theta: &[f64], guess: &[f64], u: &[f64]) -> Result<Equilibrium, StepError> {
    model.check_theta(theta)?;
    crate::step::check_size("position vector", guess.len(), model.nq())?;
    crate::step::check_size("control", u.len(), model.nu())?;
    let of_pair = || Some(model.colliders[model.collider_pairs.first()?.colliders[0]].name.clone());
    if let Some(shape) = model.shape_names.first().cloned().or_else(of_pair) {
        return Err(StepError::EquilibriumWithContact { shape });
    }
    let mut frames = model.frames_at(guess);
    let placement = place_clamped(model, theta, u, [guess, &frames])?;
    let mut q = placement.0;
    model.rods.carry_frames(guess, &q, &mut frames);
    let (zero, masses, joint_rows) = (vec![0.0; model.nv()], Masses::new(model, theta), model.active_rows(theta));
    let ((signals, _), z) = (model.resting_signals(u), model.initial_memory());
    let fixed = Fixed {
        model,
        theta,
        masses: &masses,
        joint_rows: &joint_rows,
        zero: &zero,
        u: &signals,
        z: &z,
        rod_past: RodPast::default(),
    };
    let mut ws = Workspace::new(model, theta).map_err(|source| StepError::Singular { step: 0, source })?;
    let mut work = Work::default();
    let (mut tau, mut failed) = (EQUILIBRIUM.first_step, None);
    for _ in 0..EQUILIBRIUM.most_steps {
        let last = tau >= EQUILIBRIUM.last_step;
        let inertia = if last { 0.0 } else { 1.0 / (tau * tau) };
        match solve_stage(&fixed.stage([&q, &frames], inertia), &mut ws, &mut work) {
            Ok(()) => {
                fixed.displace(&mut q, &mut frames, &ws.it.v);
                if last {
                    return finish(model, &fixed, [q, frames], placement.1, ws, work);
                }
                tau *= EQUILIBRIUM.growth;
            }
            Err(e) if tau < EQUILIBRIUM.least_step => return Err(e),
            Err(e) => {
                failed = Some(e);
                tau *= EQUILIBRIUM.shrinkage;
            }
        }
    }
    // what stood in the way last says more than how often it did
    Err(failed.unwrap_or(StepError::NotConverged {
        step: 0,
        iterations: work.iterations,
        correction: f64::NAN,
        residual: f64::NAN,
        row: 0,
        place: "everywhere".to_owned(),
        term: "equilibrium".to_owned(),
    }))
}

/// Shared by all solves of an equilibrium.
struct Fixed<'a> {
    model: &'a Model,
    theta: &'a [f64],
    masses: &'a Masses,
    joint_rows: &'a [JointRow],
    zero: &'a [f64],
    u: &'a [f64],
    z: &'a [f64],
    rod_past: RodPast,
}

impl Fixed<'_> {
    fn stage<'a>(&'a self, [q, frames]: [&'a [f64]; 2], inertia: f64) -> Stage<'a> {
        Stage {
            model: self.model,
            theta: self.theta,
            masses: self.masses,
            joint_rows: self.joint_rows,
            u: self.u,
            holds: &[],
            past: Past { q: &q[self.model.n_node_dofs()..], z: self.z, elapsed: 0.0 },
            rod_past: &self.rod_past,
            scheme: STATIC,
            h: 1.0,
            inertia,
            q_ref: q,
            frames,
            v_ref: self.zero,
            v_start: self.zero,
            v_cmd: self.zero,
            options: SolverOptions::new(self.model.contact.rest_gap, true),
        }
    }

    fn displace(&self, q: &mut [f64], frames: &mut [f64], d: &[f64]) {
        let (n, before) = (self.model.n_node_dofs(), q.to_vec());
        q[..n].iter_mut().zip(&d[..n]).for_each(|(q, d)| *q += d);
        let from = q[n..].to_vec();
        self.model.tree.add(STATIC.end, &from, &d[n..], &mut q[n..]);
        self.model.rods.carry_frames(&before, q, frames);
    }
}

fn finish(
    model: &Arc<Model>,
    fixed: &Fixed,
    [q, frames]: [Vec<f64>; 2],
    placement: Vec<(usize, Input, f64)>,
    mut ws: Workspace,
    mut work: Work,
) -> Result<Equilibrium, StepError> {
    ws.it.v.fill(0.0);
    work.factorizations += 1;
    let record = StageRecord::take(&fixed.stage([&q, &frames], 0.0), &mut ws)?;
    let signals = model.resting_signals(fixed.u).1;
    Ok(Equilibrium { model: Arc::clone(model), theta: fixed.theta.to_vec(), q, frames, record, placement, signals, work })
}

/// Derivatives of clamped positions: (row of q, control or parameter, value).
pub type Placement = Vec<(usize, Input, f64)>;

/// Positions `guess` with the prescribed nodes and twists moved to where `u` puts them, and the derivatives of those targets. `frames`:
/// z's part of rods at `guess`.
pub fn place_clamped(
    model: &Model,
    theta: &[f64],
    u: &[f64],
    [guess, frames]: [&[f64]; 2],
) -> Result<(Vec<f64>, Placement), StepError> {
    let mut shift = vec![0.0; model.nv()];
    let guess_state = [guess, frames];
    let mut derivatives = Vec::new();
    for drive in model.drives.iter().filter(|d| d.is_prescribed()) {
        drive.command(guess_state, u, theta, 1.0, &mut shift).map_err(|source| StepError::Command { step: 0, source })?;
        drive.visit(guess_state, u, theta, 1.0, &mut |row, input, value| {
            if !matches!(input, Input::Q(_)) {
                derivatives.push((row, input, value));
            }
        });
    }
    let mut q = guess.to_vec();
    q[..model.n_node_dofs()].iter_mut().zip(&shift).for_each(|(q, d)| *q += d);
    Ok((q, derivatives))
}
