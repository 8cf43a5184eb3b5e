//! Numbers that decide in Newton's method, with units and reasons. Unless a source is named they were set on the scenes of the tests and
//! benchmarks; docs/theory/step.md says how often each fallback is used.
/// See the module; one value, [`NEWTON`].
pub(super) struct NewtonConstants {
    /// Chord steps (corrections with an old matrix) still expected to the tolerance up to which no new matrix is made [-]: a matrix of ropes,
    /// rods and bodies without contact costs as much as about three of them, and each is improved by those before it (secant.rs).
    pub chords: f64,
    /// The same with contacts, or for sheets, where a matrix costs as much as six and more.
    pub chords_if_dear: f64,
    /// Full steps of a solve that may fail the monotonicity test: the matrix of the first iterates lacks the axial forces of the root, which
    /// are just being found.
    pub nonmonotone_steps: usize,
    /// Growth of the correction that these may show [-].
    pub nonmonotone_growth: f64,
    /// Where a sheet buckles: part of the slope r·d that may be left at a step's end, either way, before the step is too long or a longer
    /// one is tried [-] (the curvature condition of Wolfe's line search).
    pub slope_left: f64,
    /// The longest such step, in Newton steps [-].
    pub longest_step: f64,
    /// Iterations that descending where a sheet buckles may take, over those allowed for converging [-].
    pub buckling_patience: usize,
    /// Smallest damping factor of a Newton step that is tried [-].
    pub least_damping: f64,
    /// Relative precision of the stages of a continuation that are only passed through [-].
    pub coarse: f64,
    /// Regularization of contacts of colliders where full steps fail, over the inertia [-]: the first.
    pub first_regularization: f64,
    /// Its growth where it was too small [-].
    pub regularization_rise: f64,
    /// Its fall at convergence, and the fastest elsewhere [-].
    pub regularization_fall: f64,
    /// Its slowest fall after a step that was taken [-].
    pub regularization_hold: f64,
    /// Below this it is dropped [-].
    pub least_regularization: f64,
    /// Below this a regularized root is as good a start for the hard law as any [-].
    pub nearly_hard: f64,
    /// Above this it grows no more [-].
    pub most_regularization: f64,
    /// Roundings of the unknowns that a residual may show and count as zero [-]: residuals that no longer fall are seen at 0.02 to 1.2.
    pub rounding: f64,
    /// Largest correction at which a residual may count as rounding, over the velocity scale and the largest coordinate in a step's time [-]:
    /// the conditioning of a contact at a rest gap of 1e-9 m makes 3e-9 of it; beyond lie false ends beside singular matrices.
    pub near: f64,
    /// Part of that for corrections by a matrix of an earlier iterate [-]: without it 19 of 150 spinning balls that land ended
    /// up to 1.8e-5 off (rad/s, m/s).
    pub near_by_chords: f64,
    /// Part of a correction that the next must be below to be still falling [-].
    pub still_falls: f64,
    /// Part of the tolerance that the estimate of what is left after a last correction may be [-]: it is an estimate, and most steps end
    /// far nearer.
    pub negligible: f64,
    /// Factor of the rest gap from one stage of the continuation to the next [-].
    pub continuation_fall: f64,
    /// Levenberg weights over the inertia, in the order in which they are tried [-].
    pub damping_ladder: [f64; 4],
    /// Starts from the contact law at frozen geometry, each where the last one led: before the first attempt, and before the second.
    pub frozen_starts: [usize; 2],
    /// Relative change of velocities below which another one is of no use [-].
    pub frozen_change: f64,
    /// Approach of colliders, over what gravity gives in a step, from which they count as colliding [-].
    pub colliding: f64,
    /// Iterations of the first attempt where colliders touch: the second finds sooner what takes more.
    pub first_patience: usize,
    /// Iterations of the second walk down the ladder and of the descent, over those allowed for converging [-].
    pub damped_patience: usize,
    /// Largest ⟨c, s⟩/⟨s, s⟩ that a secant improvement extrapolates from [-]: beyond it steps would be over twice the correction.
    pub secant_limit: f64,
    /// Relative distance from the last acceleration within which an order of extrapolation must have predicted it, to be used [-].
    pub history_near: f64,
}

/// The values in use.
pub(super) const NEWTON: NewtonConstants = NewtonConstants {
    chords: 9.0,
    chords_if_dear: 18.0,
    nonmonotone_steps: 2,
    nonmonotone_growth: 10.0,
    slope_left: 0.5,
    longest_step: 8.0,
    buckling_patience: 3,
    least_damping: 1e-3,
    coarse: 1e-3,
    first_regularization: 1e-3,
    regularization_rise: 10.0,
    regularization_fall: 1e-3,
    regularization_hold: 0.3,
    least_regularization: 1e-9,
    nearly_hard: 1e-4,
    most_regularization: 0.05,
    rounding: 2.0,
    near: 1e-7,
    near_by_chords: 1e-2,
    still_falls: 0.25,
    negligible: 0.01,
    continuation_fall: 1e-2,
    damping_ladder: [100.0, 10.0, 3.0, 0.5],
    frozen_starts: [2, 6],
    frozen_change: 1e-3,
    colliding: 2.0,
    first_patience: 12,
    damped_patience: 4,
    secant_limit: 0.5,
    history_near: 0.5,
};
