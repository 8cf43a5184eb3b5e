//! Numbers that decide the verdict of a gradient check. Units and reasons; where no source is named, a value is our own choice.

/// See the module; one value, [`GRADCHECK`].
pub struct GradcheckConstants {
    /// Largest admissible relative error if the difference's floor is below a tenth of it [-].
    pub relative_error: f64,
    /// Relative precision of the steps that are checked, if the scene's own is no finer [-]: what is left of a residual at the scene's may
    /// change with an input as quickly as a hard contact does, which no width of a difference tells from a derivative.
    pub tolerance: f64,
    /// Multiple of the difference's floor that is admissible otherwise, and of the rounding seen in jvp and vjp [-].
    pub floor_factor: f64,
    /// Largest floor of a difference that judges, so that no error above 1e-5 passes [-]. Rounding leaves differences of rollouts through
    /// hard contact floors of 1e-8 to 1e-6; a term that a gradient lacks changes it by far more than 1e-5.
    pub judging_floor: f64,
    /// Admissible deviation of the Taylor slope from 2 [-].
    pub slope: f64,
    /// Largest admissible relative disagreement of jvp and vjp [-].
    pub dot_test: f64,
    /// Steps that are checked at most where no number is asked for: ropes and rods take seconds for them.
    pub steps: usize,
    /// Steps times degrees of freedom that are then checked at most: a sheet of 171 nodes takes some ten seconds for them on two cores.
    pub steps_times_dofs: usize,
    /// Steps that are then checked at least.
    pub fewest_steps: usize,
    /// Scale of a direction in coordinates, history variables and inputs [SI unit of the entry].
    pub of_coordinates: f64,
    /// Scale of a direction in velocities [m/s or rad/s].
    pub of_velocities: f64,
    /// Largest scale given to a block of zeros, in its SI unit: an input that hardly matters is not moved without limit.
    pub of_zeros: f64,
    /// Part of the terms of L by which such a block's scale moves it [-].
    pub moved: f64,
    /// A derivative along which the block's whole scale moves L by less than this part of its terms is compared absolutely [-]: the
    /// steps' roots are known to 1e-13 of the terms, which is more than `relative_error` of the derivative in the widest step.
    pub insignificant: f64,
    /// A remainder must exceed noise by this factor to be given a slope [-].
    pub above_noise: f64,
}

/// The values in use.
pub const GRADCHECK: GradcheckConstants = GradcheckConstants {
    relative_error: 1e-7,
    tolerance: 1e-13,
    floor_factor: 10.0,
    judging_floor: 1e-6,
    slope: 0.1,
    dot_test: 1e-11,
    steps: 100,
    steps_times_dofs: 10_000,
    fewest_steps: 10,
    of_coordinates: 1e-2,
    of_velocities: 0.1,
    of_zeros: 0.1,
    moved: 0.1,
    insignificant: 1e-4,
    above_noise: 30.0,
};
