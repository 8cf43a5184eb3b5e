//! The value of holding: what draws an empty gripper to a rope or a sheet.
//!
//! Before anything is held, the exact derivative of a cost by a gripper's motion is zero, and a smoothed grasp does not lead to it: its
//! pull is either saturated or dead. What would holding be worth? For every grasping gripper that holds nothing at x₀:
//!
//! 1. *Virtual hold.* A copy of x₀ in which it holds the nearest point x_a, at the distance where it is; one hard rollout with the
//!    gripper at rest, and its vjp, give ∂J/∂v_k.
//! 2. *Price* of a metre: π = max_k |∂J/∂v_k|/h; where inputs are positions, max_k |Σ_{j≥k} ∂J/∂p_j|.
//! 3. *Approach.* With K the last step before the rollout seizes (else N), D = p_K − x_a, d = |D| > r (half the reach), the residual
//!    √w (p_K − x_a − r D/d) with w = ½ π/(d − r).
//! 4. *Cut.* After seizing, the derivative by the gripper's velocities before it is left out: it is that of where the gripper was when
//!    it seized, and says nothing of what holding is for.
//! 5. *Handover.* Once it holds, the term is gone and all derivatives are exact.
//!
//! The added term is named a surrogate: it belongs to the plan's model, not to its cost.

use super::PlanError;
use super::constants::PLAN;
use crate::problem::{Problem, Rows, Terms};
use pliant_adjoint::{TangentStepper, rollout_vjp};
use pliant_engine::grasp::Grasp;
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
    /// x_a + r D/d.
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

/// The approaches of all empty grippers about a rollout of `problem`.
///
/// # Errors
/// A virtual hold whose rollout fails.
pub fn approaches(problem: &dyn Problem, plan: &Rollout) -> Result<Vec<Approach>, PlanError> {
    let model = &plan.model;
    let mut out = Vec::new();
    for (number, grasp) in model.grasps().iter().enumerate() {
        let x0 = &plan.states[0];
        let Some(reach) = grasp.reach(&x0.q).filter(|_| grasp.held(&x0.z).is_none()) else { continue };
        let price = worth(problem, plan, grasp)?;
        // the last state before the hard rollout seizes
        let seizes = plan.states.iter().position(|x| grasp.held(&x.z).is_some());
        let step = seizes.map_or(plan.controls.len(), |k| k - 1).max(1);
        let q = &plan.states[step].q;
        let p = Vec3::new(q[3 * grasp.node], q[3 * grasp.node + 1], q[3 * grasp.node + 2]);
        let inside = PLAN.inside * plan.theta[grasp.radius];
        let away = p - reach.point;
        let d = away.norm();
        if d <= inside || price == 0.0 {
            continue;
        }
        out.push(Approach {
            grasp: number,
            step,
            price,
            distance: reach.distance,
            model: Arc::clone(model),
            weight: (0.5 * price / (d - inside)).sqrt(),
            goal: reach.point + away * (inside / d),
        });
    }
    Ok(out)
}

/// π: what a metre of the gripper's motion would be worth if it held the nearest point.
fn worth(problem: &dyn Problem, plan: &Rollout, grasp: &Grasp) -> Result<f64, PlanError> {
    let model = &plan.model;
    let mut x0 = plan.states[0].clone();
    let Some(reach) = grasp.reach(&x0.q) else { return Ok(0.0) };
    grasp.hold_at_distance(&reach, &mut x0.z);
    // what is held stays where it is from the gripper
    let mut theta = plan.theta.clone();
    theta[grasp.closing_time] = PLAN.never;
    let (inputs, h) = (motion(grasp), model.step_length());
    let by_position = model.drives().iter().any(|drive| drive.name == grasp.name && drive.is_prescribed());
    let mut controls = plan.controls.clone();
    for u in &mut controls {
        let offset = |a: usize| model.drives().iter().find(|d| d.name == grasp.name).map_or(0.0, |d| plan.theta[d.offset + a]);
        for (a, input) in inputs.clone().enumerate() {
            u[input] = if by_position { reach.from[a] - offset(a) } else { 0.0 };
        }
        u[grasp.closing] = u[grasp.closing].max(1.0);
    }
    let held = rollout(model, &theta, &x0, &controls, StepOptions::default())
        .map_err(|source| PlanError::Hold { gripper: grasp.name.clone(), source: Box::new(source) })?;
    let gradient = cost_gradient(problem, &held, grasp.node)?;
    // the derivative by a shift of the gripper from a step on: for velocities of one of them, for positions of all that follow
    let (mut shift, mut most) = (Vec3::zeros(), 0.0_f64);
    for u in gradient.iter().rev() {
        let by = Vec3::from_iterator(u[inputs.clone()].iter().copied());
        shift = if by_position { shift + by } else { by / h };
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
        terms
            .residuals
            .entries
            .iter()
            .filter(|e| e.1 < ndx && !own.contains(&e.1))
            .for_each(|&(row, column, value)| bar[column] += r[row] * value);
    }
    Ok(rollout_vjp(held, &x_bar)?.u)
}
