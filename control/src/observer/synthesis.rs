//! Tubes of output feedback, for the alternation with the nominal problem.

use super::error::ObserverError;
use super::kalman::{Observer, Sensing};
use super::rows::row_tightenings;
use crate::tube::{Gains, Reach, RowValues, Tube, TubeError, TubeProblem, TubeSynthesis, Weights};

/// Whether columns share the gains of state feedback.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sharing {
    /// Gains K_{k,j}.
    PerColumn,
    /// Gains K_k: u = v + K (x̂ − z).
    Shared,
}

/// State feedback on the estimate of one observer.
///
/// The observer minimizes the size of the errors; with weights that do not depend on the column the two together are the optimum
/// (separation). With weights η_{k,j} of rows the observer does not know of them, and the tube is exact for its policy, the policy not the
/// optimum. A row's weight is μ/2 by the root of the squares of its responses to w_j and to the noise that arrives at j, as what answers
/// both is one column of gains.
///
/// References: the composition of state feedback and observer as responses: VISION-SLS; GPU-SLS, arXiv 2604.07644.
#[derive(Clone, Debug)]
pub struct OutputFeedbackTube {
    /// Measured quantities.
    pub sensing: Sensing,
    /// The observer.
    pub observer: Observer,
    /// Gains.
    pub sharing: Sharing,
}

impl OutputFeedbackTube {
    /// With the observer of a problem.
    ///
    /// # Errors
    /// As [`Observer::new`].
    pub fn new(problem: &TubeProblem<'_>, sensing: Sensing, sharing: Sharing) -> Result<Self, ObserverError> {
        let observer = Observer::new(problem, &sensing)?;
        Ok(Self { sensing, observer, sharing })
    }

    /// Tightenings of a problem under gains of state feedback, by rows.
    pub fn tightenings(&self, problem: &TubeProblem<'_>, gains: &Gains) -> RowValues {
        row_tightenings(problem, &self.sensing, &self.observer, gains).0
    }
}

impl TubeSynthesis for OutputFeedbackTube {
    /// The tube has row norms alone, and no cost.
    fn synthesize(&self, problem: &TubeProblem<'_>, multipliers: &RowValues, previous: Option<&Tube>) -> Result<Tube, TubeError> {
        let weights = Weights::new(multipliers, previous);
        let gains = match self.sharing {
            Sharing::PerColumn => Gains::exact(problem, &weights)?,
            Sharing::Shared => Gains::of_weights(problem, |k| weights.mean(k))?,
        };
        let (tightenings, norms) = row_tightenings(problem, &self.sensing, &self.observer, &gains);
        let (reach, sizes) = (Reach::Rows, tightenings.clone());
        Ok(Tube { gains, reach, tightenings, cost: None, norms, sizes }.after(previous))
    }
}
