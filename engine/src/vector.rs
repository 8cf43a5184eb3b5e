//! Many copies of one model, stepped together: each with its state, its parameters and its warm start.
//!
//! A copy takes the steps that a rollout takes, bitwise, whatever the other copies do and on however many threads: nothing is shared
//! between them but the model. A step that fails ends its copy alone.

use crate::model::Model;
use crate::rollout::{Rollout, records_fit};
use crate::step::{Run, StepError, StepOptions, StepTrace, Stepper};
use pliant_math::State;
use pliant_scene::available_memory;
use rayon::prelude::*;
use std::sync::Arc;

/// What a [`VectorStepper`] was asked for and cannot do. No copy has changed.
#[derive(Clone, Debug, thiserror::Error)]
pub enum VectorError {
    /// No copies.
    #[error("a vector stepper of 0 copies has nothing to step: ask for at least 1")]
    Empty,
    /// Inputs of another number than copies times inputs.
    #[error("u has {got} entries, but {copies} copies with {nu} inputs each need {}: give one row per copy", copies * nu)]
    Inputs {
        /// Entries given.
        got: usize,
        /// Number of copies.
        copies: usize,
        /// Inputs of each.
        nu: usize,
    },
    /// An input or an entry of a state is NaN or infinite.
    #[error("{what} of copy {copy} is {value} in component {component}, but must be finite: check what computed it")]
    NotFinite {
        /// `u` or `x`.
        what: &'static str,
        /// Copy, from 0.
        copy: usize,
        /// Component of the input vector, or of x = (q, v, z), from 0.
        component: usize,
        /// The number.
        value: f64,
    },
    /// There is no copy of that number.
    #[error("there is no copy {copy}: there are {copies}, counted from 0")]
    NoCopy {
        /// Number given.
        copy: usize,
        /// Number of copies.
        copies: usize,
    },
    /// Derivatives are asked of a copy whose last step was not recorded.
    #[error(
        "copy {copy} has no record of a last step, which derivatives need: take the step with records, and differentiate it before the \
         copy is reset or gets other parameters"
    )]
    NoRecord {
        /// Copy, from 0.
        copy: usize,
    },
    /// A state or parameters that a copy cannot begin with.
    #[error("copy {copy}: {source}")]
    Copy {
        /// Copy, from 0.
        copy: usize,
        /// Why.
        source: StepError,
    },
    /// Copies that do not fit into memory.
    #[error("{copies} copies take at least {bytes} bytes, and {available} are free: step fewer at once")]
    Memory {
        /// Number of copies.
        copies: usize,
        /// Bytes that they take at least.
        bytes: u64,
        /// Bytes that are free.
        available: u64,
    },
    /// Records of all copies do not fit into memory.
    #[error(transparent)]
    Records(StepError),
}

/// Copies of one model that are stepped together.
///
/// ```
/// # use pliant_engine::{model::ModelBuilder, vector::VectorStepper};
/// # use std::sync::Arc;
/// # let text = r#"
/// # schema_version = 1
/// # [time]
/// # step = 0.01
/// # duration = 0.1
/// # [[rope]]
/// # name = "cable"
/// # nodes = 5
/// # length = 0.5
/// # linear_density = 0.05
/// # stretch_stiffness = 500.0
/// # bend_stiffness = 1e-3
/// # initial = { shape = "straight", from = [0, 0, 0], direction = [1, 0, 0] }
/// # "#;
/// # let scene: pliant_scene::Scene = pliant_scene::parse_scene(text, "falling.toml")?;
/// let model = Arc::new(ModelBuilder::new(&scene)?.build());
/// let mut ropes = VectorStepper::new(&model, 8)?;
/// let u = vec![0.0; ropes.len() * model.nu()];
/// for _ in 0..10 {
///     ropes.step(&u, false)?;
/// }
/// for rope in ropes.copies() {
///     assert!(rope.failure().is_none() && rope.state().v[2] < -0.9); // m/s
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct VectorStepper {
    model: Arc<Model>,
    copies: Vec<ModelCopy>,
    /// Whether records of all copies were found to fit into memory.
    records_fit: bool,
}

/// One of the copies of a [`VectorStepper`].
#[derive(Clone, Debug)]
pub struct ModelCopy {
    stepper: Stepper<'static>,
    state: State,
    /// The state before the last step, or a buffer for it.
    before: State,
    /// What the steps at the halving limit before it created: the rollout's judgement.
    run: Run,
    steps: usize,
    trace: StepTrace,
    /// The last step, if it was recorded.
    record: Option<Arc<Rollout>>,
    failure: Option<StepError>,
}

