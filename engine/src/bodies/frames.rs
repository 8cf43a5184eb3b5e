//! Where the bodies are and how they move: forward kinematics, once for any scalar.

use super::tree::{JointKind, Tree, quaternion};
use nalgebra::Matrix3;
use pliant_math::rotation::{about, matrix};
use pliant_math::spatial::Motion;
use pliant_math::{Real, Vec3};

/// A body's pose and motion.
#[derive(Clone, Copy, Debug)]
pub struct Frame<S> {
    /// Axes, as columns in the world's.
    pub rotation: Matrix3<S>,
    /// Origin \[m\], seen from the origin of the evaluation.
    pub position: Vec3<S>,
    /// Velocity.
    pub velocity: Motion<S>,
    /// Acceleration, that of free fall included (the world accelerates by −g).
    pub acceleration: Motion<S>,
}

/// A degree of freedom's axis and what the motion makes of it.
#[derive(Clone, Copy, Debug)]
pub struct Axis<S> {
    /// S: the motion at unit velocity.
    pub s: Motion<S>,
    /// Ṡ = V × S with the body's velocity V.
    pub s_dot: Motion<S>,
    /// Ψ̇ = V₋ × S with the velocity V₋ before the joint: how velocities of all bodies beyond change, in their own axes, when the
    /// joint is displaced.
    pub psi_dot: Motion<S>,
    /// Ψ̈ = A₋ × S + V₋ × Ψ̇: likewise their accelerations.
    pub psi_ddot: Motion<S>,
}

/// Frames of all bodies and axes of all degrees of freedom.
#[derive(Clone, Debug, Default)]
pub struct Frames<S> {
    /// One per body.
    pub bodies: Vec<Frame<S>>,
    /// One per degree of freedom.
    pub axes: Vec<Axis<S>>,
    /// Origin of the evaluation, world coordinates \[m\].
    pub origin: Vec3<f64>,
}

impl<S: Real> Frames<S> {
    /// No body yet; momenta will be taken about `origin`.
    pub fn about(origin: Vec3<f64>) -> Self {
        Self { bodies: Vec::new(), axes: Vec::new(), origin }
    }

    /// Evaluates at coordinates q, velocities v and accelerations a; `gravity` is g [m/s²].
    pub fn evaluate(&mut self, tree: &Tree, q: &[S], v: &[S], a: &[S], gravity: &Vec3<S>) {
        self.run::<true>(tree, q, v, a, gravity);
    }

    /// As [`Frames::evaluate`], leaving out of the axes what only partial derivatives need.
    pub fn evaluate_values(&mut self, tree: &Tree, q: &[S], v: &[S], a: &[S], gravity: &Vec3<S>) {
        self.run::<false>(tree, q, v, a, gravity);
    }

    fn run<const PARTIALS: bool>(&mut self, tree: &Tree, q: &[S], v: &[S], a: &[S], gravity: &Vec3<S>) {
        self.bodies.clear();
        self.axes.clear();
        self.bodies.reserve(tree.bodies().len());
        self.axes.reserve(tree.nv());
        let zero = Vec3::repeat(S::zero());
        let world = Frame {
            rotation: Matrix3::identity(),
            position: -self.origin.map(S::from),
            velocity: Motion::zero(),
            acceleration: Motion { w: zero, v: -gravity },
        };
        for body in tree.bodies() {
            let parent = body.parent.map_or(&world, |p| &self.bodies[p]);
            let mut frame = Frame {
                rotation: if body.aligned { parent.rotation } else { times_constant(&parent.rotation, &body.rotation) },
                position: parent.position + apply(&parent.rotation, &body.position),
                ..*parent
            };
            for joint in &tree.joints()[body.joints.clone()] {
                let centred = joint.anchor == Vec3::zeros();
                let at = if centred { frame.position } else { frame.position + apply(&frame.rotation, &joint.anchor) };
                match joint.kind {
                    JointKind::Revolute => {
                        let axis = apply(&frame.rotation, &joint.axis);
                        self.push::<PARTIALS>(&mut frame, Motion::turning(axis, &at), v[joint.v], a[joint.v]);
                        turn(&mut frame.rotation, &joint.axis, q[joint.q]);
                        frame.position = if centred { at } else { at - apply(&frame.rotation, &joint.anchor) };
                    }
                    JointKind::Prismatic => {
                        let axis = apply(&frame.rotation, &joint.axis);
                        self.push::<PARTIALS>(&mut frame, Motion { w: zero, v: axis }, v[joint.v], a[joint.v]);
                        frame.position += axis * q[joint.q];
                    }
                    JointKind::Ball => {
                        frame.rotation *= matrix(&quaternion(q, joint.q));
                        self.push_ball(&mut frame, &at, &v[joint.v..joint.v + 3], &a[joint.v..joint.v + 3]);
                        frame.position = at - apply(&frame.rotation, &joint.anchor);
                    }
                }
            }
            self.bodies.push(frame);
        }
    }

    #[inline]
    fn push<const PARTIALS: bool>(&mut self, frame: &mut Frame<S>, s: Motion<S>, v: S, a: S) {
        let psi_dot = frame.velocity.cross(&s);
        let psi_ddot = if PARTIALS { frame.acceleration.cross(&s) + frame.velocity.cross(&psi_dot) } else { Motion::zero() };
        // S × S = 0: the velocity before and after the joint carry S alike
        self.axes.push(Axis { s, s_dot: psi_dot, psi_dot, psi_ddot });
        frame.velocity += s * v;
        frame.acceleration += s * a + psi_dot * v;
    }

    fn push_ball(&mut self, frame: &mut Frame<S>, at: &Vec3<S>, v: &[S], a: &[S]) {
        let before = *frame;
        let axes: [Motion<S>; 3] = std::array::from_fn(|k| Motion::turning(frame.rotation.column(k).into_owned(), at));
        for (s, v) in axes.iter().zip(v) {
            frame.velocity += *s * *v;
        }
        for (s, (v, a)) in axes.iter().zip(v.iter().zip(a)) {
            let s_dot = frame.velocity.cross(s);
            let psi_dot = before.velocity.cross(s);
            let psi_ddot = before.acceleration.cross(s) + before.velocity.cross(&psi_dot);
            self.axes.push(Axis { s: *s, s_dot, psi_dot, psi_ddot });
            frame.acceleration += *s * *a + s_dot * *v;
        }
    }
}

/// `r ← r · rot(axis, angle)`: for an axis of the frame itself, two columns.
fn turn<S: Real>(r: &mut Matrix3<S>, axis: &Vec3<f64>, angle: S) {
    let along = |k: usize| axis[k] == 1.0 && axis[(k + 1) % 3] == 0.0 && axis[(k + 2) % 3] == 0.0;
    match (0..3).find(|k| along(*k)) {
        Some(k) => {
            let (sin, cos) = angle.sin_cos();
            let (a, b) = (r.column((k + 1) % 3).into_owned(), r.column((k + 2) % 3).into_owned());
            r.set_column((k + 1) % 3, &(a * cos + b * sin));
            r.set_column((k + 2) % 3, &(b * cos - a * sin));
        }
        None => *r *= about(axis, angle),
    }
}

/// `r x` for a constant vector.
#[inline]
pub fn apply<S: Real>(r: &Matrix3<S>, x: &Vec3<f64>) -> Vec3<S> {
    r.column(0) * S::from(x[0]) + r.column(1) * S::from(x[1]) + r.column(2) * S::from(x[2])
}

fn times_constant<S: Real>(r: &Matrix3<S>, c: &Matrix3<f64>) -> Matrix3<S> {
    r * c.map(S::from)
}
