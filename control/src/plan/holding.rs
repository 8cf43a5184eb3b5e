//! The value of holding: what draws an empty gripper to a rope or a sheet.
//!
//! Before anything is held, the exact derivative of a cost by a gripper's motion is zero, and a smoothed grasp does not lead to it: its
//! pull is either saturated or dead. What would holding be worth? For every grasping gripper that holds nothing at x₀:
//!
//! 1. *Virtual hold.* A copy of x₀ in which it holds the node a that is worth most to it ([`Aim`]), at the distance where it is.
//! 2. *Price* of a metre: π = K(a) (ℓ_1 − ℓ_{N−1})/|p₀ − x_a|, the cost of the time to cover it. Where time has no price, what motion is
//!    worth in a hard rollout of the copy with the gripper at rest: max_k |∂J/∂v_k|/h, or of positions max_k |Σ_{j≥k} ∂J/∂p_j|.
//! 3. *Approach.* With K the first step in which it can be there (at most the last before the rollout seizes, or N), the residual
//!    √w (p_K − goal) with w = ½ π/|p_K − goal|. Of D = p_K − x_a, n is the part along which a stays the nearest point; the goal is
//!    x_a + ρ n/|n|, ρ half the reach and 8 |D − n|, but at most |n|: it comes within reach over a alone.
//! 4. *Cut.* After seizing, the derivative by the gripper's velocities before it is left out: it is that of where the gripper was when
//!    it seized, and says nothing of what holding is for.
//! 5. *Handover.* Once it holds, the term is gone and all derivatives are exact.
//!
//! The added term is named a surrogate: it belongs to the plan's model, not to its cost.

use super::PlanError;
use super::aim::{Aim, by_position, neighbours, rest, steps_to, without_closing};
use super::constants::PLAN;
use crate::problem::{Problem, Rows, Terms};
use pliant_adjoint::{TangentStepper, rollout_vjp};
use pliant_engine::grasp::{Grasp, Reach};
use pliant_engine::model::Model;
use pliant_engine::rollout::{Rollout, rollout};
use pliant_engine::step::StepOptions;
use pliant_math::{State, Vec3};
use std::sync::Arc;

/// The pull on one empty gripper.
#[derive(Clone, Debug)]
pub struct Approach {
    /// Number among the grasping grippers.
    pub grasp: usize,
    /// K.
    pub step: usize,
    /// π, the worth of being a metre nearer [1/m].
    pub price: f64,
    /// |p₀ − x_a| \[m\].
    pub distance: f64,
    model: Arc<Model>,
    /// √w.
    weight: f64,
    /// x_a + ρ n/|n|.
    goal: Vec3<f64>,
}

/// Inputs of the motion of a grasping gripper: those before its closing.
pub(super) fn motion(grasp: &Grasp) -> std::ops::Range<usize> {
    grasp.closing - 3..grasp.closing
}

impl Approach {
    /// √w (p_K − goal).
    pub(super) fn add(&self, x: &State, out: &mut Rows) {
        let node = self.model.grasps()[self.grasp].node;
        for a in 0..3 {
            let row = out.push(self.weight * (x.q[3 * node + a] - self.goal[a]));
            out.slope(row, 3 * node + a, self.weight);
        }
    }

    /// Its part of the cost, ½ |residual|².
    pub(super) fn cost(&self, rollout: &Rollout) -> f64 {
        let node = self.model.grasps()[self.grasp].node;
        let q = &rollout.states[self.step].q;
        0.5 * (0..3).map(|a| (self.weight * (q[3 * node + a] - self.goal[a])).powi(2)).sum::<f64>()
    }

    pub(super) fn holds(&self, x: &State) -> bool {
        self.model.grasps()[self.grasp].held(&x.z).is_some()
    }

    /// Leaves out the derivative by the gripper's velocities of the steps before `step`.
    pub(super) fn cut(&self, step: usize, nu: usize, tangent: &mut TangentStepper) {
        let m = tangent.seeds.columns;
        let inputs = motion(&self.model.grasps()[self.grasp]);
        let columns: Vec<usize> = (0..step).flat_map(|k| inputs.clone().map(move |c| k * nu + c)).collect();
        for block in [&mut tangent.x.q, &mut tangent.x.v, &mut tangent.x.z] {
            block.chunks_exact_mut(m).for_each(|row| columns.iter().for_each(|c| row[*c] = 0.0));
        }
    }
}

