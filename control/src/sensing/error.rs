//! Why there is no estimate.

use pliant_engine::step::StepError;

/// Why there is no estimate.
#[derive(Clone, Debug, thiserror::Error)]
pub enum SensingError {
    /// A reading of another size.
    #[error(
        "a reading has {got} numbers, but {expected} are needed: one for each of the {outputs} outputs, then 1 or 0 for each of the {grasps} \
         grasping gripper(s) that holds something or does not"
    )]
    Size {
        /// Numbers given.
        got: usize,
        /// Numbers needed.
        expected: usize,
        /// Outputs.
        outputs: usize,
        /// Grasping grippers.
        grasps: usize,
    },
    /// A number of a reading is infinite or NaN.
    #[error("the reading of {name} (number {number}) is {value}: give no reading at all where a sensor failed")]
    NotFinite {
        /// Its number.
        number: usize,
        /// Its words.
        name: String,
        /// Its value.
        value: f64,
    },
    /// A reading where none can have come yet.
    #[error(
        "a reading came at step {step}, but with a delay of {delay} step(s) that of the start comes at step {delay}: give none before"
    )]
    Early {
        /// Steps taken.
        step: usize,
        /// Delay in steps.
        delay: usize,
    },
    /// A noise that is negative or not finite, or an output that the model does not have.
    #[error("sensor output {number} ({name}): {what}")]
    Output {
        /// Its number.
        number: usize,
        /// Its words.
        name: String,
        /// The mistake, and how to correct it.
        what: String,
    },
    /// A controller of readings was given the state, or one of the state a reading.
    #[error("the controller needs {needed}, but was given {given}: {fix}")]
    Kind {
        /// State or readings.
        needed: &'static str,
        /// State or readings.
        given: &'static str,
        /// How to correct it.
        fix: &'static str,
    },
    /// The model cannot follow the inputs that were sent.
    #[error("the estimate cannot be carried to the present: {0}")]
    Step(#[from] StepError),
}
