//! Derivatives of the bodies' rows by inputs: entry by entry, and contracted with a multiplier.
//!
//! Inertia and gravity reach every row at or before a body, so that their entries are as many as bodies times rows. A multiplier λ meets
//! them all in one twist a body,
//! ```text
//! η_b = Σ_{l at or before b} λ_l S_l,      λᵀ ∂τ/∂x = η_b · ∂F_b/∂x      for any parameter x of body b
//! ```

use super::StageRecord;
use crate::bodies::{Frame, Frames};
use crate::memory::Past;
use crate::model::Model;
use crate::model::from_nodes;
use crate::step::constraints::InputsAt;
use crate::terms::joint::JointPoint;
use nalgebra::Const;
use num_dual::DualSVec64;
use pliant_math::inertia::{BodyInertia, NUMBERS, number_partials};
use pliant_math::spatial::{Force, Inertia, Motion};
use pliant_math::{Input, Vec3};

impl StageRecord {
    /// ∂r/∂(θ, u, z) of the bodies' rows, and by coordinates at the beginning of the step.
    pub(super) fn visit_bodies(
        &self,
        model: &Model,
        theta: &[f64],
        q_bar: &[f64],
        v_bar: &[f64],
        visit: &mut dyn FnMut(usize, Input, f64),
    ) {
        let n = model.n_node_dofs();
        let Some(frames) = self.visit_beside_inertia(model, theta, [q_bar, v_bar], visit) else { return };
        visit_inertia(model, theta, &frames, &mut |dof, param, value| visit(n + dof, Input::Theta(param), value));
        for drag in &model.body_drags {
            let frame = &frames.bodies[drag.body];
            drag.visit_theta(theta, frame, &mut |param, change| {
                let chain = model.tree.chain(model.tree.last_dof(drag.body));
                chain.for_each(|l| visit(n + l, Input::Theta(param), -frames.axes[l].s.dot(&change)));
            });
        }
    }

    /// As [`StageRecord::visit_bodies`], each derivative times its row's `lambda`.
    pub(super) fn pull_bodies(
        &self,
        model: &Model,
        theta: &[f64],
        [q_bar, v_bar]: [&[f64]; 2],
        lambda: &[f64],
        pull: &mut dyn FnMut(Input, f64),
    ) {
        let n = model.n_node_dofs();
        let each = &mut |row: usize, input, value| pull(input, value * lambda[row]);
        let Some(frames) = self.visit_beside_inertia(model, theta, [q_bar, v_bar], each) else { return };
        pull_inertia(model, theta, &frames, &lambda[n..], &mut |param, value| pull(Input::Theta(param), value));
    }

    /// Frames where the stage begins, without accelerations, about the same origin as where it is evaluated.
    pub(super) fn frames_at_start(&self, model: &Model) -> Frames<f64> {
        let (n, tree) = (model.n_node_dofs(), &model.tree);
        let (q, v) = (&self.start.q_ref[n..], &self.start.v_ref[n..]);
        let mut frames = Frames::about(tree.origin(q));
        frames.evaluate_values(tree, q, v, &vec![0.0; tree.nv()], &Vec3::zeros());
        frames
    }

    /// All but inertia and gravity; gives the frames, if there are bodies.
    fn visit_beside_inertia(
        &self,
        model: &Model,
        theta: &[f64],
        [q_bar, v_bar]: [&[f64]; 2],
        visit: &mut dyn FnMut(usize, Input, f64),
    ) -> Option<Frames<f64>> {
        let (n, tree) = (model.n_node_dofs(), &model.tree);
        if tree.bodies().is_empty() && !self.has_listed_contacts() {
            return None;
        }
        let a: Vec<f64> = self.v[n..].iter().zip(&self.start.v_ref[n..]).map(|(v, old)| self.inertia * (v - old)).collect();
        let mut frames = Frames::about(tree.origin(&self.start.q_ref[n..]));
        frames.evaluate_values(tree, &q_bar[n..], &v_bar[n..], &a, &model.gravity_vector(theta));
        for (l, dof) in tree.dofs().iter().enumerate() {
            visit(n + l, Input::Theta(tree.joints()[dof.joint].armature), a[l]);
        }
        let at = InputsAt { stage: self, model, theta, q: q_bar };
        self.constraints.cones.iter().for_each(|cone| cone.visit_link_inputs(&at, &frames, visit));
        self.visit_joints(model, theta, [q_bar, v_bar], true, visit);
        Some(frames)
    }

    /// ∂r/∂(θ, u, z, q at the beginning) of the forces of joints; ∂θ only if `all`.
    pub(super) fn visit_joints(
        &self,
        model: &Model,
        theta: &[f64],
        [q_bar, v_bar]: [&[f64]; 2],
        all: bool,
        visit: &mut dyn FnMut(usize, Input, f64),
    ) {
        let n = model.n_node_dofs();
        let past = Past { q: &self.start.q_past, z: &self.start.z_past, elapsed: self.start.elapsed };
        let at = JointPoint { tree: &model.tree, q: &q_bar[n..], v: &v_bar[n..], u: &self.start.u, theta, past };
        for term in &model.joint_terms {
            if all || term.is_prescribed() {
                term.visit_inputs(&at, all, &mut |dof, input, df| visit(n + dof, input, -df));
            }
            term.visit_past(&at, &mut |dof, input, df| visit(n + dof, from_nodes(input, n), -df));
        }
    }
}

