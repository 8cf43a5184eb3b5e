//! Where an empty gripper is to hold: the node that is worth most to hold, less the time that it takes to get there.
//!
//! ```text
//! W(a) = min_u J(u; a) + (ℓ_1 − ℓ_{N−1}) Σ_j K(a_j)
//! ```
//! J(u; a) is the cost, penalties included, of inputs u from a copy of the start in which each empty gripper j holds its node a_j at the
//! distance where it is; ℓ_k is the cost of stage k there, and K(a_j) the number of steps to come near to a_j at the highest velocities: a
//! step of delay adds ℓ_1 and drops ℓ_{N−1}. Time has no price where that difference is negative, or inputs are positions. Of a sheet the
//! nearest point is held: a Gauss–Newton step of the copy takes as long as an update there, and a horizon much shorter than a fold does not
//! see what is good for the fold.
//!
//! One plan u of the copy is kept. A step of the search takes a Gauss–Newton step from it for the present nodes, and one for others: one
//! gripper's node replaced by one that shares an element with it, in turn, until one is no better. The least W is kept, with its u. A
//! present node's own step never raises W, so from the same start W only falls: nodes do not swing back and forth.

use super::constants::PLAN;
use super::holding::motion;
use super::{PlanError, PlanOptions, Search, judge};
use crate::problem::{Problem, Terms};
use pliant_engine::grasp::{Grasp, Reach};
use pliant_engine::rollout::Rollout;
use pliant_math::{State, Vec3};
use std::time::Instant;

/// Targets of the empty grippers, and the plan of the copy in which they hold them.
#[derive(Clone, Debug, Default)]
pub struct Aim {
    /// Node that each grasping gripper is to hold; none where it holds something, or is a sheet's.
    targets: Vec<Option<usize>>,
    /// u.
    controls: Vec<Vec<f64>>,
    /// max(0, ℓ_1 − ℓ_{N−1}), what a step of delay costs.
    pub(super) time: f64,
    /// Number of the next neighbour to try.
    turn: usize,
}

impl Aim {
    /// The point that gripper `number` is to hold, at positions `q`: its node, else the nearest point.
    pub fn reach(&self, number: usize, grasp: &Grasp, q: &[f64]) -> Option<Reach> {
        self.target(number).map_or_else(|| grasp.reach(q), |node| grasp.reach_node(node, q))
    }

    /// The node that gripper `number` is to hold.
    pub fn target(&self, number: usize) -> Option<usize> {
        self.targets.get(number).copied().flatten()
    }

    /// Improves the targets about a rollout of `problem`, and returns the rollouts that this took; they are the nearest nodes at first.
    ///
    /// # Errors
    /// A problem that cannot be evaluated.
    pub fn improve(
        &mut self,
        problem: &dyn Problem,
        plan: &Rollout,
        options: PlanOptions,
        start: Instant,
    ) -> Result<usize, PlanError> {
        let (model, x0) = (&plan.model, &plan.states[0]);
        let grasps = model.grasps();
        self.targets.resize(grasps.len(), None);
        self.time = 0.0;
        for (grasp, target) in grasps.iter().zip(&mut self.targets) {
            let chooses = grasp.held(&x0.z).is_none() && grasp.corners == 2;
            *target = target.or_else(|| nearest_node(grasp, &x0.q)).filter(|_| chooses);
        }
        if self.targets.iter().all(Option::is_none) {
            self.controls.clear();
            return Ok(0);
        }
        if self.controls.len() != plan.controls.len() {
            self.controls.clone_from(&plan.controls);
            let empty = grasps.iter().filter(|grasp| grasp.held(&x0.z).is_none());
            empty.for_each(|grasp| rest(plan, grasp, &mut self.controls));
        }
        let copy = Held { problem, plan, theta: without_closing(plan), options, start };
        let first = self.controls.clone();
        // where the copy cannot be simulated, the nodes stay
        let Some((held, mut rollouts)) = copy.improved(&self.targets, &first) else { return Ok(1) };
        self.time = price_of_time(problem, &held)?;
        let mut least = copy.worth(&self.targets, &held, self.time)?;
        self.controls = held.controls;
        loop {
            let of = |(number, from): (usize, &Option<usize>)| {
                let nodes = from.map_or(Vec::new(), |from| neighbours(&grasps[number], from));
                nodes.into_iter().map(move |node| (number, node))
            };
            let all: Vec<(usize, usize)> = self.targets.iter().enumerate().flat_map(of).collect();
            let Some(&(number, node)) = all.get(self.turn % all.len().max(1)) else { return Ok(rollouts) };
            self.turn += 1;
            let mut targets = self.targets.clone();
            targets[number] = Some(node);
            let Some((held, more)) = copy.improved(&targets, &first) else { return Ok(rollouts + 1) };
            rollouts += more;
            let worth = copy.worth(&targets, &held, self.time)?;
            if worth >= least {
                return Ok(rollouts);
            }
            (least, self.targets, self.controls) = (worth, targets, held.controls);
        }
    }
}

/// A copy of the start of a plan in which empty grippers hold something.
struct Held<'a> {
    problem: &'a dyn Problem,
    plan: &'a Rollout,
    theta: Vec<f64>,
    options: PlanOptions,
    start: Instant,
}

