//! Commands that reach a motor late, where the scene's motor has no delay of its own.
//!
//! Commands are inputs, and known beforehand; so their delay needs no history variables: a motor with the delay D receives over step k
//! the mean command
//! ```text
//! c'_k = f c_{k−m−1} + (1 − f) c_{k−m},     D = (m + f) h, m whole, 0 ≤ f < 1;      ∂c'_k/∂D = (c_{k−m−1} − c_{k−m}) / h
//! ```
//! as the delay line of a scene's motor gives it ([`pliant_engine::memory::SignalPath`]), but for a lag behind it, which here takes
//! the mean over the step of a command that comes in two parts (an error of second order in h over the lag). The derivative is that towards
//! longer delays. Before the record its first commands are taken to have been held.

use super::plan::RecordPlan;
use super::run::Pass;
use crate::unknown::Target;
use pliant_adjoint::{Seeds, TangentStepper};

impl RecordPlan {
    /// The command of step `k`, which may lie before the record or after it.
    fn command(&self, k: isize, control: usize) -> f64 {
        let row = match usize::try_from(k) {
            Ok(k) => self.inputs.get(k).or(self.inputs.last()),
            Err(_) => self.past.get(self.past.len().saturating_sub(k.unsigned_abs())),
        };
        row.or(self.inputs.first()).map_or(0.0, |row| row[control])
    }

    /// Command that a control delayed by `delay` \[s\] receives over step `k`, and its derivative by the delay.
    fn late_command(&self, k: isize, control: usize, delay: f64, h: f64) -> (f64, f64) {
        let steps = delay / h;
        let whole = steps.floor();
        let newer = self.command(k - whole as isize, control);
        let older = self.command(k - whole as isize - 1, control);
        (newer + (steps - whole) * (older - newer), (older - newer) / h)
    }
}

impl Pass<'_> {
    /// Makes the inputs `u` of step `k` late, and seeds their derivatives.
    pub(super) fn make_late(&self, k: usize, u: &mut [f64], seeds: &mut Seeds) {
        let late = |control: usize, delay: f64| self.rec.late_command(k as isize, control, delay, self.h);
        for (control, &delay) in self.values.late.iter().enumerate().filter(|(_, delay)| **delay > 0.0) {
            u[control] = late(control, delay).0;
        }
        for (j, control, slope) in self.late_unknowns() {
            seeds.add_u(control, self.own + j, slope * late(control, self.values.late[control]).1);
        }
    }

    /// The commands before the record as they reached the motors.
    pub(super) fn late_past(&self) -> Vec<Vec<f64>> {
        let mut past = self.rec.past.clone();
        let rows = past.len();
        for (control, &delay) in self.values.late.iter().enumerate().filter(|(_, delay)| **delay > 0.0) {
            for (row, u) in past.iter_mut().enumerate() {
                u[control] = self.rec.late_command(row as isize - rows as isize, control, delay, self.h).0;
            }
        }
        past
    }

    /// The derivatives by delays of the initial values of lags: with a longer delay a lag starts from its value that much earlier.
    pub(super) fn seed_late_memory(&self, z: &[f64], tangent: &mut TangentStepper) {
        for (j, control, slope) in self.late_unknowns() {
            let Some((place, lag)) = self.plan.model.lag_of(control) else { continue };
            let lag = self.values.theta[lag];
            if lag > 0.0 {
                let (last, _) = self.rec.late_command(-1, control, self.values.late[control], self.h);
                tangent.x.z[place * self.columns + self.own + j] -= slope * (last - z[place]) / lag;
            }
        }
    }

    /// The unknowns that make controls late: number, control, d delay/d coordinate.
    fn late_unknowns(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        let unknowns = if self.wants.tangents { self.wants.unknowns } else { &[] };
        unknowns.iter().enumerate().filter_map(|(j, unknown)| match unknown.target {
            Target::Late(control) => Some((j, control, unknown.slope(unknown.value(self.values)))),
            _ => None,
        })
    }
}
