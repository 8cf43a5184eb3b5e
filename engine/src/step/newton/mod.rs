//! Newton's method for one stage.
//!
//! A full step with matrix K gives d = −K⁻¹ r(y). The *simplified* correction d̄ = −K⁻¹ r(y + α d), from the same factor,
//! decides: the step is taken if ‖d̄‖ ≤ (1 − α/4) ‖d‖ (Deuflhard 2011, natural monotonicity, in the mass norm, which a rotating
//! stiff rope does not fool), α is reduced if not. While the corrections contract quickly, d̄, made better by the steps before it
//! (secant.rs), is itself taken as the next step and no new factorization is made. The end is reached when what would be left after
//! taking d̄, by the contraction seen, is far below the tolerance, or where the residual is rounding and d̄ small or no longer falling.
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

use crate::bodies::JointKind;
use crate::model::Model;
use crate::step::constraints::ConstraintSet;
use crate::step::{Iterate, STATIC, Stage, StepError, Workspace};
use constants::NEWTON;

/// Work of a solve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Work {
    /// Newton matrices assembled and solved with.
    pub iterations: usize,
    /// Factorizations, those at the root for a record included.
    pub factorizations: usize,
    /// Residual evaluations in chords and line searches.
    pub evaluations: usize,
    /// Stages solved by each [`Attempt`].
    pub solved_by: [usize; Attempt::ALL.len()],
    /// Largest correction \[m/s\] that was left where the residual was rounding before corrections were below the tolerance; zero if none.
    pub left: f64,
}

