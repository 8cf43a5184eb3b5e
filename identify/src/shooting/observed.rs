//! Observable quantities and their places in a model.

use super::torque::DrivePlace;
use crate::log::JointQuantity;
use nalgebra::Vector3;

/// Something observed, by its number among its kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Observed {
    /// A point, three channels \[m\].
    Marker(usize),
    /// A quantity of a joint, one channel.
    Joint(usize),
    /// An orientation, three channels: the turn from simulated to measured as a rotation vector, with the opposite sign \[rad\].
    Orientation(usize),
}

impl Observed {
    /// Number of channels.
    pub fn width(self) -> usize {
        if matches!(self, Self::Joint(_)) { 1 } else { 3 }
    }
}

/// Where a marker is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MarkerPlace {
    /// On a rope or a sheet of cloth.
    Nodes(NodePair),
    /// On a body.
    Body {
        /// Number in the tree.
        body: usize,
        /// Place in the body's frame \[m\].
        point: Vector3<f64>,
    },
}

impl MarkerPlace {
    /// The nodes of a marker on a rope or sheet.
    pub fn nodes(&self) -> Option<&NodePair> {
        if let Self::Nodes(pair) = self { Some(pair) } else { None }
    }
}

/// A point of a rope as a weighted pair of nodes; of a sheet a node, twice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodePair {
    /// First node.
    pub node: usize,
    /// Second node.
    pub next: usize,
    /// Weight of the second node.
    pub weight: f64,
}

/// A sensor at a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct JointPlace {
    /// Name, for messages.
    pub name: String,
    /// The joint's name.
    pub joint: String,
    /// The measured quantity.
    pub quantity: JointQuantity,
    /// The coordinate, counted from the first of the bodies'.
    pub q: usize,
    /// The degree of freedom, counted likewise.
    pub v: usize,
    /// Smallest believed standard deviation of a reading.
    pub floor: f64,
    /// SI unit of a reading.
    pub unit: &'static str,
    /// The joint's actuators, for a torque sensor.
    pub drives: Vec<DrivePlace>,
}

/// An observed orientation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientationPlace {
    /// Number of the body in the tree.
    pub body: usize,
    /// Smallest believed standard deviation \[rad\].
    pub floor: f64,
}
