//! Controllers of readings: the same as of the state where readings are exact, and safe where they are not.

use faer::Mat;
use pliant_control::closed_loop::{Controller, LoopError, LoopOptions, Measured, ModelPlant, Plant, run_loop};
use pliant_control::output::{OutputMpc, OutputOptions, Planned};
use pliant_control::plan::PlanOptions;
use pliant_control::problem::{Problem, Terms};
use pliant_control::robust::{RobustMpc, TubeOptions, ball_of_free_nodes, free_rows};
use pliant_control::sensing::{Output, Sensors};
use pliant_engine::model::{Model, ModelBuilder};
use pliant_engine::step::{StepOptions, Stepper};
use pliant_math::State;
use std::sync::Arc;

const N: usize = 6;
const NODES: usize = 4;
/// Of the last node: x may not be beyond \[m\].
const WALL: f64 = 0.02;

/// A rope on a hand, which forgets velocities.
fn model() -> Arc<Model> {
    let text = format!(
        r#"
        schema_version = 1
        [time]
        step = 0.05
        duration = 1.0
        integrator = "quasi_static"
        [[rope]]
        name = "rope"
        nodes = {NODES}
        length = 0.15
        linear_density = 0.05
        stretch_stiffness = 50.0
        bend_stiffness = 1e-4
        drag_linear = 0.1
        initial = {{ shape = "straight", from = [0, 0, 0], direction = [0, 0, -1] }}
        [[gripper]]
        name = "hand"
        rope = "rope"
        nodes = [0]
        mode = "velocity"
        "#
    );
    let scene = pliant_scene::parse_scene(&text, "rope.toml").unwrap();
    Arc::new(ModelBuilder::new(&scene).unwrap().build())
}

/// The last node to x = 0.03 m, which is behind a wall.
#[derive(Clone)]
struct Wall {
    ndx: usize,
}

impl Problem for Wall {
    fn evaluate(&self, k: usize, _: usize, x: &State, u: Option<&[f64]>, out: &mut Terms) -> Result<(), String> {
        let tip = 3 * (NODES - 1);
        if k > 0 {
            let row = out.residuals.push(x.q[tip] - 0.03);
            out.residuals.slope(row, tip, 1.0);
            let row = out.constrain(x.q[tip] - WALL, 1e3);
            out.constraints.slope(row, tip, 1.0);
        }
        for (c, u) in u.into_iter().flatten().enumerate() {
            let row = out.residuals.push(0.05 * u);
            out.residuals.slope(row, self.ndx + c, 0.05);
        }
        Ok(())
    }

    fn bounds(&self, _: usize, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(-0.3);
        upper.fill(0.3);
    }
}

fn sensors(noise: f64, delay: usize) -> Sensors {
    Sensors { outputs: (0..NODES).flat_map(|node| Output::of_node(node, noise)).collect(), delay }
}

fn controller(model: &Arc<Model>, sensors: Sensors, radius: f64, tighten: bool) -> OutputMpc<Wall> {
    let options = OutputOptions { sensors, tubes: TubeOptions::of_ball(model, radius), tighten };
    let (problem, theta, guess) = (Wall { ndx: model.ndx() }, model.params().values(), vec![vec![0.0; 3]; N]);
    OutputMpc::new(problem, model, theta, &model.initial_state(), guess, PlanOptions::default(), options).unwrap()
}

/// A plant of the same model whose last node is moved by `by` after every step, and its readings.
struct Pushed {
    model: Arc<Model>,
    stepper: Stepper<'static>,
    x: State,
    by: f64,
}

impl Pushed {
    fn new(model: &Arc<Model>, by: f64) -> Self {
        let options = StepOptions { record: false, ..StepOptions::default() };
        let stepper = Stepper::shared(Arc::clone(model), model.params().values().to_vec(), options).unwrap();
        Self { model: Arc::clone(model), stepper, x: model.initial_state(), by }
    }

    fn step(&mut self, u: &[f64]) {
        self.stepper.step(&mut self.x, u).unwrap();
        let mut change = vec![0.0; self.model.ndx()];
        change[3 * (NODES - 1)] = self.by;
        self.x = self.model.displaced(&self.x, &change);
    }

    fn tip(&self) -> f64 {
        self.x.q[3 * (NODES - 1)]
    }
}

