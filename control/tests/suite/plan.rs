//! Plans: derivatives of tasks and of the quadratic model, problems with a known optimum, grasping, tubes.

use pliant_adjoint::{Seeds, TangentStepper, rollout_vjp};
use pliant_control::plan::{Aim, Approach, PlanOptions, PlanStatus, QuadraticModel, approaches, evaluate, plan};
use pliant_control::problem::{Problem, Terms};
use pliant_control::task::{Task, TaskProblem};
use pliant_engine::model::{Model, ModelBuilder};
use pliant_engine::rollout::{Rollout, rollout};
use pliant_engine::step::StepOptions;
use pliant_math::State;
use pliant_scene::{Scene, Source, parse_as, parse_scene};
use std::sync::Arc;

const ROPE: &str = r#"
schema_version = 1
[time]
step = 0.02
duration = 1.0
integrator = "quasi_static"
[contact]
rest_gap = 1e-6
[[rope]]
name = "rope"
nodes = 7
length = 0.12
linear_density = 0.002
stretch_stiffness = 0.5
bend_stiffness = 1e-6
radius = 0.002
initial = { shape = "straight", from = [0, 0, 0.0021], direction = [1, 0, 0] }
[[plane]]
name = "floor"
friction = 0.6
[[gripper]]
name = "hand"
rope = "rope"
mode = "velocity"
motion = { kind = "hold" }
[gripper.grasp]
at = [0.03, 0.01, 0.04]
radius = 0.01
stiffness = 50.0
closing_time = 0.05
"#;

const ROPE_TASK: &str = r#"
schema_version = 1
steps = 12
[[cost]]
kind = "nodes"
object = "rope"
line = { from = [0.0, 0.03, 0.05], to = [0.12, 0.03, 0.05] }
weight = 3.0
axes = [1, 0.5, 1]
[[cost]]
kind = "distance"
object = "rope"
nodes = [0, -1]
distance = 0.1
weight = 2.0
[[cost]]
kind = "reach"
gripper = "hand"
inside = 0.005
weight = 4.0
[[cost]]
kind = "inputs"
inputs = ["hand.velocity.x", "hand.velocity.y", "hand.velocity.z"]
target = 0.01
weight = 0.1
[[limit]]
kind = "inputs"
inputs = ["hand.velocity.x", "hand.velocity.y", "hand.velocity.z"]
lower = -0.2
upper = 0.2
[[limit]]
kind = "inputs"
inputs = ["hand.closing"]
lower = 1
upper = 1
[[limit]]
kind = "outside"
object = "rope"
nodes = [3, 4]
a = [0.05, -0.1, 0.02]
b = [0.05, 0.1, 0.03]
radius = 0.03
[[limit]]
kind = "above"
object = "rope"
normal = [0.1, 0, 2]
offset = 0.002
"#;

const ARM: &str = r#"
schema_version = 1
[time]
step = 0.01
duration = 0.5
integrator = "euler"
[[body]]
name = "upper"
mass = 1.0
inertia = [0.01, 0.01, 0.001, 0, 0, 0]
center_of_mass = [0.15, 0, 0]
[[body.joint]]
name = "shoulder"
kind = "revolute"
axis = [0, 1, 0]
damping = 0.5
[[body]]
name = "lower"
parent = "upper"
position = [0.3, 0, 0]
mass = 0.5
inertia = [0.004, 0.004, 0.0004, 0, 0, 0]
center_of_mass = [0.1, 0, 0]
[[body.joint]]
name = "elbow"
kind = "revolute"
axis = [0, 1, 0]
damping = 0.3
[[actuator]]
name = "first"
joint = "shoulder"
kind = "torque"
[[actuator]]
name = "second"
joint = "elbow"
kind = "torque"
"#;

struct Setup {
    model: Arc<Model>,
    problem: TaskProblem,
    theta: Vec<f64>,
}

fn setup(scene: &str, task: &str) -> Setup {
    let scene: Scene = parse_scene(scene, "scene.toml").unwrap_or_else(|e| panic!("{e}"));
    let model = Arc::new(ModelBuilder::new(&scene).unwrap().build());
    let task: Task = parse_as(&Source::new("task.toml", task)).unwrap_or_else(|e| panic!("{e}"));
    let problem = TaskProblem::new(&task, &scene, &model).unwrap_or_else(|e| panic!("{e}"));
    let theta = model.params().values().to_vec();
    Setup { model, problem, theta }
}

