//! Numbers that decide in a simulated record: values of dormant parameters without effect, and the priors of initial states.
//! Units and reasons; where no source is named, a value is our own choice.

/// See the module; one value, [`SHOOTING`].
pub(crate) struct ShootingConstants {
    // dormant parameters
    /// Edges of a rope beyond which data could not tell their lengths apart.
    pub few_edges: usize,
    /// Inactive limit: a torque that no motor reaches [N·m or N], and a curvature that no rod does [1/m].
    pub inactive_limit: f64,
    /// Inactive time \[s\]: after it no joint has crept.
    pub inactive_time: f64,
    /// Yield that every deflection exceeds [rad or m].
    pub least_yield: f64,
    /// Longest delay of a motor's commands that a diagnosis tries \[s\].
    pub longest_delay: f64,
    // initial states of nodes
    /// Samples of the local quadratic that gives positions and velocities at the start.
    pub samples: usize,
    /// Fewest finite samples of it: one more than its coefficients.
    pub fewest_samples: usize,
    /// Standard deviations of the prior of an observed node \[m\], [m/s].
    pub seen: (f64, f64),
    /// Standard deviations of the prior of a node between observed ones \[m\], [m/s].
    pub unseen: (f64, f64),
    /// Acceleration that the plausible strain of a rope or sheet goes with [m/s²]: twice gravity's.
    pub strain_acceleration: f64,
    /// Bounds of the plausible strain [-].
    pub strain_bounds: (f64, f64),
    /// Angular frequency at which plausible strains come and go [1/s].
    pub strain_rate: f64,
    /// Gauss–Newton steps to the mean of the positions.
    pub mean_steps: usize,
    /// Step that ends them \[m\]: rounding.
    pub mean_settled: f64,
    // initial states of bodies
    /// Standard deviations of coordinates without a reading [rad or m], and of their velocities [rad/s or m/s].
    pub unread: (f64, f64),
    /// Standard deviations of a read orientation \[rad\] and of its angular velocity [rad/s].
    pub turned: (f64, f64),
    /// Standard deviation of a reading, in declared floors [-].
    pub reading_floors: f64,
    /// Standard deviation of a reading, in residuals of its quadratic [-].
    pub reading_residuals: f64,
    /// Part of the record's own motion (of a point: of its distance from the sensor's origin) that a reading may be off [-]: a wrong
    /// scale or delay of its sensor must not be held against the cause that explains it (the zero of one at a joint is followed), and the
    /// samples of a record say far more of the state than this.
    pub own_motion: f64,
    /// Part of the record's own speed that the slope of a reading may be off [-], for the same reason.
    pub own_speed: f64,
    /// Gauss–Newton steps to the pose.
    pub pose_steps: usize,
    /// The longest of them [rad or m].
    pub pose_step: f64,
    /// Step that ends them [rad or m]: rounding.
    pub pose_settled: f64,
    // times of samples
    /// Singular values below this are zero in the fit of the quadratic [-].
    pub singular: f64,
    /// A sample closer than this part of a step to its end lies there [-]: rounding of time stamps.
    pub same_time: f64,
}

/// The values in use.
pub(crate) const SHOOTING: ShootingConstants = ShootingConstants {
    few_edges: 40,
    inactive_limit: 1e9,
    inactive_time: 1e7,
    least_yield: 1e-9,
    longest_delay: 0.05,
    samples: 9,
    fewest_samples: 4,
    seen: (2e-3, 0.05),
    unseen: (1e-2, 0.3),
    strain_acceleration: 20.0,
    strain_bounds: (1e-7, 0.1),
    strain_rate: 30.0,
    mean_steps: 20,
    mean_settled: 1e-12,
    unread: (1.0, 3.0),
    turned: (0.01, 0.3),
    reading_floors: 10.0,
    reading_residuals: 3.0,
    own_motion: 0.3,
    own_speed: 0.3,
    pose_steps: 50,
    pose_step: 0.5,
    pose_settled: 1e-12,
    singular: 1e-12,
    same_time: 1e-9,
};
