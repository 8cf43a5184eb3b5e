//! How a stage is solved.

/// Switches of the solver: what Newton's method and its fallbacks change from one attempt to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SolverOptions {
    /// Rest gap δ of the smoothing, κ = δ m g \[m\].
    pub rest_gap: f64,
    /// Levenberg weight added to σ in the matrix only [1/s].
    pub damping: f64,
    /// The same for the split law of contacts [-]; see [`pliant_smoothing::SplitPoint`].
    pub regularization: f64,
    /// Contacts of colliders disabled: they push nothing beside the impulses of the iterate.
    pub disabled: bool,
    /// Use all fallbacks: no further halving is allowed.
    pub thorough: bool,
    /// The root is an intermediate point of a continuation, and need not be precise.
    pub coarse: bool,
    /// Matrices from positive semidefinite parts alone, whose steps lead downhill wherever they start.
    pub descent: bool,
}

impl SolverOptions {
    /// As steps begin.
    pub fn new(rest_gap: f64, thorough: bool) -> Self {
        Self { rest_gap, damping: 0.0, regularization: 0.0, disabled: false, thorough, coarse: false, descent: false }
    }
}
