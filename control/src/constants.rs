//! Numbers that decide in quadratic programs and problems of optimal control, with unit and reason. Where no source is named, a value is
//! our own choice.

/// Of the dual active-set method; one value, [`ACTIVE_SET`].
pub(crate) struct ActiveSetConstants {
    /// Violation of a row below this part of its right-hand side is taken for rounding noise [-]: a hundredth of the accuracy promised.
    pub feasible: f64,
    /// The same as a part of |L⁻¹ a| times the largest |Lᵀ z| since the last refinement, to which the rounding errors of aᵀ z are proportional [-].
    pub noise: f64,
    /// A refined solution may violate a row by this many times as much [-], or the search goes on.
    pub refined: f64,
    /// A row whose part orthogonal to the working rows is below this part of its norm depends on them [-]: a step along it would have
    /// fewer than half the digits.
    pub dependent: f64,
    /// Orthogonal parts below this part of the norm are orthogonalised again [-] (Daniel, Gragg, Kaufman, Stewart 1976).
    pub corrected: f64,
    /// At most this many corrections: two suffice unless a row depends on the others.
    pub corrections: usize,
    /// A violated row that depends on the working rows contradicts them from this part of its size on [-], and is noise below.
    pub contradiction: f64,
    /// Rates of multipliers below this part of the entering row are noise, and block no step [-].
    pub rate: f64,
    /// A multiplier that refinement finds outside of its range by this part of the largest one, or more, leaves the working set [-].
    pub sign: f64,
    /// Refinements of a solution at most; the second leaves rounding errors of the residuals alone.
    pub refinements: usize,
    /// Working-set changes at most, as a multiple of the number of variables and rows, plus 100: tests need less than a fifth of it.
    pub changes: usize,
    /// A pivot of the Hessian below this part of its diagonal entry is rounding noise [-].
    pub pivot: f64,
}

/// The values in use.
pub(crate) const ACTIVE_SET: ActiveSetConstants = ActiveSetConstants {
    feasible: 1e-11,
    noise: 1e-13,
    refined: 10.0,
    dependent: 1e-9,
    corrected: 0.5,
    corrections: 3,
    contradiction: 1e-8,
    rate: 1e-10,
    sign: 1e-11,
    refinements: 3,
    changes: 20,
    pivot: 16.0 * f64::EPSILON,
};
