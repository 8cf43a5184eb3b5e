//! Bodies and the joints that carry them: a forest, numbered so that a parent comes before its children.

use nalgebra::Matrix3;
use pliant_math::Vec3;
use pliant_math::inertia::BodyInertia;
use pliant_math::rotation::{Map, Quaternion, normalized, product};
use std::ops::Range;

/// Kind of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Turn about the axis through the anchor; q \[rad\], v [rad/s].
    Revolute,
    /// Slide along the axis; q \[m\], v [m/s].
    Prismatic,
    /// Turn about the anchor any way; q a unit quaternion (w, x, y, z), v the angular velocity in the body's axes [rad/s].
    Ball,
}

impl JointKind {
    /// Coordinates in q.
    pub fn n_coordinates(self) -> usize {
        if self == Self::Ball { 4 } else { 1 }
    }

    /// Degrees of freedom, entries of v.
    pub fn n_dofs(self) -> usize {
        if self == Self::Ball { 3 } else { 1 }
    }
}

/// A joint. Several in one body act one after the other; a free body has three prismatic ones and a ball.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name in the scene.
    pub name: String,
    /// Its kind.
    pub kind: JointKind,
    /// The body it moves.
    pub body: usize,
    /// Unit axis in the body's axes; of no meaning for a ball.
    pub axis: Vec3<f64>,
    /// The fixed point in the body's frame \[m\].
    pub anchor: Vec3<f64>,
    /// First coordinate in q, counted from the first of the bodies'.
    pub q: usize,
    /// First degree of freedom in v, counted likewise.
    pub v: usize,
    /// Index in θ of the armature, a rotor's inertia seen at the joint [kg·m²] or \[kg\].
    pub armature: usize,
}

/// A rigid body.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Name in the scene.
    pub name: String,
    /// The body it hangs on; the world if none.
    pub parent: Option<usize>,
    /// Origin in the parent's frame with all joints at zero \[m\].
    pub position: Vec3<f64>,
    /// Axes in the parent's frame with all joints at zero.
    pub rotation: Matrix3<f64>,
    /// Whether `rotation` is the identity; filled in by [`Tree::push`].
    pub aligned: bool,
    /// Its joints; filled in by [`Tree::push`].
    pub joints: Range<usize>,
    /// Its mass; none if it has no mass.
    pub inertia: Option<BodyInertia>,
}

/// One degree of freedom's place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dof {
    /// The body it moves.
    pub body: usize,
    /// Its joint.
    pub joint: usize,
    /// The degree of freedom before it on the way to the root.
    pub parent: Option<usize>,
    /// The last degree of freedom before its joint on the way to the root.
    pub before_joint: Option<usize>,
}

/// The forest of all bodies of a model.
#[derive(Clone, Debug, Default)]
pub struct Tree {
    bodies: Vec<Body>,
    joints: Vec<Joint>,
    dofs: Vec<Dof>,
    /// Last degree of freedom that moves each body.
    last_dof: Vec<Option<usize>>,
    /// First of the neighbouring numbers that each degree of freedom's way to the root begins with.
    run_start: Vec<usize>,
    nq: usize,
}

impl Tree {
    /// Appends a body; its parent must have been appended before. The joints' `body`, `q` and `v` are filled in.
    pub fn push(&mut self, body: Body, joints: Vec<Joint>) -> usize {
        let index = self.bodies.len();
        let mut last = body.parent.and_then(|p| self.last_dof[p]);
        let first = self.joints.len();
        for mut joint in joints {
            (joint.body, joint.q, joint.v) = (index, self.nq, self.dofs.len());
            self.nq += joint.kind.n_coordinates();
            let before_joint = last;
            for _ in 0..joint.kind.n_dofs() {
                let dof = self.dofs.len();
                self.run_start.push(last.filter(|l| l + 1 == dof).map_or(dof, |l| self.run_start[l]));
                self.dofs.push(Dof { body: index, joint: self.joints.len(), parent: last, before_joint });
                last = Some(dof);
            }
            self.joints.push(joint);
        }
        self.last_dof.push(last);
        let aligned = body.rotation == Matrix3::identity();
        self.bodies.push(Body { joints: first..self.joints.len(), aligned, ..body });
        index
    }

