//! Grippers that grasp by proximity: a prescribed point with a closing control c that seizes the nearest point of a rope or a sheet.
//!
//! ```text
//! σ(c) = 1/(1 + exp(−s (c − ½)))                             closing, s = `steepness`
//! seize   c ≥ ½ and d ≤ radius, d = |x_a − p|, x_a = Σ wᵢ xᵢ the point of the rope's edges or the sheet's triangles nearest to p
//! hold    force k σ(c) (p + o − x_a) at the material point that was seized, o ← o exp(−t/closing_time)
//! let go  c < ½
//! ```
//! What is seized, where on it (w) and how far from the gripper's point (o, first x_a − p) are part of z; all of it is decided from the
//! state at the *beginning* of a (halved) step. (With the distance at the end of the step the indicator would leave steps without a
//! root.) So a step sees a linear spring at fixed weights towards a point that moves as commanded: one symmetric block on at most three
//! neighbouring nodes, for which the matrix has room.
//!
//! *Material, not nearest, once seized.* A spring to whatever point is nearest now lets a rope slip through at the rate F/(k h) under a
//! pull F along it: a creep that depends on the step length, and that grows without bound as h falls. What is held here does not slip.
//!
//! *Smooth.* The exact derivative of all this knows nothing of what is not yet in reach. [`Grasping::Smooth`] steps are for surrogates: as
//! long as nothing is held, the nearest point is pulled by
//! ```text
//! k σ(c) a(d) (p − x_a),    a(d) = (1 − tail)/(1 + exp((d − radius)/smoothing)) + tail/(1 + (d/tail_reach)²)
//! ```
//! with d of the step's beginning. Its algebraic tail is felt at any distance; at d > tail_reach the pull grows on approach.
//!
//! Derivatives are exact but for switches (seizing, letting go, another nearest face), where they are those of one side. Where the
//! distance is zero, ∂d is taken as 0.

mod constants;
mod law;
mod nearest;

pub(crate) use law::{Begin, Hold, Phase};

use crate::terms::Point;
use pliant_math::Vec3;

/// Which grasp a step is taken with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Grasping {
    /// The indicator: nothing out of reach is pulled.
    #[default]
    Hard,
    /// The smoothed activation: another simulation, for surrogate gradients.
    Smooth,
}

/// A gripper that grasps. Entries of θ are indices.
#[derive(Clone, Debug, PartialEq)]
pub struct Grasp {
    /// Name of the gripper in the scene.
    pub name: String,
    /// Its point: a massless prescribed node.
    pub node: usize,
    /// Its closing control in u.
    pub closing: usize,
    /// Spring k [N/m].
    pub stiffness: usize,
    /// Reach \[m\].
    pub radius: usize,
    /// s [-].
    pub steepness: usize,
    /// Time constant with which what is held is drawn to the point \[s\].
    pub closing_time: usize,
    /// Width of the smoothed activation \[m\].
    pub smoothing: usize,
    /// Part of it that falls off with the distance's square [-].
    pub tail: usize,
    /// Where that has fallen to one half \[m\].
    pub tail_reach: usize,
    /// First of its numbers in z: the element held, counted from 1 (0: none); the weights of its nodes but the first; o \[m\].
    pub memory: usize,
    /// Edges (two nodes, the second repeated) or triangles that it may seize.
    pub elements: Vec<[usize; 3]>,
    /// Nodes of an element: 2 or 3.
    pub corners: usize,
}

/// The point of a rope or a sheet nearest to a gripper's point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    gripper: usize,
    element: usize,
    nodes: [usize; 3],
    weights: [f64; 3],
    corners: usize,
    /// The nearest point x_a = Σ wᵢ xᵢ \[m\].
    pub point: Vec3<f64>,
    /// The gripper's point p \[m\].
    pub from: Vec3<f64>,
    /// |x_a − p| \[m\].
    pub distance: f64,
}

impl Reach {
    /// Number of the edge or triangle, from 0.
    pub fn element(&self) -> usize {
        self.element
    }

    /// Nodes of the element and their weights.
    pub fn weights(&self) -> impl Iterator<Item = (usize, f64)> {
        self.nodes.into_iter().zip(self.weights).take(self.corners)
    }

    /// Calls `visit(k, ∂distance/∂q_k)`. Exact but where another element or another part of it is as near, and where the distance is
    /// zero, where it is taken as zero: at the nearest point a change of its weights does not change the distance.
    pub fn visit_distance(&self, mut visit: impl FnMut(usize, f64)) {
        if self.distance == 0.0 {
            return;
        }
        let away = (self.from - self.point) / self.distance;
        for a in 0..3 {
            visit(3 * self.gripper + a, away[a]);
            self.weights().for_each(|(node, w)| visit(3 * node + a, -w * away[a]));
        }
    }
}

impl Grasp {
    /// How many numbers of z it has: the element, `corners − 1` weights, three of o.
    pub fn n_memory(corners: usize) -> usize {
        3 + corners
    }

    /// Their names.
    pub(crate) fn memory_names(name: &str, corners: usize) -> Vec<String> {
        let weights = (1..corners).map(|k| format!("{name}.held_weight[{k}]"));
        let offset = ["x", "y", "z"].map(|axis| format!("{name}.held_offset.{axis}"));
        std::iter::once(format!("{name}.held")).chain(weights).chain(offset).collect()
    }

    /// The nodes it holds at internal variables `z`, and their weights; `None` if it holds nothing.
    pub fn held(&self, z: &[f64]) -> Option<Vec<(usize, f64)>> {
        let element = self.elements.get(law::element_of(z[self.memory])?)?;
        let others = &z[self.memory + 1..self.memory + self.corners];
        let weights = std::iter::once(1.0 - others.iter().sum::<f64>()).chain(others.iter().copied());
        Some(element.iter().copied().zip(weights).collect())
    }
}

impl Hold {
    /// `f += k σ w (target − x_a)` \[N\].
    pub(crate) fn add_force(&self, at: &Point, f: &mut [f64]) {
        let pull = self.pull(at.q);
        for (&node, w) in self.nodes().iter().zip(self.weights) {
            (0..3).for_each(|a| f[3 * node + a] += w * pull[a]);
        }
    }

    /// `add(row, column, ∂f_row/∂q_column)`: −k σ w wᵀ.
    pub(crate) fn visit_jacobian(&self, mut add: impl FnMut(usize, usize, f64)) {
        for (&i, wi) in self.nodes().iter().zip(self.weights) {
            for (&j, wj) in self.nodes().iter().zip(self.weights) {
                (0..3).for_each(|a| add(3 * i + a, 3 * j + a, -self.stiffness * wi * wj));
            }
        }
    }

    /// Force on the point that is held \[N\].
    pub(crate) fn pull(&self, q: &[f64]) -> Vec3<f64> {
        let x = |i: usize| Vec3::new(q[3 * i], q[3 * i + 1], q[3 * i + 2]);
        let point: Vec3<f64> = self.nodes().iter().zip(self.weights).map(|(&node, w)| x(node) * w).sum();
        (self.target - point) * self.stiffness
    }
}
