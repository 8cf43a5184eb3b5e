//! From the command of a step to what a motor sees of it.

use super::Layout;
use super::constants::MEMORY;
use nalgebra::SVector;
use num_dual::{Derivative, DualSVec64};
use pliant_math::{Input, Real};

/// The way of one command: controller, delay, lag, each of them or none.
/// ```text
/// controller   c = u,   or   target⁺ = target + scale · min(max(u, −1), 1),  c = target⁺
/// delay        c_D(t) = c(t − D): over a step, c_{k−m−1} for the time f h and then c_{k−m}, with D = (m + f) h, 0 ≤ f ≤ 1
/// lag          T ẏ = c_D − y, exactly for that c_D:   y ← E y + (1 − E) c,  E = e^{−t/T}, over t = f h and then (1 − f) h
/// signal       s = mean of y over the step (of c_D without lag: f c_{k−m−1} + (1 − f) c_{k−m})
/// ```
/// Units are the command's; D, T in seconds. z holds `target`, the commands c_{k−1} … c_{k−L} (L h ≥ the longest delay), and y.
///
/// The limits: T = 0 is no lag, D = 0 no delay. s has a kink in D where D/h is whole (the derivative there is that towards longer
/// delays), and in u at ±1 of a target's controller (beyond, the derivative is 0).
#[derive(Clone, Debug, PartialEq)]
pub struct SignalPath {
    /// The actuator's name.
    pub name: String,
    /// The control.
    pub control: usize,
    /// Index in θ of a controller's scale; none if u is the command itself.
    pub scale: Option<usize>,
    /// Index in θ of the delay, and the longest it may be \[s\].
    pub delay: Option<(usize, f64)>,
    /// Index in θ of the lag's time constant.
    pub lag: Option<usize>,
    /// Command before the start.
    pub start: f64,
}

/// Inputs of a path: u, target, the two commands that the delay lets through, y, and scale, D, T.
const INPUTS: usize = 8;
type Dual = DualSVec64<INPUTS>;

/// Results of a path over a step: command, signal and the lag's end.
pub(crate) struct SubstepResult<S> {
    pub command: S,
    pub signal: S,
    pub lagged: S,
}

impl SignalPath {
    /// Commands kept at steps of length `h`.
    pub(crate) fn kept(&self, h: f64) -> usize {
        // a longest delay of whole steps needs no more, whatever its rounding
        self.delay.map_or(0, |(_, longest)| ((longest / h - 1e-9).ceil() as usize).max(1))
    }

    /// Numbers of z at steps of length `h`.
    pub(crate) fn size(&self, h: f64) -> usize {
        usize::from(self.scale.is_some()) + self.kept(h) + usize::from(self.lag.is_some())
    }

    /// Names of its numbers.
    pub(crate) fn names(&self, h: f64) -> Vec<String> {
        let target = self.scale.map(|_| format!("{}.target", self.name));
        let kept = (0..self.kept(h)).map(|k| format!("{}.command[{k}]", self.name));
        target.into_iter().chain(kept).chain(self.lag.map(|_| format!("{}.lagged", self.name))).collect()
    }

    /// Whole steps of delay, at most as many as are kept, and where they are: (m, place of c_{k−1}).
    pub(crate) fn whole(&self, first: usize, theta: &[f64], h: f64) -> (usize, usize) {
        let m = self.delay.map_or(0, |(d, _)| ((theta[d] / h).floor() as usize).min(self.kept(h) - 1));
        (m, first + usize::from(self.scale.is_some()))
    }

    /// Indices of what the path reads, in the order of [`SignalPath::pass`].
    fn inputs(&self, first: usize, theta: &[f64], h: f64) -> [Option<Input>; INPUTS] {
        let (m, line) = self.whole(first, theta, h);
        let delayed = self.delay.is_some();
        [
            Some(Input::U(self.control)),
            self.scale.map(|_| Input::Z(first)),
            delayed.then_some(Input::Z(line + m)),
            (delayed && m > 0).then(|| Input::Z(line + m - 1)),
            self.lag.map(|_| Input::Z(line + self.kept(h))),
            self.scale.map(Input::Theta),
            self.delay.map(|(d, _)| Input::Theta(d)),
            self.lag.map(Input::Theta),
        ]
    }

    fn pass<S: Real>(&self, [u, target, older, newer, y, scale, delay, lag]: [S; INPUTS], m: usize, h: f64) -> SubstepResult<S> {
        let command = if self.scale.is_some() { target + scale * clipped(u) } else { u };
        let (older, newer, part) = match self.delay {
            Some(_) => (older, if m > 0 { newer } else { command }, delay / h - m as f64),
            None => (command, command, S::zero()),
        };
        let delayed = older * part + newer * (-part + 1.0);
        if self.lag.is_none() {
            return SubstepResult { command, signal: delayed, lagged: delayed };
        }
        if lag.re() < MEMORY.no_lag * h {
            return SubstepResult { command, signal: delayed + (y - newer) * lag / h, lagged: newer };
        }
        let (first, area) = lagging(y, older, part * h, lag);
        let (last, rest) = lagging(first, newer, (-part + 1.0) * h, lag);
        SubstepResult { command, signal: delayed + (area + rest) / h, lagged: last }
    }

