//! Newton's method for one stage.
//!
//! A full step with matrix K gives d = −K⁻¹ r(y). The *simplified* correction d̄ = −K⁻¹ r(y + α d), from the same factor,
//! decides: the step is taken if ‖d̄‖ ≤ (1 − α/4) ‖d‖ (Deuflhard 2011, natural monotonicity, in the mass norm, which a rotating
//! stiff rope does not fool), α is reduced if not. While the corrections contract quickly, d̄, made better by the steps before it
//! (secant.rs), is itself taken as the next step and no new factorization is made. The end is reached when what would be left after taking d̄, by the contraction seen, is far below the
//! tolerance, or ‖d̄‖ itself below it, and the eigenvalues of all cone variables have settled.
//!
//! Compressed in its plane, a sheet has directions in which its energy falls ever faster: K is indefinite, and Newton's step leads to a
//! saddle. There the matrix is made of what resists alone, tension and the resistance of folds, which is positive; its step leads
//! downhill. Models with forces that may buckle (and no others) also accept steps by the slope r·d at their end, for corrections may
//! well grow on the way down: one that has not turned up by more than half of what it was at the beginning will do, and one
//! that still points down as much is taken further.

mod constants;
mod fallback;
mod history;
mod secant;

pub use fallback::Attempt;
pub(crate) use fallback::solve_stage;
pub(crate) use history::History;
pub(crate) use secant::Secant;

use crate::step::constraints::ConstraintSet;
use crate::step::{Iterate, STATIC, Stage, StepError, Workspace};
use constants::NEWTON;
use pliant_linalg::System;

/// Work of a solve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Newton matrices assembled and solved with.
    pub iterations: usize,
    /// Factorizations, those at the root for a record included.
    pub factorizations: usize,
    /// Residual evaluations in chords and line searches.
    pub evaluations: usize,
    /// Stages solved by each [`Attempt`].
    pub solved_by: [usize; Attempt::ALL.len()],
}

impl Work {
    /// Sums up.
    pub fn add(&mut self, other: Self) {
        self.iterations += other.iterations;
        self.factorizations += other.factorizations;
        self.evaluations += other.evaluations;
        self.solved_by.iter_mut().zip(other.solved_by).for_each(|(sum, count)| *sum += count);
    }
}

/// Why Newton's method gave up, and how far it was.
#[derive(Clone, Debug)]
pub(crate) enum Stuck {
    /// The correction no longer shrinks, or there were too many iterations.
    NoProgress { correction: f64 },
    /// A typed error that no other start will mend.
    Error(StepError),
}

impl From<StepError> for Stuck {
    fn from(e: StepError) -> Self {
        Self::Error(e)
    }
}

/// Solves the stage from the iterate in `ws.it`, whose prescribed velocities already are the commanded ones.
pub(crate) fn newton(stage: &Stage, ws: &mut Workspace, max_iterations: usize, work: &mut Work) -> Result<(), Stuck> {
    let precision =
        if stage.options.coarse { stage.model.solver.tolerance.max(NEWTON.coarse) } else { stage.model.solver.tolerance };
    let tolerance = (precision * velocity_scale(stage, ws)).max(rounding(stage));
    let mut correction = f64::INFINITY;
    ws.newton.nonmonotone = if stage.options.damping == 0.0 { NEWTON.nonmonotone_steps } else { 0 };

    let (mut regularization, mut eased) = (stage.options.regularization, false);
    let patience =
        if by_slope(stage) && stage.options.damping == 0.0 { NEWTON.buckling_patience * max_iterations } else { max_iterations };
    for _ in 0..patience {
        let stage = &stage.with(|o| o.regularization = regularization);
        work.iterations += 1;
        work.factorizations += 1;
        if !factor(stage, ws, work)? {
            return Err(Stuck::NoProgress { correction });
        }
        correction = direction(stage, ws);
        if !correction.is_finite() {
            return Err(Stuck::NoProgress { correction });
        }
        match descend(stage, ws, correction, tolerance, work)? {
            // softened contacts have converged when they have without
            Descent::Converged if regularization > 0.0 && !stage.options.coarse => {
                eased = true;
                regularization =
                    if regularization > NEWTON.nearly_hard { regularization * NEWTON.regularization_fall } else { 0.0 }
            }
            Descent::Converged => return Ok(()),
            Descent::Continue(ratio) => regularization = fallen(regularization, ratio),
            // what is left where softened contacts have converged is rounding noise if it is small
            Descent::Soften if eased && correction <= NEWTON.noise * tolerance => return Ok(()),
            Descent::Soften => regularization = (regularization * NEWTON.regularization_rise).max(NEWTON.first_regularization),
            Descent::Stalled if correction <= NEWTON.noise * tolerance || balanced(stage, ws, correction) => return Ok(()),
            Descent::Stalled => return Err(Stuck::NoProgress { correction }),
        }
    }
    if stage.scheme != STATIC && !stage.options.coarse && regularization == 0.0 && balanced(stage, ws, correction) {
        return Ok(());
    }
    Err(Stuck::NoProgress { correction })
}

