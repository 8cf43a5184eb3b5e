//! Corrections by one matrix made better by those before them: Broyden's update of its inverse in the mass norm, kept as the steps taken
//! (Deuflhard 2011, §2.1.4, "QNERR").
//!
//! With steps s₀ … s_k by the matrix J at the iterates y₀ … y_k and c = −J⁻¹ r(y_{k+1}) the next is
//! ```text
//! c ← c + s_{i+1} ⟨c, s_i⟩/⟨s_i, s_i⟩   for i = 0 … k−1,        s_{k+1} = c/(1 − ⟨c, s_k⟩/⟨s_k, s_k⟩)
//! ```
//! Where a matrix is a little off in one direction, all corrections by it point along that one, each a constant part of the one before;
//! their sum is then taken in one step. (Impulses must count in ⟨·,·⟩: by velocities alone contacts take more matrices than without.)

use super::constants::NEWTON;
use crate::step::{Iterate, Stage, Workspace};

/// Numbers summed side by side.
const LANES: usize = 8;

/// The steps taken by one matrix; a step is all unknowns in a row: velocities, then multipliers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Secant {
    steps: Vec<Vec<f64>>,
    /// ⟨s, s⟩ of each.
    squares: Vec<f64>,
    /// How many of them are by the matrix at hand; the others are memory.
    taken: usize,
    correction: Vec<f64>,
}

impl Secant {
    /// Forgets the steps: a new matrix begins.
    pub fn clear(&mut self) {
        self.taken = 0;
    }

    /// Takes in the step that was taken.
    fn push(&mut self, weights: &[f64], [v, lambda]: [&[f64]; 2]) {
        if self.taken == self.steps.len() {
            self.steps.push(Vec::new());
            self.squares.push(0.0);
        }
        let s = &mut self.steps[self.taken];
        s.clear();
        s.extend_from_slice(v);
        s.extend_from_slice(lambda);
        self.squares[self.taken] = inner(weights, s, s);
        self.taken += 1;
    }

    /// Makes the correction after the last step better; leaves it where nothing can be told.
    fn improve(&mut self, weights: &[f64]) {
        let (c, last) = (&mut self.correction, self.taken - 1);
        // (a step of zero tells nothing)
        let part = |c: &[f64], k: usize| match inner(weights, c, &self.steps[k]) / self.squares[k] {
            part if part.is_finite() => part,
            _ => 0.0,
        };
        for k in 0..last {
            let part = part(c, k);
            c.iter_mut().zip(&self.steps[k + 1]).for_each(|(c, s)| *c += part * s);
        }
        let part = part(c, last);
        if part < NEWTON.secant_limit {
            c.iter_mut().for_each(|c| *c /= 1.0 - part);
        }
    }
}

/// Makes the pending correction better by the whole step taken before it, which is in `ws.newton.d_next`, and by those before that;
/// returns its norm.
pub(super) fn improve(stage: &Stage, ws: &mut Workspace) -> f64 {
    let (weights, newton) = (&ws.weights, &mut ws.newton);
    let (secant, Iterate { v, lambda }) = (&mut newton.secant, &mut newton.d);
    secant.push(weights, [&newton.d_next.v, &newton.d_next.lambda]);
    secant.correction.clear();
    secant.correction.extend_from_slice(v);
    secant.correction.extend_from_slice(lambda);
    secant.improve(weights);
    let (of_v, of_lambda) = secant.correction.split_at(v.len());
    v.copy_from_slice(of_v);
    lambda.copy_from_slice(of_lambda);
    (inner(weights, &secant.correction, &secant.correction) / stage.masses.total).sqrt()
}

/// Σ weight · a · b, in lanes.
fn inner(weight: &[f64], a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; LANES];
    let (ws, aas, bs) = (weight.chunks_exact(LANES), a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest = ws.remainder().iter().zip(aas.remainder()).zip(bs.remainder());
    let rest: f64 = rest.map(|((w, a), b)| w * a * b).sum();
    for ((w, a), b) in ws.zip(aas).zip(bs) {
        for lane in 0..LANES {
            lanes[lane] += w[lane] * a[lane] * b[lane];
        }
    }
    lanes.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use crate::step::newton::secant::*;

    /// Corrections −J⁻¹ r with J⁻¹ r' = 1 − u ⟨w, ·⟩: each of them after the first is the part u ⟨w, s⟩ of the step before, for ever. Made better,
    /// the second of them is the last.
    #[test]
    fn a_matrix_off_in_one_direction_is_mended_by_two_steps() {
        let (u, w) = ([0.3, -0.2, 0.1], [0.5, 0.4, 2.0]);
        let (mut secant, weights) = (Secant::default(), [1.0, 2.0, 0.5]);
        let root = [1.0, -2.0, 3.0];
        let chord = |y: &[f64; 3]| {
            let left: Vec<f64> = root.iter().zip(y).map(|(root, y)| root - y).collect();
            let along: f64 = w.iter().zip(&left).map(|(w, l)| w * l).sum();
            [0, 1, 2].map(|k| left[k] - u[k] * along)
        };
        let mut y = [0.0; 3];
        let mut steps = Vec::new();
        let mut step = chord(&y);
        for _ in 0..3 {
            (0..3).for_each(|k| y[k] += step[k]);
            secant.push(&weights, [&step, &[]]);
            secant.correction = chord(&y).to_vec();
            secant.improve(&weights);
            step = [0, 1, 2].map(|k| secant.correction[k]);
            steps.push(inner(&weights, &step, &step).sqrt());
        }
        assert!(steps[0] > 0.1 && steps[1] > 1e-4 && steps[2] < 1e-14, "{steps:?}");
        // another matrix knows nothing of it, and a step of zero tells nothing
        secant.clear();
        secant.push(&weights, [&[0.0; 3], &[]]);
        secant.correction = vec![1.0, 2.0, 3.0];
        secant.improve(&weights);
        assert_eq!(secant.correction, [1.0, 2.0, 3.0]);
    }

    #[test]
    fn products_count_what_is_left_beside_lanes() {
        let a: Vec<f64> = (0..19).map(f64::from).collect();
        let (ones, expected) = ([1.0; 19], a.iter().map(|a| a * a).sum::<f64>());
        assert_eq!(inner(&ones, &a, &a), expected);
    }
}
