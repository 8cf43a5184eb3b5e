//! Seconds per unit of work, timed here so that no interpreter is in the figure.

use crate::errors::{self, input};
use crate::model::Model;
use pliant::scene::Source;
use pliant::{Differentiate, Linearizer, State, StepOptions, Stepper, rollout};
use pyo3::prelude::*;
use std::hint::black_box;
use std::time::Instant;

const FORWARD: StepOptions = StepOptions { record: false, max_halvings: None };
const RECORDED: StepOptions = StepOptions { record: true, max_halvings: None };

/// Seconds per unit of work over `repeats` units: the mean of "step" or "linearize", the median of "rollout" or "rollout_vjp".
#[pyfunction]
pub fn bench(py: Python<'_>, scene_text: &str, work: &str, repeats: usize) -> PyResult<f64> {
    let model = Model::build(py, &Source::new("scene.toml", scene_text))?;
    py.detach(|| {
        let theta = model.theta_or_default(None)?;
        let setup = Setup { x0: model.start(&theta)?, u: model.rows(None)?, theta, model };
        if repeats == 0 || setup.u.is_empty() {
            return Err(input("nothing to time: repeats and the scene's number of steps must be positive"));
        }
        // steps differ along a rollout: their mean is the cost of a rollout, as a peer that is timed over many steps reports
        let times = match work {
            "step" => return setup.steps(FORWARD, repeats, false).map(mean),
            "linearize" => return setup.steps(RECORDED, repeats, true).map(mean),
            "rollout" => (0..repeats).map(|_| setup.rollout()).collect::<PyResult<_>>()?,
            "rollout_vjp" => setup.rollout_vjps(repeats)?,
            _ => return Err(input(format!("work is \"{work}\", but must be step, linearize, rollout or rollout_vjp"))),
        };
        Ok(median(times))
    })
}

struct Setup {
    model: Model,
    theta: Vec<f64>,
    x0: State,
    u: Vec<Vec<f64>>,
}

impl Setup {
    /// Times steps one by one along the scene's rollout, again from its start when it ends; with the Jacobians A and B of each
    /// step, if asked for.
    fn steps(&self, options: StepOptions, repeats: usize, jacobians: bool) -> PyResult<Vec<f64>> {
        let model = self.model.engine();
        let mut times = Vec::with_capacity(repeats);
        // it holds matrices of the size of a state squared
        let mut linearizer = jacobians.then(|| Linearizer::new(model, &self.theta, false));
        while times.len() < repeats {
            let mut stepper = Stepper::new(model, &self.theta, options).map_err(errors::step)?;
            let mut state = self.x0.clone();
            for (k, u) in self.u.iter().enumerate().take(repeats - times.len()) {
                let begin = Instant::now();
                let (_, record) = stepper.step(&mut state, u).map_err(|e| errors::step(e.at_step(k)))?;
                if let (Some(record), Some(linearizer)) = (record, &mut linearizer) {
                    black_box(linearizer.linearize(&record));
                }
                times.push(begin.elapsed().as_secs_f64());
            }
        }
        Ok(times)
    }

    fn rollout(&self) -> PyResult<f64> {
        let begin = Instant::now();
        black_box(rollout(self.model.engine(), &self.theta, &self.x0, &self.u, FORWARD).map_err(errors::step)?);
        Ok(begin.elapsed().as_secs_f64())
    }

    /// A rollout with records and the gradient of the sum of all its states.
    fn rollout_vjps(&self, repeats: usize) -> PyResult<Vec<f64>> {
        let x_bar = vec![vec![1.0; self.model.engine().ndx()]; self.u.len() + 1];
        let one = |_| {
            let begin = Instant::now();
            let run = rollout(self.model.engine(), &self.theta, &self.x0, &self.u, RECORDED).map_err(errors::step)?;
            black_box(run.vjp(&x_bar).map_err(errors::adjoint)?);
            Ok(begin.elapsed().as_secs_f64())
        };
        (0..repeats).map(one).collect()
    }
}

fn mean(times: Vec<f64>) -> f64 {
    times.iter().sum::<f64>() / times.len() as f64
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    let (low, high) = (times[(times.len() - 1) / 2], times[times.len() / 2]);
    0.5 * (low + high)
}
