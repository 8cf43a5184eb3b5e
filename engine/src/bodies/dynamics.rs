//! Inverse dynamics, τ(q, v, a; θ) [N·m or N], and how it changes: recursive Newton–Euler and its partial derivatives.
//!
//! ```text
//! F_b = I_b A_b + V_b ×* (I_b V_b) − W_b        body b, A including −g, W_b what acts on it from outside
//! τ_l = S_l · Σ_{b beyond l} F_b + armature_l a_l
//! ```
//! With composites over all bodies beyond body b, I = Σ I_k, B = Σ B_k ([`VelocityPartial`]), C = Σ C_k, F = Σ F_k, and a
//! displacement δq̄ = J δ, δv̄ = cv δ, δā = cm δ of every degree of freedom l, the change of τ_i is
//! ```text
//! l at or before i:   S_i · (I α_l + B β_l + C γ_l)               composites at the body of i
//! l beyond i:         S_i · (I α_l + B β_l + C γ_l + γ_l ×* F)    composites at the body of l
//! α = cm S + cv (Ψ̇ + Ṡ) + cq Ψ̈ J,   β = cv S + cq Ψ̇ J,   γ = cq S J
//! ```
//! Reference: S. Singh, R. Russell, P. Wensing (2022), IEEE RA-L 7(2), for the form of Ψ̇ and Ψ̈; C holds what a wrench from
//! outside does when its body is displaced.

use super::assemble::Spread;
use super::frames::{Frame, Frames};
use super::tree::Tree;
use nalgebra::{Matrix3, Matrix6, Vector6};
use pliant_math::spatial::{Force, Inertia, Motion, VelocityPartial, column, product, symmetric_mul};
use pliant_math::{Real, Vec3};

/// Generalized forces of inertia and gravity at `frames`, for inertias `inertia` about each body's own origin; `wrenches` act on
/// the bodies from outside (none: empty). Overwrites `tau`; armature is not included.
pub fn inverse_dynamics<S: Real>(
    tree: &Tree,
    frames: &Frames<S>,
    inertia: &[Inertia<S>],
    wrenches: &[Force<S>],
    forces: &mut Vec<Force<S>>,
    tau: &mut [S],
) {
    forces.clear();
    for (b, frame) in frames.bodies.iter().enumerate() {
        let inertial = inertial_force(&inertia[b], frame);
        forces.push(wrenches.get(b).map_or(inertial, |w| inertial - *w));
    }
    for (b, body) in tree.bodies().iter().enumerate().rev() {
        if let Some(parent) = body.parent {
            let force = forces[b];
            forces[parent] += force;
        }
    }
    for (l, dof) in tree.dofs().iter().enumerate() {
        tau[l] = frames.axes[l].s.dot(&forces[dof.body]);
    }
}

/// I A + V ×* I V of a body, about the origin of the evaluation. In the body's axes about its own origin, where the inertia is constant,
/// with the origin's acceleration a:
/// ```text
/// f = m a + α × h + ω × (ω × h),   n = J α + ω × J ω + h × a
/// ```
fn inertial_force<S: Real>(inertia: &Inertia<S>, frame: &Frame<S>) -> Force<S> {
    let own = |x: &Vec3<S>| {
        Vec3::new(frame.rotation.column(0).dot(x), frame.rotation.column(1).dot(x), frame.rotation.column(2).dot(x))
    };
    let (velocity, acceleration, p) = (&frame.velocity, &frame.acceleration, &frame.position);
    let a = own(&(acceleration.at(p) + velocity.w.cross(&velocity.at(p))));
    let (w, alpha, h) = (own(&velocity.w), own(&acceleration.w), &inertia.h);
    let f = a * inertia.m + alpha.cross(h) + w.cross(&w.cross(h));
    let n = symmetric_mul(&inertia.j, &alpha) + w.cross(&symmetric_mul(&inertia.j, &w)) + h.cross(&a);
    let f = frame.rotation * f;
    Force { n: frame.rotation * n + p.cross(&f), f }
}

/// Weights of the displacement that a matrix is wanted for: δā = cm δ, δv̄ = cv δ, δq̄ = cq J δ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Displacement {
    /// Of accelerations.
    pub cm: f64,
    /// Of velocities.
    pub cv: f64,
    /// Of positions.
    pub cq: f64,
}