    /// The bodies.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// The joints.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// The degrees of freedom.
    pub fn dofs(&self) -> &[Dof] {
        &self.dofs
    }

    /// Number of coordinates.
    pub fn nq(&self) -> usize {
        self.nq
    }

    /// Number of degrees of freedom.
    pub fn nv(&self) -> usize {
        self.dofs.len()
    }

    /// The last degree of freedom that moves a body.
    pub fn last_dof(&self, body: usize) -> Option<usize> {
        self.last_dof[body]
    }

    /// The degrees of freedom from `last` to the root.
    pub fn chain(&self, last: Option<usize>) -> impl Iterator<Item = usize> + '_ {
        std::iter::successors(last, |&l| self.dofs[l].parent)
    }

    /// As [`Tree::chain`], in runs of neighbouring numbers.
    pub fn runs(&self, last: Option<usize>) -> impl Iterator<Item = Range<usize>> + '_ {
        let run = |last: usize| self.run_start[last]..last + 1;
        std::iter::successors(last.map(run), move |r| self.dofs[r.start].parent.map(run))
    }

    /// The body of that name.
    pub fn body(&self, name: &str) -> Option<usize> {
        self.bodies.iter().position(|b| b.name == name)
    }

    /// The joint of that name.
    pub fn joint(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|j| j.name == name)
    }

    /// Whether there is a ball joint, so that coordinates and degrees of freedom differ.
    pub fn has_balls(&self) -> bool {
        self.nq != self.nv()
    }

    /// A point near the bodies \[m\]: where the first root's sliding joints have taken it. Momenta are taken about it, for precision.
    pub fn origin(&self, q: &[f64]) -> Vec3<f64> {
        let Some(body) = self.bodies.first() else { return Vec3::zeros() };
        let slides = self.joints[body.joints.clone()].iter().take_while(|j| j.kind == JointKind::Prismatic);
        slides.fold(body.position, |p, j| p + body.rotation * j.axis * q[j.q])
    }

    /// Coordinates with every joint at zero.
    pub fn neutral(&self) -> Vec<f64> {
        let mut q = vec![0.0; self.nq];
        self.joints.iter().filter(|j| j.kind == JointKind::Ball).for_each(|j| q[j.q] = 1.0);
        q
    }

    /// `to = from ⊕ t` for a tangent `t` \[rad or m\].
    pub fn add(&self, map: Map, from: &[f64], t: &[f64], to: &mut [f64]) {
        for joint in &self.joints {
            match joint.kind {
                JointKind::Ball => {
                    let turned =
                        product(&quaternion(from, joint.q), &map.turn(&Vec3::new(t[joint.v], t[joint.v + 1], t[joint.v + 2])));
                    to[joint.q..joint.q + 4].copy_from_slice(&normalized(&turned));
                }
                _ => to[joint.q] = from[joint.q] + t[joint.v],
            }
        }
    }

    /// `b ⊖ a`: the tangent t with `a ⊕ t = b` under the exponential map, each turn at most π.
    pub fn subtract(&self, b: &[f64], a: &[f64], t: &mut [f64]) {
        for joint in &self.joints {
            match joint.kind {
                JointKind::Ball => {
                    let inverse = pliant_math::rotation::conjugate(&quaternion(a, joint.q));
                    let turn = pliant_math::rotation::logarithm(&product(&inverse, &quaternion(b, joint.q)));
                    t[joint.v..joint.v + 3].copy_from_slice(turn.as_slice());
                }
                _ => t[joint.v] = b[joint.q] - a[joint.q],
            }
        }
    }
}

/// The quaternion that starts at `first`.
pub fn quaternion<S: Copy>(q: &[S], first: usize) -> Quaternion<S> {
    [q[first], q[first + 1], q[first + 2], q[first + 3]]
}
