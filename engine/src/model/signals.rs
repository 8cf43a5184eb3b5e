//! Signals of motors: delay, lag and saturation of commands, and the update of their part of z.

use super::Model;
use crate::memory::{Partials, SignalPath};
use pliant_math::Input;

impl Model {
    /// Signals of all motors from the controls `u` over the step from z; controls of grippers are passed through.
    pub(crate) fn signals(&self, u: &[f64], z: &[f64], theta: &[f64], out: &mut Vec<f64>) {
        out.clear();
        out.extend_from_slice(u);
        for (path, first) in self.memory.placed(self.h) {
            out[path.control] = path.evaluate(first, u, z, theta, self.h).signal;
        }
    }

    /// On which branch every motor's signal is, between kinks: whole steps of its delay, and 1 or 2 where a target's step is cut.
    pub fn signal_modes(&self, u: &[f64], theta: &[f64]) -> Vec<u8> {
        let mode = |(path, first): (&SignalPath, usize)| {
            let u = u[path.control];
            let cut = if path.scale.is_some() && u.abs() > 1.0 { 1 + u8::from(u > 0.0) } else { 0 };
            [path.whole(first, theta, self.h).0 as u8, cut]
        };
        self.memory.placed(self.h).flat_map(mode).collect()
    }

    /// Moves the signals' part of z on by a step.
    pub(crate) fn advance_signals(&self, u: &[f64], z: &mut [f64], theta: &[f64]) {
        for (path, first) in self.memory.placed(self.h) {
            let passed = path.evaluate(first, u, z, theta, self.h);
            let (_, line) = path.whole(first, theta, self.h);
            let end = line + path.kept(self.h);
            if path.scale.is_some() {
                z[first] = passed.command;
            }
            if end > line {
                z[line..end].rotate_right(1);
                z[line] = passed.command;
            }
            if path.lag.is_some() {
                z[end] = passed.lagged;
            }
        }
    }

    /// History variables of motors after the commands `past`, one row of controls per step, the first of them held for ever before:
    /// z in the signals' places of `z`, and (place, index in θ, derivative) of what depends on delays and lags.
    ///
    /// A motor with a controller keeps what `z` has of it: where its target was nobody knows.
    pub fn prime_signals(&self, past: &[Vec<f64>], theta: &[f64], z: &mut [f64]) -> Vec<(usize, usize, f64)> {
        let mut by_theta = Vec::new();
        let Some(first_row) = past.first() else { return by_theta };
        for (path, first) in self.memory.placed(self.h).filter(|(path, _)| path.scale.is_none()) {
            let size = path.size(self.h);
            z[first..first + size].fill(first_row[path.control]);
            let slope = path.prime(first, past, z, theta, self.h);
            let place = first + size - 1;
            let entries = [path.delay.map(|(d, _)| d), path.lag];
            by_theta.extend(entries.into_iter().zip(slope).filter_map(|(k, d)| Some((place, k.filter(|_| d != 0.0)?, d))));
        }
        by_theta
    }

    /// Where the lag of a control's motor stands: its place in z, and the index of its time constant in θ.
    pub fn lag_of(&self, control: usize) -> Option<(usize, usize)> {
        let (path, first) = self.memory.placed(self.h).find(|(path, _)| path.control == control)?;
        Some((first + path.size(self.h) - 1, path.lag?))
    }

    /// ∂s/∂(u, z, θ), rows counted as controls, and ∂z⁺/∂(u, z, θ) of the signals' part of z. Both empty if no motor remembers: s = u.
    pub(crate) fn signal_partials(&self, u: &[f64], z: &[f64], theta: &[f64]) -> [Partials; 2] {
        let (mut signals, mut next) = (Vec::new(), Vec::new());
        if self.memory.paths.is_empty() {
            return [signals, next];
        }
        let remembers = |k: usize| self.memory.paths.iter().any(|p| p.control == k);
        signals.extend((0..u.len()).filter(|k| !remembers(*k)).map(|k| (k, Input::U(k), 1.0)));
        for (path, first) in self.memory.placed(self.h) {
            path.partials(first, [u, z, theta], self.h, &mut signals, &mut next);
        }
        [signals, next]
    }

    /// Signals of commands held for ever, for an equilibrium; a target stays at the start whatever u is.
    pub(crate) fn resting_signals(&self, u: &[f64]) -> (Vec<f64>, Partials) {
        let (mut out, mut partials): (Vec<f64>, Partials) = (u.to_vec(), Vec::new());
        let held = |k: usize| self.memory.paths.iter().find(|p| p.control == k && p.scale.is_some());
        for (k, signal) in out.iter_mut().enumerate() {
            match held(k) {
                Some(path) => *signal = path.start,
                None => partials.push((k, Input::U(k), 1.0)),
            }
        }
        (out, partials)
    }
}
