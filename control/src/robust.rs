//! Robust model predictive control: the nominal controller with its constraints tightened by the tube about its plan.
//!
//! ```text
//! update(x)   Gauss–Newton step on the nominal plan, constraints c + h ≤ 0 and bounds moved in by h_u      h of the last tube
//!             A_k, B_k and the constraints' rows about the new plan → tube → h, h_u                        (crate::tube)
//! ```
//! The tube is that of the linearization along the plan, for a disturbance E w, |w|₂ ≤ 1, of every step. Where the state is estimated
//! ([`crate::output`]) it begins at the time of the last reading, whose estimate has an error E_0 w, with the steps since, whose inputs are
//! sent; the plan's inputs answer estimates. It does not cover the error of the linearization, nor a gripper that seizes or lets go within the
//! plan ([`RobustUpdate::switches`]): there the linearization says nothing of the other side.

use crate::mpc::{Mpc, Update};
use crate::observer::{ObserverError, OutputFeedbackTube, Sensing, Sharing};
use crate::ocp::{Ocp, Rows, Stage};
use crate::plan::{PlanError, PlanOptions, Violation};
use crate::problem::{Problem, Terms};
use crate::sensing::{Estimate, SensingError, Sensors};
use crate::tube::{
    Constraint, Disturbance, ExactTube, RowValues, SharedGainTube, Tube, TubeCost, TubeError, TubeProblem, TubeSynthesis,
};
use faer::Mat;
use pliant_adjoint::Linearizer;
use pliant_engine::model::Model;
use pliant_engine::rollout::Rollout;
use pliant_math::State;
use std::sync::Arc;

/// Disturbances and gains of the tube.
#[derive(Clone, Debug)]
pub struct TubeOptions {
    /// E of a change of state, ndx × nw: the disturbance of each step is E w, |w|₂ ≤ 1.
    pub disturbance: Mat<f64>,
    /// E_0, the uncertainty of the measured state, or of the first one where it is estimated from readings; no columns: none.
    pub initial: Mat<f64>,
    /// Whether every disturbance has gains of its own; else all share one gain a stage, which is cheaper and tightens by more.
    pub exact: bool,
}

impl TubeOptions {
    /// Exact tubes of [`ball_of_free_nodes`] about a state that is measured exactly.
    pub fn of_ball(model: &Model, radius: f64) -> Self {
        Self { disturbance: ball_of_free_nodes(model, radius), initial: Mat::zeros(model.ndx(), 0), exact: true }
    }
}

/// E of a disturbance that displaces all free nodes together by a vector of length `radius` \[m\] at most: ndx rows, three columns a node.
pub fn ball_of_free_nodes(model: &Model, radius: f64) -> Mat<f64> {
    let free = free_rows(model);
    Mat::from_fn(model.ndx(), free.len(), |r, c| if free[c] == r { radius } else { 0.0 })
}

/// Rows of a change of state that displace nodes which no gripper holds.
pub fn free_rows(model: &Model) -> Vec<usize> {
    (0..3 * model.n_nodes()).filter(|row| !model.prescribed()[row / 3]).collect()
}

/// Constraints moved in by a tube.
struct Tightened<P> {
    problem: P,
    /// h of the constraints and of the inputs, by stage; empty: none.
    rows: Vec<Vec<f64>>,
    inputs: Vec<Vec<f64>>,
}

impl<P: Problem> Problem for Tightened<P> {
    fn evaluate(&self, k: usize, n: usize, x: &State, u: Option<&[f64]>, out: &mut Terms) -> Result<(), String> {
        let before = out.constraints.values.len();
        self.problem.evaluate(k, n, x, u, out)?;
        let own = out.constraints.values[before..].iter_mut();
        own.zip(self.rows.get(k).into_iter().flatten()).for_each(|(c, h)| *c += h);
        Ok(())
    }