/// Numbers without a pattern in −1 … 1.
fn rough(k: usize) -> f64 {
    ((k as f64 + 1.0) * 12.9898).sin()
}

impl Setup {
    fn run(&self, controls: &[Vec<f64>]) -> Rollout {
        rollout(&self.model, &self.theta, &self.model.initial_state(), controls, StepOptions::default()).unwrap()
    }

    fn inputs(&self, steps: usize, size: f64) -> Vec<Vec<f64>> {
        let nu = self.model.nu();
        let mut rows: Vec<Vec<f64>> = (0..steps).map(|k| (0..nu).map(|c| size * rough(k * nu + c)).collect()).collect();
        if let Some(grasp) = self.model.grasps().first() {
            rows.iter_mut().for_each(|u| u[grasp.closing] = 1.0);
        }
        rows
    }

    fn terms(&self, k: usize, n: usize, x: &State, u: Option<&[f64]>) -> Terms {
        let mut terms = Terms::default();
        self.problem.evaluate(k, n, x, u, &mut terms).unwrap();
        terms
    }
}

/// Every derivative of a stage's rows against a central difference.
fn rows_match_differences(setup: &Setup, x: &State, u: &[f64], k: usize, n: usize) {
    let (ndx, nu) = (setup.model.ndx(), setup.model.nu());
    let base = setup.terms(k, n, x, Some(u));
    assert!(!base.residuals.values.is_empty());
    let h = 1e-6;
    for column in 0..ndx + nu {
        let at = |sign: f64| {
            let (mut dx, mut u) = (vec![0.0; ndx], u.to_vec());
            if column < ndx {
                dx[column] = sign * h;
            } else {
                u[column - ndx] += sign * h;
            }
            setup.terms(k, n, &setup.model.displaced(x, &dx), Some(&u))
        };
        let (plus, minus) = (at(1.0), at(-1.0));
        for (own, [a, b]) in
            [(&base.residuals, [&plus.residuals, &minus.residuals]), (&base.constraints, [&plus.constraints, &minus.constraints])]
        {
            for row in 0..own.values.len() {
                let exact: f64 = own.entries.iter().filter(|e| e.0 == row && e.1 == column).map(|e| e.2).sum();
                let difference = (a.values[row] - b.values[row]) / (2.0 * h);
                assert!(
                    (exact - difference).abs() < 1e-7 * (1.0 + exact.abs()),
                    "row {row}, column {column}: {exact} {difference}"
                );
            }
        }
    }
}

#[test]
fn costs_and_limits_of_ropes_have_exact_derivatives() {
    let setup = setup(ROPE, ROPE_TASK);
    let run = setup.run(&setup.inputs(3, 0.05));
    let x = &run.states[3];
    let bent: Vec<f64> = (0..setup.model.ndx()).map(|k| if k < 21 { 0.003 * rough(k) } else { 0.0 }).collect();
    let x = setup.model.displaced(x, &bent);
    // the gripper's point is away from the rope, or its cost would be zero
    assert!(setup.model.grasps()[0].reach(&x.q).unwrap().distance > 0.01);
    rows_match_differences(&setup, &x, &[0.1, -0.05, 0.02, 1.0], 2, 12);
}

#[test]
fn costs_and_limits_of_bodies_have_exact_derivatives() {
    let task = r#"
schema_version = 1
steps = 5
[[cost]]
kind = "body"
body = "lower"
point = [0.2, 0.01, 0]
goal = [0.1, 0, 0.4]
weight = 5
[[cost]]
kind = "joint"
joint = "elbow"
goal = 0.7
[[cost]]
kind = "joint_speed"
joint = "shoulder"
weight = 0.3
when = "end"
[[cost]]
kind = "inputs"
inputs = ["first", "second"]
weight = 0.01
[[limit]]
kind = "joint"
joint = "elbow"
lower = -0.1
upper = 0.2
"#;
    let setup = setup(ARM, task);
    let run = setup.run(&setup.inputs(5, 2.0));
    rows_match_differences(&setup, &run.states[5], &[0.3, -0.2], 5, 5);
}

