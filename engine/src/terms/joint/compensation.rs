//! Torques that hold an arm up.

use super::{JointPoint, JointTerm};
use crate::bodies::dynamics::{Displacement, Partials, inverse_dynamics};
use crate::bodies::{Frames, Tree};
use nalgebra::Matrix3;
use pliant_math::spatial::Inertia;
use pliant_math::{Input, Vec3};

/// Motors that carry the weight of all bodies beyond their joints: f_l = g_l ID_l(q̄, 0, 0) [N·m or N], with the gain g_l of the joint
/// in θ and inverse dynamics at the inertias and gravity *of the scene*: a controller knows the arm it was told of, so a fit that moves
/// a mass does not move what the controller holds. At gain 1 and the scene's parameters an arm at rest stays there.
///
/// It is a force of the joint, evaluated where all forces are: no delay, lag or saturation of a motor acts on it.
#[derive(Clone, Debug)]
pub struct GravityCompensation {
    /// Degree of freedom and index in θ of its gain.
    pub gains: Vec<(usize, usize)>,
    /// Inertias of all bodies in the scene.
    pub inertias: Vec<Inertia<f64>>,
    /// Its gravity [m/s²].
    pub gravity: Vec3<f64>,
}

impl GravityCompensation {
    fn frames(&self, tree: &Tree, q: &[f64]) -> Frames<f64> {
        let zero = vec![0.0; tree.nv()];
        let mut frames = Frames::about(tree.origin(q));
        frames.evaluate(tree, q, &zero, &zero, &self.gravity);
        frames
    }

    fn weights(&self, at: &JointPoint) -> Vec<f64> {
        let mut tau = vec![0.0; at.tree.nv()];
        inverse_dynamics(at.tree, &self.frames(at.tree, at.q), &self.inertias, &[], &mut Vec::new(), &mut tau);
        tau
    }
}

impl JointTerm for GravityCompensation {
    fn name(&self) -> &str {
        "gravity compensation"
    }

    fn add_force(&self, at: &JointPoint, f: &mut [f64]) {
        let tau = self.weights(at);
        self.gains.iter().for_each(|&(dof, gain)| f[dof] += at.theta[gain] * tau[dof]);
    }

    fn add_change(&self, at: &JointPoint, by: Displacement, turns: &[Option<Matrix3<f64>>], out: &mut [f64], stride: usize) {
        let (n, frames, mut partials) = (at.tree.nv(), self.frames(at.tree, at.q), Partials::default());
        partials.gather(at.tree, &frames, &self.inertias, &[], &[]);
        let mut change = vec![0.0; n * n];
        partials.add(at.tree, &frames, Displacement { cm: 0.0, cv: 0.0, cq: by.cq }, turns, &mut change, n);
        for &(dof, gain) in &self.gains {
            let row = &mut out[dof * stride..dof * stride + n];
            row.iter_mut().zip(&change[dof * n..]).for_each(|(o, d)| *o += at.theta[gain] * d);
        }
    }

    fn is_prescribed(&self) -> bool {
        false
    }

    fn visit_inputs(&self, at: &JointPoint, all: bool, visit: &mut dyn FnMut(usize, Input, f64)) {
        if !all {
            return;
        }
        let tau = self.weights(at);
        self.gains.iter().for_each(|&(dof, gain)| visit(dof, Input::Theta(gain), tau[dof]));
    }
}