/// Linearizes at the iterate and factors; again with what resists alone, where forces may buckle and the matrix is indefinite: its
/// direction would lead uphill. False if it is singular.
fn factor(stage: &Stage, ws: &mut Workspace, work: &mut Work) -> Result<bool, Stuck> {
    if stage.options.descent {
        ws.newton.semidefinite = true;
        stage.linearize_semidefinite(ws)?;
        return Ok(ws.factor.refactor(&ws.k).is_ok());
    }
    stage.linearize_mixed(ws)?;
    let sound = ws.factor.refactor(&ws.k).is_ok();
    // (pivots of a friction's matrix may be negative for its own reasons)
    let definite = sound && (stage.has_contact() || ws.factor.all_positive());
    ws.newton.semidefinite = stage.model.buckles() && !definite;
    if !ws.newton.semidefinite {
        return Ok(sound);
    }
    stage.linearize_semidefinite(ws)?;
    work.factorizations += 1;
    Ok(ws.factor.refactor(&ws.k).is_ok())
}

/// Whether steps are judged by the slope at their end too.
fn by_slope(stage: &Stage) -> bool {
    stage.model.buckles() || stage.options.descent
}

/// A softening after a correction fell by `ratio`.
fn fallen(regularization: f64, ratio: f64) -> f64 {
    if regularization > NEWTON.least_regularization {
        regularization * ratio.clamp(NEWTON.regularization_fall, NEWTON.regularization_hold)
    } else {
        0.0
    }
}

/// How one Newton direction ended.
enum Descent {
    Converged,
    /// A step was taken, and the correction fell by this ratio.
    Continue(f64),
    /// No step was taken: contacts of colliders must be softened.
    Soften,
    Stalled,
}

