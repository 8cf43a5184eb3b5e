//! Rods that twist: their edges' material axes, how these are carried along, and what bending and twisting cost.
//!
//! An edge has a twist angle θ \[rad\] among the coordinates, behind the nodes', and a *reference axis* d in z, a unit vector normal to it.
//! Its first material axis is d turned by θ about the edge. As the edge turns, d is carried along by the smallest rotation
//! (Bergou et al. 2010, time-parallel transport), so that θ's rate is the angular velocity of the material about the edge. Between
//! edges that meet z has the twist m of one's reference axis against the other's, with all its whole turns:
//! ```text
//! z = (d of every edge, m of every joint) behind what joints and motors remember,     τ = θ₂ − θ₁ + m
//! ```
//! **Tangents.** θ and d are two numbers for one thing, so d and m have no tangent of their own. A change of a state is (δx, δα, …):
//! nodes move by δx and carry the axes along, then material axes turn by δα about their edges, by θ. What the axes of an edge
//! are after a step depends on the way its direction took: from direction a to b,
//! ```text
//! δα(b) = δα(a) + h δω + ψ_a·δe_a + ψ_b·δe_b,     ψ = −(a × b)/((1 + a·b) l)
//! ```
//! because the smallest rotations around a triangle of directions turn by its area. That is [`TransportDerivative`].

mod constants;
mod displace;
mod frames;
mod interpolate;
mod joint;
mod memory;
mod simd;
mod term;
mod transport;

pub use frames::RodPoint;
pub use interpolate::Following;
pub(crate) use memory::Remembered;
pub use memory::RodPast;
pub use transport::TransportDerivative;

use crate::terms::section::SectionLaw;
use pliant_linalg::{CarriedPlace, NodeMatrix, Places};
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

/// An edge with a twist angle: number k among them has row 3 n_nodes + k.
#[derive(Clone, Debug, PartialEq)]
pub struct RodEdge {
    /// From node to node.
    pub nodes: [usize; 2],
    /// Index in θ of the rod's moment of inertia about its axis per length [kg·m].
    pub inertia: usize,
    /// Index in θ of the rod's length \[m\].
    pub length: usize,
    /// Rest length as a fraction of it.
    pub fraction: f64,
}

impl RodEdge {
    /// Moment of inertia about the edge [kg·m²].
    pub fn moment(&self, theta: &[f64]) -> f64 {
        theta[self.inertia] * theta[self.length] * self.fraction
    }

    /// Calls `visit(parameter, ∂moment/∂parameter)`.
    pub fn visit(&self, theta: &[f64], visit: &mut dyn FnMut(usize, f64)) {
        visit(self.inertia, theta[self.length] * self.fraction);
        visit(self.length, theta[self.inertia] * self.fraction);
    }
}

/// Two edges that meet at a node.
#[derive(Clone, Debug, PartialEq)]
pub struct RodJoint {
    /// Edges, in the rod's order.
    pub edges: [usize; 2],
    /// Nodes before, between and behind them.
    pub nodes: [usize; 3],
    /// Length that its strain is spread over, as a fraction of the rod's.
    pub fraction: f64,
}

/// Joints of one rod, and the laws of its section.
#[derive(Clone, Debug)]
pub struct RodSection {
    /// Joints.
    pub joints: Range<usize>,
    /// Laws whose moments add up.
    pub laws: Vec<Arc<dyn SectionLaw>>,
    /// History variables of each: the first place in z, and how many numbers per joint.
    pub places: Vec<(usize, usize)>,
    /// Whether it is without forces as the scene begins.
    pub rest_initial: bool,
    /// Of a closed rod, whose first joint is between its last edge and its first: the twist of the whole ring as the scene begins \[rad\].
    pub seam: Option<f64>,
}

/// The rods of a model.
#[derive(Clone, Debug, Default)]
pub struct Rods {
    /// Edges with a twist angle.
    pub edges: Vec<RodEdge>,
    /// Where they meet.
    pub joints: Vec<RodJoint>,
    /// Section laws, rod by rod.
    pub sections: Vec<RodSection>,
    /// Number of nodes of the model: twists' rows follow three of each.
    pub n_nodes: usize,
    /// Rows of the forces that an edge's axes matter to, edge by edge.
    pub neighbours: Vec<Vec<usize>>,
    places: Places<Vec<CarriedPlace>>,
}

impl Rods {
    /// Number of twist angles.
    pub fn n_twists(&self) -> usize {
        self.edges.len()
    }

    /// Numbers of z.
    pub fn n_frames(&self) -> usize {
        3 * self.edges.len() + self.joints.len()
    }

    /// Sets what follows from edges and joints.
    pub(crate) fn finish(&mut self, n_nodes: usize) {
        self.n_nodes = n_nodes;
        let rows = |k: usize| {
            let mut rows: Vec<usize> =
                self.joints.iter().filter(|joint| joint.edges.contains(&k)).flat_map(|joint| self.rows(joint)).collect();
            rows.sort_unstable();
            rows.dedup();
            rows
        };
        self.neighbours = (0..self.edges.len()).map(rows).collect();
    }

    /// Where in a matrix of forces' slopes are those by an edge's twist and by its nodes, edge by edge.
    pub(crate) fn carried_places(&self, matrix: &NodeMatrix) -> Cow<'_, [Vec<CarriedPlace>]> {
        let of = |(k, edge): (usize, &RodEdge)| matrix.carried_places(&self.neighbours[k], self.row(k), edge.nodes);
        let find = || self.edges.iter().enumerate().map(of).collect::<Vec<_>>();
        self.places.of(matrix, find).map_or_else(|| Cow::Owned(find()), Cow::Borrowed)
    }

    /// Row of twist k.
    #[inline]
    pub fn row(&self, k: usize) -> usize {
        3 * self.n_nodes + k
    }
}
