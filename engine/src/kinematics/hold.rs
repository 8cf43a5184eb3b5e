//! Edges of twisting rods in a gripper's hold: how fast it turns their material axes.
//!
//! A gripper that holds both ends of an edge holds its material axes. At the end of the step the first one shall be
//! ```text
//! R(t⁺, φ) D,    D = the director among the controls (its part normal to the edge), or for clamped nodes, which have none,
//!                    the material axis at which the scene begins, by the smallest rotation from that edge's direction to t⁺
//! φ = roll + a·(t⁺ − t₀) + b·(x⁺ − x₀)
//! ```
//! with t₀, x₀ the edge's direction and the place of its first node (of a clamped end, of the rope's last; where the controls have it, without
//! the gripper's offset) as the scene begins: a gripper whose turn about the rope is not measured turns with where its arm takes it, to
//! first order so much by direction (a \[rad\]) and so much by place (b [rad/m]).
//!
//! The twist's velocity is the angle to it from today's axis, carried to t⁺, over h: the way that is shorter than half a turn. A
//! gripper prescribed by an angular velocity ω turns the edge by cay(h ω), of which 2 atan(h ω·t/2) is about the edge.

use pliant_math::transport::{angle, carried};
use pliant_math::{Input, Real, Vec3};

/// An edge with a twist in the hold of a gripper.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldEdge {
    /// Number among the edges that twist: its reference axis is at 3 of these in z's part of rods.
    pub edge: usize,
    /// Row of the twist.
    pub row: usize,
    /// From node to node.
    pub nodes: [usize; 2],
    /// Direction, material axis and place as the scene begins.
    pub start: [Vec3<f64>; 3],
    /// Index in θ of the roll \[rad\], if it has one; its three slopes by direction \[rad\] and three by place [rad/m] follow.
    pub roll: Option<usize>,
}

/// Where an edge is as a step begins.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Now {
    tangent: Vec3<f64>,
    axis: Vec3<f64>,
    twist: f64,
}

impl HeldEdge {
    /// Reads direction and axes from the coordinates and z's part of rods.
    pub(crate) fn now(&self, q: &[f64], frames: &[f64]) -> Now {
        let at = |x: &[f64], i: usize| Vec3::new(x[3 * i], x[3 * i + 1], x[3 * i + 2]);
        let tangent = (at(q, self.nodes[1]) - at(q, self.nodes[0])).normalize();
        let (d, twist) = (at(frames, self.edge), q[self.row]);
        Now { tangent, axis: d * twist.cos() + tangent.cross(&d) * twist.sin(), twist }
    }

    /// Inputs of the turn as the step begins.
    pub(crate) fn inputs(&self) -> impl Iterator<Item = Input> {
        let nodes = self.nodes.into_iter().flat_map(|node| (0..3).map(move |a| Input::Q(3 * node + a)));
        nodes.chain([Input::Q(self.row)]).chain(self.roll.into_iter().flat_map(|roll| (roll..roll + 7).map(Input::Theta)))
    }

    /// The unit tangent and the first material axis as the step begins, for any scalar: axes are carried along with the nodes.
    fn axes<S: Real>(&self, now: &Now, get: &dyn Fn(Input) -> S) -> [Vec3<S>; 2] {
        let vec3 = |node: usize| Vec3::new(get(Input::Q(3 * node)), get(Input::Q(3 * node + 1)), get(Input::Q(3 * node + 2)));
        let edge = vec3(self.nodes[1]) - vec3(self.nodes[0]);
        let tangent = edge * edge.dot(&edge).sqrt().recip();
        let axis = carried(&now.tangent.map(S::from), &tangent, &now.axis.map(S::from));
        let (sin, cos) = (get(Input::Q(self.row)) - now.twist).sin_cos();
        [tangent, axis * cos + tangent.cross(&axis) * sin]
    }

    /// φ \[rad\] of an edge in the direction `tangent` that begins at `place`.
    fn turned<S: Real>(&self, tangent: &Vec3<S>, place: &Vec3<S>, get: &dyn Fn(Input) -> S) -> S {
        let Some(roll) = self.roll else { return S::zero() };
        let slope = |first: usize, by: &Vec3<S>| {
            let terms = (0..3).map(|a| get(Input::Theta(roll + first + a)) * by[a]);
            terms.fold(S::zero(), |sum, term| sum + term)
        };
        let [direction, _, from] = self.start.map(|v| v.map(S::from));
        get(Input::Theta(roll)) + slope(1, &(tangent - direction)) + slope(4, &(place - from))
    }

    /// Velocity of the twist [rad/s] of an edge that ends the step at the vector `edge` from `place`, held by a director, if there is one.
    pub(crate) fn command<S: Real>(
        &self,
        now: &Now,
        [place, edge]: [Vec3<S>; 2],
        director: Option<Vec3<S>>,
        get: &dyn Fn(Input) -> S,
        h: f64,
    ) -> S {
        let end = edge * edge.dot(&edge).sqrt().recip();
        let [tangent, axis] = self.axes(now, get);
        let [direction, first, _] = self.start.map(|v| v.map(S::from));
        let wish = director.unwrap_or_else(|| carried(&direction, &end, &first));
        let across = end.cross(&wish);
        let wish = across.cross(&end);
        let (sin, cos) = self.turned(&end, &place, get).sin_cos();
        let wish = wish * cos + across * sin;
        angle(&carried(&tangent, &end, &axis), &wish, &end) / S::from(h)
    }

    /// Velocity of the twist [rad/s] in a gripper that turns with the angular velocity `omega`.
    pub(crate) fn spin<S: Real>(&self, now: &Now, omega: Vec3<S>, get: &dyn Fn(Input) -> S, h: f64) -> S {
        let [tangent, _] = self.axes(now, get);
        (omega.dot(&tangent) * S::from(0.5 * h)).atan() * S::from(2.0 / h)
    }
}
