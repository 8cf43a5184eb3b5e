//! Changes that no law describes: a force at a joint, on nodes or in bending, or an error of a sensor, as a function of one variable.
//!
//! They are looked at where they have no size, so only their directions are of use.

mod bends;

pub use bends::Bends;

use pliant_engine::bodies::quaternion;
use pliant_math::rotation::logarithm;

/// A change of size one.
#[derive(Clone, Debug, PartialEq)]
pub struct Form {
    /// The force or the reading that it changes.
    pub place: Place,
    /// The variable that its size depends on.
    pub variable: Variable,
    /// The function of that variable.
    pub shape: Shape,
    /// Whether it turns over with the velocity, as friction does.
    pub reversing: bool,
}

/// The force or the reading that a form changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The force at a joint [N or N·m].
    Force {
        /// The coordinate, counted from the first of the bodies'.
        q: usize,
        /// The degree of freedom, counted likewise.
        v: usize,
    },
    /// The moment at a ball joint about one axis of the body that it turns [N·m]; its position is that component of the rotation vector,
    /// its velocity that of the angular velocity.
    Moment {
        /// The first entry of its quaternion, counted from the first of the bodies' coordinates.
        q: usize,
        /// Its first degree of freedom, counted likewise.
        v: usize,
        /// The axis.
        axis: usize,
    },
    /// A force on each of these nodes along an axis of the world \[N\], a function of the time alone.
    Nodes {
        /// The first node.
        first: usize,
        /// How many there are from there on.
        number: usize,
        /// The axis.
        axis: usize,
    },
    /// The moment at inner nodes of a rope [N·m²]; its position is the size of the curvature there, its velocity that of its rate.
    Bends(Bends),
    /// The reading of this sensor at a joint.
    Reading(usize),
    /// The readings of all markers along an axis of the sensor \[m\], a function of the time alone.
    Markers {
        /// The axis.
        axis: usize,
    },
}

impl Place {
    /// The coordinate of a joint among those of all bodies [m or rad]; 0 of what is no joint.
    pub fn position(self, q: &[f64]) -> f64 {
        match self {
            Self::Force { q: k, .. } => q[k],
            Self::Moment { q: k, axis, .. } => logarithm(&quaternion(q, k))[axis],
            Self::Nodes { .. } | Self::Bends(_) | Self::Reading(_) | Self::Markers { .. } => 0.0,
        }
    }

    /// Its velocity among those of all bodies [m/s or rad/s].
    pub fn velocity(self, v: &[f64]) -> f64 {
        match self {
            Self::Force { v: k, .. } => v[k],
            Self::Moment { v: k, axis, .. } => v[k + axis],
            Self::Nodes { .. } | Self::Bends(_) | Self::Reading(_) | Self::Markers { .. } => 0.0,
        }
    }

    /// Degrees of freedom that a force of one size acts on, `bodies` being the first of the bodies'; none of an error of a sensor, or of a
    /// moment in bending ([`Bends::forces`]).
    pub fn dofs(self, bodies: usize) -> impl Iterator<Item = usize> {
        let (first, number, apart) = match self {
            Self::Force { v, .. } => (bodies + v, 1, 1),
            Self::Moment { v, axis, .. } => (bodies + v + axis, 1, 1),
            Self::Nodes { first, number, axis } => (3 * first + axis, number, 3),
            Self::Bends(_) | Self::Reading(_) | Self::Markers { .. } => (0, 0, 1),
        };
        (0..number).map(move |k| first + apart * k)
    }
}

/// The variable that a form is a function of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variable {
    /// Time since the record began \[s\].
    Time,
    /// The joint's coordinate [m or rad].
    Position,
    /// The joint's velocity [m/s or rad/s].
    Velocity,
}

/// The function of the variable x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// xⁿ.
    Power(i32),
    /// |x|.
    Size,
    /// 1 at the peak and 0 from `width` on, linear between: a hat of a row of them over a range.
    Hat {
        /// Where it is 1.
        peak: f64,
        /// The distance to the next one.
        width: f64,
        /// Whether it is the first of its row, and stays 1 before its peak.
        first: bool,
        /// Whether it is the last, and stays 1 behind its peak.
        last: bool,
    },
    /// sin(k x) with the wave number k.
    Sine(f64),
    /// cos(k x).
    Cosine(f64),
}

impl Form {
    /// Its value at a time, a coordinate and a velocity.
    pub fn value(&self, time: f64, q: f64, v: f64) -> f64 {
        let x = match self.variable {
            Variable::Time => time,
            Variable::Position => q,
            Variable::Velocity => v,
        };
        let sign = match (self.reversing, v) {
            (true, 0.0) => 0.0,
            (true, v) => v.signum(),
            (false, _) => 1.0,
        };
        sign * self.shape.at(x)
    }
}

impl Shape {
    /// Its value.
    pub fn at(self, x: f64) -> f64 {
        match self {
            Self::Power(n) => x.powi(n),
            Self::Size => x.abs(),
            Self::Hat { peak, width, first, last } => {
                let side = (x - peak) / width;
                let beyond = side < 0.0 && first || side > 0.0 && last;
                if beyond { 1.0 } else { (1.0 - side.abs()).max(0.0) }
            }
            Self::Sine(k) => (k * x).sin(),
            Self::Cosine(k) => (k * x).cos(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hats_of_a_row_add_up_to_one_everywhere() {
        let hat = |k: usize| Shape::Hat { peak: f64::from(k as u8) * 0.5, width: 0.5, first: k == 0, last: k == 3 };
        for x in [-3.0, 0.0, 0.1, 0.77, 1.5, 9.0] {
            let sum: f64 = (0..4).map(|k| hat(k).at(x)).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{x} {sum}");
        }
    }

    #[test]
    fn a_force_finds_its_place_in_the_state() {
        let ball = Place::Moment { q: 1, v: 1, axis: 2 };
        let half = 0.15_f64;
        assert!((ball.position(&[7.0, half.cos(), 0.0, 0.0, half.sin()]) - 0.3).abs() < 1e-12);
        assert_eq!(ball.velocity(&[7.0, 1.0, 2.0, 3.0]), 3.0);
        assert_eq!(ball.dofs(12).collect::<Vec<_>>(), [15]);
        assert_eq!(Place::Nodes { first: 2, number: 3, axis: 1 }.dofs(99).collect::<Vec<_>>(), [7, 10, 13]);
        assert_eq!(Place::Reading(0).dofs(4).count() + Place::Markers { axis: 0 }.dofs(4).count(), 0);
    }

    #[test]
    fn what_reverses_has_the_sign_of_the_velocity() {
        let place = Place::Force { q: 0, v: 0 };
        let friction = Form { place, variable: Variable::Position, shape: Shape::Size, reversing: true };
        assert_eq!([-2.0, 0.0, 0.1].map(|v| friction.value(5.0, -3.0, v)), [-3.0, 0.0, 3.0]);
        let later = Form { place, variable: Variable::Time, shape: Shape::Power(1), reversing: false };
        assert_eq!(later.value(5.0, -3.0, -2.0), 5.0);
    }
}