/// Damped step along `ws.d`, then chords with the same matrix while they contract quickly.
fn descend(stage: &Stage, ws: &mut Workspace, norm: f64, tolerance: f64, work: &mut Work) -> Result<Descent, Stuck> {
    let (first, mut norm) = (norm, norm);
    let mut alpha: f64 = 1.0;
    // chords do without axial forces, which therefore do not follow them
    let mut behind = false;
    ws.newton.secant.clear();
    let chords = if stage.model.buckles() || stage.has_contact() { NEWTON.chords_if_dear } else { NEWTON.chords };
    let by_slope = by_slope(stage);
    let (mut slope, mut longest) = (dot(&ws.r, &ws.newton.d.v), if ws.newton.semidefinite { NEWTON.longest_step } else { 1.0 });
    loop {
        let mut next = try_step(stage, ws, alpha, work)?;
        // a damped matrix contracts slowly by design: any decrease will do
        let demanded = if stage.options.damping > 0.0 || stage.options.regularization > 0.0 { 0.0 } else { 0.25 * alpha };
        let monotone = next <= (1.0 - demanded) * norm;
        let dare = alpha == 1.0 && !behind && ws.newton.nonmonotone > 0 && next < NEWTON.nonmonotone_growth * norm;
        // where a sheet buckles a step leads downhill, whatever corrections do
        let rise = if by_slope && slope < 0.0 { dot(&ws.r, &ws.newton.d.v) / -slope } else { f64::INFINITY };
        let descent = !behind && rise < NEWTON.slope_left;
        if rise < -NEWTON.slope_left && alpha < longest && norm > tolerance {
            alpha *= 2.0;
            continue;
        }
        if next.is_finite() && (monotone || dare || descent) {
            ws.newton.nonmonotone -= usize::from(!monotone && !descent);
            accept(ws);
            if alpha == 1.0 && monotone {
                next = secant::improve(stage, ws);
            }
            if alpha != 1.0 {
                follow(stage, ws, alpha);
                return Ok(Descent::Continue(1.0));
            }
            if converged(stage, ws, next, left_after(next, norm), tolerance) {
                take_correction(ws);
                return Ok(Descent::Converged);
            }
            if chords_left(next, norm, tolerance) > chords {
                follow(stage, ws, alpha);
                return Ok(Descent::Continue(next / first));
            }
            behind = true;
            norm = next;
            slope = dot(&ws.r, &ws.newton.d.v);
        } else {
            if std::mem::take(&mut behind) {
                stay(stage, ws);
                // a chord that leads astray says nothing of the iterate: a new matrix will
                if norm > NEWTON.noise * tolerance {
                    return Ok(Descent::Continue(1.0));
                }
            }
            if norm <= tolerance {
                // rounding noise: the last correction was already below the tolerance
                return Ok(if settled(stage, ws) { Descent::Converged } else { Descent::Stalled });
            }
            if alpha == 1.0 && stage.options.regularization < NEWTON.most_regularization && ws.constraints.any_listed() {
                return Ok(Descent::Soften);
            }
            longest = 0.0;
            alpha = match next.is_finite() {
                true if rise.is_finite() => (alpha / (1.0 + rise)).clamp(0.1 * alpha, 0.5 * alpha),
                true => reduced(alpha, norm, next),
                false => 0.1 * alpha,
            };
            if alpha < NEWTON.least_damping {
                return Ok(Descent::Stalled);
            }
        }
    }
}

/// How many corrections it takes from `next` to the tolerance, if all fall as it did from `norm`.
fn chords_left(next: f64, norm: f64, tolerance: f64) -> f64 {
    // NaN where nothing falls, which is no small number
    let left = (tolerance / next).ln() / (next / norm).ln();
    if left > 0.0 && next < norm { left } else { f64::INFINITY }
}

/// Estimated error once a correction is taken that fell from `norm` to `next`: the sum of those that would follow with the same matrix. After
/// the first they fall half as fast at worst as from the step itself (Deuflhard 2011, §2.1.2).
fn left_after(next: f64, norm: f64) -> f64 {
    let ratio = 2.0 * next / norm;
    if ratio < 0.5 { next * ratio / (1.0 - ratio) } else { f64::INFINITY }
}

/// Whether the iterate with the pending correction is the root: what is `left` then far below the tolerance, or the correction itself below
/// it, velocities' or the rounding of those that stops tell, cone variables' or their rounding noise; and their eigenvalues settled.
fn converged(stage: &Stage, ws: &Workspace, norm: f64, left: f64, tolerance: f64) -> bool {
    if norm > tolerance && left > NEWTON.negligible * tolerance {
        let by_cones = multiplier_norm(stage, ws, &ws.newton.d);
        let by_velocities = (norm * norm - by_cones * by_cones).max(0.0).sqrt();
        if by_velocities > tolerance.max(velocity_rounding(stage, ws)) || by_cones > cone_rounding(stage, ws) {
            return false;
        }
    }
    settled(stage, ws)
}

/// Rounding noise of the cone variables in [`norm`] [m/s]: that of the elastic forces, a relative ε of a coordinate times the
/// largest stiffness, which a sticking contact has to balance; and that of joint friction and stops. (It moves nothing: the contact
/// holds.)
fn cone_rounding(stage: &Stage, ws: &Workspace) -> f64 {
    let farthest = ws.q_bar[..3 * stage.masses.nodes.len()].iter().fold(0.0_f64, |a, q| a.max(q.abs()));
    let nodes = stage.masses.nodes.len().max(1) as f64;
    let mass = stage.masses.nodes.iter().sum::<f64>().max(f64::MIN_POSITIVE) / nodes;
    let of_nodes = f64::EPSILON * farthest * ws.stiffness * stage.h / mass;
    let of_constraints: f64 = ws.constraints.sets().iter().map(|set| set.rounding2(stage)).sum();
    of_nodes + (of_constraints / stage.masses.total).sqrt()
}