    pub(crate) fn evaluate(&self, first: usize, u: &[f64], z: &[f64], theta: &[f64], h: f64) -> SubstepResult<f64> {
        self.pass(self.inputs(first, theta, h).map(|input| read(input, u, z, theta)), self.whole(first, theta, h).0, h)
    }
}

/// Places of y, D and T among the inputs of [`SignalPath::pass`].
const LAGGED: [usize; 3] = [4, 6, 7];

impl SignalPath {
    /// Moves a path without controller on over the commands `past`, one row per step; ∂(the lag's end)/∂(D, T).
    pub(crate) fn prime(&self, first: usize, past: &[Vec<f64>], z: &mut [f64], theta: &[f64], h: f64) -> [f64; 2] {
        let (m, line) = self.whole(first, theta, h);
        let (end, mut slope) = (line + self.kept(h), [0.0; 2]);
        for u in past {
            let inputs = self.inputs(first, theta, h);
            let mut seeded = inputs.map(|input| Dual::from_re(read(input, u, z, theta)));
            for k in LAGGED {
                let mut unit = SVector::zeros();
                unit[k] = 1.0;
                seeded[k].eps = Derivative::some(unit);
            }
            let passed = self.pass(seeded, m, h);
            if self.lag.is_some() {
                let by = passed.lagged.eps.0.unwrap_or_else(SVector::zeros);
                slope = [by[LAGGED[1]] + by[LAGGED[0]] * slope[0], by[LAGGED[2]] + by[LAGGED[0]] * slope[1]];
                z[end] = passed.lagged.re;
            }
            if end > line {
                z[line..end].rotate_right(1);
                z[line] = passed.command.re;
            }
        }
        slope
    }

    /// Adds ∂s/∂(u, z, θ) and ∂z⁺/∂(u, z, θ) at `at` = (u, z, θ); rows are controls, and places in z.
    pub(crate) fn partials(&self, first: usize, at: [&[f64]; 3], h: f64, signals: &mut Partials, next: &mut Partials) {
        let [u, z, theta] = at;
        let inputs = self.inputs(first, theta, h);
        let (m, line) = self.whole(first, theta, h);
        let end = line + self.kept(h);
        let seeded: [Dual; INPUTS] = std::array::from_fn(|k| {
            let mut unit = SVector::zeros();
            unit[k] = 1.0;
            Dual::new(read(inputs[k], u, z, theta), Derivative::some(unit))
        });
        let passed = self.pass(seeded, m, h);
        let emit = |out: &mut Partials, row: usize, x: Dual| {
            let Some(by) = x.eps.0 else { return };
            let entries = inputs.iter().zip(by.iter()).filter(|(_, d)| **d != 0.0);
            out.extend(entries.filter_map(|(input, d)| input.map(|input| (row, input, *d))));
        };
        emit(signals, self.control, passed.signal);
        if self.scale.is_some() {
            emit(next, first, passed.command);
        }
        if end > line {
            emit(next, line, passed.command);
            next.extend((line + 1..end).map(|k| (k, Input::Z(k - 1), 1.0)));
        }
        if self.lag.is_some() {
            emit(next, end, passed.lagged);
        }
    }
}

/// Kind of an input of a path.
fn read(input: Option<Input>, u: &[f64], z: &[f64], theta: &[f64]) -> f64 {
    match input {
        Some(Input::U(k)) => u[k],
        Some(Input::Z(k)) => z[k],
        Some(Input::Theta(k)) => theta[k],
        _ => 0.0,
    }
}

/// min(max(u, −1), 1); the derivative is 1 at ±1 and 0 beyond.
fn clipped<S: Real>(u: S) -> S {
    if u.re().abs() <= 1.0 { u } else { S::from(u.re().signum()) }
}

/// End of T ẏ = c − y after the time t, and ∫ (y − c) dt over it.
fn lagging<S: Real>(y: S, c: S, t: S, lag: S) -> (S, S) {
    let decayed = -(-(t / lag)).exp_m1(); // 1 − E
    ((c - y) * decayed + y, (y - c) * lag * decayed)
}

/// (row, input, derivative).
pub(crate) type Partials = Vec<(usize, Input, f64)>;

impl Layout {
    /// Signals at rest at their starting commands.
    pub(crate) fn resting(&self, h: f64) -> Vec<f64> {
        let materials = self.materials.iter().map(|(_, start)| *start);
        materials.chain(self.paths.iter().flat_map(|p| std::iter::repeat_n(p.start, p.size(h)))).collect()
    }
}