/// Composites over subtrees: see [`Partials::gather`].
#[derive(Clone, Debug, Default)]
pub struct Partials {
    pub(super) inertia: Vec<Inertia<f64>>,
    pub(super) forces: Vec<Force<f64>>,
    pub(super) b: Vec<VelocityPartial>,
    /// Of the wrenches from outside: with displacement (C), and with velocity.
    pub(super) outside: Vec<[Matrix6<f64>; 2]>,
    pub(super) columns: Vec<Columns>,
    pub(super) spread: Spread,
}

/// Contribution of a degree of freedom to the products above.
#[derive(Clone, Copy, Debug)]
pub(super) struct Columns {
    pub alpha: Vector6<f64>,
    pub beta: Vector6<f64>,
    pub gamma: Vector6<f64>,
}

/// How the wrench on a body changes: with its displacement (twist of the body) and with its velocity.
#[derive(Clone, Copy, Debug)]
pub struct WrenchPartial {
    /// The body.
    pub body: usize,
    /// ∂W/∂ξ for a displacement ξ of the body, at fixed velocity.
    pub displaced: Matrix6<f64>,
    /// ∂W/∂V.
    pub moving: Matrix6<f64>,
}

impl Partials {
    /// Composites at `frames`. `wrenches` as in [`inverse_dynamics`], `changes` how they depend on their own bodies.
    pub fn gather(
        &mut self,
        tree: &Tree,
        frames: &Frames<f64>,
        inertia: &[Inertia<f64>],
        wrenches: &[Force<f64>],
        changes: &[WrenchPartial],
    ) {
        self.b.clear();
        self.inertia.clear();
        self.forces.clear();
        for (b, frame) in frames.bodies.iter().enumerate() {
            let inertia = inertia[b].placed(&frame.rotation, &frame.position);
            let inertial = inertia.mul(&frame.acceleration) + frame.velocity.cross_force(&inertia.mul(&frame.velocity));
            self.forces.push(wrenches.get(b).map_or(inertial, |w| inertial - *w));
            self.b.push(VelocityPartial::new(&inertia, &frame.velocity));
            self.inertia.push(inertia);
        }
        self.gather_outside(frames, wrenches, changes);
        for (b, body) in tree.bodies().iter().enumerate().rev() {
            if let Some(p) = body.parent {
                let (inertia, force, velocity) = (self.inertia[b], self.forces[b], self.b[b]);
                self.inertia[p] += inertia;
                self.forces[p] += force;
                self.b[p] += velocity;
                if !self.outside.is_empty() {
                    let [c, d] = self.outside[b];
                    self.outside[p][0] += c;
                    self.outside[p][1] += d;
                }
            }
        }
    }

    fn gather_outside(&mut self, frames: &Frames<f64>, wrenches: &[Force<f64>], changes: &[WrenchPartial]) {
        self.outside.clear();
        if wrenches.is_empty() {
            return;
        }
        self.outside.extend(wrenches.iter().map(|w| [force_cross_matrix(w), Matrix6::zeros()]));
        for change in changes {
            // in the body's own axes: δ'W = ∂W/∂ξ ξ + ∂W/∂V (δ'V + ξ × V) − ξ ×* W
            let velocity = &frames.bodies[change.body].velocity;
            self.outside[change.body][0] -= change.displaced + product(&change.moving, &cross_matrix(velocity));
            self.outside[change.body][1] -= change.moving;
        }
    }

    /// τ at what was gathered, without armature.
    pub fn tau(&self, tree: &Tree, frames: &Frames<f64>, tau: &mut [f64]) {
        for (l, dof) in tree.dofs().iter().enumerate() {
            tau[l] = frames.axes[l].s.dot(&self.forces[dof.body]);
        }
    }

    /// Displacement and change of velocity (world axes) of the bodies that degree of freedom `l` moves, one of which has `velocity`,
    /// for the last displacement that was added.
    pub fn change(&self, l: usize, velocity: &Motion<f64>) -> (Vector6<f64>, Vector6<f64>) {
        let own = &self.columns[l];
        (own.gamma, own.beta + moved_along(&own.gamma, velocity))
    }