impl VectorStepper {
    /// `n` copies in the model's initial state, with its parameters.
    ///
    /// # Errors
    /// No copies, or more than memory holds; a matrix of the step that cannot be analysed.
    pub fn new(model: &Arc<Model>, n: usize) -> Result<Self, VectorError> {
        if n == 0 {
            return Err(VectorError::Empty);
        }
        available_memory().map_or(Ok(()), |available| fits(n, model, available))?;
        let theta = model.params().values();
        let copy = ModelCopy::new(model, theta, model.initial_state()).map_err(|source| VectorError::Copy { copy: 0, source })?;
        Ok(Self { model: Arc::clone(model), copies: vec![copy; n], records_fit: false })
    }

    /// The model.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// Number of copies.
    #[allow(clippy::len_without_is_empty)] // it has at least one
    pub fn len(&self) -> usize {
        self.copies.len()
    }

    /// The copies.
    pub fn copies(&self) -> &[ModelCopy] {
        &self.copies
    }

    /// One of the copies.
    ///
    /// # Errors
    /// There is no such copy.
    pub fn copy(&self, copy: usize) -> Result<&ModelCopy, VectorError> {
        self.copies.get(copy).ok_or(VectorError::NoCopy { copy, copies: self.copies.len() })
    }

    fn copy_mut(&mut self, copy: usize) -> Result<&mut ModelCopy, VectorError> {
        let copies = self.copies.len();
        self.copies.get_mut(copy).ok_or(VectorError::NoCopy { copy, copies })
    }

    /// Takes a step of every copy that has not failed, on the threads of the current rayon pool; a single copy on the thread that calls.
    ///
    /// `u`: (n, nu), row-major, in the units of the inputs. With `record` every copy keeps its step for derivatives, until its next
    /// step ([`VectorStepper::record`]); that changes no state. A copy whose step fails keeps the state before it and takes no more
    /// steps until it is reset: see [`ModelCopy::failure`].
    ///
    /// # Errors
    /// Inputs of another size or not finite, records that do not fit into memory: then no copy has taken a step.
    pub fn step(&mut self, u: &[f64], record: bool) -> Result<(), VectorError> {
        self.check_inputs(u)?;
        if record && !self.records_fit {
            records_fit(self.copies.len(), &self.model).map_err(VectorError::Records)?;
            self.records_fit = true;
        }
        let (model, nu) = (&self.model, self.model.nu());
        let one = |(k, copy): (usize, &mut ModelCopy)| copy.step(model, &u[k * nu..(k + 1) * nu], record);
        // to hand a single task to the pool takes as long as a step of a small scene
        if self.copies.len() == 1 {
            self.copies.iter_mut().enumerate().for_each(one);
        } else {
            // copies differ in work, so that a thread without any takes over single ones
            self.copies.par_iter_mut().enumerate().with_max_len(1).for_each(one);
        }
        Ok(())
    }

    fn check_inputs(&self, u: &[f64]) -> Result<(), VectorError> {
        let (copies, nu) = (self.copies.len(), self.model.nu());
        if u.len() != copies * nu {
            return Err(VectorError::Inputs { got: u.len(), copies, nu });
        }
        match u.iter().position(|value| !value.is_finite()) {
            Some(k) => Err(VectorError::NotFinite { what: "u", copy: k / nu, component: k % nu, value: u[k] }),
            None => Ok(()),
        }
    }

    /// Lets a copy start anew from `x` at time zero, with the parameters that it has: as a new rollout, without warm start, failure and
    /// record.
    ///
    /// # Errors
    /// There is no such copy; a state of another size, not finite, or with reference axes that do not belong to its positions.
    pub fn reset(&mut self, copy: usize, x: &State) -> Result<(), VectorError> {
        self.copy(copy)?;
        check_state(&self.model, copy, x)?;
        self.copy_mut(copy)?.reset(x);
        Ok(())
    }

    /// Gives a copy other parameters (n_params), in SI units. It goes on from its state and time as a rollout that starts there: without
    /// warm start and record. A failed copy stays failed.
    ///
    /// # Errors
    /// There is no such copy; parameters of another size or out of their bounds.
    pub fn set_theta(&mut self, copy: usize, theta: &[f64]) -> Result<(), VectorError> {
        self.copy(copy)?;
        let stepper = stepper(&self.model, theta).map_err(|source| VectorError::Copy { copy, source })?;
        let changed = self.copy_mut(copy)?;
        (changed.stepper, changed.run, changed.record) = (stepper, Run::default(), None);
        Ok(())
    }

    /// Makes copy `to` the same as copy `from`: state, time, parameters, warm start, failure and record, so that both go on alike.
    ///
    /// # Errors
    /// There is no such copy.
    pub fn clone_copy(&mut self, from: usize, to: usize) -> Result<(), VectorError> {
        let source = self.copy(from)?.clone();
        *self.copy_mut(to)? = source;
        Ok(())
    }

