//! Ropes that twist: their edges, joints, section laws, and which axes grippers hold.

use super::Model;
use super::build::RopeNodes;
use crate::kinematics::{DriveKind, HeldEdge};
use crate::rods::{RodEdge, RodJoint, RodPoint, RodSection};
use crate::terms::section::{
    AutomaticMemory, CreepSection, DahlSection, Elastic, ElasticSection, PlasticSection, SectionLaw, Stiffening,
    StiffeningSection, Viscous, ViscousSection,
};
use pliant_math::Vec3;
use pliant_math::params::{ANY, NON_NEGATIVE, POSITIVE, Params};
use pliant_scene::{BendFriction, Creep, JointSection, Plasticity, Rest, RodStart, Scene, SceneError, Twist};
use std::sync::Arc;

impl Model {
    /// Adds the twists of all ropes that have them, behind the nodes.
    pub(super) fn add_rods(&mut self, scene: &Scene, ropes: &[RopeNodes]) -> Result<(), SceneError> {
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
        self.rods.join_ends(&self.q0, &mut self.frames0);
        let mut start = RodPoint::default();
        self.rods.evaluate(&self.q0, &self.frames0, &self.q0, &mut start);
        self.rods.rest_at(&start);
        Ok(())
    }

    fn add_rod(&mut self, rope: &RopeNodes, twist: &Twist) {
        let (corners, edges) = (rope.corners(), rope.edges());
        let names: Vec<i64> = corners.iter().map(|([_, node, _], _)| rope.number(*node)).collect();
        let (inertia, laws) = self.add_section(rope, twist, &names);
        let places = self.remember_joints(&rope.rope.name, &names, &laws);
        let first = self.rods.edges.len();
        let begin = self.rods.joints.len();
        for (k, (nodes, fraction)) in corners.into_iter().enumerate() {
            // the first corner of a closed rope is between its last edge and its first
            let pair = if rope.is_closed() { [(k + edges.len() - 1) % edges.len(), k] } else { [k, k + 1] };
            self.rods.joints.push(RodJoint { edges: pair.map(|e| first + e), nodes, fraction });
        }
        let length = rope.params.length;
        self.rods.edges.extend(edges.into_iter().map(|(nodes, fraction)| RodEdge { nodes, inertia, length, fraction }));
        self.rods.sections.push(RodSection {
            joints: begin..self.rods.joints.len(),
            laws,
            places,
            rest_initial: twist.rest == Rest::Initial,
            seam: rope.is_closed().then_some(twist.initial),
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
        let stiffening = rope.rope.stiffening.as_ref().map(|from| {
            let path = format!("{name}.stiffening");
            self.params.push(path, "m²", ANY, from.coefficient)
        });
        let viscous = Arc::new(Viscous::new(ViscousSection { params: [length, bend_damping, damping] }));
        let mut laws: Vec<Arc<dyn SectionLaw>> = match (&rope.rope.plasticity, stiffening) {
            (Some(from), _) => {
                let plastic = plastic(name, elastic, stiffening, from, &mut self.params);
                vec![Arc::new(AutomaticMemory::new(plastic)), viscous]
            }
            (None, None) => vec![Arc::new(Elastic::new(elastic)), viscous],
            (None, Some(c)) => {
                vec![Arc::new(Elastic::new(elastic.clone())), viscous, Arc::new(Stiffening::new(stiff(elastic, c)))]
            }
        };
        if let Some(creep) = &rope.rope.creep {
            let section = creeping(name, [length, bend, second, stiffness, roll], [own, begin], creep, &mut self.params);
            laws.push(Arc::new(AutomaticMemory::new(section)));
        }
        if let Some(friction) = &rope.rope.bend_friction {
            laws.push(Arc::new(AutomaticMemory::new(rubbing(name, length, friction, &mut self.params))));
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

    /// Owner of twist k, for messages and names: the rope, and the edge's number in it (−1 for the ghost before it).
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

/// The stiffening term beside an elastic section, with the parameter `c`.
fn stiff(elastic: ElasticSection, c: usize) -> StiffeningSection {
    let ElasticSection { params: [length, one, two, twist, roll, first, second, rest_twist], own, joints, rest } = elastic;
    StiffeningSection { params: [length, one, two, twist, roll, first, second, rest_twist, c], own, joints, rest }
}

/// The elastic section with a yield, and its parameters; it stiffens if there is such a parameter.
fn plastic(
    rope: &str,
    elastic: ElasticSection,
    stiffening: Option<usize>,
    from: &Plasticity,
    params: &mut Params,
) -> PlasticSection {
    let limit = params.push(format!("{rope}.yield_curvature"), "1/m", POSITIVE, from.yield_curvature);
    let time = params.push(format!("{rope}.plastic_time"), "s", POSITIVE, from.time);
    let ElasticSection { params: of_elastic, own, joints, rest } = elastic;
    let params = of_elastic.into_iter().chain([limit, time]).chain(stiffening).collect();
    PlasticSection { params, own, joints, rest }
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

/// The section's friction, and its parameters.
fn rubbing(rope: &str, length: usize, from: &BendFriction, params: &mut Params) -> DahlSection {
    let moment = params.push(format!("{rope}.friction_moment"), "N·m", NON_NEGATIVE, from.moment);
    let curvature = params.push(format!("{rope}.friction_curvature"), "1/m", POSITIVE, from.curvature);
    DahlSection { params: [length, moment, curvature] }
}