/// The approaches of all empty grippers to the points that they are to hold, about a rollout of `problem`.
///
/// # Errors
/// A virtual hold whose rollout fails.
pub fn approaches(problem: &dyn Problem, plan: &Rollout, aim: &Aim) -> Result<Vec<Approach>, PlanError> {
    let model = &plan.model;
    let mut out = Vec::new();
    for (number, grasp) in model.grasps().iter().enumerate() {
        let x0 = &plan.states[0];
        let Some(reach) = aim.reach(number, grasp, &x0.q).filter(|_| grasp.held(&x0.z).is_none()) else { continue };
        let delay = steps_to(problem, plan, grasp, &reach.point);
        let by_time = if delay > 0.0 && delay.is_finite() { aim.time * delay / reach.distance } else { 0.0 };
        let price = if by_time > 0.0 { by_time } else { worth(problem, plan, grasp, &reach)? };
        // the last state before the hard rollout seizes
        let seizes = plan.states.iter().position(|x| grasp.held(&x.z).is_some());
        let steps = plan.controls.len();
        // the saturating conversion makes an endless way one beyond the plan; without bounds it ends with the plan
        let soon = if delay > 0.0 { delay.ceil() as usize } else { steps };
        let step = seizes.map_or(steps, |k| k - 1).min(soon).max(1);
        let q = &plan.states[step].q;
        let Some(target) = aim.reach(number, grasp, q) else { continue };
        let (away, reach_of) = (target.from - target.point, plan.theta[grasp.radius]);
        let outward = outward(grasp, aim.target(number), q, away);
        let beside = (away - outward).norm();
        let height = (PLAN.inside * reach_of + PLAN.funnel * beside).min(outward.norm());
        let goal = target.point + outward.try_normalize(0.0).unwrap_or_else(Vec3::zeros) * height;
        let far = (target.from - goal).norm();
        // near to it, it is not drawn any more
        if far == 0.0 || away.norm() <= PLAN.inside * reach_of || price == 0.0 {
            continue;
        }
        out.push(Approach {
            grasp: number,
            step,
            price,
            distance: reach.distance,
            model: Arc::clone(model),
            weight: (0.5 * price / far).sqrt(),
            goal,
        });
    }
    Ok(out)
}

/// The part of `away`, from a node, along which the node stays the nearest point: its projection on the cone of the directions that make
/// no acute angle with an edge at the node.
fn outward(grasp: &Grasp, node: Option<usize>, q: &[f64], away: Vec3<f64>) -> Vec3<f64> {
    let Some(node) = node else { return away };
    let at = |node: usize| Vec3::new(q[3 * node], q[3 * node + 1], q[3 * node + 2]);
    let edges: Vec<Vec3<f64>> =
        neighbours(grasp, node).into_iter().filter_map(|other| (at(other) - at(node)).try_normalize(0.0)).collect();
    let one = |away: Vec3<f64>, edge: &Vec3<f64>| away - edge * away.dot(edge).max(0.0);
    (0..PLAN.sweeps).fold(away, |away, _| edges.iter().fold(away, one))
}

/// π: what a metre of the gripper's motion would be worth if it held the point `reach`.
fn worth(problem: &dyn Problem, plan: &Rollout, grasp: &Grasp, reach: &Reach) -> Result<f64, PlanError> {
    let model = &plan.model;
    let mut x0 = plan.states[0].clone();
    grasp.hold_at_distance(reach, &mut x0.z);
    let mut controls = plan.controls.clone();
    rest(plan, grasp, &mut controls);
    let held = rollout(model, &without_closing(plan), &x0, &controls, StepOptions::default())
        .map_err(|source| PlanError::Hold { gripper: grasp.name.clone(), source: Box::new(source) })?;
    let gradient = cost_gradient(problem, &held, grasp.node)?;
    // the derivative by a shift of the gripper from a step on: for velocities of one of them, for positions of all that follow
    let (mut shift, mut most) = (Vec3::zeros(), 0.0_f64);
    for u in gradient.iter().rev() {
        let by = Vec3::from_iterator(u[motion(grasp)].iter().copied());
        shift = if by_position(plan, grasp) { shift + by } else { by / model.step_length() };
        most = most.max(shift.norm());
    }
    Ok(most)
}

/// ∂J/∂u by one backward sweep, without the cost's own derivative by u and by where the gripper's node is: neither is what holding is for.
fn cost_gradient(problem: &dyn Problem, held: &Rollout, gripper: usize) -> Result<Vec<Vec<f64>>, PlanError> {
    let (ndx, steps) = (held.model.ndx(), held.controls.len());
    let mut x_bar = vec![vec![0.0; ndx]; steps + 1];
    let mut terms = Terms::default();
    for (k, bar) in x_bar.iter_mut().enumerate() {
        terms.clear();
        let u = held.controls.get(k).map(Vec::as_slice);
        problem.evaluate(k, steps, &held.states[k], u, &mut terms).map_err(PlanError::Problem)?;
        let r = &terms.residuals.values;
        let own = 3 * gripper..3 * gripper + 3;
        let of_squares = terms.residuals.entries.iter().map(|&(row, column, value)| (column, r[row] * value));
        let of_values = terms.values.entries.iter().map(|&(_, column, value)| (column, value));
        let outside = |&(column, _): &(usize, f64)| column < ndx && !own.contains(&column);
        of_squares.chain(of_values).filter(outside).for_each(|(column, value)| bar[column] += value);
    }
    Ok(rollout_vjp(held, &x_bar)?.u)
}
