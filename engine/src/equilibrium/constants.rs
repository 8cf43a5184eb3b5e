//! Numbers that decide in the search for an equilibrium. Units and reasons; they were set on the scenes of the tests.

/// See the module; one value, [`EQUILIBRIUM`].
pub(crate) struct EquilibriumConstants {
    /// First pseudo-time step \[s\]; it grows while Newton's method follows and ends at infinity.
    pub first_step: f64,
    /// Factor by which it grows after a step that is solved [-].
    pub growth: f64,
    /// Factor by which it shrinks after one that is not [-].
    pub shrinkage: f64,
    /// Step below which a failure is final \[s\].
    pub least_step: f64,
    /// Step that counts as infinite \[s\].
    pub last_step: f64,
    /// Most steps.
    pub most_steps: usize,
}

/// The values in use.
pub(crate) const EQUILIBRIUM: EquilibriumConstants =
    EquilibriumConstants { first_step: 0.02, growth: 3.0, shrinkage: 0.1, least_step: 1e-4, last_step: 1e4, most_steps: 400 };