    fn bounds(&self, k: usize, lower: &mut [f64], upper: &mut [f64]) {
        self.problem.bounds(k, lower, upper);
        for ((l, u), h) in lower.iter_mut().zip(upper).zip(self.inputs.get(k).into_iter().flatten()) {
            // where there is no room for both, the nominal input is in the middle
            let (low, high) = (*l + h, *u - h);
            (*l, *u) = if low <= high { (low, high) } else { (0.5 * (*l + *u), 0.5 * (*l + *u)) };
        }
    }

    fn constraint(&self, k: usize, n: usize, row: usize) -> String {
        self.problem.constraint(k, n, row)
    }
}

/// A controller.
pub struct RobustMpc<P> {
    inner: Mpc<Tightened<P>>,
    options: TubeOptions,
    /// Whose readings the inputs answer; `None`: the state.
    sensors: Option<Sensors>,
    /// The tube of the last update, whose reach weighs its rows.
    previous: Option<Tube>,
}

/// The decision of an update.
#[derive(Clone, Debug)]
pub struct RobustUpdate {
    /// The nominal plan; its first inputs are to be applied.
    pub update: Update,
    /// The tube about it.
    pub tube: Tube,
    /// Stages of the tube before the plan's first: steps since the last reading.
    pub before: usize,
    /// Constraints that the tube reaches beyond, largest first: none, and the linearized plan is safe.
    pub violations: Vec<Violation>,
    /// Steps of the plan in which a gripper seizes or lets go, through which the tube is not valid.
    pub switches: Vec<usize>,
}