    /// Displacement of every body, and change of its velocity seen from its own axes, for the changes `d` of all degrees of freedom,
    /// by the columns of the last displacement that was added.
    pub fn carry(&self, tree: &Tree, d: &[f64]) -> Vec<(Vector6<f64>, Vector6<f64>)> {
        let mut out: Vec<(Vector6<f64>, Vector6<f64>)> = Vec::with_capacity(tree.bodies().len());
        for body in tree.bodies() {
            let (mut gamma, mut beta) = body.parent.map_or((Vector6::zeros(), Vector6::zeros()), |p| out[p]);
            for joint in &tree.joints()[body.joints.clone()] {
                let dofs = joint.v..joint.v + joint.kind.n_dofs();
                for (columns, d) in self.columns[dofs.clone()].iter().zip(&d[dofs]) {
                    gamma += columns.gamma * *d;
                    beta += columns.beta * *d;
                }
            }
            out.push((gamma, beta));
        }
        out
    }

    /// The columns of the displacement `by` alone, for [`Partials::change`].
    pub fn fill_columns(&mut self, tree: &Tree, frames: &Frames<f64>, by: Displacement, turns: &[Option<Matrix3<f64>>]) {
        self.columns.clear();
        for axis in &frames.axes {
            let [s, psi_dot, psi_ddot] = [axis.s, axis.psi_dot, axis.psi_ddot].map(|m| column(&m));
            self.columns.push(Columns { alpha: psi_ddot * by.cq, beta: psi_dot * by.cq, gamma: s * by.cq });
        }
        for (joint, turn) in tree.joints().iter().zip(turns) {
            if let Some(j) = turn {
                turn_columns(&mut self.columns[joint.v..joint.v + 3], j);
            }
        }
        for (columns, axis) in self.columns.iter_mut().zip(&frames.axes) {
            let s = column(&axis.s);
            columns.alpha += s * by.cm + (column(&axis.psi_dot) + column(&axis.s_dot)) * by.cv;
            columns.beta += s * by.cv;
        }
    }
}

/// ξ × V: what a displacement makes of a velocity that is carried along.
pub fn moved_along(xi: &Vector6<f64>, velocity: &Motion<f64>) -> Vector6<f64> {
    column(&as_motion(xi).cross(velocity))
}

/// Column k becomes Σ_a (column a) J_ak.
fn turn_columns(columns: &mut [Columns], j: &Matrix3<f64>) {
    let old = [columns[0], columns[1], columns[2]];
    for (k, new) in columns.iter_mut().enumerate() {
        let mix = |part: fn(&Columns) -> Vector6<f64>| {
            part(&old[0]) * j[(0, k)] + part(&old[1]) * j[(1, k)] + part(&old[2]) * j[(2, k)]
        };
        *new = Columns { alpha: mix(|c| c.alpha), beta: mix(|c| c.beta), gamma: mix(|c| c.gamma) };
    }
}

pub(super) fn as_motion(x: &Vector6<f64>) -> Motion<f64> {
    Motion { w: x.fixed_rows::<3>(0).into_owned(), v: x.fixed_rows::<3>(3).into_owned() }
}

pub(super) fn force_column(f: &Force<f64>) -> Vector6<f64> {
    Vector6::new(f.n[0], f.n[1], f.n[2], f.f[0], f.f[1], f.f[2])
}

/// The matrix of `ξ ↦ ξ × V` … of a motion.
fn cross_matrix(v: &Motion<f64>) -> Matrix6<f64> {
    // ξ × V = −V × ξ
    let (w, u) = (pliant_math::spatial::hat(&v.w), pliant_math::spatial::hat(&v.v));
    let mut m = Matrix6::zeros();
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(&-w);
    m.fixed_view_mut::<3, 3>(3, 0).copy_from(&-u);
    m.fixed_view_mut::<3, 3>(3, 3).copy_from(&-w);
    m
}

/// The matrix of `ξ ↦ ξ ×* W`.
fn force_cross_matrix(w: &Force<f64>) -> Matrix6<f64> {
    let (n, f) = (pliant_math::spatial::hat(&w.n), pliant_math::spatial::hat(&w.f));
    let mut m = Matrix6::zeros();
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(&-n);
    m.fixed_view_mut::<3, 3>(0, 3).copy_from(&-f);
    m.fixed_view_mut::<3, 3>(3, 0).copy_from(&-f);
    m
}
