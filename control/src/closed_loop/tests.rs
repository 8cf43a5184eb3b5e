#![allow(clippy::unwrap_used, clippy::panic)]
use super::*;
use crate::mpc::Mpc;
use crate::plan::{PlanError, PlanOptions, PlanStatus};
use crate::problem::{Problem, Terms};
use crate::robust::{RobustMpc, TubeOptions, ball_of_free_nodes, free_rows};
use pliant_engine::model::{Model, ModelBuilder};
use std::sync::Arc;

/// Answers but at some steps, and keeps what it was given.
#[derive(Default)]
struct Fickle {
    deaf: Vec<usize>,
    mute: Vec<usize>,
    given: Vec<f64>,
    asked: usize,
    step: usize,
}

impl Plant for Fickle {
    fn measure(&mut self) -> Result<Measured, String> {
        self.asked += 1;
        if self.mute.contains(&self.step) {
            return Err(format!("no telegram at {}", self.step));
        }
        Ok(Measured::State(State { q: vec![self.step as f64], v: Vec::new(), z: Vec::new() }))
    }

    fn apply(&mut self, u: &[f64]) -> Result<(), String> {
        self.step += 1;
        if self.deaf.contains(&(self.step - 1)) {
            return Err("the line is cut".to_owned());
        }
        self.given.push(u[0]);
        Ok(())
    }
}

/// Decides on ten times the state; its plan holds −1, −2, … for the steps without a decision.
#[derive(Default)]
struct Simple {
    fails: Vec<usize>,
    plan: f64,
}

impl Controller for Simple {
    fn decide(&mut self, measured: &Measured) -> Result<Decision, RobustError> {
        let Measured::State(x) = measured else { panic!("the plant measures its state") };
        if self.fails.contains(&(x.q[0] as usize)) {
            return Err(PlanError::Empty.into());
        }
        self.plan -= 1.0;
        let (inputs, steps, violations) = (vec![10.0 * x.q[0]], Vec::new(), Vec::new());
        Ok(Decision { inputs, cost: 0.0, penalty: 0.0, status: PlanStatus::Converged, steps, violations, reach: None })
    }

    fn hold(&mut self) -> Vec<f64> {
        self.plan -= 1.0;
        vec![self.plan]
    }
}

const OPTIONS: LoopOptions = LoopOptions { steps: 6, silence: 2, failures: 3 };

fn run(controller: &mut Simple, plant: &mut Fickle) -> Result<LoopRun, LoopError> {
    run_loop(controller, plant, OPTIONS, &mut |_, _| ())
}

#[test]
fn a_loop_that_nothing_disturbs_decides_every_step() {
    let (mut controller, mut plant, mut told) = (Simple::default(), Fickle::default(), Vec::new());
    let found = run_loop(&mut controller, &mut plant, OPTIONS, &mut |k, step| told.push((k, step.inputs[0]))).unwrap();
    assert_eq!(plant.given, [0.0, 10.0, 20.0, 30.0, 40.0, 50.0]);
    assert_eq!(told, [(0, 0.0), (1, 10.0), (2, 20.0), (3, 30.0), (4, 40.0), (5, 50.0)]);
    assert_eq!((found.end.unwrap().q[0], plant.asked), (6.0, 7));
    assert!(found.steps.iter().all(|s| s.decision.is_some() && s.failure.is_none() && s.silence.is_none()));
}

#[test]
fn a_failed_controller_goes_on_with_its_plan_and_ends_after_three() {
    let mut controller = Simple { fails: vec![1, 2, 4], ..Simple::default() };
    let mut plant = Fickle::default();
    let found = run(&mut controller, &mut plant).unwrap();
    assert_eq!(plant.given, [0.0, -2.0, -3.0, 30.0, -5.0, 50.0], "the count begins anew after a decision");
    assert!(found.steps[2].failure.is_some() && found.steps[2].state.is_some() && found.steps[3].failure.is_none());
    let error = run(&mut Simple { fails: vec![2, 3, 4], ..Simple::default() }, &mut Fickle::default()).unwrap_err();
    assert!(matches!(error, LoopError::Controller { step: 4, failures: 3, .. }), "{error}");
    assert!(error.to_string().contains("3 time(s) in a row, the last time at step 4: a plan of 0 steps"), "{error}");
}