/// ∂τ/∂θ of inertia and gravity: (degree of freedom, parameter, value).
fn visit_inertia(model: &Model, theta: &[f64], frames: &Frames<f64>, visit: &mut dyn FnMut(usize, usize, f64)) {
    let tree = &model.tree;
    let gravity = gravity_partials(model, theta);
    for (b, (body, frame)) in tree.bodies().iter().zip(&frames.bodies).enumerate() {
        let Some(inertia) = body.inertia else { continue };
        let placed = inertia.evaluate(theta).placed(&frame.rotation, &frame.position);
        let by_number = inertia_force_partials(&inertia, theta, frame);
        // A holds −g
        let by_gravity = gravity.map(|g| placed.mul(&Motion { w: Vec3::zeros(), v: -g }));
        for l in tree.chain(tree.last_dof(b)) {
            let s = &frames.axes[l].s;
            by_number.iter().enumerate().for_each(|(k, f)| visit(l, inertia.first + k, s.dot(f)));
            by_gravity.iter().enumerate().for_each(|(k, f)| visit(l, model.gravity + k, s.dot(f)));
        }
    }
}

/// ∂g/∂(magnitude, tilts).
fn gravity_partials(model: &Model, theta: &[f64]) -> [Vec3<f64>; 3] {
    let x: [DualSVec64<3>; 3] = std::array::from_fn(|k| DualSVec64::from_re(theta[model.gravity + k]).derivative(k));
    let g = crate::terms::gravity_vector(x[0], [x[1], x[2]]);
    std::array::from_fn(|k| g.map(|g| g.eps.unwrap_generic(Const::<3>, Const::<1>)[k]))
}

/// ∂(I A + V ×* I V)/∂ of the body's ten numbers. The force is linear in mass, first and second moments: it is made in the body's
/// own axes and turned once per number.
fn inertia_force_partials(inertia: &BodyInertia, theta: &[f64], frame: &Frame<f64>) -> [Force<f64>; NUMBERS] {
    let x: [f64; NUMBERS] = std::array::from_fn(|k| theta[inertia.first + k]);
    let own = |m: &Motion<f64>| Motion { w: frame.rotation.tr_mul(&m.w), v: frame.rotation.tr_mul(&m.at(&frame.position)) };
    let (velocity, acceleration) = (own(&frame.velocity), own(&frame.acceleration));
    number_partials(&x).map(|change| {
        let force = change.mul(&acceleration) + velocity.cross_force(&change.mul(&velocity));
        let f = frame.rotation * force.f;
        Force { n: frame.rotation * force.n + frame.position.cross(&f), f }
    })
}

/// [`visit_inertia`] contracted with the multiplier `lambda` of the degrees of freedom.
fn pull_inertia(model: &Model, theta: &[f64], frames: &Frames<f64>, lambda: &[f64], pull: &mut dyn FnMut(usize, f64)) {
    let tree = &model.tree;
    let mut twists: Vec<Motion<f64>> = Vec::with_capacity(tree.bodies().len());
    // Σ m η at the bodies' centres of mass: what a free fall is multiplied by
    let mut falling = Vec3::zeros();
    for (body, frame) in tree.bodies().iter().zip(&frames.bodies) {
        let mut eta = body.parent.map_or(Motion::zero(), |p| twists[p]);
        for joint in &tree.joints()[body.joints.clone()] {
            (joint.v..joint.v + joint.kind.n_dofs()).for_each(|l| eta += frames.axes[l].s * lambda[l]);
        }
        twists.push(eta);
        let Some(inertia) = body.inertia else { continue };
        let slope = force_slope(frame, &eta);
        let x: [f64; NUMBERS] = std::array::from_fn(|k| theta[inertia.first + k]);
        for (k, change) in number_partials(&x).iter().enumerate() {
            pull(inertia.first + k, slope.of(change));
        }
        let own = inertia.evaluate(theta);
        falling += eta.at(&frame.position) * own.m + eta.w.cross(&(frame.rotation * own.h));
    }
    for drag in &model.body_drags {
        let (frame, eta) = (&frames.bodies[drag.body], &twists[drag.body]);
        drag.visit_theta(theta, frame, &mut |param, change| pull(param, -eta.dot(&change)));
    }
    gravity_partials(model, theta).iter().enumerate().for_each(|(k, g)| pull(model.gravity + k, -falling.dot(g)));
}

/// The change of η · (I A + V ×* I V) with an inertia about its body's origin, whose numbers it is linear in.
struct ForceSlope {
    mass: f64,
    first: Vec3<f64>,
    /// By J (xx, yy, zz, xy, xz, yz).
    second: [f64; 6],
}

impl ForceSlope {
    fn of(&self, change: &Inertia<f64>) -> f64 {
        let second: f64 = self.second.iter().zip(&change.j).map(|(a, b)| a * b).sum();
        self.mass * change.m + self.first.dot(&change.h) + second
    }
}

/// In the body's axes about its origin, with η = (w, u), the origin's acceleration a, α and ω:
/// ```text
/// η · F = u · (m a + α × h + ω × (ω × h)) + w · (J α + ω × J ω + h × a)
/// ```
fn force_slope(frame: &Frame<f64>, eta: &Motion<f64>) -> ForceSlope {
    let own = |x: &Vec3<f64>| frame.rotation.tr_mul(x);
    let (velocity, acceleration, p) = (&frame.velocity, &frame.acceleration, &frame.position);
    let a = own(&(acceleration.at(p) + velocity.w.cross(&velocity.at(p))));
    let (omega, alpha, w, u) = (own(&velocity.w), own(&acceleration.w), own(&eta.w), own(&eta.at(p)));
    let turned = w.cross(&omega);
    let both = |r: usize, c: usize| w[r] * alpha[c] + turned[r] * omega[c];
    ForceSlope {
        mass: u.dot(&a),
        first: u.cross(&alpha) + omega.cross(&omega.cross(&u)) + a.cross(&w),
        second: [both(0, 0), both(1, 1), both(2, 2), both(0, 1) + both(1, 0), both(0, 2) + both(2, 0), both(1, 2) + both(2, 1)],
    }
}
