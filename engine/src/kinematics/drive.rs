//! Grippers: the velocity they command to the nodes they clamp.
//!
//! The command of a step is computed once, with the step's full length h, from the state at its start, the inputs u and θ:
//!
//! - prescribed: `v_cmd = (target(u, θ) − q)/h`, the target being the position at the *end* of the step;
//! - velocity-controlled: `v_cmd = u`, and a clamped end edge also turns with the angular velocity ω by the Cayley map.
//!
//! Of a rope that twists it holds the axes of edges too: see [`super::hold`].
//!
//! A clamped end edge is a ghost node one rest length behind the end node: `p_ghost = p_end − l a/|a|`, `a` the axis pointing
//! into the rope.

use super::constants::KINEMATICS;
use super::hold::{HeldEdge, Now};
use pliant_math::input::{Dual, differentiate};
use pliant_math::{Input, Real, Vec3};

/// The ghost of a clamped end edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeClamp {
    /// The rope's end node.
    pub end: usize,
    /// The massless node behind it.
    pub ghost: usize,
    /// Index in θ of the rope's length \[m\].
    pub length: usize,
    /// Rest length of the ghost edge as a fraction of the rope's length.
    pub fraction: f64,
}

/// Nodes that a gripper holds and its motion. Controls start at `first_u`; `offset` is the index in θ of the gripper's offset \[m\].
#[derive(Clone, Debug, PartialEq)]
pub enum DriveKind {
    /// Positions of the clamped nodes \[m\], three controls per node.
    PrescribedNodes(Vec<usize>),
    /// Position \[m\] of the end node and axis [-] (any length) into the rope: six controls; three more, the first material axis [-],
    /// where the rope twists.
    PrescribedEdge(EdgeClamp),
    /// One velocity [m/s] for all clamped nodes: three controls.
    VelocityNodes(Vec<usize>),
    /// Velocity [m/s] and angular velocity [rad/s] of the end edge: six controls.
    VelocityEdge(EdgeClamp),
}

/// A gripper of the model.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    /// Name in the scene.
    pub name: String,
    /// The nodes it holds.
    pub kind: DriveKind,
    /// First of its controls in u.
    pub first_u: usize,
    /// First of the three entries of its offset in θ.
    pub offset: usize,
    /// Edges of a twisting rope whose axes it holds.
    pub held: Vec<HeldEdge>,
    /// Whether one more control, the last, closes it: see [`crate::grasp`].
    pub closes: bool,
}

/// A command that cannot be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CommandError {
    /// The axis of a clamped end edge is zero or not finite.
    #[error("gripper `{gripper}`: the axis of its clamped end edge is ({}, {}, {}), which has no direction; give a vector pointing into the rope", axis[0], axis[1], axis[2])]
    Axis {
        /// Gripper.
        gripper: String,
        /// The axis given.
        axis: [f64; 3],
    },
    /// The director of a clamped end edge has no part normal to it.
    #[error("gripper `{gripper}`: the director of its clamped end edge is ({}, {}, {}), which has no part across the axis; give the direction of the edge's first material axis", director[0], director[1], director[2])]
    Director {
        /// Gripper.
        gripper: String,
        /// The director given.
        director: [f64; 3],
    },
    /// A control is not finite.
    #[error("gripper `{gripper}`: control {index} is {value}; inputs must be finite numbers")]
    NotFinite {
        /// Gripper.
        gripper: String,
        /// Index into u.
        index: usize,
        /// Its value.
        value: f64,
    },
}

impl Drive {
    /// Number of controls of this gripper.
    pub fn n_controls(&self) -> usize {
        let of_motion = match &self.kind {
            DriveKind::PrescribedNodes(nodes) => 3 * nodes.len(),
            DriveKind::VelocityNodes(_) => 3,
            DriveKind::PrescribedEdge(_) => 6 + 3 * self.held.len(),
            DriveKind::VelocityEdge(_) => 6,
        };
        of_motion + usize::from(self.closes)
    }

    /// The nodes it clamps, ghosts included.
    pub fn nodes(&self) -> Vec<usize> {
        match &self.kind {
            DriveKind::PrescribedNodes(nodes) | DriveKind::VelocityNodes(nodes) => nodes.clone(),
            DriveKind::PrescribedEdge(c) | DriveKind::VelocityEdge(c) => vec![c.end, c.ghost],
        }
    }