/// Why there is no decision.
#[derive(Clone, Debug, thiserror::Error)]
pub enum RobustError {
    /// Of the plan.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// Of the tube.
    #[error(transparent)]
    Tube(#[from] TubeError),
    /// Of the tube of output feedback.
    #[error(transparent)]
    Observer(#[from] ObserverError),
    /// Of the estimate.
    #[error(transparent)]
    Sensing(#[from] SensingError),
    /// A disturbance of another size than the model's changes of state.
    #[error("the {what} has {got} rows, but a change of state has {expected} numbers: give one row for each")]
    Disturbance {
        /// Which.
        what: &'static str,
        /// Rows given.
        got: usize,
        /// Rows needed.
        expected: usize,
    },
}

/// Whether the disturbances have a row for each number of a change of state.
pub(crate) fn check_rows(model: &Model, options: &TubeOptions) -> Result<(), RobustError> {
    let expected = model.ndx();
    for (what, e) in [("disturbance", &options.disturbance), ("initial uncertainty", &options.initial)] {
        if e.nrows() != expected && e.ncols() > 0 {
            return Err(RobustError::Disturbance { what, got: e.nrows(), expected });
        }
    }
    Ok(())
}

impl RobustUpdate {
    /// Largest tightening of a constraint.
    pub fn tightening(&self) -> f64 {
        let stages = 0..=self.before + self.update.rollout.controls.len();
        stages.flat_map(|k| self.tube.tightenings.rows(k)).fold(0.0, |most: f64, h| most.max(*h))
    }
}

impl<P: Problem> RobustMpc<P> {
    /// A controller whose first plan is `controls`.
    ///
    /// # Errors
    /// As [`Mpc::new`]; a disturbance of another size.
    pub fn new(
        problem: P,
        model: &Arc<Model>,
        theta: &[f64],
        controls: Vec<Vec<f64>>,
        plan: PlanOptions,
        options: TubeOptions,
    ) -> Result<Self, RobustError> {
        check_rows(model, &options)?;
        let tightened = Tightened { problem, rows: Vec::new(), inputs: Vec::new() };
        Ok(Self { inner: Mpc::new(tightened, model, theta, controls, plan)?, options, sensors: None, previous: None })
    }

    /// The same whose inputs answer readings, for [`RobustMpc::update_from`].
    #[must_use]
    pub(crate) fn with_sensors(self, sensors: Sensors) -> Self {
        Self { sensors: Some(sensors), ..self }
    }

    /// Improves the plan from the measured state `x` and makes the tube about it.
    ///
    /// # Errors
    /// As [`Mpc::update`]; a tube that cannot be made.
    pub fn update(&mut self, x: &State) -> Result<RobustUpdate, RobustError> {
        let (x, error) = (x.clone(), self.options.initial.clone());
        self.update_from(&Estimate { x, error, since: Vec::new(), corrected: true })
    }

    /// The same from an estimate.
    pub(crate) fn update_from(&mut self, estimate: &Estimate) -> Result<RobustUpdate, RobustError> {
        let update = self.inner.update(&estimate.x)?;
        let controls = update.rollout.controls.clone();
        self.surround(update, estimate).or_else(|error| {
            // a plan without a tube is not shifted, so that `hold` has its inputs for now
            self.inner.set_controls(controls)?;
            Err(error)
        })
    }

    /// The inputs that the last plan has for now, where there was no update; the plan is shifted as by an update.
    pub fn hold(&mut self) -> Vec<f64> {
        self.inner.hold()
    }

    /// Makes the tube about a plan.
    fn surround(&mut self, update: Update, estimate: &Estimate) -> Result<RobustUpdate, RobustError> {
        let about = self.about(&update.rollout, estimate)?;
        let (n, before) = (update.rollout.controls.len(), estimate.since.len());
        let disturbance =
            Disturbance::new((0..=before + n).map(|k| if k == 0 { about.of_start.clone() } else { about.of_step.clone() }));
        let problem = TubeProblem::new(&about.ocp, &disturbance, &about.cost)?;
        // what holds the plan back is what the gains should keep deviations off
        let mut multipliers = RowValues::zeros(&about.ocp);
        for price in &update.prices {
            let constraint = if price.input { Constraint::Input(price.row) } else { Constraint::Row(price.row) };
            multipliers.set(before + price.stage, constraint, price.multiplier);
        }
        // before the first reading a tube has fewer stages
        let previous = self.previous.as_ref().filter(|tube| tube.tightenings.len() == before + n + 1);
        let tube = match (&about.sensing, self.options.exact) {
            (None, true) => ExactTube.synthesize(&problem, &multipliers, previous)?,
            (None, false) => SharedGainTube.synthesize(&problem, &multipliers, previous)?,
            (Some(sensing), exact) => {
                let sharing = if exact { Sharing::PerColumn } else { Sharing::Shared };
                OutputFeedbackTube::new(&problem, sensing.clone(), sharing)?.synthesize(&problem, &multipliers, previous)?
            }
        };
        self.previous = Some(tube.clone());
        let violations = self.violations(&update.rollout, &about, &tube, before);
        self.tighten(&tube, before, n);
        let holds = |x: &State| self.inner.model().grasps().iter().map(|g| g.held(&x.z).is_some()).collect::<Vec<_>>();
        let states = &update.rollout.states;
        let switches = (0..n).filter(|k| holds(&states[*k]) != holds(&states[k + 1])).collect();
        Ok(RobustUpdate { update, tube, before, violations, switches })
    }

    /// h of the next update: what is k steps ahead then has been disturbed as often as what is k steps ahead now.
    fn tighten(&mut self, tube: &Tube, before: usize, n: usize) {
        let h = &tube.tightenings;
        let problem = self.inner.problem_mut();
        problem.rows = (0..=n).map(|k| h.rows(before + k).to_vec()).collect();
        problem.inputs = (0..n).map(|k| h.inputs(before + k).to_vec()).collect();
    }

    /// Constraints that the plan's tube reaches beyond.
    fn violations(&self, plan: &Rollout, about: &About, tube: &Tube, before: usize) -> Vec<Violation> {
        let (n, problem) = (plan.controls.len(), self.inner.problem());
        let mut out = Vec::new();
        for k in 0..=n {
            let over =
                about.values[k].iter().zip(tube.tightenings.rows(before + k)).enumerate().map(|(row, (c, h))| (row, c + h));
            let broken = over.filter(|(_, by)| *by > 0.0);
            out.extend(broken.map(|(row, by)| Violation { constraint: problem.constraint(k, n, row), by }));
        }
        for (k, u) in plan.controls.iter().enumerate() {
            let nu = u.len();
            let (mut lower, mut upper) = (vec![0.0; nu], vec![0.0; nu]);
            problem.problem.bounds(k, &mut lower, &mut upper);
            for input in 0..nu {
                let h = tube.tightenings.get(before + k, Constraint::Input(input));
                let by = (lower[input] - (u[input] - h)).max(u[input] + h - upper[input]);
                if h > 0.0 && by > crate::constants::ROUNDING * (1.0 + u[input].abs()) {
                    out.push(Violation { constraint: format!("bounds of input {input} in step {k} of {n}"), by });
                }
            }
        }
        out.sort_by(|a, b| b.by.total_cmp(&a.by));
        out
    }

    /// Dynamics, rows and costs about a plan and the steps before it, in the numbers of the state that matter.
    fn about(&self, plan: &Rollout, estimate: &Estimate) -> Result<About, RobustError> {
        let (model, n) = (&plan.model, plan.controls.len());
        let (ndx, nu) = (model.ndx(), model.nu());
        let mut linearizer = Linearizer::new(model, &plan.theta, false);
        let jacobians: Vec<_> = plan.records.iter().map(|record| linearizer.linearize(record)).collect();
        let mut terms = Vec::with_capacity(n + 1);
        for (k, x) in plan.states.iter().enumerate() {
            let mut of_stage = Terms::default();
            let u = plan.controls.get(k).map(Vec::as_slice);
            self.inner.problem().problem.evaluate(k, n, x, u, &mut of_stage).map_err(PlanError::Problem)?;
            terms.push(of_stage);
        }
        // a state's number matters if something follows from it: a quasi-static step forgets the velocities
        let mut matters = vec![false; ndx];
        for jacobian in estimate.since.iter().chain(&jacobians) {
            jacobian.a.chunks_exact(ndx).for_each(|row| row.iter().zip(&mut matters).for_each(|(a, m)| *m |= *a != 0.0));
        }
        let entries = terms.iter().flat_map(|t| t.residuals.entries.iter().chain(&t.constraints.entries));
        entries.filter(|e| e.1 < ndx).for_each(|e| matters[e.1] = true);
        let kept: Vec<usize> = (0..ndx).filter(|k| matters[*k]).collect();
        let mut place = vec![usize::MAX; ndx];
        kept.iter().enumerate().for_each(|(k, column)| place[*column] = k);
        let nx = kept.len();
        let cut =
            |e: &Mat<f64>| if e.ncols() == 0 { Mat::zeros(nx, 0) } else { Mat::from_fn(nx, e.ncols(), |r, c| e[(kept[r], c)]) };
        let before = estimate.since.len();
        let mut stages = Vec::with_capacity(before + n);
        for jacobian in &estimate.since {
            // their inputs are sent, and answer nothing any more
            stages.push(Stage {
                a: Mat::from_fn(nx, nx, |r, c| jacobian.a[kept[r] * ndx + kept[c]]),
                b: Mat::zeros(nx, nu),
                d: vec![0.0; nx],
                q: Mat::zeros(nx, nx),
                s: Mat::zeros(nu, nx),
                r: Mat::identity(nu, nu),
                q_linear: vec![0.0; nx],
                r_linear: vec![0.0; nu],
                lower: vec![f64::NEG_INFINITY; nu],
                upper: vec![f64::INFINITY; nu],
                rows: Rows::none(nx, nu),
            });
        }
        let (mut lower, mut upper) = (vec![0.0; nu], vec![0.0; nu]);
        let mut moves = vec![true; nu];
        for (k, jacobian) in jacobians.iter().enumerate() {
            self.inner.problem().problem.bounds(k, &mut lower, &mut upper);
            (0..nu).for_each(|c| moves[c] &= lower[c] < upper[c]);
            stages.push(Stage {
                a: Mat::from_fn(nx, nx, |r, c| jacobian.a[kept[r] * ndx + kept[c]]),
                // an input that may not move does not answer a disturbance
                b: Mat::from_fn(nx, nu, |r, c| if moves[c] { jacobian.b[kept[r] * nu + c] } else { 0.0 }),
                d: vec![0.0; nx],
                q: Mat::zeros(nx, nx),
                s: Mat::zeros(nu, nx),
                r: Mat::identity(nu, nu),
                q_linear: vec![0.0; nx],
                r_linear: vec![0.0; nu],
                lower: lower.clone(),
                upper: upper.clone(),
                rows: rows(&terms[k], &place, nx, nu, ndx),
            });
        }
        let ocp = Ocp {
            x0: vec![0.0; nx],
            stages,
            q_final: Mat::zeros(nx, nx),
            q_final_linear: vec![0.0; nx],
            rows_final: rows(&terms[n], &place, nx, 0, ndx),
        };
        let cost = cost(&terms, &place, [nx, nu, ndx], &moves);
        let values = terms.into_iter().map(|t| t.constraints.values).collect();
        let of_start = cut(&estimate.error);
        let sensing = self.sensors.as_ref().map(|sensors| {
            let (c, f) = (sensors.matrix(&place, nx), sensors.noise());
            let read = if estimate.corrected { Mat::zeros(0, nx) } else { c.clone() };
            let silent = if estimate.corrected { Mat::zeros(0, f.ncols()) } else { f.clone() };
            let later = before + n - 1;
            Sensing {
                c: std::iter::once(read).chain(std::iter::repeat_n(c, later)).collect(),
                f: std::iter::once(silent).chain(std::iter::repeat_n(f, later)).collect(),
                delay: sensors.delay,
            }
        });
        Ok(About { of_step: cut(&self.options.disturbance), of_start, sensing, ocp, cost, values })
    }
}

/// The linearization about a plan.
struct About {
    ocp: Ocp,
    cost: TubeCost,
    of_step: Mat<f64>,
    of_start: Mat<f64>,
    /// Readings to come.
    sensing: Option<Sensing>,
    /// c of each stage, not tightened.
    values: Vec<Vec<f64>>,
}

/// Constraints of a stage as rows.
fn rows(terms: &Terms, place: &[usize], nx: usize, nu: usize, ndx: usize) -> Rows {
    let m = terms.constraints.values.len();
    let (mut gx, mut gu) = (Mat::zeros(m, nx), Mat::zeros(m, nu));
    for &(row, column, value) in &terms.constraints.entries {
        if column < ndx {
            gx[(row, place[column])] += value;
        } else if column - ndx < nu {
            gu[(row, column - ndx)] += value;
        }
    }
    Rows { gx, gu, limits: terms.constraints.values.iter().map(|c| -c).collect(), weights: terms.prices.clone() }
}

/// Deviations cost what they cost in the plan: rᵤᵀ rᵤ and rₓᵀ rₓ, the mean over the stages.
fn cost(terms: &[Terms], place: &[usize], [nx, nu, ndx]: [usize; 3], moves: &[bool]) -> TubeCost {
    let (mut q, mut r) = (Mat::zeros(nx, nx), Mat::zeros(nu, nu));
    let share = 1.0 / (terms.len() as f64 - 1.0).max(1.0);
    for of_stage in terms {
        let mut by_row: Vec<Vec<(usize, f64)>> = vec![Vec::new(); of_stage.residuals.values.len()];
        of_stage.residuals.entries.iter().for_each(|&(row, column, value)| by_row[row].push((column, value)));
        for row in by_row {
            for &(i, a) in &row {
                for &(j, b) in &row {
                    if i < ndx && j < ndx {
                        q[(place[i], place[j])] += share * a * b;
                    } else if i >= ndx && j >= ndx {
                        r[(i - ndx, j - ndx)] += share * a * b;
                    }
                }
            }
        }
    }
    let most = (0..nu).map(|k| r[(k, k)]).fold(0.0, f64::max);
    for (k, moves) in moves.iter().enumerate() {
        // inputs without a cost get a little of one, so that the gains are finite
        let floor = if most > 0.0 { crate::constants::FREE_INPUT * most } else { 1.0 };
        r[(k, k)] = if *moves { r[(k, k)].max(floor) } else { 1.0 };
    }
    TubeCost { q_final: q.clone(), q, r }
}
