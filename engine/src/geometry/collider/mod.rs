//! Solids: shapes that a body carries, shapes fixed in the world, and nodes of ropes as balls; and the points where two of them may
//! touch.
//!
//! Contact is looked for in two stages. [`candidates`] lists, for one pair and one pose, which *features* (ends, edges, corners, faces,
//! rims) may meet in the coming step; [`contact_geometry`] is the gap between two features in closed form, generic over the scalar, so that all
//! its derivatives are automatic. Features stay what they are for the whole step.

mod candidates;
mod contact_geometry;
mod features;
mod overlap;
mod parts;
mod polyhedron;
mod rim_candidates;
mod rims;

pub use candidates::candidates;
pub(crate) use contact_geometry::point_over_face;
pub use contact_geometry::{ContactGeometry, contact_geometry};
pub(crate) use features::{BLOCK, SIDES, corner_sides, edge_sides};
pub use features::{Feature, FeaturePair};
pub(crate) use overlap::drop_hidden;
pub use overlap::overlap;
pub use polyhedron::Polyhedron;

use nalgebra::Matrix3;
use pliant_math::rotation::of_vector;
use pliant_math::spatial::hat;
use pliant_math::{Real, Vec3};
use std::sync::Arc;

/// Shapes in their own frame.
#[derive(Clone, Debug, PartialEq)]
pub enum ColliderShape {
    /// Everything below z = 0. No sizes.
    HalfSpace,
    /// Size: radius.
    Ball,
    /// Points within the radius of a segment of the z axis. Sizes: radius, half the segment's length.
    Capsule,
    /// Round about the z axis with flat ends. Sizes: radius, half the length.
    Cylinder,
    /// Sizes: half the edges along x, y and z.
    Block,
    /// A convex polyhedron, with its origin anywhere. No sizes.
    Hull(Arc<Polyhedron>),
}

impl ColliderShape {
    /// Numbers of its size.
    pub fn n_sizes(&self) -> usize {
        match self {
            Self::HalfSpace | Self::Hull(_) => 0,
            Self::Ball => 1,
            Self::Capsule | Self::Cylinder => 2,
            Self::Block => 3,
        }
    }
}

/// The frame that a collider moves with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Attachment {
    /// Nothing: it is fixed in the world.
    World,
    /// A body.
    Body(usize),
    /// A node of a rope: a ball that does not turn.
    Node(usize),
}

/// Where a solid is with respect to its carrier, as far as θ says it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// At the carrier's origin.
    Origin,
    /// Its own origin at the three entries of θ from here on \[m\].
    At(usize),
    /// Moved along its z axis by this entry of θ \[m\] from a constant point.
    Height(usize),
    /// A capsule between two points, three entries of θ each \[m\].
    Between([usize; 3], [usize; 3]),
}

/// A shape with a carrier.
#[derive(Clone, Debug, PartialEq)]
pub struct Collider {
    /// Name in the scene.
    pub name: String,
    /// Shape.
    pub form: ColliderShape,
    /// The frame it moves with.
    pub attachment: Attachment,
    /// Axes in the carrier's, where the rotation vector is zero.
    pub rotation: Matrix3<f64>,
    /// First of three entries of θ: the rotation vector that turns them, in the carrier's axes \[rad\]. A ball has none.
    pub turn: Option<usize>,
    /// The constant point of [`Place::Height`].
    pub point: Vec3<f64>,
    /// Where it is.
    pub place: Place,
    /// Indices of its sizes in θ \[m\], as many as its form has.
    pub sizes: [usize; 3],
    /// Index of its coefficient of friction [-]; a solid without one takes its partner's.
    pub friction: Option<usize>,
}

/// Pose of a carrier, seen from the origin of an evaluation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose<S> {
    /// Axes, as columns in the world's.
    pub rotation: Matrix3<S>,
    /// Origin \[m\].
    pub position: Vec3<S>,
}