impl Work {
    /// Sums up.
    pub fn add(&mut self, other: Self) {
        self.iterations += other.iterations;
        self.factorizations += other.factorizations;
        self.evaluations += other.evaluations;
        self.solved_by.iter_mut().zip(other.solved_by).for_each(|(sum, count)| *sum += count);
        self.left = self.left.max(other.left);
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
    let scale = velocity_scale(stage, ws);
    let tolerance = precision * scale;
    let near = NEWTON.near * (scale + farthest(stage.model, stage.q_ref) / (stage.h * stage.scheme.free.a1));
    let mut correction = f64::INFINITY;
    ws.newton.nonmonotone = if stage.options.damping == 0.0 { NEWTON.nonmonotone_steps } else { 0 };

    let (mut regularization, mut eased) = (stage.options.regularization, false);
    let patience =
        if by_slope(stage) && stage.options.damping == 0.0 { NEWTON.buckling_patience * max_iterations } else { max_iterations };
    for _ in 0..patience {
        let stage = &stage.with(|o| o.regularization = regularization);
        work.iterations += 1;
        work.factorizations += 1;
        ws.newton.left = 0.0;
        if !factor(stage, ws, work)? {
            return Err(Stuck::NoProgress { correction });
        }
        correction = direction(stage, ws);
        if !correction.is_finite() {
            return Err(Stuck::NoProgress { correction });
        }
        match descend(stage, ws, correction, [tolerance, near], work)? {
            // softened contacts have converged when they have without
            Descent::Converged if regularization > 0.0 && !stage.options.coarse => {
                eased = true;
                regularization =
                    if regularization > NEWTON.nearly_hard { regularization * NEWTON.regularization_fall } else { 0.0 }
            }
            Descent::Converged => return Ok(()),
            Descent::Continue(ratio) => regularization = fallen(regularization, ratio),
            // softened contacts have converged, and what is left is rounding
            Descent::Soften if eased && correction <= near && still_at_rounding(stage, ws)? => {
                ws.newton.left = correction;
                return Ok(());
            }
            Descent::Soften => regularization = (regularization * NEWTON.regularization_rise).max(NEWTON.first_regularization),
            Descent::Stalled if correction <= near && still_at_rounding(stage, ws)? => {
                ws.newton.left = correction;
                return Ok(());
            }
            Descent::Stalled => return Err(Stuck::NoProgress { correction }),
        }
    }
    if regularization == 0.0 && correction <= near && still_at_rounding(stage, ws)? {
        ws.newton.left = correction;
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

/// Damped step along `ws.d`, then chords with the same matrix while they contract quickly, to a correction below `tolerance`, or to a
/// residual of rounding that corrects by no more than `near`.
fn descend(stage: &Stage, ws: &mut Workspace, norm: f64, [tolerance, near]: [f64; 2], work: &mut Work) -> Result<Descent, Stuck> {
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
        // a chord that no longer falls may want a new matrix, which a correction that small is not worth
        let near = if behind { NEWTON.near_by_chords * near } else { near };
        let ended = next <= tolerance || (next > NEWTON.still_falls * norm && next <= near);
        if alpha == 1.0 && ended && left_after(next, norm) > NEWTON.negligible * tolerance && at_rounding(stage, ws) {
            ws.newton.left = next;
            // from a start that was as good, by a matrix that lacks the tension of the root, the step leads away from it; at rest it has it
            if next < norm || stage.scheme == STATIC {
                accept(ws);
                take_correction(ws);
            }
            return Ok(Descent::Converged);
        }
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
            let left = if stage.options.coarse { next } else { left_after(next, norm) / NEWTON.negligible };
            if left <= tolerance {
                take_correction(ws);
                return Ok(Descent::Converged);
            }
            if chords_left(next, norm, NEWTON.negligible * tolerance) > chords {
                follow(stage, ws, alpha);
                return Ok(Descent::Continue(next / first));
            }
            behind = true;
            norm = next;
            slope = dot(&ws.r, &ws.newton.d.v);
        } else {
            if std::mem::take(&mut behind) {
                // a chord that leads astray says nothing of the iterate: a new matrix will
                stay(stage, ws);
                return Ok(Descent::Continue(1.0));
            }
            if norm <= tolerance {
                return Ok(Descent::Converged);
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
/// the first they fall half as fast at worst as from the step itself (Deuflhard 2011, §2.1.2). The rounding of that step stays: one of
/// 1e14 m/s, by a matrix that is all but singular, leaves nothing right, however much smaller the next is.
fn left_after(next: f64, norm: f64) -> f64 {
    let ratio = 2.0 * next / norm;
    if ratio < 0.5 { next * ratio / (1.0 - ratio) + f64::EPSILON * norm } else { f64::INFINITY }
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
    let size = if stage.scheme == STATIC { farthest(stage.model, stage.q_ref) } else { 0.0 };
    mean_square(stage.v_ref).max(mean_square(&ws.it.v)).sqrt() + fall.abs().max(size) + 1e-9
}

/// Largest coordinate of a node, and of a joint that slides [m].
fn farthest(model: &Model, q: &[f64]) -> f64 {
    let (n, nodes) = (model.n_node_dofs(), &q[..3 * model.n_nodes()]);
    let joints = model.tree.joints().iter().filter(|joint| joint.kind == JointKind::Prismatic);
    joints.fold(nodes.iter().fold(0.0, |far: f64, q| far.max(q.abs())), |far, joint| far.max(q[n + joint.q].abs()))
}

/// Whether the residual at hand is no larger than what the rounding of velocities and coordinates makes of it,
/// ```text
/// |r_i| ≤ 2 ε Σ_j |K_ij| (|v_j| + |v_j at the start| + |q_j|/(h a₁))
/// ```
/// in every row, to which what the laws of contacts and closures round is added, and likewise in the rows of the constraints: then this is the root for a state that differs in the last digit, and nothing better
/// can be told (a componentwise backward error: Oettli & Prager 1964). To an angle 1 rad is added, and a displacement counts as
/// the largest coordinate there is, for either may be the difference of two such. It says nothing far from the root, where K may be large for
/// reasons of its own: the fold of a rod.
fn at_rounding(stage: &Stage, ws: &mut Workspace) -> bool {
    // a change of coordinates is one of velocities over this time
    let time = stage.h * stage.scheme.free.a1;
    let (far, n_nodes, n) = (farthest(stage.model, stage.q_ref), 3 * stage.masses.nodes.len(), stage.model.n_node_dofs());
    let size = &mut ws.newton.size;
    size.clear();
    size.extend(ws.it.v.iter().zip(stage.v_ref).map(|(v, start)| v.abs() + start.abs()));
    size[..n_nodes].iter_mut().for_each(|size| *size += far / time);
    size[n_nodes..n].iter_mut().zip(&stage.q_ref[n_nodes..n]).for_each(|(size, angle)| *size += (1.0 + angle.abs()) / time);
    for joint in stage.model.tree.joints() {
        let coordinate = match joint.kind {
            JointKind::Prismatic => far,
            JointKind::Revolute => 1.0 + stage.q_ref[n + joint.q].abs(),
            JointKind::Ball => 1.0,
        };
        let dofs = n + joint.v..n + joint.v + joint.kind.n_dofs();
        size[dofs].iter_mut().for_each(|size| *size += coordinate / time);
    }
    let unit = NEWTON.rounding * f64::EPSILON;
    let speed = ws.newton.size.iter().fold(0.0, |a: f64, v| a.max(*v));
    // in K the levers of contacts on both sides of a body cancel, but not what their laws round
    let of_links = &mut ws.newton.of_links;
    of_links.clear();
    of_links.resize(ws.r.len(), 0.0);
    for (set, lambda) in ws.constraints.parts(&ws.it.lambda) {
        for (link, w) in set.links().iter().zip(lambda.chunks_exact(4)) {
            link.add_rounding(stage, &ws.bodies.frames, w, [unit, speed], of_links);
        }
    }
    let (size, of_links) = (&ws.newton.size, &ws.newton.of_links);
    // the three rows of a node are judged together: what is small in one may be the difference of what is large in others
    let negligible = |row: usize, rows: &[f64]| {
        let largest = rows.iter().fold(0.0_f64, |a, r| a.max(r.abs()));
        let may = |row: usize| unit * ws.k.row_magnitude(row, size) + of_links[row];
        largest <= (row..row + rows.len()).map(may).fold(0.0, f64::max)
    };
    let (nodes, others) = ws.r.split_at(n_nodes);
    let balanced = nodes.chunks_exact(3).enumerate().all(|(node, rows)| negligible(3 * node, rows))
        && others.iter().enumerate().all(|(k, r)| negligible(n_nodes + k, std::slice::from_ref(r)));
    let mut residuals = ws.residuals.as_slice();
    let satisfied = |(set, lambda): (&dyn ConstraintSet, &[f64])| {
        let (own, rest) = residuals.split_at(lambda.len());
        residuals = rest;
        set.at_rounding(stage, lambda, own, unit, speed)
    };
    balanced && ws.constraints.parts(&ws.it.lambda).all(satisfied)
}

/// Energy \[J\] of nodes and twists by which the rounding of their coordinates may change a (sub)step of length `h` from `q_ref`: that of the
/// forces, and of velocities, over displacements of that size.
pub(crate) fn rounding_energy(model: &Model, q_ref: &[f64], h: f64, ws: &mut Workspace) -> f64 {
    let n = model.n_node_dofs();
    let size = &mut ws.newton.size;
    size.clear();
    size.resize(model.nv(), 1.0);
    size[..3 * model.n_nodes()].fill(farthest(model, q_ref));
    let rows = (0..n).map(|row| ws.newton.size[row] * ws.k.row_magnitude(row, &ws.newton.size));
    rows.sum::<f64>() / h * (NEWTON.rounding * f64::EPSILON).powi(2)
}

/// [`at_rounding`] at the iterate, whose residual is evaluated again.
fn still_at_rounding(stage: &Stage, ws: &mut Workspace) -> Result<bool, Stuck> {
    let it = std::mem::take(&mut ws.it);
    let result = stage.residual(&it, ws);
    ws.it = it;
    result?;
    Ok(at_rounding(stage, ws))
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn negate_into(from: &[f64], to: &mut [f64]) {
    for (t, f) in to.iter_mut().zip(from) {
        *t = -f;
    }
}
