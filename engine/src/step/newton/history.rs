//! Extrapolation of the accelerations of the last stages: a start for Newton's method that costs no evaluation.
//!
//! With the accelerations a₁ (last), a₂, a₃ of equal stages, the polynomials through them give
//! ```text
//! order 0:  0       1:  a₁       2:  2 a₁ − a₂       3:  3 a₁ − 3 a₂ + a₃
//! ```
//! Taken is the one that would have been best for the last stage. After an impact that is order 0: none.

use super::constants::NEWTON;

/// Accelerations that are kept.
const KEPT: usize = 3;

/// Weights of the kept accelerations, the last one first, by order.
const WEIGHTS: [[f64; KEPT]; KEPT + 1] = [[0.0; KEPT], [1.0, 0.0, 0.0], [2.0, -1.0, 0.0], [3.0, -3.0, 1.0]];

/// The last accelerations of degrees of freedom [m/s² or rad/s²].
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct History {
    /// The last one first; as many as there are.
    kept: Vec<[f64; KEPT]>,
    /// How many of them were ever made.
    made: usize,
    /// The order that was best for the last one.
    order: usize,
}

impl History {
    /// Adds to the velocities `v` what they are expected to change in a stage of the length `h` \[s\].
    pub fn extrapolate(&self, h: f64, v: &mut [f64]) {
        let weights = &WEIGHTS[self.order];
        for (v, kept) in v.iter_mut().zip(&self.kept) {
            *v += h * expected(weights, kept);
        }
    }

    /// Takes in the change from `before` to `after` in a stage of length 1/σ, and judges the orders by it in the norm that `weight` makes.
    pub fn push(&mut self, sigma: f64, before: &[f64], after: &[f64], weight: &[f64]) {
        self.kept.resize(after.len(), [0.0; KEPT]);
        let mut missed2 = [0.0; KEPT + 1];
        for (kept, ((before, after), weight)) in self.kept.iter_mut().zip(before.iter().zip(after).zip(weight)) {
            let now = sigma * (after - before);
            for (missed2, weights) in missed2.iter_mut().zip(&WEIGHTS) {
                let miss = now - expected(weights, kept);
                *missed2 += weight * miss * miss;
            }
            *kept = [now, kept[0], kept[1]];
        }
        missed2[0] *= NEWTON.history_near * NEWTON.history_near;
        let known = ..=self.made.min(KEPT);
        self.order = missed2[known].iter().enumerate().fold(0, |best, (k, m)| if *m < missed2[best] { k } else { best });
        self.made += 1;
    }
}

fn expected(weights: &[f64; KEPT], kept: &[f64; KEPT]) -> f64 {
    weights[0] * kept[0] + weights[1] * kept[1] + weights[2] * kept[2]
}

#[cfg(test)]
mod tests {
    use crate::step::newton::history::*;

    fn history(velocity: impl Fn(f64) -> f64, stages: usize) -> History {
        let mut history = History::default();
        (0..stages).for_each(|k| history.push(1.0, &[velocity(k as f64)], &[velocity(k as f64 + 1.0)], &[1.0]));
        history
    }

    #[test]
    fn smooth_motions_are_followed() {
        let velocity = |t: f64| 0.2 * t * t * t - t * t + 3.0 * t;
        let mut v = [velocity(6.0)];
        history(velocity, 6).extrapolate(1.0, &mut v);
        assert!((v[0] - velocity(7.0)).abs() < 1e-12);
    }

    #[test]
    fn nothing_is_expected_at_first_and_after_a_jolt() {
        let jolt = |t: f64| if t < 5.5 { t } else { -40.0 };
        for (stages, at) in [(0, 0.0), (6, 6.0)] {
            let mut v = [at];
            history(jolt, stages).extrapolate(1.0, &mut v);
            assert_eq!(v[0], at);
        }
    }
}
