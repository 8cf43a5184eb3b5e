//! Forces of one's own: their parameters and elements.

use super::Model;
use crate::terms::joint::{AutomaticJoint, ByFormula, JointElement};
use crate::terms::{Automatic, ByFormulas, Element};
use pliant_math::params::ANY;
use pliant_scene::{Force, ForceMistake, JointKind, MOST_AT_JOINT, MOST_ON_NODES, Mistake, Scene, SceneError};
use std::sync::Arc;

/// Unit of a parameter: the one that its formula gives it.
const UNIT: &str = "SI";

const _: () = assert!(MOST_AT_JOINT <= AutomaticJoint::<ByFormula>::MAX_INPUTS);
const _: () = assert!(MOST_ON_NODES < Automatic::<ByFormulas>::MAX_PARAMS);

impl Model {
    /// Adds the forces that a scene writes as formulas, behind all others.
    pub(super) fn add_forces(&mut self, scene: &Scene) -> Result<(), SceneError> {
        scene.force.iter().enumerate().try_for_each(|(k, force)| self.add_force(scene, force, k))
    }

    fn add_force(&mut self, scene: &Scene, force: &Force, number: usize) -> Result<(), SceneError> {
        let joints = || scene.body.iter().flat_map(|body| &body.joint);
        let kind = force.joint.as_ref().and_then(|name| joints().find(|joint| joint.name == *name)).map(|joint| joint.kind);
        let Some(variables) = force.variables(kind) else { return Ok(()) }; // which the scene's check refuses
        let formulas = force.read(variables).map_err(|(k, error)| {
            let text = force.formula.texts()[k].clone();
            let error = ForceMistake::Formula { text, error };
            SceneError::at(format!("force[{number}].formula"), Mistake::Force { error })
        })?;
        let name = format!("force \"{}\"", force.name);
        let entry = |(key, value): (&String, &f64)| self.params.push(format!("{}.{key}", force.name), UNIT, ANY, *value);
        let params: Vec<usize> = force.parameters.iter().map(entry).collect();
        match kind {
            None => {
                let elements = self.force_elements(scene, force, &params);
                self.terms.push(Arc::new(Automatic::new(ByFormulas { name, formulas }, elements)));
            }
            Some(JointKind::Revolute | JointKind::Prismatic | JointKind::Ball) => {
                let joints = force.joint.iter().filter_map(|name| self.tree.joint(name)).collect();
                let element = JointElement { joints, params, ..JointElement::default() };
                self.add_joint_law(ByFormula { name, formulas }, vec![element]);
            }
            Some(JointKind::Universal | JointKind::Free) => {}
        }
        Ok(())
    }

    /// One element per node: those that are listed with the whole force, or all with their part of the length or area.
    fn force_elements(&self, scene: &Scene, force: &Force, params: &[usize]) -> Vec<Element> {
        let Some(name) = force.rope.as_ref().or(force.cloth.as_ref()) else { return Vec::new() };
        let Some(span) = self.node_spans().find_map(|(span, nodes)| (span == name).then_some(nodes)) else { return Vec::new() };
        let Some(numbers) = &force.nodes else {
            let share = |node: usize| {
                let mass = &self.masses[node];
                let params = std::iter::once(mass.length).chain(params.iter().copied()).collect();
                Element { nodes: vec![node], params, constants: vec![mass.fraction] }
            };
            return span.map(share).collect();
        };
        let rope = scene.rope.iter().find(|rope| rope.name == *name);
        let cloth = scene.cloth.iter().find(|cloth| cloth.name == *name);
        let place = |number: i64| rope.map_or_else(|| cloth.and_then(|cloth| cloth.node(number)), |rope| rope.node(number));
        let nodes = numbers.iter().filter_map(|&number| place(number));
        nodes.map(|node| Element { nodes: vec![span.start + node], params: params.to_vec(), constants: Vec::new() }).collect()
    }
}