impl Pose<f64> {
    /// The same pose as a function of a displacement of its carrier: `seeds` turns entry k (angular first) into a scalar.
    pub fn displaced<S: Real>(&self, displacement: &[S; 6]) -> Pose<S> {
        let w = Vec3::new(displacement[0], displacement[1], displacement[2]);
        let v = Vec3::new(displacement[3], displacement[4], displacement[5]);
        let (r, p) = (self.rotation.map(S::from), self.position.map(S::from));
        let turned = Matrix3::from_columns(&[0, 1, 2].map(|k| w.cross(&r.column(k).into_owned())));
        Pose { rotation: r + turned, position: p + v + w.cross(&p) }
    }
}

/// A solid in the world: its axes, its origin and its sizes.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedCollider<S> {
    /// Shape.
    pub form: ColliderShape,
    /// Axes, as columns in the world's. Of a capsule between two points only the third means anything.
    pub rotation: Matrix3<S>,
    /// Origin \[m\], seen from the origin of the evaluation.
    pub position: Vec3<S>,
    /// Sizes \[m\].
    pub sizes: [S; 3],
}

impl Collider {
    /// Where it stands, for its carrier at `pose` and entries of θ as `theta` has them.
    pub fn placed<S: Real>(&self, pose: &Pose<S>, theta: impl Fn(usize) -> S) -> PlacedCollider<S> {
        let n = self.form.n_sizes();
        let mut sizes = std::array::from_fn(|k| if k < n { theta(self.sizes[k]) } else { S::from(0.0) });
        let vector = |k: usize| Vec3::new(theta(k), theta(k + 1), theta(k + 2));
        let axes = || {
            let as_built = self.rotation.map(S::from);
            self.turn.map_or(as_built, |k| of_vector(&vector(k)) * as_built)
        };
        let (rotation, local) = match self.place {
            Place::Origin => (pose.rotation * axes(), Vec3::repeat(S::from(0.0))),
            Place::At(first) => (pose.rotation * axes(), vector(first)),
            Place::Height(k) => {
                let axes = axes();
                let along = axes.column(2) * theta(k);
                (pose.rotation * axes, self.point.map(S::from) + along)
            }
            Place::Between(a, b) => {
                let [a, b] = [a, b].map(|p| Vec3::new(theta(p[0]), theta(p[1]), theta(p[2])));
                let axis = b - a;
                let length = axis.dot(&axis).sqrt();
                sizes[1] = length * 0.5;
                let zero = Vec3::repeat(S::from(0.0));
                let z = axis * length.recip();
                (pose.rotation * Matrix3::from_columns(&[zero, zero, z]), (a + b) * S::from(0.5))
            }
        };
        PlacedCollider { form: self.form.clone(), rotation, position: pose.position + pose.rotation * local, sizes }
    }

    /// Entries of θ that its place and size depend on.
    pub fn params(&self) -> impl Iterator<Item = usize> + '_ {
        let place: Vec<usize> = match self.place {
            Place::Origin => vec![],
            Place::At(first) => (first..first + 3).collect(),
            Place::Height(k) => vec![k],
            Place::Between(a, b) => a.into_iter().chain(b).collect(),
        };
        let sizes = match self.place {
            Place::Between(..) => 1,
            _ => self.form.n_sizes(),
        };
        let turn = self.turn.into_iter().flat_map(|first| first..first + 3);
        place.into_iter().chain(turn).chain(self.sizes[..sizes].iter().copied())
    }
}

impl PlacedCollider<f64> {
    /// Radius of a ball about its origin that holds it \[m\]; infinite for a half space.
    pub fn reach(&self) -> f64 {
        let [a, b, c] = self.sizes;
        match &self.form {
            ColliderShape::HalfSpace => f64::INFINITY,
            ColliderShape::Hull(p) => p.reach,
            ColliderShape::Ball => a,
            ColliderShape::Capsule => a + b,
            ColliderShape::Cylinder => a.hypot(b),
            ColliderShape::Block => (a * a + b * b + c * c).sqrt(),
        }
    }
}

/// The matrix of the change of a vector carried along by a displacement: `ω ↦ ω × x`, and of a point: also `v ↦ v`.
pub(crate) fn carried(x: &Vec3<f64>, point: bool) -> nalgebra::Matrix3x6<f64> {
    let mut m = nalgebra::Matrix3x6::zeros();
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(&-hat(x));
    if point {
        m.fixed_view_mut::<3, 3>(0, 3).fill_with_identity();
    }
    m
}