#[test]
fn a_silent_plant_gets_the_last_inputs_and_ends_the_loop_after_two() {
    let mut plant = Fickle { mute: vec![2, 3], deaf: vec![5], ..Fickle::default() };
    let mut controller = Simple::default();
    let found = run(&mut controller, &mut plant).unwrap();
    assert_eq!(plant.given, [0.0, 10.0, 10.0, 10.0, 40.0]);
    assert_eq!(controller.plan, -6.0, "the plan goes on while nothing is measured");
    let said: Vec<_> = found.steps.iter().map(|s| (s.state.is_some(), s.silence.is_some())).collect();
    assert_eq!(said, [(true, false), (true, false), (false, true), (false, true), (true, false), (true, true)]);

    let mut plant = Fickle { mute: vec![2, 3, 4], ..Fickle::default() };
    let error = run(&mut Simple::default(), &mut plant).unwrap_err();
    assert!(matches!(error, LoopError::Plant { step: 4, silent: 3, .. }), "{error}");
    assert!(error.to_string().ends_with("3 step(s) in a row, the last of them step 4: no telegram at 4"), "{error}");
    let error = run(&mut Simple::default(), &mut Fickle { mute: vec![0], ..Fickle::default() }).unwrap_err();
    assert!(matches!(&error, LoopError::Start { message } if message == "no telegram at 0"), "{error}");
}

/// A hand with a velocity at the end of a short rope.
fn model() -> Arc<Model> {
    let text = r#"
        schema_version = 1
        [time]
        step = 0.02
        duration = 0.1
        integrator = "euler"
        [[rope]]
        name = "rope"
        nodes = 4
        length = 0.3
        linear_density = 0.05
        stretch_stiffness = 100.0
        initial = { shape = "straight", from = [0, 0, 0], direction = [0, 0, -1] }
        [[gripper]]
        name = "hand"
        rope = "rope"
        nodes = [0]
        mode = "velocity"
    "#;
    let scene = pliant_scene::parse_scene(text, "rope.toml").unwrap();
    Arc::new(ModelBuilder::new(&scene).unwrap().build())
}

/// The hand to x = 0.1 m, at most 0.1 m/s; refuses to be evaluated if told so.
struct Pull {
    refuses: bool,
    ndx: usize,
}

impl Problem for Pull {
    fn evaluate(&self, _: usize, _: usize, x: &State, u: Option<&[f64]>, out: &mut Terms) -> Result<(), String> {
        if self.refuses {
            return Err("not today".to_owned());
        }
        let row = out.residuals.push(x.q[0] - 0.1);
        out.residuals.slope(row, 0, 1.0);
        for (c, u) in u.into_iter().flatten().enumerate() {
            let row = out.residuals.push(0.01 * u);
            out.residuals.slope(row, self.ndx + c, 0.01);
        }
        let row = out.constrain(x.q[0] - 0.01, 10.0);
        out.constraints.slope(row, 0, 1.0);
        Ok(())
    }

    fn bounds(&self, _: usize, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(-0.1);
        upper.fill(0.1);
    }
}

#[test]
fn the_engine_is_a_plant_and_its_disturbances_are_drawn_from_the_ball() {
    let model = model();
    let (theta, x0) = (model.params().values(), model.initial_state());
    let u = [0.1, 0.0, 0.0];
    let after = |plant: ModelPlant| {
        let mut plant = plant;
        plant.apply(&u).unwrap();
        plant.state().unwrap()
    };
    let still = after(ModelPlant::new(&model, theta, &x0).unwrap());
    assert!((still.q[0] - 0.002).abs() < 1e-12, "the hand moves by its velocity");
    let free = free_rows(&model);
    assert_eq!(free, (3..12).collect::<Vec<_>>());
    let mut lengths = Vec::new();
    for seed in 0..40 {
        let moved = after(ModelPlant::new(&model, theta, &x0).unwrap().disturbed(1e-3, seed));
        let change = model.difference(&moved, &still);
        assert!(change.iter().enumerate().all(|(row, d)| free.contains(&row) || *d == 0.0), "seed {seed}: {change:?}");
        lengths.push(change.iter().map(|d| d * d).sum::<f64>().sqrt());
    }
    assert!(lengths.iter().all(|l| *l <= 1e-3 * (1.0 + 1e-12)), "{lengths:?}");
    // uniform in a ball of nine dimensions: the mean length is 9/10 of the radius, with a standard deviation of 0.014 radii over 40 seeds
    let mean = lengths.iter().sum::<f64>() / 40.0;
    assert!((mean / 1e-3 - 0.9).abs() < 0.06, "{mean}");
    let twice = [4, 4, 5].map(|seed| after(ModelPlant::new(&model, theta, &x0).unwrap().disturbed(1e-3, seed)).q);
    assert!(twice[0] == twice[1] && twice[0] != twice[2], "the seed decides");
    let ball = ball_of_free_nodes(&model, 1e-3);
    assert_eq!((ball.nrows(), ball.ncols()), (model.ndx(), 9));
    assert!((0..9).all(|c| (0..model.ndx()).all(|r| ball[(r, c)] == if r == free[c] { 1e-3 } else { 0.0 })));
    let error = ModelPlant::new(&model, theta, &x0).unwrap().apply(&[0.0]).unwrap_err();
    assert!(error.contains("1 entries"), "{error}");
}