/// Rounding of the velocities that closed joint limits determine, in the norm of corrections [m/s].
fn velocity_rounding(stage: &Stage, ws: &Workspace) -> f64 {
    let squares: f64 = ws.constraints.sets().iter().map(|set| set.velocity_rounding2(stage)).sum();
    (squares / stage.masses.total).sqrt()
}

/// Minimiser of the quadratic model of the simplified correction, kept within [0.1, 0.5] of the last factor.
fn reduced(alpha: f64, norm: f64, next: f64) -> f64 {
    let curvature = 2.0 * (next - (1.0 - alpha) * norm).abs() / (alpha * alpha);
    (norm / curvature.max(f64::MIN_POSITIVE)).clamp(0.1 * alpha, 0.5 * alpha)
}

/// Solves for the correction at the linearized iterate: `ws.r`, `ws.residuals` → `ws.newton.d`; returns its norm.
fn direction(stage: &Stage, ws: &mut Workspace) -> f64 {
    let mut d = std::mem::take(&mut ws.newton.d);
    correct(stage, ws, &mut d);
    ws.newton.d = d;
    norm(stage, ws, &ws.newton.d)
}

/// −K⁻¹ times the residuals at hand.
fn correct(stage: &Stage, ws: &Workspace, d: &mut Iterate) {
    negate_into(&ws.r, &mut d.v);
    ws.factor.solve(&mut d.v);
    stage.correct_multipliers(ws, d);
}

/// Residual at `it + alpha d` and its simplified correction into `ws.newton.d_next`; returns its norm.
fn try_step(stage: &Stage, ws: &mut Workspace, alpha: f64, work: &mut Work) -> Result<f64, Stuck> {
    work.evaluations += 1;
    let mut trial = std::mem::take(&mut ws.newton.trial);
    trial.set_step(&ws.it, alpha, &ws.newton.d);
    let result = stage.residual(&trial, ws);
    ws.newton.trial = trial;
    result?;
    let mut next = std::mem::take(&mut ws.newton.d_next);
    correct(stage, ws, &mut next);
    ws.newton.d_next = next;
    Ok(norm(stage, ws, &ws.newton.d_next))
}

/// The trial becomes the iterate, its simplified correction the next direction.
fn accept(ws: &mut Workspace) {
    std::mem::swap(&mut ws.it, &mut ws.newton.trial);
    std::mem::swap(&mut ws.newton.d, &mut ws.newton.d_next);
}

/// Takes the axial forces at the iterate as they are.
fn stay(stage: &Stage, ws: &mut Workspace) {
    let (it, mut none) = (std::mem::take(&mut ws.it), std::mem::take(&mut ws.newton.d_next));
    none.v.fill(0.0);
    stage.predict_axial(1.0, &it.v, &none.v, ws);
    (ws.it, ws.newton.d_next) = (it, none);
}

/// Takes the axial forces along the step just accepted, for the matrix that comes next.
fn follow(stage: &Stage, ws: &mut Workspace, alpha: f64) {
    let (before, d) = (std::mem::take(&mut ws.newton.trial), std::mem::take(&mut ws.newton.d_next));
    stage.predict_axial(alpha.min(1.0), &before.v, &d.v, ws);
    (ws.newton.trial, ws.newton.d_next) = (before, d);
}

fn take_correction(ws: &mut Workspace) {
    ws.it.add(&ws.newton.d);
}

/// Whether the pending correction leaves all multipliers where they are.
fn settled(stage: &Stage, ws: &Workspace) -> bool {
    let mut d = ws.newton.d.lambda.as_slice();
    let still = |(set, lambda): (&dyn ConstraintSet, &[f64])| {
        let (own, rest) = d.split_at(lambda.len());
        d = rest;
        set.settled(stage, lambda, own)
    };
    stage.options.coarse || ws.constraints.parts(&ws.it.lambda).all(still)
}

/// Σ weight v² of the bodies' degrees of freedom.
fn dofs_norm2(stage: &Stage, v: &[f64]) -> f64 {
    stage.model.weights.held.iter().zip(v).map(|(w, v)| w * v * v).sum()
}

