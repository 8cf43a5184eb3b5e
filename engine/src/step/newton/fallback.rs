//! Starts of Newton's method, in the order in which they are tried: [`Attempt`]. Halving the step is the caller's last resort, and comes
//! before the last three where colliders touch: two halves take less work than those.

use super::constants::NEWTON;
use crate::step::newton::{Stuck, Work, newton, speed, stay};
use crate::step::{STATIC, Stage, StepError, Workspace};
use pliant_scene::Law;

/// A start of Newton's method. [`Work::solved_by`] counts the stages that each solved; docs/theory/step.md has the counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Attempt {
    /// The velocities extrapolated from the last steps and the last impulses; where colliders approach each other fast, the root of the
    /// contact law at frozen geometry.
    Warm,
    /// The root at frozen geometry, and regularized contacts of colliders.
    Regularized,
    /// A continuation in the rest gap, from soft contacts to hard ones, knowing nothing of the last impulses.
    Continuation,
    /// Of rods: down the energy by positive semidefinite matrices.
    Descent,
    /// Down a ladder of Levenberg weights.
    Levenberg,
}

impl Attempt {
    /// All, in order.
    pub const ALL: [Self; 5] = [Self::Warm, Self::Regularized, Self::Continuation, Self::Descent, Self::Levenberg];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Warm => "warm start",
            Self::Regularized => "regularized contacts",
            Self::Continuation => "continuation in the rest gap",
            Self::Descent => "energy descent",
            Self::Levenberg => "Levenberg ladder",
        }
    }

    /// Whether it is for this stage, after those before it.
    fn applies(self, stage: &Stage, touching: bool, warm: bool) -> bool {
        let thorough = stage.options.thorough || !touching || !warm;
        match self {
            Self::Warm => warm,
            Self::Regularized => touching && warm,
            Self::Continuation => thorough && stage.has_contact(),
            Self::Descent => thorough && !stage.model.rods.edges.is_empty(),
            Self::Levenberg => thorough,
        }
    }

    fn run(self, stage: &Stage, ws: &mut Workspace, touching: bool, work: &mut Work) -> Result<(), Stuck> {
        let limit = stage.model.solver.max_iterations;
        match self {
            Self::Warm => {
                start_warm(stage, ws);
                let fall = stage.h * stage.theta[stage.model.gravity].abs();
                if touching && ws.constraints.bodies.closing > NEWTON.colliding * fall {
                    start_frozen(stage, ws, NEWTON.frozen_starts[0], work);
                } else {
                    extrapolate(stage, ws);
                }
                newton(stage, ws, if touching { limit.min(NEWTON.first_patience) } else { limit }, work)
            }
            Self::Regularized => {
                start_warm(stage, ws);
                start_frozen(stage, ws, NEWTON.frozen_starts[1], work);
                newton(&stage.with(|o| o.regularization = NEWTON.first_regularization), ws, limit, work)
            }
            Self::Continuation => cold(stage, ws, limit, work),
            Self::Descent => descent(stage, ws, limit, work),
            Self::Levenberg => damped(stage, ws, limit, work),
        }
    }
}

/// Solves the stage into `ws.it`; leaves the cone variables there as the next warm start.
pub(crate) fn solve_stage(stage: &Stage, ws: &mut Workspace, work: &mut Work) -> Result<(), StepError> {
    stage.find_constraints(ws);
    // the law at frozen geometry is Coulomb's
    let touching = ws.constraints.bodies.any() && stage.model.contact.law == Law::Coulomb;
    let warm = ws.warm.is_some() || !stage.has_cones();
    let mut stuck = None;
    for attempt in Attempt::ALL {
        if attempt.applies(stage, touching, warm) {
            stuck = Some(attempt.run(stage, ws, touching, work));
            if matches!(stuck, Some(Ok(()))) {
                work.solved_by[attempt as usize] += 1;
                work.left = work.left.max(ws.newton.left);
                break;
            }
        }
    }
    match stuck {
        Some(Ok(())) => {
            let (n, warm) = (stage.model.n_node_dofs(), ws.warm.get_or_insert_default());
            warm.nodes.push(stage.inertia, &stage.v_ref[..n], &ws.it.v[..n], &stage.masses.weights);
            warm.history.push(stage.inertia, &stage.v_ref[n..], &ws.it.v[n..], &stage.model.weights.held);
            warm.impulses.listed.clear();
            ws.constraints.parts(&ws.it.lambda).for_each(|(set, own)| set.keep(own, &mut warm.impulses));
            warm.impulses.listed.sort_unstable_by_key(|(id, _)| *id);
            Ok(())
        }
        Some(Err(Stuck::Error(e))) => Err(e),
        Some(Err(Stuck::NoProgress { correction })) => Err(explain(stage, ws, correction, work)),
        None => Err(explain(stage, ws, f64::NAN, work)),
    }
}