#[test]
fn controllers_hold_the_inputs_that_their_plan_has_for_now() {
    let model = model();
    let (theta, x0) = (model.params().values(), model.initial_state());
    let options = PlanOptions { iterations: 3, ..PlanOptions::default() };
    let guess: Vec<Vec<f64>> = (0..4).map(|k| vec![0.04 * k as f64 - 0.01, 0.5, 0.0]).collect();
    let pull = |refuses| Pull { refuses, ndx: model.ndx() };
    let mut mpc = Mpc::new(pull(true), &model, theta, guess.clone(), options).unwrap();
    assert!(mpc.decide(&Measured::State(x0.clone())).is_err());
    let held: Vec<Vec<f64>> = (0..5).map(|_| Controller::hold(&mut mpc)).collect();
    let expected = [[-0.01, 0.1, 0.0], [0.03, 0.1, 0.0], [0.07, 0.1, 0.0], [0.1, 0.1, 0.0], [0.1, 0.1, 0.0]];
    assert!(held.iter().flatten().zip(expected.as_flattened()).all(|(a, b)| (a - b).abs() < 1e-15), "{held:?}");

    let mut mpc = Mpc::new(pull(false), &model, theta, guess.clone(), options).unwrap();
    let decision = mpc.decide(&Measured::State(x0.clone())).unwrap();
    assert!(decision.inputs[0] > 0.0 && !decision.steps.is_empty() && decision.reach.is_none());
    let second = mpc.controls()[0].clone();
    assert_eq!(Controller::hold(&mut mpc), second, "the second row of the plan");

    // a plan whose tube fails is kept, and not shifted
    let bad = TubeOptions::of_ball(&model, f64::NAN);
    let mut robust = RobustMpc::new(pull(false), &model, theta, guess.clone(), options, bad).unwrap();
    let error = robust.decide(&Measured::State(x0.clone())).unwrap_err();
    assert!(matches!(error, RobustError::Tube(_)), "{error}");
    assert_eq!(Controller::hold(&mut robust), decision.inputs);
    assert_eq!(Controller::hold(&mut robust), second);

    let tubes = TubeOptions::of_ball(&model, 1e-4);
    let mut robust = RobustMpc::new(pull(false), &model, theta, guess, options, tubes).unwrap();
    let decision = robust.decide(&Measured::State(x0.clone())).unwrap();
    assert!(decision.reach.is_some());
    let next = Controller::hold(&mut robust);
    assert!(next.len() == 3 && next.iter().all(|u| u.abs() <= 0.1), "{next:?}");
}

#[test]
fn a_loop_is_scored_by_its_own_states() {
    let states: Vec<State> = [0.0, 0.03, 0.02].iter().map(|q| State { q: vec![*q], v: Vec::new(), z: Vec::new() }).collect();
    let found = score(&Pull { refuses: false, ndx: 2 }, &states, &[vec![2.0], vec![0.0]]).unwrap();
    let expected = [0.5 * (0.01 + 0.0004), 0.5 * 0.0049, 0.5 * 0.0064];
    assert!(found.stage_costs.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15), "{found:?}");
    let said: Vec<_> = found.violations.iter().map(|v| (v.stage, v.constraint.as_str())).collect();
    assert_eq!(said, [(1, "constraint 0 of stage 1 of 2"), (2, "constraint 0 of stage 2 of 2")]);
    assert!((found.violations[0].by - 0.02).abs() < 1e-15);
    assert!(score(&Pull { refuses: true, ndx: 2 }, &states, &[vec![0.0], vec![0.0]]).is_err());
}