    /// Whether the controls are positions (rather than velocities).
    pub fn is_prescribed(&self) -> bool {
        matches!(self.kind, DriveKind::PrescribedNodes(_) | DriveKind::PrescribedEdge(_))
    }

    /// Writes the commanded velocities of its nodes [m/s] and twists [rad/s] into `v_cmd` (by rows). `frames`: z's part of rods.
    pub fn command(
        &self,
        [q, frames]: [&[f64]; 2],
        u: &[f64],
        theta: &[f64],
        h: f64,
        v_cmd: &mut [f64],
    ) -> Result<(), CommandError> {
        self.check(u)?;
        for held in &self.held {
            v_cmd[held.row] = self.twist_command(held, &held.now(q, frames), &|input| value(input, q, u, theta), h);
        }
        match &self.kind {
            DriveKind::PrescribedNodes(nodes) => {
                for (k, &node) in nodes.iter().enumerate() {
                    for a in 0..3 {
                        let target = u[self.first_u + 3 * k + a] + theta[self.offset + a];
                        v_cmd[3 * node + a] = (target - q[3 * node + a]) / h;
                    }
                }
            }
            DriveKind::VelocityNodes(nodes) => {
                for &node in nodes {
                    v_cmd[3 * node..3 * node + 3].copy_from_slice(&u[self.first_u..self.first_u + 3]);
                }
            }
            DriveKind::PrescribedEdge(c) | DriveKind::VelocityEdge(c) => {
                let (end, ghost) = self.edge_command(c, &|input| value(input, q, u, theta), h);
                v_cmd[3 * c.end..3 * c.end + 3].copy_from_slice(end.as_slice());
                v_cmd[3 * c.ghost..3 * c.ghost + 3].copy_from_slice(ghost.as_slice());
            }
        }
        Ok(())
    }

    /// Calls `visit(row, input, ∂v_cmd[row]/∂input)` for every structural nonzero.
    pub fn visit(&self, [q, frames]: [&[f64]; 2], u: &[f64], theta: &[f64], h: f64, visit: &mut dyn FnMut(usize, Input, f64)) {
        for held in &self.held {
            let now = held.now(q, frames);
            differentiate(
                &self.twist_inputs(held),
                &|input| value(input, q, u, theta),
                &|get| vec![(held.row, self.twist_command(held, &now, get, h))],
                visit,
            );
        }
        match &self.kind {
            DriveKind::PrescribedNodes(nodes) => {
                for (k, &node) in nodes.iter().enumerate() {
                    for a in 0..3 {
                        let row = 3 * node + a;
                        visit(row, Input::U(self.first_u + 3 * k + a), 1.0 / h);
                        visit(row, Input::Theta(self.offset + a), 1.0 / h);
                        visit(row, Input::Q(row), -1.0 / h);
                    }
                }
            }
            DriveKind::VelocityNodes(nodes) => {
                for &node in nodes {
                    for a in 0..3 {
                        visit(3 * node + a, Input::U(self.first_u + a), 1.0);
                    }
                }
            }
            DriveKind::PrescribedEdge(c) | DriveKind::VelocityEdge(c) => self.visit_edge(c, q, u, theta, h, visit),
        }
    }

    fn visit_edge(&self, c: &EdgeClamp, q: &[f64], u: &[f64], theta: &[f64], h: f64, visit: &mut dyn FnMut(usize, Input, f64)) {
        let command = |get: &dyn Fn(Input) -> Dual| {
            let (end, ghost) = self.edge_command(c, get, h);
            let rows = |node: usize, x: Vec3<Dual>| (0..3).map(move |a| (3 * node + a, x[a]));
            rows(c.end, end).chain(rows(c.ghost, ghost)).collect()
        };
        differentiate(&self.edge_inputs(c), &|input| value(input, q, u, theta), &command, visit);
    }

    /// Velocity of the twist of a held edge [rad/s].
    fn twist_command<S: Real>(&self, held: &HeldEdge, now: &Now, get: &dyn Fn(Input) -> S, h: f64) -> S {
        let control = |k: usize| Vec3::from_fn(|a, _| get(Input::U(self.first_u + k + a)));
        match &self.kind {
            DriveKind::PrescribedEdge(c) => {
                // the axis points into the rope, the edge from its first node on
                let edge = if held.nodes[1] == c.ghost { -control(3) } else { control(3) };
                held.command(now, [control(0), edge], Some(control(6)), get, h)
            }
            DriveKind::PrescribedNodes(nodes) => {
                let place = |node: usize| nodes.iter().position(|n| *n == node).map_or(0, |k| 3 * k);
                let [from, to] = held.nodes.map(|node| control(place(node)));
                held.command(now, [from, to - from], None, get, h)
            }
            DriveKind::VelocityEdge(_) => held.spin(now, control(3), get, h),
            DriveKind::VelocityNodes(_) => S::zero(),
        }
    }