#[test]
fn a_growing_tangent_is_that_of_all_columns() {
    let setup = setup(ROPE, ROPE_TASK);
    let run = setup.run(&setup.inputs(6, 0.05));
    let (nu, np) = (setup.model.nu(), setup.model.n_params());
    let mut whole = TangentStepper::new(&setup.model, &setup.theta, Seeds::none(6 * nu, nu, np));
    let mut growing = TangentStepper::new(&setup.model, &setup.theta, Seeds::none(nu, nu, np));
    for (k, record) in run.records.iter().enumerate() {
        whole.seeds.clear_u();
        growing.grow((k + 1) * nu);
        for c in 0..nu {
            whole.seeds.add_u(c, k * nu + c, 1.0);
            growing.seeds.add_u(c, k * nu + c, 1.0);
        }
        whole.step(record);
        growing.step(record);
        let known = (k + 1) * nu;
        for (all, some) in [(&whole.x.q, &growing.x.q), (&whole.x.v, &growing.x.v), (&whole.x.z, &growing.x.z)] {
            for (a, b) in all.chunks_exact(6 * nu).zip(some.chunks_exact(known)) {
                assert_eq!(&a[..known], b);
                assert!(a[known..].iter().all(|x| *x == 0.0));
            }
        }
    }
    assert!(growing.x.q.iter().any(|x| *x != 0.0));
}

/// g against the adjoint of the whole cost, and H and C against differences of residuals along a direction.
#[test]
fn the_quadratic_model_is_that_of_the_rollout() {
    let mut setup = setup(ROPE, ROPE_TASK);
    // it holds the rope, or no node would move with it
    setup.theta[setup.model.grasps()[0].radius] = 0.05;
    let n = 8;
    let controls = setup.inputs(n, 0.1);
    let run = setup.run(&controls);
    assert!(setup.model.grasps()[0].held(&run.states[1].z).is_some());
    let mut model = QuadraticModel::default();
    model.evaluate(&setup.problem, &run, &[]).unwrap();
    let (ndx, nu) = (setup.model.ndx(), setup.model.nu());
    let mut x_bar = vec![vec![0.0; ndx]; n + 1];
    let mut gradient = vec![0.0; n * nu];
    let mut cost = 0.0;
    for k in 0..=n {
        let terms = setup.terms(k, n, &run.states[k], run.controls.get(k).map(Vec::as_slice));
        cost += terms.cost();
        for &(row, column, value) in &terms.residuals.entries {
            let part = terms.residuals.values[row] * value;
            if column < ndx { x_bar[k][column] += part } else { gradient[k * nu + column - ndx] += part }
        }
    }
    let pulled = rollout_vjp(&run, &x_bar).unwrap().u.concat();
    gradient.iter_mut().zip(pulled).for_each(|(g, p)| *g += p);
    assert!((model.cost - cost).abs() < 1e-14 * cost);
    let size = gradient.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    assert!(size > 1e-3);
    for (a, b) in model.gradient.iter().zip(&gradient) {
        assert!((a - b).abs() < 1e-11 * size, "{a} {b}");
    }
    // along a direction of the velocities
    let direction: Vec<f64> = (0..n * nu).map(|k| if k % nu == nu - 1 { 0.0 } else { rough(k + 7) }).collect();
    let h = 1e-6;
    let moved = |sign: f64| {
        let controls: Vec<Vec<f64>> =
            (0..n).map(|k| (0..nu).map(|c| controls[k][c] + sign * h * direction[k * nu + c]).collect()).collect();
        let run = setup.run(&controls);
        let stage = |k: usize| setup.terms(k, n, &run.states[k], run.controls.get(k).map(Vec::as_slice));
        let all: Vec<Terms> = (0..=n).map(stage).collect();
        let residuals: Vec<f64> = all.iter().flat_map(|t| t.residuals.values.clone()).collect();
        let constraints: Vec<f64> = all.iter().flat_map(|t| t.constraints.values.clone()).collect();
        (residuals, constraints)
    };
    let (plus, minus) = (moved(1.0), moved(-1.0));
    let curvature: f64 = plus.0.iter().zip(&minus.0).map(|(a, b)| ((a - b) / (2.0 * h)).powi(2)).sum();
    let entry = |i: usize, j: usize| if i >= j { model.hessian[(i, j)] } else { model.hessian[(j, i)] };
    let own: f64 =
        (0..n * nu).flat_map(|i| (0..n * nu).map(move |j| (i, j))).map(|(i, j)| direction[i] * entry(i, j) * direction[j]).sum();
    assert!((own - curvature).abs() < 1e-6 * curvature, "{own} {curvature}");
    assert_eq!(model.values.len(), plus.1.len());
    for (row, (a, b)) in plus.1.iter().zip(&minus.1).enumerate() {
        let slope: f64 = (0..n * nu).map(|c| model.rows[row * n * nu + c] * direction[c]).sum();
        assert!((slope - (a - b) / (2.0 * h)).abs() < 1e-6 * (1.0 + slope.abs()), "row {row}");
    }
}

