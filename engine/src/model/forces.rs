//! Forces of one's own: their parameters and elements.

use super::Model;
use crate::terms::joint::{AutomaticJoint, ByFormula, JointElement};
use crate::terms::{Automatic, ByFormulas, Element};
use num_dual::Dual64;
use pliant_math::formula::Formula;
use pliant_math::params::ANY;
use pliant_scene::{Force, ForceMistake, MOST_AT_JOINT, MOST_ON_NODES, Mistake, Scene, SceneError};
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
            let error = ForceMistake::Formula { text, error: Box::new(error) };
            SceneError::at(format!("force[{number}].formula"), Mistake::Force { error })
        })?;
        let name = format!("force \"{}\"", force.name);
        let entry = |(key, value): (&String, &f64)| self.params.push(format!("{}.{key}", force.name), UNIT, ANY, *value);
        let params: Vec<usize> = force.parameters.iter().map(entry).collect();
        let acts = match kind {
            None => {
                let elements = self.force_elements(scene, force, &params);
                let nodes = elements.iter().flat_map(|element| element.nodes.iter().copied()).collect();
                let law = ByFormulas { name, formulas: formulas.clone() };
                self.terms.push(Arc::new(Automatic::new(law, elements)));
                Acts::Nodes { nodes, density: force.nodes.is_none() }
            }
            Some(_) => {
                let Some(joint) = force.joint.as_ref().and_then(|name| self.tree.joint(name)) else { return Ok(()) };
                let element = JointElement { joints: vec![joint], params: params.clone(), ..JointElement::default() };
                self.add_joint_law(ByFormula { name, formulas: formulas.clone() }, vec![element]);
                Acts::Joint(joint)
            }
        };
        self.own_forces.push(OwnForce { name: force.name.clone(), params, acts, formulas });
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

/// A force of one's own in a model: what a search for it needs to know.
#[derive(Clone, Debug)]
pub struct OwnForce {
    /// Name in the scene.
    pub name: String,
    /// Entries of θ, in the order of its parameters' names.
    pub params: Vec<usize>,
    /// Where it acts.
    pub acts: Acts,
    formulas: Vec<Formula>,
}

/// Where a force of one's own acts.
#[derive(Clone, Debug, PartialEq)]
pub enum Acts {
    /// At this joint of the tree.
    Joint(usize),
    /// On these nodes, as a density or not.
    Nodes {
        /// Nodes of the model.
        nodes: Vec<usize>,
        /// Per length or area, not per node.
        density: bool,
    },
}

impl OwnForce {
    /// |∂f/∂p| of each parameter p where its variables (positions, then velocities) have these values; f is the force as it is written,
    /// a density included.
    pub fn slopes(&self, variables: &[f64], theta: &[f64]) -> Vec<f64> {
        let slope = |k: usize| {
            let constant = variables.iter().map(|x| Dual64::from(*x));
            let seeded = self.params.iter().enumerate().map(|(j, &p)| Dual64::new(theta[p], if j == k { 1.0 } else { 0.0 }));
            let values: Vec<Dual64> = constant.chain(seeded).collect();
            self.formulas.iter().map(|formula| formula.eval(&values).eps.powi(2)).sum::<f64>().sqrt()
        };
        (0..self.params.len()).map(slope).collect()
    }

    /// Mean mass of the nodes it acts on \[kg\], per length [kg/m] or area [kg/m²] if it is a density; `None` at a joint.
    pub fn mass(&self, model: &Model, theta: &[f64]) -> Option<f64> {
        let Acts::Nodes { nodes, density } = &self.acts else { return None };
        let of = |node: &usize| {
            let mass = &model.masses[*node];
            if *density { theta[mass.density] } else { mass.mass(theta) }
        };
        Some(nodes.iter().map(of).sum::<f64>() / nodes.len().max(1) as f64)
    }
}

impl Model {
    /// The forces of one's own, in the scene's order.
    pub fn own_forces(&self) -> &[OwnForce] {
        &self.own_forces
    }
}
