//! Numbers that decide whether a log is refused or cut. Units and reasons; where no source is named, a value is our own choice. Bounds of
//! declared values stand at their checks.

/// See the module; one value, [`LOG`].
pub(super) struct LogConstants {
    /// Fewest samples of a record.
    pub samples: usize,
    /// Interval between samples beyond which the inputs in between are unknown \[s\], and in periods [-].
    pub gap: (f64, f64),
    /// Fewest samples of a part between gaps that is simulated.
    pub part: usize,
    /// Distance of a reading from the curve through its neighbours, in their scatter, from which it is left out [-]: of a million readings with normal noise
    /// one is off by 5.
    pub lone: f64,
    /// The same of a reading at an end, and the parabola through the three next to it [-]: less, for three say less about a fourth.
    pub lone_end: f64,
    /// Part of a sensor's readings up to which they are left out [-].
    pub lone_share: f64,
    /// Time from the second reading before one to the second behind it, in periods, up to which they are its neighbours [-].
    pub lone_span: f64,
    /// Part by which the sample period may differ from a whole number of steps [-]: jittering clocks pass.
    pub period_error: f64,
    /// Steps between two samples below which the clock is taken for one in seconds that is read as milliseconds, and above which for one
    /// in milliseconds [-].
    pub steps: (f64, f64),
    /// Extent of the markers, and of markers and grippers, in the length of all ropes, below and above which positions are taken for
    /// another unit's [-].
    pub extent: (f64, f64),
    /// Markers up to which a small extent is accepted: few may well stay in one place, several cannot.
    pub judged_markers: usize,
    /// Part by which a quaternion's length may differ from one [-]: beyond, the columns hold something else.
    pub unit_quaternion: f64,
    /// Revolutions over which a turning joint without limits may move before its unit is doubted [-].
    pub revolutions: f64,
    /// Motion of a joint, in the distance of its limits, beyond which its unit is doubted [-].
    pub beyond_limits: f64,
}

/// The values in use.
pub(super) const LOG: LogConstants = LogConstants {
    samples: 10,
    gap: (0.1, 5.0),
    part: 20,
    lone: 8.0,
    lone_end: 5.0,
    lone_share: 0.02,
    lone_span: 4.5,
    period_error: 0.02,
    steps: (0.05, 500.0),
    extent: (0.01, 10.0),
    judged_markers: 3,
    unit_quaternion: 0.02,
    revolutions: 10.0,
    beyond_limits: 5.0,
};