#[test]
fn exact_readings_are_state_feedback() {
    let (model, radius) = (model(), 1e-3);
    let (problem, theta, guess) = (Wall { ndx: model.ndx() }, model.params().values(), vec![vec![0.0; 3]; N]);
    let tubes = TubeOptions::of_ball(&model, radius);
    let mut by_state = RobustMpc::new(problem, &model, theta, guess, PlanOptions::default(), tubes).unwrap();
    let mut by_readings = controller(&model, sensors(0.0, 0), radius, true);
    let mut plant = Pushed::new(&model, 5e-4);
    let mut widest: f64 = 0.0;
    for _ in 0..8 {
        let expected = by_state.update(&plant.x).unwrap();
        let reading = by_readings.sensors().read(&model, &plant.x);
        let found = by_readings.update(Some(&reading)).unwrap();
        let Planned::Tubes(found) = found.planned else { panic!("tightened") };
        for (a, b) in found.update.rollout.controls.iter().flatten().zip(expected.update.rollout.controls.iter().flatten()) {
            assert!((a - b).abs() < 1e-10, "{a} against {b}");
        }
        for k in 0..=N {
            let (a, b) = (&found.tube.tightenings, &expected.tube.tightenings);
            let pairs = a.rows(k).iter().chain(a.inputs(k)).zip(b.rows(k).iter().chain(b.inputs(k)));
            pairs.for_each(|(a, b)| assert!((a - b).abs() < 1e-10, "stage {k}: {a} against {b}"));
        }
        widest = widest.max(found.tightening());
        plant.step(&found.update.rollout.controls[0]);
    }
    assert!(widest > radius, "{widest}");
}

#[test]
fn a_delay_costs_nothing_where_the_model_is_exact() {
    let model = model();
    let run = |delay: usize| {
        let mut mpc = controller(&model, sensors(0.0, delay), 1e-3, false);
        let (mut plant, mut seen, mut inputs) = (Pushed::new(&model, 0.0), Vec::new(), Vec::new());
        for k in 0_usize..8 {
            seen.push(mpc.sensors().read(&model, &plant.x));
            let reading = k.checked_sub(delay).map(|k| seen[k].clone());
            let found = mpc.update(reading.as_deref()).unwrap();
            assert!(found.estimate.q.iter().zip(&plant.x.q).all(|(a, b)| (a - b).abs() < 1e-12));
            let u = found.planned.update().rollout.controls[0].clone();
            plant.step(&u);
            inputs.push(u);
        }
        inputs
    };
    let prompt = run(0);
    assert!(prompt.iter().flatten().any(|u| u.abs() > 0.01));
    for delay in [1, 3] {
        let pairs = run(delay);
        assert!(pairs.iter().flatten().zip(prompt.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-10), "{delay}");
    }
}

/// Every step's disturbance pushes the tip towards the wall with all of its radius, and every reading says, with all of its ball, that it
/// is farther away.
#[test]
fn the_worst_disturbances_and_noises_stay_outside_of_the_wall() {
    let (model, radius, noise, delay) = (model(), 1e-3, 5e-4, 2);
    let closest = |tighten: bool| {
        let mut mpc = controller(&model, sensors(noise, delay), radius, tighten);
        let (mut plant, mut seen, mut closest) = (Pushed::new(&model, radius), Vec::new(), f64::NEG_INFINITY);
        for k in 0_usize..40 {
            let mut reading = mpc.sensors().read(&model, &plant.x);
            reading[3 * (NODES - 1)] -= 3.0 * noise;
            seen.push(reading);
            let found = mpc.update(k.checked_sub(delay).map(|k| seen[k].as_slice())).unwrap();
            plant.step(&found.planned.update().rollout.controls[0]);
            closest = closest.max(plant.tip() - WALL);
        }
        closest
    };
    let (nominal, tubes) = (closest(false), closest(true));
    assert!(nominal > 2.0 * radius, "{nominal}");
    assert!((-radius..=0.0).contains(&tubes), "{tubes}");
}

