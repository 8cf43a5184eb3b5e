//! z: what joints and motors remember, and how it moves on.
//!
//! ```text
//! z = (materials, signals)
//! materials   the plastic part of a joint's coordinate; the torque a joint carried;
//!             elastic and plastic parts of rods' strains                               move on with every (halved) step
//! signals     a controller's target, a motor's delay line, its lag                     move on once per step of the scene
//! ```
//! Nothing in z is an unknown of a step: what a step needs of it is known when the step begins, and z⁺ follows from the step's end
//! in closed form. So a step stays one root, and z adds columns and rows to its derivatives.
//!
//! **Signals.** A command u is held over a step of length h, as a controller holds it. What the motor sees of it is s, the *mean over
//! the step* of the delayed and lagged command ([`SignalPath`]): the impulse of the motor is exact, whatever the delay, and s is
//! second-order accurate under every integrator. It is the same in all stages of a step (both of sdirk2), and in its halves if the
//! step is halved.
//!
//! **Materials.** A joint's memory is taken from the beginning of the step to where the force is evaluated, at constant rate: over h
//! (Euler), h/2 (midpoint), γh and then h from the same beginning (the two stages of sdirk2). z⁺ is taken over h from the beginning
//! to q⁺. See [`crate::terms::joint::PlasticSpring`], and of rods [`crate::terms::section::CreepSection`],
//! [`crate::terms::section::PlasticSection`] and [`crate::terms::section::DahlSection`], whose strains at the beginning depend on all that stands there ([`crate::rods::RodPast`]).

mod constants;
mod signal;

pub(crate) use signal::Partials;
pub use signal::SignalPath;

/// Past state with which joint forces are evaluated: the beginning of the step.
#[derive(Clone, Copy, Debug)]
pub struct Past<'a> {
    /// The bodies' coordinates there.
    pub q: &'a [f64],
    /// Internal variables there.
    pub z: &'a [f64],
    /// Time since then \[s\].
    pub elapsed: f64,
}

/// The places of z, and what stands there at the start.
#[derive(Clone, Debug, Default)]
pub(crate) struct Layout {
    /// Names and starting values of materials.
    pub materials: Vec<(String, f64)>,
    /// Joints that carry a torque into the next step: degree of freedom and place.
    pub loads: Vec<(usize, usize)>,
    /// Motors that remember.
    pub paths: Vec<SignalPath>,
}

impl Layout {
    /// Appends a material's number; returns its place.
    pub fn push(&mut self, name: String, start: f64) -> usize {
        self.materials.push((name, start));
        self.materials.len() - 1
    }

    /// Places of signals, for steps of length `h`: (path, its first place).
    pub fn placed(&self, h: f64) -> impl Iterator<Item = (&SignalPath, usize)> {
        let mut next = self.materials.len();
        self.paths.iter().map(move |path| {
            let first = next;
            next += path.size(h);
            (path, first)
        })
    }

    /// Size of z.
    pub fn len(&self, h: f64) -> usize {
        self.materials.len() + self.paths.iter().map(|p| p.size(h)).sum::<usize>()
    }
}
