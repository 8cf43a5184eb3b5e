//! Numbers that decide in a step beside Newton's method: substeps, energy checks, the warm start at frozen geometry, and when multipliers
//! have settled. Units and reasons; unless a source is named they were set on the scenes of the tests.
/// See the module; one value, [`STEP`].
pub(crate) struct StepConstants {
    /// Bound of a step's work, over what it takes if all its shortest substeps take all their iterations [-].
    pub attempts: usize,
    /// Most halvings that this bound counts.
    pub most_counted: usize,
    /// Largest part of the kinetic energy of bodies that a step may create [-].
    pub created_by_bodies: f64,
    /// Part of a step's fall below which a rebound is one of rest [-]: as slow as that, a node lies again within the step.
    pub slow: f64,
    /// Largest part of the energy at hand (kinetic, elastic, and the weight of all nodes raised by their extent) that a step, and a substep in
    /// proportion, may create [-].
    pub created: f64,
    /// Largest part of it that substeps at the halving limit, and steps in a row, may create together [-].
    pub created_together: f64,
    /// Part of a step in which history variables relax [-]: as good as none, but it is divided by.
    pub at_once: f64,
    /// Iterations on the central path of the contacts at frozen geometry: observed are 8 to 22.
    pub central_iterations: usize,
    /// Part of the way to the boundary of the cone that such an iteration may go [-].
    pub central_boundary: f64,
    /// Relative precision at which it ends [-]: Newton's method goes on from there.
    pub central_precision: f64,
    /// Mobility of a contact over one by the mass of everything, at least [-]: a body guided along a surface has none along the normal.
    pub least_mobility: f64,
    /// Speed, per length of the step, at which a contact that begins deep is pushed out [m/s²]: of the order of a step's fall, so that
    /// nothing is thrown.
    pub recovery: f64,
    /// Regularization of the law that disables a contact [-].
    pub disabled: f64,
}

/// The values in use.
pub(crate) const STEP: StepConstants = StepConstants {
    attempts: 4,
    most_counted: 8,
    created_by_bodies: 0.02,
    slow: 0.1,
    created: 1e-3,
    created_together: 0.1,
    at_once: 1e-9,
    central_iterations: 60,
    central_boundary: 0.95,
    central_precision: 1e-6,
    least_mobility: 1e-6,
    recovery: 10.0,
    disabled: 1e12,
};