/// A hand that alone moves is linear in its inputs: one step finds the optimum, which is a mean.
#[test]
fn a_linear_problem_takes_one_step() {
    struct Goal;
    impl Problem for Goal {
        fn evaluate(&self, k: usize, n: usize, x: &State, u: Option<&[f64]>, out: &mut Terms) -> Result<(), String> {
            if k == n {
                let row = out.residuals.push(x.q[21] - 0.05);
                out.residuals.slope(row, 21, 1.0);
            }
            if let Some(u) = u {
                let row = out.residuals.push(0.1 * u[0]);
                out.residuals.slope(row, x.q.len() + x.v.len() + x.z.len(), 0.1);
            }
            Ok(())
        }
        fn bounds(&self, _: usize, lower: &mut [f64], upper: &mut [f64]) {
            lower.copy_from_slice(&[-1.0, 0.0, 0.0, 0.0]);
            upper.copy_from_slice(&[1.0, 0.0, 0.0, 0.0]);
        }
    }
    let setup = setup(ROPE, ROPE_TASK);
    let (n, h) = (5, 0.02);
    let guess = vec![vec![0.0; 4]; n];
    let options = PlanOptions { tolerance: 1e-12, holding: false, ..PlanOptions::default() };
    let found = plan(&Goal, &setup.model, &setup.theta, &setup.model.initial_state(), &guess, options).unwrap();
    assert_eq!(found.status, PlanStatus::Converged);
    assert!(found.steps.len() <= 2 && !found.surrogate, "{:?}", found.steps);
    // min ½ (d − h Σu)² + ½ 0.01 Σu², d = 0.02: u = h d/(N h² + 0.01)
    let best = h * 0.02 / (n as f64 * h * h + 0.01);
    for u in &found.rollout.controls {
        assert!((u[0] - best).abs() < 1e-9, "{} {best}", u[0]);
    }
}

/// The same optimum from values and slopes alone.
#[test]
fn costs_given_by_value_find_the_same_optimum() {
    struct Goal;
    impl Problem for Goal {
        fn evaluate(&self, k: usize, n: usize, x: &State, u: Option<&[f64]>, out: &mut Terms) -> Result<(), String> {
            if k == n {
                let row = out.values.push(0.5 * (x.q[21] - 0.05).powi(2));
                out.values.slope(row, 21, x.q[21] - 0.05);
            }
            if let Some(u) = u {
                let row = out.values.push(0.005 * u[0] * u[0]);
                out.values.slope(row, x.q.len() + x.v.len() + x.z.len(), 0.01 * u[0]);
            }
            Ok(())
        }
        fn bounds(&self, _: usize, lower: &mut [f64], upper: &mut [f64]) {
            lower.copy_from_slice(&[-1.0, 0.0, 0.0, 0.0]);
            upper.copy_from_slice(&[1.0, 0.0, 0.0, 0.0]);
        }
    }
    let setup = setup(ROPE, ROPE_TASK);
    let (n, h) = (5, 0.02);
    let options = PlanOptions { tolerance: 1e-12, holding: false, ..PlanOptions::default() };
    let guess = vec![vec![0.0; 4]; n];
    let found = plan(&Goal, &setup.model, &setup.theta, &setup.model.initial_state(), &guess, options).unwrap();
    let best = h * 0.02 / (n as f64 * h * h + 0.01);
    for u in &found.rollout.controls {
        assert!((u[0] - best).abs() < 1e-5, "{} {best} {:?}", u[0], found.status);
    }
}

#[test]
fn an_empty_hand_is_drawn_to_the_rope_and_holds_it() {
    // without a reach cost, and without an obstacle in the way
    let reach = "kind = \"reach\"\ngripper = \"hand\"\ninside = 0.005\nweight = 4.0\n[[cost]]\n";
    assert!(ROPE_TASK.contains(reach));
    let task = ROPE_TASK.replace(reach, "").replace("radius = 0.03\n", "radius = 0.001\n");
    let setup = setup(ROPE, &task);
    let x0 = setup.model.initial_state();
    let guess: Vec<Vec<f64>> = vec![vec![0.0, 0.0, 0.0, 1.0]; 20];
    let seizes = |holding: bool| {
        let options = PlanOptions { holding, ..PlanOptions::default() };
        let found = plan(&setup.problem, &setup.model, &setup.theta, &x0, &guess, options).unwrap();
        (found.rollout.states.iter().any(|x| setup.model.grasps()[0].held(&x.z).is_some()), found.surrogate, found.cost)
    };
    let (with, surrogate, cost) = seizes(true);
    assert!(with && surrogate, "drawn there, and named a surrogate");
    let (without, exact, cost_without) = seizes(false);
    assert!(!without && !exact, "the exact derivative is blind");
    assert!(cost < 0.9 * cost_without, "{cost} {cost_without}");
}