    fn twist_inputs(&self, held: &HeldEdge) -> Vec<Input> {
        let controls = match &self.kind {
            DriveKind::VelocityNodes(_) => return Vec::new(),
            _ => (self.first_u..self.first_u + self.n_controls()).map(Input::U),
        };
        held.inputs().chain(controls).collect()
    }

    fn edge_inputs(&self, c: &EdgeClamp) -> Vec<Input> {
        let mut inputs: Vec<Input> = (0..6).map(|k| Input::U(self.first_u + k)).collect();
        inputs.extend((0..3).flat_map(|a| [Input::Q(3 * c.end + a), Input::Q(3 * c.ghost + a)]));
        if self.is_prescribed() {
            inputs.extend((0..3).map(|a| Input::Theta(self.offset + a)));
            inputs.push(Input::Theta(c.length));
        }
        inputs
    }

    fn edge_command<S: Real>(&self, c: &EdgeClamp, get: &dyn Fn(Input) -> S, h: f64) -> (Vec3<S>, Vec3<S>) {
        let vec3 = |at: &dyn Fn(usize) -> Input| Vec3::new(get(at(0)), get(at(1)), get(at(2)));
        let first = vec3(&|a| Input::U(self.first_u + a));
        let second = vec3(&|a| Input::U(self.first_u + 3 + a));
        let q_end = vec3(&|a| Input::Q(3 * c.end + a));
        let q_ghost = vec3(&|a| Input::Q(3 * c.ghost + a));
        if self.is_prescribed() {
            let target = first + vec3(&|a| Input::Theta(self.offset + a));
            let l = get(Input::Theta(c.length)) * c.fraction;
            let ghost = target - second * (l / second.dot(&second).sqrt());
            ((target - q_end) / S::from(h), (ghost - q_ghost) / S::from(h))
        } else {
            (first, first + cayley_minus_identity(second * S::from(h), q_ghost - q_end) / S::from(h))
        }
    }

    fn check(&self, u: &[f64]) -> Result<(), CommandError> {
        let range = self.first_u..self.first_u + self.n_controls();
        if let Some(index) = range.clone().find(|&k| !u[k].is_finite()) {
            return Err(CommandError::NotFinite { gripper: self.name.clone(), index, value: u[index] });
        }
        if matches!(self.kind, DriveKind::PrescribedEdge(_)) {
            let axis = [u[range.start + 3], u[range.start + 4], u[range.start + 5]];
            if axis.iter().map(|a| a * a).sum::<f64>() < f64::MIN_POSITIVE {
                return Err(CommandError::Axis { gripper: self.name.clone(), axis });
            }
            if !self.held.is_empty() {
                let [axis, director] = [3, 6].map(|k| Vec3::from_fn(|a, _| u[range.start + k + a]));
                if axis.cross(&director).norm() <= KINEMATICS.parallel * axis.norm() * director.norm() {
                    return Err(CommandError::Director { gripper: self.name.clone(), director: director.into() });
                }
            }
        }
        Ok(())
    }
}

fn value(input: Input, q: &[f64], u: &[f64], theta: &[f64]) -> f64 {
    match input {
        Input::Q(k) => q[k],
        Input::U(k) => u[k],
        Input::Theta(k) => theta[k],
        Input::Z(_) | Input::QNext(_) | Input::VNext(_) | Input::Command(_) => 0.0, // a gripper reads none of them
    }
}

/// `(cay(a) − I) x` with `cay(a) = I + 4/(4 + |a|²) ([a]ₓ + ½ [a]ₓ²)`, a rotation about `a` by 2 atan(|a|/2).
fn cayley_minus_identity<S: Real>(a: Vec3<S>, x: Vec3<S>) -> Vec3<S> {
    let ax = a.cross(&x);
    (ax + a.cross(&ax) * S::from(0.5)) * ((a.dot(&a) + 4.0).recip() * 4.0)
}