    /// The last step of a copy as a rollout of one step, x₀ → x₁, with its record: for jvp, vjp and Jacobians.
    ///
    /// # Errors
    /// There is no such copy, or its last step was not recorded.
    pub fn record(&self, copy: usize) -> Result<&Arc<Rollout>, VectorError> {
        self.copy(copy)?.record.as_ref().ok_or(VectorError::NoRecord { copy })
    }
}

impl ModelCopy {
    fn new(model: &Arc<Model>, theta: &[f64], state: State) -> Result<Self, StepError> {
        Ok(Self {
            stepper: stepper(model, theta)?,
            before: state.clone(),
            state,
            run: Run::default(),
            steps: 0,
            trace: StepTrace::default(),
            record: None,
            failure: None,
        })
    }

    /// Its state: of a failed copy, the last before the failure.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Time since it was made or reset \[s\].
    pub fn time(&self) -> f64 {
        self.steps as f64 * self.stepper.step_length()
    }

    /// Its parameters.
    pub fn theta(&self) -> &[f64] {
        self.stepper.theta()
    }

    /// Work of its last step, and whether it was halved.
    pub fn trace(&self) -> &StepTrace {
        &self.trace
    }

    /// Why its step failed, with the number of the step since it was made or reset; `None` while it takes steps.
    pub fn failure(&self) -> Option<&StepError> {
        self.failure.as_ref()
    }

    fn reset(&mut self, x: &State) {
        assign(&mut self.state, x);
        self.stepper.forget();
        (self.run, self.steps, self.trace) = (Run::default(), 0, StepTrace::default());
        (self.record, self.failure) = (None, None);
    }

    fn step(&mut self, model: &Arc<Model>, u: &[f64], record: bool) {
        if self.failure.is_some() {
            return;
        }
        // its memory is free before the next record is made
        self.record = None;
        if let Err(error) = self.advance(model, u, record) {
            std::mem::swap(&mut self.state, &mut self.before);
            self.failure = Some(error.at_step(self.steps));
        }
    }

    /// On error `before` has the state that counts.
    fn advance(&mut self, model: &Arc<Model>, u: &[f64], record: bool) -> Result<(), StepError> {
        assign(&mut self.before, &self.state);
        self.stepper.set_record(record);
        let (trace, record) = self.stepper.step(&mut self.state, u)?;
        self.stepper.continue_run(&mut self.run, &trace.last_halves, &self.before, &self.state)?;
        self.steps += 1;
        self.trace = trace;
        self.record = record.map(|record| {
            Arc::new(Rollout {
                model: Arc::clone(model),
                theta: self.stepper.theta().to_vec(),
                states: vec![self.before.clone(), self.state.clone()],
                controls: vec![u.to_vec()],
                traces: vec![trace],
                records: vec![record],
                checkpoints: None,
            })
        });
        Ok(())
    }
}

fn stepper(model: &Arc<Model>, theta: &[f64]) -> Result<Stepper<'static>, StepError> {
    Stepper::shared(Arc::clone(model), theta.to_vec(), StepOptions { record: false, ..StepOptions::default() })
}

/// Refuses copies that certainly do not fit into memory, from their states and their dense matrices of bodies: ∂f/∂q̄, ∂f/∂v̄, the matrix
/// of the step, and its factor.
fn fits(copies: usize, model: &Model, available: u64) -> Result<(), VectorError> {
    let numbers = 4 * (model.tree().nv() as u64).pow(2) + 2 * model.nx() as u64;
    let one = size_of::<ModelCopy>() as u64 + numbers.saturating_mul(size_of::<f64>() as u64);
    let bytes = one.saturating_mul(copies as u64);
    if bytes > available { Err(VectorError::Memory { copies, bytes, available }) } else { Ok(()) }
}

fn check_state(model: &Model, copy: usize, x: &State) -> Result<(), VectorError> {
    let refused = |source| VectorError::Copy { copy, source };
    model.check_sizes(x).map_err(refused)?;
    let numbers = x.q.iter().chain(&x.v).chain(&x.z);
    if let Some((component, &value)) = numbers.enumerate().find(|(_, value)| !value.is_finite()) {
        return Err(VectorError::NotFinite { what: "x", copy, component, value });
    }
    model.check_frames(x).map_err(refused)
}

/// Copies a state in the memory of another.
fn assign(to: &mut State, from: &State) {
    to.q.clone_from(&from.q);
    to.v.clone_from(&from.v);
    to.z.clone_from(&from.z);
}