#[test]
fn what_holding_is_worth_is_the_derivative_of_the_held_rollout() {
    let setup = setup(ROPE, ROPE_TASK);
    let run = setup.run(&vec![vec![0.0, 0.0, 0.0, 1.0]; 10]);
    // no node is chosen yet: the nearest point, and time has no price
    let found: Vec<Approach> = approaches(&setup.problem, &run, &Aim::default()).unwrap();
    assert_eq!((found.len(), found[0].step), (1, 9));
    // by hand: hold at a distance, move all of the motion from step k on, difference the cost
    let grasp = &setup.model.grasps()[0];
    let mut x0 = setup.model.initial_state();
    let reach = grasp.reach(&x0.q).unwrap();
    assert!(
        (reach.distance - found[0].distance).abs() < 1e-15
            && (reach.distance - (0.01_f64.powi(2) + 0.0379_f64.powi(2)).sqrt()).abs() < 1e-12
    );
    grasp.hold_at_distance(&reach, &mut x0.z);
    let mut theta = setup.theta.clone();
    theta[grasp.closing_time] = 1e9;
    let cost = |k: usize, axis: usize, by: f64| {
        let mut u = vec![vec![0.0, 0.0, 0.0, 1.0]; 10];
        u[k][axis] += by;
        let run = rollout(&setup.model, &theta, &x0, &u, StepOptions::default()).unwrap();
        let of_states: f64 = (0..=10).map(|k| setup.terms(k, 10, &run.states[k], None).cost()).sum();
        of_states
    };
    let by_step = |k: usize| (0..3).map(|a| ((cost(k, a, 1e-5) - cost(k, a, -1e-5)) / 2e-5).powi(2)).sum::<f64>().sqrt();
    let most = (0..10).map(by_step).fold(0.0, f64::max) / 0.02;
    assert!(most > 1e-3 && (found[0].price - most).abs() < 1e-5 * most, "{} {most}", found[0].price);
}

#[test]
fn limits_hold_where_they_can_and_are_reported_where_not() {
    let task = |floor: f64| {
        ROPE_TASK.replace("offset = 0.002", &format!("offset = {floor}")).replace("radius = 0.03\n", "radius = 0.001\n")
    };
    let solve = |floor: f64| {
        let setup = setup(ROPE, &task(floor));
        let guess: Vec<Vec<f64>> = vec![vec![0.0, 0.0, 0.0, 1.0]; 6];
        plan(&setup.problem, &setup.model, &setup.theta, &setup.model.initial_state(), &guess, PlanOptions::default()).unwrap()
    };
    assert!(solve(-0.01).violations.is_empty());
    // half a metre up: no plan of 6 steps gets there
    let found = solve(0.5);
    assert!(found.violations[0].by > 0.3, "{:?}", found.violations[0]);
    assert!(found.violations[0].constraint.contains("below the plane") && found.violations[0].constraint.contains("step"));
    assert!(found.violations.windows(2).all(|pair| pair[0].by >= pair[1].by));
}

#[test]
fn a_plan_evaluates_as_it_says() {
    let setup = setup(ROPE, ROPE_TASK);
    let guess: Vec<Vec<f64>> = vec![vec![0.0, 0.0, 0.0, 1.0]; 8];
    let found =
        plan(&setup.problem, &setup.model, &setup.theta, &setup.model.initial_state(), &guess, PlanOptions::default()).unwrap();
    let again = setup.run(&found.rollout.controls);
    assert_eq!(again.states, found.rollout.states);
    let (cost, violations) = evaluate(&setup.problem, &again.states, &again.controls).unwrap();
    assert_eq!((cost, violations), (found.cost, found.violations));
    for u in &found.rollout.controls {
        assert!(u[..3].iter().all(|v| v.abs() <= 0.2) && u[3] == 1.0);
    }
}
