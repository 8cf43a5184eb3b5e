//! Ropes that twist: their edges, joints, section laws, and which axes grippers hold.

use super::Model;
use super::build::RopeNodes;
use crate::kinematics::{DriveKind, HeldEdge};
use crate::params::{ANY, NON_NEGATIVE, POSITIVE, Params};
use crate::rods::{RodEdge, RodJoint, RodPoint, RodSection};
use crate::scene::{Creep, JointSection, Plasticity, Rest, RodStart, Scene, SceneError, Twist};
use crate::terms::Vec3;
use crate::terms::section::{
    AutomaticMemory, CreepSection, Elastic, ElasticSection, PlasticSection, SectionLaw, Viscous, ViscousSection,
};
use std::sync::Arc;

impl Model {
    /// Adds the twists of all ropes that have them, behind the nodes.
    pub(super) fn add_rods<X>(&mut self, scene: &Scene<X>, ropes: &[RopeNodes]) -> Result<(), SceneError> {
        let mut references = Vec::new();
        for (r, rope) in ropes.iter().enumerate() {
            if let (Some(twist), Some(start)) = (&rope.rope.twist, RodStart::new(scene, r)?) {
                self.add_rod(rope, twist);
                references.extend(start.references);
                self.q0.extend(&start.twists);
                self.v0.extend(start.twists.iter().map(|_| 0.0));
            }
        }
        self.rods.finish(self.n_nodes());
        self.frames0 = self.rods.with_twists(&self.q0, &references);
        let mut start = RodPoint::default();
        self.rods.evaluate(&self.q0, &self.frames0, &self.q0, &mut start);
        self.rods.rest_at(&start);
        Ok(())
    }

    fn add_rod(&mut self, rope: &RopeNodes, twist: &Twist) {
        let nodes = rope.chain();
        let names: Vec<i64> = nodes[1..nodes.len() - 1].iter().map(|node| rope.number(*node)).collect();
        let (inertia, laws) = self.add_section(rope, twist, &names);
        let places = self.remember_joints(&rope.rope.name, &names, &laws);
        let fractions = rope.chain_fractions();
        let first = self.rods.edges.len();
        for (pair, &fraction) in nodes.windows(2).zip(&fractions) {
            self.rods.edges.push(RodEdge { nodes: [pair[0], pair[1]], inertia, length: rope.params.length, fraction });
        }
        let begin = self.rods.joints.len();
        for (k, three) in nodes.windows(3).enumerate() {
            let fraction = rope.joint_fraction(three[1]);
            let edges = [first + k, first + k + 1];
            self.rods.joints.push(RodJoint { edges, nodes: [three[0], three[1], three[2]], fraction });
        }
        self.rods.sections.push(RodSection {
            joints: begin..self.rods.joints.len(),
            laws,
            places,
            rest_initial: twist.rest == Rest::Initial,
        });
    }

    /// Pushes the section's parameters; the index of its inertia, and its laws on the next joints, which are at nodes of these numbers.
    fn add_section(&mut self, rope: &RopeNodes, twist: &Twist, nodes: &[i64]) -> (usize, Vec<Arc<dyn SectionLaw>>) {
        let (name, params) = (&rope.rope.name, &mut self.params);
        let mut entry = |key: &str, unit, bounds, value| params.push(format!("{name}.{key}"), unit, bounds, value);
        let stiffness = entry("twist_stiffness", "N·m²", NON_NEGATIVE, twist.stiffness);
        let damping = entry("twist_damping", "N·m²·s", NON_NEGATIVE, twist.damping);
        let inertia = entry("twist_inertia", "kg·m", POSITIVE, rope.rope.twist_inertia().unwrap_or(0.0));
        let second = twist.bend_stiffness_2.map(|value| entry("bend_stiffness_2", "N·m²", NON_NEGATIVE, value));
        let roll = entry("section_roll", "rad", ANY, twist.section_roll);
        let curvature = [0, 1].map(|a| entry(&format!("rest_curvature[{a}]"), "1/m", ANY, twist.rest_curvature[a]));
        let rest_twist = entry("rest_twist", "rad/m", ANY, twist.rest_twist);
        let own = push_joints(rope, twist, nodes, &mut self.params);
        let (length, bend, bend_damping) = (rope.params.length, rope.params.bend, rope.params.bend_damping);
        let second = second.unwrap_or(bend);
        let begin = self.rods.joints.len();
        let elastic = ElasticSection {
            params: [length, bend, second, stiffness, roll, curvature[0], curvature[1], rest_twist],
            own,
            joints: begin..begin + nodes.len(),
            rest: vec![[0.0; 3]; nodes.len()],
        };
        let mut laws: Vec<Arc<dyn SectionLaw>> = vec![match &rope.rope.plasticity {
            Some(plasticity) => Arc::new(AutomaticMemory::new(plastic(name, elastic, plasticity, &mut self.params))),
            None => Arc::new(Elastic::new(elastic)),
        }];
        laws.push(Arc::new(Viscous::new(ViscousSection { params: [length, bend_damping, damping] })));
        if let Some(creep) = &rope.rope.creep {
            let section = creeping(name, [length, bend, second, stiffness, roll], [own, begin], creep, &mut self.params);
            laws.push(Arc::new(AutomaticMemory::new(section)));
        }
        (inertia, laws)
    }

