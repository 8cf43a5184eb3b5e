//! Tubes about a nominal trajectory, by system-level synthesis (SLS).
//!
//! ```text
//! x_k = z_k + δx_k,   u_k = v_k + δu_k,   δx_{k+1} = A_k δx_k + B_k δu_k + E_{k+1} w_{k+1},   δx_0 = E_0 w_0,   |w_j|₂ ≤ 1 for each j
//! δx_k = Σ_{j≤k} Φ_x[k,j] E_j w_j,   δu_k = Σ_{j≤k} Φ_u[k,j] E_j w_j                 responses; Φ_x[j,j] = 1
//! Φ_x[k+1,j] = A_k Φ_x[k,j] + B_k Φ_u[k,j],   Φ_u[k,j] = K_{k,j} Φ_x[k,j]            achievability
//! h_{k,i} = Σ_{j≤k} |g_{k,i} [Φ_x[k,j]; Φ_u[k,j]] E_j|₂                              tightening of row i of stage k
//! ```
//! A trajectory of the policy meets g x + g u ≤ limit for every w if the nominal one meets g z + g v ≤ limit − h, and there is a w for
//! which it meets it with equality. Bounds of inputs are rows like others. [`robust`] minimizes the nominal cost plus a cost of responses
//! over both, by alternating between the tightened problem and the responses.
//!
//! ```text
//! problem      TubeProblem: an Ocp, a Disturbance (balls, with or without a centre), a TubeCost
//! synthesis    TubeSynthesis: ExactTube, SharedGainTube, EllipsoidalTube; crate::observer has that of output feedback
//! tube         Tube: gains, responses or ellipsoids, tightenings
//! policy       TubePolicy: u of the measured state, stage by stage
//! ```
//! Columns run in parallel; results do not depend on the number of threads, as each column is computed alone and sums keep the order of
//! times.
//!
//! Not covered: disturbances that depend on state or input, and the error of linearization. A caller that bounds either adds columns.
//!
//! References: Anderson, Doyle, Low and Matni (2019), "System level synthesis"; Leeman, Köhler, Messerer, Lahr, Diehl and Zeilinger (2024),
//! "Fast system level synthesis", arXiv 2401.13762.

mod columns;
pub(crate) mod constants;
mod ellipsoid;
mod error;
mod gains;
mod multipliers;
mod policy;
mod problem;
mod riccati;
mod robust;
mod room;
mod rows;
mod weights;

pub use columns::{Column, ExactTube, SharedGainTube};
pub use ellipsoid::{EllipsoidalTube, Scaling};
pub use error::{Constraint, TubeError};
pub use gains::Gains;
pub use policy::TubePolicy;
pub use problem::{Ball, Disturbance, TubeCost, TubeProblem};
pub use robust::{RobustOptions, RobustSolution, Violation, robust};
pub use rows::RowValues;

pub(crate) use problem::check;
pub(crate) use weights::{Norms, Weights};

use faer::Mat;

/// Deviations that the disturbances reach.
#[derive(Clone, Debug)]
pub enum Reach {
    /// Φ_x E and Φ_u E, by the time j of the disturbance.
    Columns(Vec<Column>),
    /// Shapes Σ_0 … Σ_N, nx × nx.
    Ellipsoids(Vec<Mat<f64>>),
    /// Row norms alone.
    Rows,
}

/// A policy's gains and what its disturbances reach.
#[derive(Clone, Debug)]
pub struct Tube {
    /// K_{k,j}.
    pub gains: Gains,
    /// Responses.
    pub reach: Reach,
    /// h of every row and input.
    pub tightenings: RowValues,
    /// Cost of the responses, where the synthesis computes it.
    pub cost: Option<f64>,
    /// a_{k,j} at `[j][k − j][row]`; none of ellipsoids.
    pub(crate) norms: Norms,
    /// Tightenings of the first tube of an alternation, whose weights were zero: what small ones are small against.
    pub(crate) sizes: RowValues,
}

impl Tube {
    /// The next tube of an alternation.
    pub(crate) fn after(mut self, previous: Option<&Self>) -> Self {
        if let Some(previous) = previous {
            self.sizes = previous.sizes.clone();
        }
        self
    }

    /// g · Φ_{k,j} shift_j summed over j: how much higher every row and input of the nominal trajectory through the balls' centres is than
    /// that of the nominal trajectory without their shifts, under the policy.
    pub fn shifts(&self, problem: &TubeProblem<'_>) -> RowValues {
        let mut shifts = RowValues::zeros(problem.ocp);
        for j in 0..=problem.horizon() {
            let shift = problem.disturbance.shift(j, problem.nx);
            if shift.iter().all(|s| *s == 0.0) {
                continue;
            }
            let start = Mat::from_fn(problem.nx, 1, |r, _| shift[r]);
            let response = Column::propagate(problem, &self.gains, j, start);
            for (k, x) in (j..).zip(&response.x) {
                let u = response.u.get(k - j).map_or(&[][..], |u| u.col_as_slice(0));
                for (sum, value) in shifts.stage_mut(k).iter_mut().zip(problem.rows[k].apply(x.col_as_slice(0), u)) {
                    *sum += value;
                }
            }
        }
        shifts
    }
}

/// Makes a tube for given multipliers of the tightened problem.
pub trait TubeSynthesis {
    /// Without a previous tube all weights are zero, and the responses minimize their own cost.
    ///
    /// # Errors
    /// [`TubeError::Indefinite`].
    fn synthesize(&self, problem: &TubeProblem<'_>, multipliers: &RowValues, previous: Option<&Tube>) -> Result<Tube, TubeError>;
}