/// Velocities and impulses of the last step.
fn start_warm(stage: &Stage, ws: &mut Workspace) {
    start(stage, ws);
    let warm = ws.warm.as_ref().map(|warm| &warm.impulses);
    ws.constraints.for_parts(&mut ws.it.lambda, |set, own| set.start(stage, warm, own));
}

/// Velocities of the last step, and multipliers that do not know its.
fn start_cold(stage: &Stage, ws: &mut Workspace) {
    start(stage, ws);
    let warm = ws.warm.as_ref().map(|warm| &warm.impulses);
    ws.constraints.for_parts(&mut ws.it.lambda, |set, own| set.start_cold(stage, warm, own));
}

/// The velocities of the last step, changed as their accelerations up to now let expect.
fn extrapolate(stage: &Stage, ws: &mut Workspace) {
    if let Some(warm) = ws.warm.as_ref().filter(|_| stage.scheme != STATIC) {
        let (nodes, bodies) = ws.it.v.split_at_mut(stage.model.n_node_dofs());
        // without momentum a step's velocities begin at none
        if stage.scheme.momentum != 0.0 {
            warm.nodes.extrapolate(1.0 / stage.inertia, nodes);
            for (k, _) in stage.model.prescribed_rows.iter().enumerate().filter(|(_, prescribed)| **prescribed) {
                nodes[k] = stage.v_cmd[k];
            }
        }
        warm.history.extrapolate(1.0 / stage.inertia, bodies);
    }
}

/// From there to the root of the law at frozen geometry, as often as given, or until it moves little.
fn start_frozen(stage: &Stage, ws: &mut Workspace, times: usize, work: &mut Work) {
    for _ in 0..times {
        work.factorizations += 1;
        if !stage.solve_frozen(ws) {
            return;
        }
        let change: Vec<f64> = ws.it.v.iter().zip(&ws.newton.trial.v).map(|(v, before)| v - before).collect();
        if speed(stage, &change) <= NEWTON.frozen_change * speed(stage, &ws.it.v) {
            return;
        }
    }
}

/// Velocities of the last step, prescribed rows at their command.
fn start(stage: &Stage, ws: &mut Workspace) {
    for (k, &prescribed) in stage.model.prescribed_rows.iter().enumerate() {
        ws.it.v[k] = if prescribed { stage.v_cmd[k] } else { stage.v_start[k] };
    }
    let n = stage.model.n_node_dofs();
    ws.it.v[n..].copy_from_slice(&stage.v_start[n..]);
    if stage.scheme != STATIC {
        stage.start_axial(ws);
    } else {
        // at rest nothing but the axial forces may hold a node sideways
        stay(stage, ws);
    }
}

fn cold(stage: &Stage, ws: &mut Workspace, limit: usize, work: &mut Work) -> Result<(), Stuck> {
    start(stage, ws);
    let g = stage.theta[stage.model.gravity];
    let nodes = &stage.v_ref[..3 * stage.masses.nodes.len()];
    let fastest = nodes.iter().fold((g * stage.h).max(ws.constraints.bodies.fastest), |a, v| a.max(v.abs()));
    // a contact this soft turns a node of that speed round within the step
    let mut gap = (fastest * fastest / g.max(1e-3)).max(stage.options.rest_gap);
    let soft = stage.with(|o| o.rest_gap = gap);
    ws.constraints.for_parts(&mut ws.it.lambda, |set, own| set.start_soft(&soft, own));
    loop {
        let coarse = stage.lists_constraints() && gap > stage.options.rest_gap;
        newton(&stage.with(|o| (o.rest_gap, o.coarse) = (gap, coarse)), ws, limit, work)?;
        if gap <= stage.options.rest_gap {
            return Ok(());
        }
        gap = (gap * NEWTON.continuation_fall).max(stage.options.rest_gap);
        if coarse && gap < 2.0 * stage.options.rest_gap {
            // what is only passed through is not precise, so the last one must not be missed by rounding
            gap = stage.options.rest_gap;
        }
    }
}