impl Held<'_> {
    /// Its rollout with `controls`, after a Gauss–Newton step, and the rollouts that this took, a sweep of derivatives counted as one; none
    /// where it cannot be simulated.
    fn improved(&self, targets: &[Option<usize>], controls: &[Vec<f64>]) -> Option<(Rollout, usize)> {
        let model = &self.plan.model;
        let mut x0 = self.plan.states[0].clone();
        for (grasp, reach) in self.reaches(targets) {
            grasp.hold_at_distance(&reach, &mut x0.z);
        }
        let options = PlanOptions { holding: false, smoothing: None, ..self.options };
        let mut search = Search::new(self.problem, model, &self.theta, &x0, controls, options).ok()?;
        let (step, _) = search.step(options, self.start).ok()?;
        Some((search.rollout, step.rollouts + 2))
    }

    /// The empty grippers and what they are to hold.
    fn reaches(&self, targets: &[Option<usize>]) -> Vec<(&Grasp, Reach)> {
        let State { q, z, .. } = &self.plan.states[0];
        let empty = self.plan.model.grasps().iter().zip(targets).filter(|(grasp, _)| grasp.held(z).is_none());
        let reach = |grasp: &Grasp, node: &Option<usize>| node.map_or_else(|| grasp.reach(q), |node| grasp.reach_node(node, q));
        empty.filter_map(|(grasp, node)| Some((grasp, reach(grasp, node)?))).collect()
    }

    /// W.
    fn worth(&self, targets: &[Option<usize>], held: &Rollout, time: f64) -> Result<f64, PlanError> {
        let reaches = self.reaches(targets).into_iter();
        let steps = reaches.map(|(grasp, reach)| steps_to(self.problem, self.plan, grasp, &reach.point));
        // nothing is worth an endless way, but where time has no price
        let delay = if time > 0.0 { time * steps.sum::<f64>() } else { 0.0 };
        let (cost, penalty) = judge(self.problem, held, &mut Terms::default())?;
        Ok(cost + penalty + delay)
    }
}

/// The nearest node of what a gripper may seize.
fn nearest_node(grasp: &Grasp, q: &[f64]) -> Option<usize> {
    grasp.reach(q)?.weights().max_by(|a, b| a.1.total_cmp(&b.1)).map(|(node, _)| node)
}

/// The nodes that share an element with `node`.
pub(super) fn neighbours(grasp: &Grasp, node: usize) -> Vec<usize> {
    let elements = grasp.elements.iter().map(|element| &element[..grasp.corners]).filter(|element| element.contains(&node));
    let mut out: Vec<usize> = elements.flatten().copied().filter(|other| *other != node).collect();
    out.sort_unstable();
    out.dedup();
    out
}

/// θ with which what is held stays where it is from the gripper.
pub(super) fn without_closing(plan: &Rollout) -> Vec<f64> {
    let mut theta = plan.theta.clone();
    plan.model.grasps().iter().for_each(|grasp| theta[grasp.closing_time] = PLAN.never);
    theta
}

/// Whether the inputs of a gripper's motion are positions.
pub(super) fn by_position(plan: &Rollout, grasp: &Grasp) -> bool {
    plan.model.drives().iter().any(|drive| drive.name == grasp.name && drive.is_prescribed())
}

/// Inputs of a gripper at rest where it is, and closed.
pub(super) fn rest(plan: &Rollout, grasp: &Grasp, controls: &mut [Vec<f64>]) {
    let (model, q) = (&plan.model, &plan.states[0].q);
    let offset = |a: usize| model.drives().iter().find(|d| d.name == grasp.name).map_or(0.0, |d| plan.theta[d.offset + a]);
    let by_position = by_position(plan, grasp);
    for u in controls {
        for (a, input) in motion(grasp).enumerate() {
            u[input] = if by_position { q[3 * grasp.node + a] - offset(a) } else { 0.0 };
        }
        u[grasp.closing] = u[grasp.closing].max(1.0);
    }
}

/// max(0, ℓ_1 − ℓ_{N−1}): the cost of a step of delay.
fn price_of_time(problem: &dyn Problem, held: &Rollout) -> Result<f64, PlanError> {
    let n = held.controls.len();
    let mut terms = Terms::default();
    let mut stage = |k: usize| {
        terms.clear();
        problem
            .evaluate(k, n, &held.states[k], held.controls.get(k).map(Vec::as_slice), &mut terms)
            .map_err(PlanError::Problem)?;
        Ok::<f64, PlanError>(terms.cost() + terms.penalty())
    };
    if n < 2 { Ok(0.0) } else { Ok((stage(1)? - stage(n - 1)?).max(0.0)) }
}

/// K: steps in which a gripper comes to half its reach from `point`, at its highest velocities; 0 where its inputs are positions.
pub(super) fn steps_to(problem: &dyn Problem, plan: &Rollout, grasp: &Grasp, point: &Vec3<f64>) -> f64 {
    let (model, q) = (&plan.model, &plan.states[0].q);
    if by_position(plan, grasp) {
        return 0.0;
    }
    let way = point - Vec3::new(q[3 * grasp.node], q[3 * grasp.node + 1], q[3 * grasp.node + 2]);
    let outside = (1.0 - PLAN.inside * plan.theta[grasp.radius] / way.norm()).max(0.0);
    let (mut lower, mut upper) = (vec![0.0; model.nu()], vec![0.0; model.nu()]);
    problem.bounds(0, &mut lower, &mut upper);
    let axis = |(a, input): (usize, usize)| {
        let most = if way[a] > 0.0 { upper[input] } else { -lower[input] };
        if way[a] == 0.0 { 0.0 } else { outside * way[a].abs() / (most.max(0.0) * model.step_length()) }
    };
    motion(grasp).enumerate().map(axis).fold(0.0, f64::max)
}