/// Noise that the readings are averaged over, lost readings, and inputs that were not those decided.
#[test]
fn estimates_are_nearer_than_readings() {
    let (model, noise, delay) = (model(), 2e-3, 1);
    let mut mpc = controller(&model, sensors(noise, delay), 2e-4, false);
    let theta = model.params().values();
    let x0 = model.initial_state();
    let mut plant = ModelPlant::new(&model, theta, &x0).unwrap().disturbed(2e-4, 3).read_by(sensors(noise, delay), 3);
    let (mut of_estimate, mut of_reading, mut count) = (0.0_f64, 0.0_f64, 0.0);
    for k in 0..60 {
        let Measured::Readings(reading) = plant.measure().unwrap() else { panic!("readings") };
        assert_eq!(reading.is_some(), k >= delay);
        assert_eq!(plant.measure().unwrap(), Measured::Readings(reading.clone()), "asked twice");
        let lost = k % 7 == 3;
        let found = mpc.update(reading.as_deref().filter(|_| !lost)).unwrap();
        let truth = plant.state().unwrap();
        let error = |q: &[f64]| (3..3 * NODES).map(|c| (q[c] - truth.q[c]).powi(2)).sum::<f64>();
        if let Some(reading) = reading.filter(|_| k > 10) {
            (of_estimate, of_reading, count) =
                (of_estimate + error(&found.estimate.q), of_reading + error(&reading), count + 1.0);
        }
        let u: Vec<f64> = found.planned.update().rollout.controls[0].iter().map(|u| 0.5 * u).collect();
        plant.apply(&u).unwrap();
        mpc.sent(&u).unwrap();
    }
    let (of_estimate, of_reading) = ((of_estimate / count).sqrt(), (of_reading / count).sqrt());
    // nine numbers, each with the noise
    assert!(of_estimate < 0.5 * 3.0 * noise && of_estimate < 0.5 * of_reading, "{of_estimate} against {of_reading}");
}

#[test]
fn loops_run_on_readings_and_refuse_what_does_not_fit() {
    let model = model();
    let (theta, x0) = (model.params().values(), model.initial_state());
    let plant = || ModelPlant::new(&model, theta, &x0).unwrap().disturbed(1e-4, 1);
    let options = LoopOptions { steps: 8, silence: 0, failures: 1 };
    let mut mpc = controller(&model, sensors(1e-4, 2), 1e-4, true);
    let found = run_loop(&mut mpc, &mut plant().read_by(sensors(1e-4, 2), 1), options, &mut |_, _| ()).unwrap();
    assert!(found.end.is_some() && found.steps.iter().all(|step| step.state.is_some() && step.failure.is_none()));
    assert!(found.steps.iter().all(|step| step.decision.as_ref().unwrap().reach.is_some()));

    let said = |error: LoopError| error.to_string();
    let mut mpc = controller(&model, sensors(1e-4, 2), 1e-4, true);
    let error = run_loop(&mut mpc, &mut plant(), options, &mut |_, _| ()).map(|_| ()).map_err(said).unwrap_err();
    assert!(error.contains("needs readings, but was given its state"), "{error}");
    let tubes = TubeOptions::of_ball(&model, 1e-4);
    let guess = vec![vec![0.0; 3]; N];
    let mut by_state = RobustMpc::new(Wall { ndx: model.ndx() }, &model, theta, guess, PlanOptions::default(), tubes).unwrap();
    let read = Measured::Readings(None);
    let error = by_state.decide(&read).unwrap_err().to_string();
    assert!(error.contains("needs the state, but was given readings"), "{error}");

    let mut mpc = controller(&model, sensors(1e-4, 2), 1e-4, true);
    let reading = mpc.sensors().read(&model, &x0);
    for (reading, says) in [(reading.clone(), "that of the start comes at step 2"), (vec![0.0; 5], "at step 2")] {
        let error = mpc.update(Some(&reading)).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
    let mut mpc = controller(&model, sensors(1e-4, 0), 1e-4, true);
    let error = mpc.update(Some(&reading[1..])).unwrap_err().to_string();
    assert!(error.contains("11 numbers, but 12 are needed"), "{error}");
    let mut broken = reading.clone();
    broken[4] = f64::NAN;
    let error = mpc.update(Some(&broken)).unwrap_err().to_string();
    assert!(error.contains("y of node 1 (number 4) is NaN"), "{error}");
    assert!(mpc.sent(&[0.0]).is_err());

    let made = |outputs: Vec<Output>| {
        let tubes =
            TubeOptions { disturbance: ball_of_free_nodes(&model, 1e-4), initial: Mat::zeros(model.ndx(), 0), exact: true };
        let options = OutputOptions { sensors: Sensors { outputs, delay: 0 }, tubes, tighten: true };
        OutputMpc::new(Wall { ndx: model.ndx() }, &model, theta, &x0, vec![vec![0.0; 3]; N], PlanOptions::default(), options)
            .map(|_| ())
            .map_err(|error| error.to_string())
    };
    assert!(made(Output::of_node(NODES, 1e-3).into()).unwrap_err().contains("the model has 12 positions"));
    assert!(made(Output::of_node(0, -1.0).into()).unwrap_err().contains("its noise is -1"));
    assert_eq!(free_rows(&model).len(), 9);
}
