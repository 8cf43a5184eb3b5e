//! The observation model: from positions to readings.
//!
//! ```text
//! y(t) = scale · R(rotation) p(t − time_offset) + bias
//! ```
//! `p` true position \[m\], `R` the rotation by the vector `rotation` \[rad\] about the world's origin, `bias` \[m\],
//! `time_offset` \[s\] > 0 where the sensor is late. No sensor error: scale 1, all else 0.

//!
//! A sensor at a joint reads one number x (a coordinate, a velocity or a torque):
//! ```text
//! y(t) = scale · x(t − time_offset − delay) + bias + drift · t
//! ```
//! with `time_offset` that of the markers' sensor, which all sensors share, `delay` \[s\] > 0 where this one is later still, and t = 0 at the
//! first sample of every record.

use nalgebra::{Matrix3, SVector, Vector3};
use num_dual::{Derivative, DualNum, DualSVec64};
use pliant_math::params::{ANY, POSITIVE};

/// Entries of a sensor's parameters, in this order: bias (3), scale, rotation (3), time offset.
pub const SENSOR_PARAMS: usize = 8;
/// Paths of [`SENSOR_PARAMS`].
pub const SENSOR_PATHS: [&str; SENSOR_PARAMS] = [
    "sensor.bias[0]",
    "sensor.bias[1]",
    "sensor.bias[2]",
    "sensor.scale",
    "sensor.rotation[0]",
    "sensor.rotation[1]",
    "sensor.rotation[2]",
    "sensor.time_offset",
];
/// Units of [`SENSOR_PARAMS`].
pub const SENSOR_UNITS: [&str; SENSOR_PARAMS] = ["m", "m", "m", "-", "rad", "rad", "rad", "s"];
/// Physical bounds of [`SENSOR_PARAMS`].
pub const SENSOR_BOUNDS: [(f64, f64); SENSOR_PARAMS] = [ANY, ANY, ANY, POSITIVE, ANY, ANY, ANY, ANY];
/// Index of the scale.
pub const SCALE: usize = 3;
/// Index of the time offset.
pub const TIME_OFFSET: usize = 7;

/// Numbers of a sensor at a joint, in this order.
pub const JOINT_ENTRIES: [&str; 4] = ["bias", "scale", "delay", "drift"];
/// Values of [`JOINT_ENTRIES`].
pub type JointNumbers = [f64; JOINT_ENTRIES.len()];
/// Their physical bounds. A sensor may well count backwards.
pub const JOINT_BOUNDS: [(f64, f64); JOINT_ENTRIES.len()] = [ANY; JOINT_ENTRIES.len()];
/// Index of a joint sensor's bias.
pub const BIAS: usize = 0;
/// Index of its scale.
pub const GAIN: usize = 1;
/// Index of its delay.
pub const DELAY: usize = 2;
/// Index of the rate at which its zero moves.
pub const DRIFT: usize = 3;

/// A position sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor(pub [f64; SENSOR_PARAMS]);

impl Default for Sensor {
    fn default() -> Self {
        let mut p = [0.0; SENSOR_PARAMS];
        p[SCALE] = 1.0;
        Self(p)
    }
}

type Dual = DualSVec64<7>;

impl Sensor {
    /// Time offset \[s\].
    pub fn time_offset(&self) -> f64 {
        self.0[TIME_OFFSET]
    }

    /// Reading of a point at `p`, ∂y/∂p, and ∂y/∂(bias, scale, rotation) by columns.
    pub fn read(&self, p: Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>, [Vector3<f64>; 7]) {
        let y = reading(&self.duals(), p.map(Dual::from_re));
        let r = [0, 1, 2].map(|a| rotated(&self.0, Vector3::ith(a, 1.0)) * self.0[SCALE]);
        (y.map(|c| c.re), Matrix3::from_columns(&r), columns(&y))
    }

    /// The point that reads `y`, and its derivatives by (bias, scale, rotation).
    pub fn locate(&self, y: Vector3<f64>) -> (Vector3<f64>, [Vector3<f64>; 7]) {
        let p = located(&self.duals(), y.map(Dual::from_re));
        (p.map(|c| c.re), columns(&p))
    }

    /// The direction that reads `d`, and its derivatives.
    pub fn locate_direction(&self, d: Vector3<f64>) -> (Vector3<f64>, [Vector3<f64>; 7]) {
        let mut s = self.duals();
        (0..SCALE).for_each(|a| s[a] = Dual::from_re(0.0));
        s[SCALE] = Dual::from_re(1.0);
        let p = located(&s, d.map(Dual::from_re));
        (p.map(|c| c.re), columns(&p))
    }

    fn duals(&self) -> [Dual; SENSOR_PARAMS] {
        std::array::from_fn(|k| {
            let mut eps = SVector::zeros();
            if k < 7 {
                eps[k] = 1.0;
            }
            Dual::new(self.0[k], Derivative::some(eps))
        })
    }
}

fn columns(y: &Vector3<Dual>) -> [Vector3<f64>; 7] {
    let eps = y.map(|c| c.eps.0.unwrap_or_else(SVector::zeros));
    std::array::from_fn(|k| Vector3::new(eps[0][k], eps[1][k], eps[2][k]))
}

fn reading<S: DualNum<Primitive = f64> + Copy>(s: &[S; SENSOR_PARAMS], p: Vector3<S>) -> Vector3<S> {
    rotated(s, p) * s[SCALE] + Vector3::new(s[0], s[1], s[2])
}

fn located<S: DualNum<Primitive = f64> + Copy>(s: &[S; SENSOR_PARAMS], y: Vector3<S>) -> Vector3<S> {
    let mut back = *s;
    (4..7).for_each(|k| back[k] = -s[k]);
    rotated(&back, (y - Vector3::new(s[0], s[1], s[2])) / s[SCALE])
}

/// Rodrigues' formula; its coefficients by series near zero, where the closed form has no derivative.
fn rotated<S: DualNum<Primitive = f64> + Copy>(s: &[S; SENSOR_PARAMS], p: Vector3<S>) -> Vector3<S> {
    let r = Vector3::new(s[4], s[5], s[6]);
    let angle2 = r.dot(&r);
    let (a, b) = if angle2.re() < 1e-6 {
        // sin x/x and (1 − cos x)/x²
        (-(angle2 / 6.0) + 1.0, -(angle2 / 24.0) + 0.5)
    } else {
        let angle = angle2.sqrt();
        (angle.sin() / angle, (-angle.cos() + 1.0) / angle2)
    };
    let rp = r.cross(&p);
    p + rp * a + r.cross(&rp) * b
}
