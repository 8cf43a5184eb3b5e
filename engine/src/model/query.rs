//! Poses, mass matrix and bias forces of the bodies: what a step is made of, for controllers, planners and comparisons.
//!
//! Coordinates q (nq) and velocities v (nv) are those of a whole state: nodes first, then joint by joint in the bodies' order. A
//! revolute or prismatic joint has one number each [rad, rad/s or m, m/s]; a ball a unit quaternion (w, x, y, z) and its angular
//! velocity in the body's axes; a free body its origin in the world \[m\] and a quaternion, the velocity of its origin in the
//! world's axes and its angular velocity in its own.

use super::Model;
use crate::bodies::Frames;
use crate::bodies::drag::BodyDrag;
use crate::bodies::dynamics::{Partials, inverse_dynamics};
use pliant_math::Vec3;
use pliant_math::rotation::{Quaternion, from_matrix};

impl Model {
    /// The same model, its steps solved at least to this relative precision [-] (a scene's `solver.tolerance`).
    pub fn solved_to(mut self, tolerance: f64) -> Self {
        self.solver.tolerance = self.solver.tolerance.min(tolerance);
        self
    }

    /// Whether contact depends on the squares of friction coefficients alone: under the convex relaxation.
    pub fn friction_is_even(&self) -> bool {
        self.contact.law == pliant_scene::Law::Anitescu
    }

    /// Origin \[m\] and axes, a unit quaternion (w ≥ 0), of every body's frame in the world.
    ///
    /// # Panics
    /// If `q` has not nq entries.
    pub fn body_poses(&self, q: &[f64]) -> Vec<(Vec3<f64>, Quaternion<f64>)> {
        let zero = vec![0.0; self.tree.nv()];
        let frames = self.body_frames(q, &zero, &Vec3::zeros());
        frames.bodies.iter().map(|b| (b.position + frames.origin, from_matrix(&b.rotation))).collect()
    }

    /// M(q; θ) of the bodies' degrees of freedom, armatures included, row-major and square [kg·m², kg·m or kg]:
    /// ```text
    /// kinetic energy = ½ vᵀ M v,    M a + bias = joint forces
    /// ```
    ///
    /// # Panics
    /// If `q` has not nq entries or `theta` not n_params.
    pub fn mass_matrix(&self, q: &[f64], theta: &[f64]) -> Vec<f64> {
        let (tree, n) = (&self.tree, self.tree.nv());
        let frames = self.body_frames(q, &vec![0.0; n], &Vec3::zeros());
        let mut partials = Partials::default();
        partials.gather(tree, &frames, &self.inertias(theta), &[], &[]);
        let mut m = vec![0.0; n * n];
        partials.add_mass(tree, &frames, &mut m, n);
        for (l, dof) in tree.dofs().iter().enumerate() {
            m[l * n + l] += theta[tree.joints()[dof.joint].armature];
        }
        m
    }

    /// Forces of the bodies' degrees of freedom that let them move without acceleration, Coriolis forces less weight [N·m or N]:
    /// inverse dynamics at a = 0. Springs, friction, motors and the air's drag are not among them.
    ///
    /// # Panics
    /// If `q`, `v` or `theta` have not nq, nv and n_params entries.
    pub fn bias_forces(&self, q: &[f64], v: &[f64], theta: &[f64]) -> Vec<f64> {
        let frames = self.body_frames(q, &v[self.n_node_dofs()..], &self.gravity_vector(theta));
        let mut tau = vec![0.0; self.tree.nv()];
        inverse_dynamics(&self.tree, &frames, &self.inertias(theta), &[], &mut Vec::new(), &mut tau);
        tau
    }

    /// What the air does to every body with mass.
    pub fn body_drags(&self) -> impl Iterator<Item = &BodyDrag> {
        self.body_drags.iter()
    }

    /// Owner of a row of the velocities, for messages: "node 3, axis x", or a joint by its name.
    pub fn row_name(&self, row: usize) -> String {
        match row.checked_sub(self.n_node_dofs()).and_then(|l| Some((l, self.tree.dofs().get(l)?))) {
            None if row >= 3 * self.n_nodes() && row < self.n_node_dofs() => self.twist_name(row - 3 * self.n_nodes()),
            None => format!("node {}, axis {}", row / 3, ["x", "y", "z"][row % 3]),
            Some((l, dof)) => {
                let joint = &self.tree.joints()[dof.joint];
                match joint.kind.n_dofs() {
                    1 => format!("joint `{}`", joint.name),
                    _ => format!("joint `{}`, axis {}", joint.name, ["x", "y", "z"][l - joint.v]),
                }
            }
        }
    }

    /// Owner of a coordinate.
    pub(crate) fn coordinate_name(&self, k: usize) -> String {
        let own = |l: usize| self.tree.joints().iter().find(|j| (j.q..j.q + j.kind.n_coordinates()).contains(&l));
        match k.checked_sub(self.n_node_dofs()).and_then(own) {
            Some(joint) => format!("joint `{}`", joint.name),
            None => self.row_name(k),
        }
    }

    /// Frames at q and the bodies' velocities v, without acceleration.
    fn body_frames(&self, q: &[f64], v: &[f64], gravity: &Vec3<f64>) -> Frames<f64> {
        let q = &q[self.n_node_dofs()..];
        let mut frames = Frames::about(self.tree.origin(q));
        frames.evaluate(&self.tree, q, v, &vec![0.0; self.tree.nv()], gravity);
        frames
    }
}