/// Down a ladder of Levenberg weights, each continuing where the last one stopped: the damped matrix brings the iterate near,
/// the true one finishes. A second, longer walk follows if the first fails.
fn damped(stage: &Stage, ws: &mut Workspace, limit: usize, work: &mut Work) -> Result<(), Stuck> {
    let mut last = Stuck::NoProgress { correction: f64::NAN };
    for patience in [1, NEWTON.damped_patience] {
        start_cold(stage, ws);
        for weight in NEWTON.damping_ladder {
            let stiff = stage.with(|o| o.damping = weight * stage.inertia.max(1.0));
            match newton(&stiff, ws, patience * limit, work) {
                Ok(()) | Err(Stuck::NoProgress { .. }) => {}
                Err(e) => return Err(e),
            }
        }
        match newton(stage, ws, limit, work) {
            Ok(()) => return Ok(()),
            Err(e) => last = e,
        }
    }
    Err(last)
}

/// Down the energy by matrices of what resists alone, as far as that leads quickly; the true one finishes.
fn descent(stage: &Stage, ws: &mut Workspace, limit: usize, work: &mut Work) -> Result<(), Stuck> {
    start_cold(stage, ws);
    match newton(&stage.with(|o| (o.descent, o.coarse) = (true, true)), ws, NEWTON.damped_patience * limit, work) {
        Ok(()) | Err(Stuck::NoProgress { .. }) => {}
        Err(e) => return Err(e),
    }
    newton(stage, ws, limit, work)
}

/// The error of a stage that did not converge, naming the number, the row and the term. Iterates that left the range where terms are defined
/// are a failure of the search, unless nothing is defined where the stage begins: then the state or a parameter is.
fn explain(stage: &Stage, ws: &mut Workspace, correction: f64, work: &Work) -> StepError {
    if let Some(k) = stage.q_ref.iter().chain(stage.v_ref).position(|x| !x.is_finite()) {
        let place = match k.checked_sub(stage.q_ref.len()) {
            None => stage.model.coordinate_name(k),
            Some(row) => stage.model.row_name(row),
        };
        return StepError::NotFinite { step: 0, term: "state".to_owned(), place, value: f64::NAN };
    }
    let mut found = blame(stage, ws);
    if let Ok(Blame { broken: Some(_), .. }) = found {
        ws.it.v.fill(0.0);
        found = blame(stage, ws);
    }
    match found {
        Err(e) => e,
        Ok(Blame { broken: Some((term, row, value)), .. }) => {
            StepError::NotFinite { step: 0, term, place: stage.model.row_name(row), value }
        }
        Ok(Blame { row, term, residual, .. }) => {
            let place = stage.model.row_name(row);
            StepError::NotConverged { step: 0, iterations: work.iterations, correction, residual, row, place, term }
        }
    }
}

/// The row of the largest residual at the iterate, what is largest in it, and a term that is not finite, if there is one.
struct Blame {
    row: usize,
    residual: f64,
    term: String,
    broken: Option<(String, usize, f64)>,
}

fn blame(stage: &Stage, ws: &mut Workspace) -> Result<Blame, StepError> {
    let it = ws.it.clone();
    stage.residual(&it, ws)?;
    let row = (0..ws.r.len()).max_by(|&a, &b| ws.r[a].abs().total_cmp(&ws.r[b].abs())).unwrap_or(0);
    let residual = ws.r[row].abs();
    let (term, broken) = stage.blame(&it, row, ws);
    Ok(Blame { row, residual, term, broken })
}
