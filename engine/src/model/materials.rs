//! History variables of joints, and the model's interface to z. Those of rod sections stand among them: see `crate::rods::memory`.

use super::Model;
use crate::bodies::dynamics::Displacement;
use crate::memory::{Partials, Past};
use crate::terms::joint::JointPoint;
use pliant_linalg::Square;
use pliant_math::{Input, State};

impl Model {
    /// Number of internal variables z: what joints and motors remember, then the reference axes of rods.
    pub fn nz(&self) -> usize {
        self.ndz() + self.rods.n_frames()
    }

    /// Numbers of a change of z: reference axes move with the nodes and have none.
    pub fn ndz(&self) -> usize {
        self.memory.len(self.h)
    }

    /// Names of the internal variables: `elbow.plastic` [rad or m] (`wrist.plastic[k]` of a ball, its rotation vector's axes),
    /// `elbow.load` [N·m or N], `elbow.presliding` [rad or m]; `cable.node[i].creep[k]` [-, rad], `cable.node[i].plastic[k]`, `cable.node[i].friction[k]` [-]; `motor.target`, `motor.command[k]` (k + 1 steps ago), `motor.lagged` in the unit of its control;
    /// `cable.edge[k].axis.x` [-], the reference axis of a rod's edge, and `cable.node[i].reference_twist` \[rad\].
    pub fn memory_names(&self) -> Vec<String> {
        let materials = self.memory.materials.iter().map(|(name, _)| name.clone());
        let signals = self.memory.paths.iter().flat_map(|p| p.names(self.h));
        materials.chain(signals).chain(self.frame_names()).collect()
    }

    /// The state the scene begins with.
    pub fn initial_state(&self) -> State {
        State { q: self.q0.clone(), v: self.v0.clone(), z: self.initial_memory() }
    }

    /// z the scene begins with: plastic parts `plastic_start`, motors as if they had been commanded their `start` for ever, and
    /// each joint's load as springs and motors make it there, at the scene's parameters.
    pub fn initial_memory(&self) -> Vec<f64> {
        let (mut z, n) = (self.memory.resting(self.h), self.n_node_dofs());
        if !self.memory.loads.is_empty() {
            let mut u = vec![0.0; self.nu()];
            self.memory.paths.iter().for_each(|p| u[p.control] = p.start);
            let past = Past { q: &self.q0[n..], z: &z.clone(), elapsed: 0.0 };
            let at =
                JointPoint { tree: &self.tree, q: &self.q0[n..], v: &self.v0[n..], u: &u, theta: self.params.values(), past };
            self.carry_loads(&at, &mut z);
        }
        z.extend_from_slice(&self.frames0);
        z
    }

    /// Number of internal variables that move on with every (halved) step.
    pub(crate) fn n_materials(&self) -> usize {
        self.memory.materials.len()
    }

    /// The torques of springs and motors that joints carry into the next step.
    fn carry_loads(&self, end: &JointPoint, z: &mut [f64]) {
        if !self.memory.loads.is_empty() {
            let mut f = vec![0.0; self.tree.nv()];
            self.joint_terms.iter().for_each(|term| term.add_force(end, &mut f));
            self.memory.loads.iter().for_each(|&(dof, place)| z[place] = f[dof]);
        }
    }

    /// Moves the materials' part of z on to the end of a step: `end` is (q⁺, v⁺), with the whole step past.
    pub(crate) fn advance_materials(&self, end: &JointPoint, z: &mut [f64]) {
        self.joint_terms.iter().for_each(|term| term.advance(end, z));
        self.carry_loads(end, z);
    }

    /// ∂z⁺/∂ of the same, degrees of freedom counted from the nodes' first.
    pub(crate) fn material_partials(&self, end: &JointPoint) -> Partials {
        let (n, nv, mut out) = (self.n_node_dofs(), self.tree.nv(), Vec::new());
        for term in &self.joint_terms {
            term.visit_advance(end, &mut |place, input, value| out.push((place, from_nodes(input, n), value)));
        }
        if self.memory.loads.is_empty() {
            return out;
        }
        let place = |dof: usize| self.memory.loads.iter().find(|(d, _)| *d == dof).map(|(_, place)| *place);
        let [mut by_q, mut by_v] = [Square::zeros(nv), Square::zeros(nv)];
        for term in &self.joint_terms {
            term.add_change(end, Displacement { cm: 0.0, cv: 0.0, cq: 1.0 }, &[], by_q.data_mut(), nv);
            term.add_change(end, Displacement { cm: 0.0, cv: 1.0, cq: 0.0 }, &[], by_v.data_mut(), nv);
            let mut visit = |dof: usize, input: Input, value: f64| {
                out.extend(place(dof).map(|place| (place, from_nodes(input, n), value)));
            };
            term.visit_inputs(end, true, &mut visit);
            term.visit_past(end, &mut visit);
        }
        for &(dof, place) in &self.memory.loads {
            for k in 0..nv {
                let both = [(Input::QNext(n + k), by_q.get(dof, k)), (Input::VNext(n + k), by_v.get(dof, k))];
                out.extend(both.into_iter().filter(|(_, d)| *d != 0.0).map(|(input, d)| (place, input, d)));
            }
        }
        out
    }
}

/// The input with degrees of freedom counted from the nodes' first instead of the bodies'.
pub(crate) fn from_nodes(input: Input, n: usize) -> Input {
    match input {
        Input::Q(k) => Input::Q(n + k),
        Input::QNext(k) => Input::QNext(n + k),
        Input::VNext(k) => Input::VNext(n + k),
        other => other,
    }
}
