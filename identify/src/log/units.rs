//! Units of logs, and their sizes in SI units.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Units of time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum TimeUnit {
    /// Seconds.
    #[default]
    S,
    /// Milliseconds.
    Ms,
    /// Microseconds.
    Us,
    /// Nanoseconds, as stamps of ROS.
    Ns,
}

/// Units of length; for velocities, the same per second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LengthUnit {
    /// Metres.
    #[default]
    M,
    /// Centimetres.
    Cm,
    /// Millimetres.
    Mm,
}

/// Units of angle; for angular velocities, the same per second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum AngleUnit {
    /// Radians.
    #[default]
    Rad,
    /// Degrees.
    Deg,
}

/// Units of torque.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum TorqueUnit {
    /// N·m; of forces N.
    #[default]
    Nm,
    /// N·cm.
    Ncm,
    /// N·mm.
    Nmm,
    /// mN·m.
    #[serde(rename = "mNm")]
    MilliNm,
}

impl TimeUnit {
    /// The unit in seconds.
    pub fn seconds(self) -> f64 {
        match self {
            Self::S => 1.0,
            Self::Ms => 1e-3,
            Self::Us => 1e-6,
            Self::Ns => 1e-9,
        }
    }
}

impl LengthUnit {
    /// The unit in metres.
    pub fn metres(self) -> f64 {
        match self {
            Self::M => 1.0,
            Self::Cm => 1e-2,
            Self::Mm => 1e-3,
        }
    }
}

impl AngleUnit {
    /// The unit in radians.
    pub fn radians(self) -> f64 {
        match self {
            Self::Rad => 1.0,
            Self::Deg => std::f64::consts::PI / 180.0,
        }
    }
}

impl TorqueUnit {
    /// The unit in newton metres.
    pub fn newton_metres(self) -> f64 {
        match self {
            Self::Nm => 1.0,
            Self::Ncm => 1e-2,
            Self::Nmm | Self::MilliNm => 1e-3,
        }
    }

    /// Whether it is the SI unit.
    pub fn is_si(&self) -> bool {
        *self == Self::default()
    }
}
