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
    /// A warm start's rows are factored at once if each one's orthogonal part is at least this part of its norm [-]: squares of it leave
    /// ten digits, which refinement completes.
    pub at_once: f64,
    /// At most this many corrections: two suffice unless a row depends on the others.
    pub corrections: usize,
    /// A violated row that depends on the working rows contradicts them from this part of its size on [-], and is noise below.
    pub contradiction: f64,
    /// Rates of multipliers below this part of the entering row are noise, and block no step [-].
    pub rate: f64,
    /// A multiplier that refinement finds outside of its range by this part of the largest one, or more, leaves the working set [-].
    pub sign: f64,
    /// Sets of bounds guessed at most, where none is known.
    pub guesses: usize,
    /// Bounds violated from which on they enter together: below, single changes are faster (`examples/qp_times.rs`).
    pub guessed: usize,
    /// Refinements of a solution at most; the second leaves rounding errors of the residuals alone.
    pub refinements: usize,
    /// Working-set changes at most, as a multiple of the number of variables and rows, plus 100: no set comes back but by
    /// rounding, which this ends.
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
    corrected: 0.1,
    at_once: 1e-3,
    corrections: 3,
    contradiction: 1e-8,
    rate: 1e-10,
    sign: 1e-11,
    guesses: 4,
    guessed: 64,
    refinements: 3,
    changes: 20,
    pivot: 16.0 * f64::EPSILON,
};

/// Of problems of optimal control; one value, [`OCP`].
pub(crate) struct OcpConstants {
    /// Inputs of all stages, as a multiple of the number of states plus `least_states`, up to which a problem is condensed [-]. By
    /// `examples/qp_times.rs` both methods take as long at 800 to 1000 inputs of 4 to 20 states with a known working set, at 500 without; of
    /// 69 states condensing is three times faster at 480. Large dense matrices leave the cache.
    pub condensed_inputs: f64,
    /// See there.
    pub least_states: usize,
    /// A matrix of fewer entries than one in so many is multiplied entry by entry.
    pub sparse_rows: usize,
    // interior-point method
    /// Errors of the conditions of optimality at which it ends, relative to their terms [-].
    pub aimed: f64,
    /// Errors at which a solution is accepted where no further digits can be had [-].
    pub accepted: f64,
    /// Largest product of slack and multiplier at which it ends, relative to the cost's size [-]: errors of u are proportional to it where
    /// rows hold with positive multipliers, and to its root where multipliers vanish.
    pub complementary: f64,
    /// Part of the way to the boundary that a step takes at most [-]; 1 − μ at the end (Mehrotra 1992).
    pub boundary: f64,
    /// Part of a step below which the corrected direction is given up for one that centres.
    pub short: f64,
    /// The same of the mean product's growth.
    pub grown: f64,
    /// The mean product that one aims at, relative to the present one [-].
    pub centering: f64,
    /// Mean product at the start, relative to the least slack times the largest slope [-]: 1200 random problems took
    /// 8.7 iterations on average and 31 at most with 1, 8.9 and 22 with 10, 9.1 and 18 with 30.
    pub start: f64,
    /// Iterations at most: on 1200 random problems 9 on average, 22 at most.
    pub iterations: usize,
    /// Iterations without a better error, of points that satisfy all but complementarity, after which it ends.
    pub stalled: usize,
    /// Curvature of u [-] beside prices of 1 where least violations are sought: small, so that it moves no violation it need not.
    pub elastic: f64,
    /// Multiplier from which on a row that holds counts among those that contradict each other, where violations cost 1 [-].
    pub acting: f64,
    /// Violation from which on a row counts as contradicting others, relative to its terms [-].
    pub contradiction: f64,
    /// Complementarity, as above, from which on the rows that hold are solved for as equations, and the part of it at which that is tried
    /// again.
    pub polished_from: f64,
    /// See there.
    pub polished_again: f64,
    /// Guesses of these rows at most, each from what the last one showed.
    pub guesses: usize,
    /// Weight of these equations relative to slopes and states [-]: half of the digits, so that two or three steps give all.
    pub polish_weight: f64,
    /// Steps at most.
    pub polish_steps: usize,
    /// Part of the error aimed at where they end.
    pub polished: f64,
    /// Part of entries that are not zero from which on a stage's rows are multiplied as dense matrices [-].
    pub dense_rows: f64,
}

/// The values in use.
pub(crate) const OCP: OcpConstants = OcpConstants {
    condensed_inputs: 10.0,
    least_states: 40,
    sparse_rows: 8,
    aimed: 1e-10,
    accepted: 1e-8,
    complementary: 1e-13,
    boundary: 0.995,
    short: 0.1,
    grown: 1.0,
    centering: 0.5,
    start: 10.0,
    iterations: 60,
    stalled: 6,
    elastic: 1e-4,
    acting: 1e-3,
    contradiction: 1e-6,
    polished_from: 1e-7,
    polished_again: 1e-2,
    guesses: 3,
    polish_weight: 1e7,
    polish_steps: 8,
    polished: 1e-3,
    dense_rows: 0.25,
};

/// Part of an input's size that two sums of the same numbers may differ by [-].
pub(crate) const ROUNDING: f64 = 1e-9;

/// Cost of a deviation of an input that costs nothing in the plan, as a part of the dearest one's [-]: the gains stay finite.
pub(crate) const FREE_INPUT: f64 = 1e-3;
