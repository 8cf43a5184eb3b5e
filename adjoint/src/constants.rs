//! Numbers that decide in derivatives of steps. Units and reasons.

/// See the module; one value, [`ADJOINT`].
pub(crate) struct AdjointConstants {
    /// Relative change by a refinement below which it is not worth its price for many columns [-]. The image of a column under one step may
    /// be far larger than under the following ones: joints pulled off their coupling move by the pull over the step, and back.
    pub refined: f64,
}

/// The values in use.
pub(crate) const ADJOINT: AdjointConstants = AdjointConstants { refined: 1e-14 };