/// Norm of a correction [m/s]: √(Σ m |d|² + Σ |dλ|²/m) over the root of the total mass.
fn norm(stage: &Stage, ws: &Workspace, d: &Iterate) -> f64 {
    speed(stage, &d.v).hypot(multiplier_norm(stage, ws, d))
}

/// The multipliers' part of [`norm`].
fn multiplier_norm(stage: &Stage, ws: &Workspace, d: &Iterate) -> f64 {
    let weights = &ws.weights[d.v.len()..];
    let squares: f64 = weights.iter().zip(&d.lambda).map(|(weight, d)| weight * d * d).sum();
    (squares / stage.masses.total).sqrt()
}

/// √(Σ m v²/Σ m) [m/s] of velocities or their change.
fn speed(stage: &Stage, v: &[f64]) -> f64 {
    let (nodes, dofs) = v.split_at(stage.masses.rows.len());
    let of_nodes = stage.masses.weights.iter().zip(nodes).map(|(m, d)| m * d * d);
    ((of_nodes.sum::<f64>() + dofs_norm2(stage, dofs)) / stage.masses.total).sqrt()
}

/// The velocity [m/s] that tolerances refer to: root mean square of the velocities at hand, and a step's fall.
fn velocity_scale(stage: &Stage, ws: &Workspace) -> f64 {
    let mean_square = |v: &[f64]| {
        let (nodes, dofs) = v.split_at(stage.masses.rows.len());
        let of_nodes =
            nodes[..3 * stage.masses.nodes.len()].iter().map(|x| x * x).sum::<f64>() / (stage.masses.nodes.len().max(1)) as f64;
        of_nodes + dofs_norm2(stage, dofs) / stage.masses.total
    };
    let fall = stage.theta[stage.model.gravity] * stage.h.min(1.0 / stage.inertia.max(f64::MIN_POSITIVE));
    // at rest the unknown is a displacement, and without weight the size of things is all there is to compare it with
    let size = if stage.scheme == STATIC { farthest(stage) } else { 0.0 };
    mean_square(stage.v_ref).max(mean_square(&ws.it.v)).sqrt() + fall.abs().max(size) + 1e-9
}

/// Uncertainty of velocities by the rounding of the nodes' positions [m/s]: stiff edges far from the origin, or a rope without
/// weight at rest, tell them no better.
fn rounding(stage: &Stage) -> f64 {
    f64::EPSILON * farthest(stage) / stage.h
}

/// Whether nodes are in balance but for the rounding of inner forces, a relative ε of coordinates and velocities times the largest stiffness
/// and viscosity: where something gives way easily, that moves it further than any tolerance allows. At rest it may move it as far as it
/// likes, in a step by little.
fn balanced(stage: &Stage, ws: &Workspace, correction: f64) -> bool {
    let n = 3 * stage.masses.nodes.len();
    let stiffest = |of: &System| (0..n).fold(0.0, |a: f64, k| a.max(-of.nodes.get(k, k)));
    let largest = ws.r[..n].iter().fold(0.0_f64, |a, r| a.max(r.abs()));
    if stage.scheme == STATIC {
        return largest <= NEWTON.roundings * f64::EPSILON * farthest(stage) * stiffest(&ws.dq);
    }
    let [stiffness, viscosity] =
        if stage.has_contact() { [ws.stiffness, ws.viscosity] } else { [stiffest(&ws.dq), stiffest(&ws.dv)] };
    let fastest = ws.it.v[..n].iter().fold(0.0_f64, |a, v| a.max(v.abs()));
    let noise = 4.0 * NEWTON.roundings * f64::EPSILON * (farthest(stage) * stiffness + fastest * viscosity);
    // (bodies have balances of their own)
    let unmoved = if stage.model.tree.nv() == 0 { NEWTON.unmoved * farthest(stage) / stage.h } else { 0.0 };
    correction <= unmoved.max(NEWTON.unresolved * velocity_scale(stage, ws)) && settled(stage, ws) && largest <= noise
}

/// Largest coordinate of a node [m].
fn farthest(stage: &Stage) -> f64 {
    stage.q_ref[..3 * stage.masses.nodes.len()].iter().fold(0.0_f64, |a, q| a.max(q.abs()))
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn negate_into(from: &[f64], to: &mut [f64]) {
    for (t, f) in to.iter_mut().zip(from) {
        *t = -f;
    }
}
