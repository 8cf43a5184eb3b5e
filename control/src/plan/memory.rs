//! Memory of a plan, known before any of it is asked for.
//!
//! ```text
//! bytes(N) = 8 [4 (N nu)² + N nu (ndx + m + c N)]      H, its factor and two more of their size; S_k, r_u, C
//! ```
//! with m residuals and c constraints of a stage: a lower bound.

use super::PlanError;
use crate::problem::{Problem, Terms};
use pliant_math::State;
use pliant_scene::available_memory;

/// Sizes of a stage: inputs, a change of x, residuals, constraints.
#[derive(Clone, Copy, Debug)]
struct Stage {
    nu: usize,
    ndx: usize,
    residuals: usize,
    constraints: usize,
}

impl Stage {
    /// Factors of N² and N.
    fn factors(self) -> [f64; 2] {
        let [nu, ndx, m, c] = [self.nu, self.ndx, self.residuals, self.constraints].map(|n| n as f64);
        [8.0 * nu * (4.0 * nu + c), 8.0 * nu * (ndx + m)]
    }

    fn bytes(self, steps: usize) -> f64 {
        let ([a, b], n) = (self.factors(), steps as f64);
        n * (a * n + b)
    }

    /// The largest number of steps that fit.
    fn fit(self, available: f64) -> usize {
        let [a, b] = self.factors();
        ((-b + (b * b + 4.0 * a * available).sqrt()) / (2.0 * a)) as usize
    }
}

/// Refuses plans whose quadratic model does certainly not fit into the memory that is free.
///
/// # Errors
/// Such a plan; a problem that cannot be evaluated.
pub(super) fn check(problem: &dyn Problem, x0: &State, controls: &[Vec<f64>], ndx: usize) -> Result<(), PlanError> {
    let (steps, nu) = (controls.len(), controls.first().map_or(0, Vec::len));
    let smallest = Stage { nu, ndx, residuals: 0, constraints: 0 };
    // so small that its rows do not matter: none of them is counted
    let Some(available) = available_memory().map(|bytes| bytes as f64).filter(|_| nu > 0 && smallest.bytes(steps) > SMALL) else {
        return Ok(());
    };
    let (k, mut terms) = (steps / 2, Terms::default());
    problem.evaluate(k, steps, x0, controls.get(k).map(Vec::as_slice), &mut terms).map_err(PlanError::Problem)?;
    let stage = Stage { residuals: terms.residuals.values.len(), constraints: terms.constraints.values.len(), ..smallest };
    refuse(stage, steps, available)
}

/// Bytes below which a plan is not looked at: no machine lacks them, and the problem need not be evaluated for them.
const SMALL: f64 = 1e7;

fn refuse(stage: Stage, steps: usize, available: f64) -> Result<(), PlanError> {
    let bytes = stage.bytes(steps);
    if bytes <= available { Ok(()) } else { Err(PlanError::Memory { steps, bytes, available, fit: stage.fit(available) }) }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic)]
    use super::*;

    #[test]
    fn a_plan_that_does_not_fit_is_refused_with_the_steps_that_do() {
        let stage = Stage { nu: 8, ndx: 200, residuals: 71, constraints: 42 };
        let error = refuse(stage, 20_000, 1e9).unwrap_err();
        let PlanError::Memory { fit, bytes, .. } = error else { panic!("{error}") };
        assert!(bytes > 1e12 && stage.bytes(fit) <= 1e9 && stage.bytes(fit + 1) > 1e9, "{fit} {bytes}");
        assert!(refuse(stage, fit, 1e9).is_ok());
        assert!(error.to_string().contains(&format!("{fit} steps would fit")), "{error}");
    }
}