    /// Gives the joints at nodes of these numbers their places in z, law by law: the first, and how many a joint.
    fn remember_joints(&mut self, rope: &str, nodes: &[i64], laws: &[Arc<dyn SectionLaw>]) -> Vec<(usize, usize)> {
        let mut place = |law: &Arc<dyn SectionLaw>| {
            let first = self.memory.materials.len();
            for node in nodes {
                for name in law.memory() {
                    self.memory.push(format!("{rope}.node[{node}].{name}"), 0.0);
                }
            }
            (first, law.memory().len())
        };
        laws.iter().map(&mut place).collect()
    }

    /// Edges of twisting ropes of which a gripper holds both ends, with their axes as the scene begins.
    pub(super) fn held_edges(&self, kind: &DriveKind) -> Vec<HeldEdge> {
        let (nodes, end) = match kind {
            DriveKind::PrescribedNodes(nodes) | DriveKind::VelocityNodes(nodes) => (nodes.clone(), None),
            DriveKind::PrescribedEdge(clamp) | DriveKind::VelocityEdge(clamp) => (vec![clamp.end, clamp.ghost], Some(clamp.end)),
        };
        let mut start = RodPoint::default();
        self.rods.evaluate(&self.q0, &self.frames0, &self.q0, &mut start);
        let held = |(k, edge): (usize, &RodEdge)| {
            edge.nodes.iter().all(|node| nodes.contains(node)).then(|| {
                let (axes, place) = (&start.edges[k], 3 * end.unwrap_or(edge.nodes[0]));
                let start = [axes.tangent, axes.axes[0], Vec3::from_row_slice(&self.q0[place..place + 3])];
                HeldEdge { edge: k, row: self.rods.row(k), nodes: edge.nodes, start, roll: None }
            })
        };
        self.rods.edges.iter().enumerate().filter_map(held).collect()
    }

    /// What twist k belongs to, for messages and names: the rope, and the edge's number in it (−1 for the ghost before it).
    fn rod_edge(&self, k: usize) -> (&str, i64) {
        let [a, b] = self.rods.edges[k].nodes;
        let rope = self.ropes.iter().find(|rope| rope.nodes.contains(&a) || rope.nodes.contains(&b));
        rope.map_or(("?", 0), |rope| (&rope.name, a as i64 - rope.nodes.start as i64))
    }

    /// "twist of edge 3 of `cable`".
    pub(super) fn twist_name(&self, k: usize) -> String {
        let (rope, edge) = self.rod_edge(k);
        format!("twist of edge {edge} of `{rope}`")
    }

    /// Names of z's part of rods.
    pub(crate) fn frame_names(&self) -> Vec<String> {
        let axes = (0..self.rods.edges.len()).flat_map(|k| {
            let (rope, edge) = self.rod_edge(k);
            ["x", "y", "z"].map(|axis| format!("{rope}.edge[{edge}].axis.{axis}"))
        });
        let twists = self.rods.joints.iter().map(|joint| {
            let (rope, edge) = self.rod_edge(joint.edges[1]);
            format!("{rope}.node[{edge}].reference_twist")
        });
        axes.chain(twists).collect()
    }

    /// First material axes of all edges that twist at a state, three numbers each, in the order of their twists.
    pub fn material_axes(&self, q: &[f64], z: &[f64]) -> Vec<Vec3<f64>> {
        let mut at = RodPoint::default();
        self.rods.evaluate(q, &z[self.ndz()..], q, &mut at);
        at.edges.iter().map(|edge| edge.axes[0]).collect()
    }
}

/// Pushes what each joint has of its own; the index of the first.
fn push_joints(rope: &RopeNodes, twist: &Twist, nodes: &[i64], params: &mut Params) -> usize {
    let (name, first) = (&rope.rope.name, params.len());
    for &node in nodes {
        let own = twist.joint.iter().find(|own| rope.rope.node(own.node).and_then(|k| i64::try_from(k).ok()) == Some(node));
        let own = own.cloned().unwrap_or(JointSection { node, ..JointSection::default() });
        for (a, value) in own.rest_curvature.into_iter().enumerate() {
            params.push(format!("{name}.node[{node}].rest_curvature[{a}]"), "1/m", ANY, value);
        }
        params.push(format!("{name}.node[{node}].bend_factor"), "-", NON_NEGATIVE, own.bend_factor);
    }
    first
}

/// The elastic section with a yield, and its parameters.
fn plastic(rope: &str, elastic: ElasticSection, from: &Plasticity, params: &mut Params) -> PlasticSection {
    let limit = params.push(format!("{rope}.yield_curvature"), "1/m", POSITIVE, from.yield_curvature);
    let time = params.push(format!("{rope}.plastic_time"), "s", POSITIVE, from.time);
    let ElasticSection { params: [length, one, two, twist, roll, first, second, rest_twist], own, joints, rest } = elastic;
    PlasticSection { params: [length, one, two, twist, roll, first, second, rest_twist, limit, time], own, joints, rest }
}

/// The section's part that relaxes, and its parameters.
fn creeping(
    rope: &str,
    [length, one, two, twist, roll]: [usize; 5],
    [own, first]: [usize; 2],
    from: &Creep,
    params: &mut Params,
) -> CreepSection {
    let bend = params.push(format!("{rope}.creep_fraction"), "-", NON_NEGATIVE, from.fraction);
    let of_twist = from.twist_fraction.map(|value| params.push(format!("{rope}.creep_twist_fraction"), "-", NON_NEGATIVE, value));
    let time = params.push(format!("{rope}.creep_time"), "s", POSITIVE, from.time);
    let params = [length, one, two, twist, roll, bend, of_twist.unwrap_or(bend), time];
    CreepSection { params, own: own + 2, stride: 3, first }
}
