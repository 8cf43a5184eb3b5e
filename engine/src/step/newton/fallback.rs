//! What is tried when Newton's method fails, in this order: the warm start, from the law at frozen geometry where solids collide;
//! a longer such start; a cold start with κ taken down from a soft contact; for rods that twist
//! a walk downhill; a Levenberg-damped matrix. Halving the step is the caller's
//! last resort, and comes before the last two where solids touch: two halves take less work than those.

use crate::step::newton::{FIRST_SOFT, Stuck, Work, newton, speed, stay};
use crate::step::{STATIC, Stage, StepError, Workspace};
use pliant_scene::Law;

/// κ falls by this factor per stage of the continuation.
const KAPPA_FACTOR: f64 = 1e-2;
/// Levenberg weights as multiples of the inertia, tried in this order.
const DAMPING_LADDER: [f64; 4] = [100.0, 10.0, 3.0, 0.5];
/// Starts at frozen geometry, each where the last one led: before the first attempt, and before the second.
const FROZEN_STARTS: [usize; 2] = [2, 6];
/// Relative change of velocities after which another one is no use.
const FROZEN: f64 = 1e-3;
/// Solids that would pierce each other faster than this many steps' fall collide.
const COLLIDING: f64 = 2.0;
/// Iterations of the first attempt where solids touch: what takes more of them is found sooner by the second.
const FIRST_PATIENCE: usize = 12;
/// How much longer the second walk down the ladder may take.
const DAMPED_PATIENCE: usize = 4;

/// Solves the stage into `ws.it`; leaves the cone variables there as the next warm start.
pub(crate) fn solve_stage(stage: &Stage, ws: &mut Workspace, work: &mut Work) -> Result<(), StepError> {
    let limit = stage.model.solver.max_iterations;
    stage.find_constraints(ws);
    // the law at frozen geometry is Coulomb's
    let touching = ws.constraints.bodies.any() && stage.model.contact.law == Law::Coulomb;
    let mut stuck = if stage.has_cones() && ws.warm.is_none() {
        None
    } else {
        start_warm(stage, ws);
        if touching && ws.constraints.bodies.closing > COLLIDING * stage.h * stage.theta[stage.model.gravity].abs() {
            start_frozen(stage, ws, FROZEN_STARTS[0], work);
        } else {
            extrapolate(stage, ws);
        }
        Some(newton(stage, ws, if touching { limit.min(FIRST_PATIENCE) } else { limit }, work))
    };
    if touching && matches!(stuck, Some(Err(_))) {
        start_warm(stage, ws);
        start_frozen(stage, ws, FROZEN_STARTS[1], work);
        stuck = Some(newton(&stage.with(|o| o.soften = FIRST_SOFT), ws, limit, work));
    }
    let thorough = stage.options.thorough || !touching || stuck.is_none();
    if thorough && stage.has_contact() && !matches!(stuck, Some(Ok(()))) {
        stuck = Some(cold(stage, ws, limit, work));
    }
    if thorough && !matches!(stuck, Some(Ok(()))) && !stage.model.rods.edges.is_empty() {
        stuck = Some(downhill(stage, ws, limit, work));
    }
    if thorough && !matches!(stuck, Some(Ok(()))) {
        stuck = Some(damped(stage, ws, limit, work));
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
            for (k, _) in stage.model.driven_rows.iter().enumerate().filter(|(_, driven)| **driven) {
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
        if speed(stage, &change) <= FROZEN * speed(stage, &ws.it.v) {
            return;
        }
    }
}

/// Velocities of the last step, driven rows at their command.
fn start(stage: &Stage, ws: &mut Workspace) {
    for (k, &driven) in stage.model.driven_rows.iter().enumerate() {
        ws.it.v[k] = if driven { stage.v_cmd[k] } else { stage.v_start[k] };
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
        gap = (gap * KAPPA_FACTOR).max(stage.options.rest_gap);
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
    for patience in [1, DAMPED_PATIENCE] {
        start_cold(stage, ws);
        for weight in DAMPING_LADDER {
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
fn downhill(stage: &Stage, ws: &mut Workspace, limit: usize, work: &mut Work) -> Result<(), Stuck> {
    start_cold(stage, ws);
    match newton(&stage.with(|o| (o.downhill, o.coarse) = (true, true)), ws, DAMPED_PATIENCE * limit, work) {
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
