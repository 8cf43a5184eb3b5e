//! From a scene's couplings to rows.

use super::Model;
use super::constants::MODEL;
use crate::constraints::{Coupling, JointRow, JointRowKind, Lead};
use pliant_math::params::{ANY, NON_NEGATIVE};
use pliant_scene as scene;
use pliant_scene::{JointKind, Mistake, Scene, SceneError};

/// Units of the coefficients by power, for angles and lengths that follow angles and lengths.
const UNITS: [[[&str; 5]; 2]; 2] = [
    [["rad", "rad/rad", "rad/rad²", "rad/rad³", "rad/rad⁴"], ["rad", "rad/m", "rad/m²", "rad/m³", "rad/m⁴"]],
    [["m", "m/rad", "m/rad²", "m/rad³", "m/rad⁴"], ["m", "m/m", "m/m²", "m/m³", "m/m⁴"]],
];

impl Model {
    /// Adds joints that follow others; the inertias of all degrees of freedom must be known.
    pub(super) fn add_couplings(&mut self, scene: &Scene) -> Result<(), SceneError> {
        for (k, coupling) in scene.coupling.iter().enumerate() {
            // the scene's check has found both
            let Some(follower) = self.single(&coupling.joint) else { continue };
            let lead = coupling.to.as_deref().and_then(|name| self.single(name));
            let row = self.couple(scene, coupling, follower, lead, &format!("coupling[{k}]"))?;
            self.joint_rows.push(row);
        }
        Ok(())
    }

    /// Coordinate and degree of freedom of a joint of one.
    fn single(&self, name: &str) -> Option<[usize; 2]> {
        self.tree.joint(name).map(|j| [self.tree.joints()[j].q, self.tree.joints()[j].v])
    }

    fn couple(
        &mut self,
        scene: &Scene,
        coupling: &scene::Coupling,
        [q, dof]: [usize; 2],
        lead: Option<[usize; 2]>,
        field: &str,
    ) -> Result<JointRow, SceneError> {
        let slides = |name: &str| {
            let joint = scene.body.iter().flat_map(|b| &b.joint).find(|j| j.name == name);
            usize::from(joint.is_some_and(|j| j.kind == JointKind::Prismatic))
        };
        let follows = slides(&coupling.joint);
        let leads = coupling.to.as_deref().map_or(0, slides);
        let name = &coupling.name;
        let coefficients = self.params.len();
        for (k, c) in coupling.coefficients.iter().enumerate() {
            self.params.push(format!("{name}.coefficient[{k}]"), UNITS[follows][leads][k], ANY, *c);
        }
        let lead = lead.map(|[q, dof]| {
            let reference = self.params.push(format!("{name}.reference"), ["rad", "m"][leads], ANY, coupling.reference);
            Lead { dof, q, reference }
        });
        let unit = ["rad/(N·m)", "m/N"][follows];
        let compliance = coupling.compliance.map(|c| self.params.push(format!("{name}.compliance"), unit, NON_NEGATIVE, c));
        let mut row = Coupling {
            lead,
            coefficients,
            count: coupling.coefficients.len(),
            compliance,
            held: self.weights.held[dof],
            yielding: self.weights.yielding[dof],
        };
        let (theta, start) = (self.params.values(), &self.q0[self.n_node_dofs()..]);
        let [wanted, slope] = row.wanted(lead.map_or(0.0, |joint| start[joint.q]), theta);
        if (start[q] - wanted).abs() > MODEL.open {
            let mistake = Mistake::StartsApart { joint: coupling.joint.clone(), start: start[q], wanted };
            return Err(SceneError::at(format!("{field}.coefficients"), mistake));
        }
        if let Some(joint) = lead {
            let together = |own: f64, other: f64| 1.0 / (1.0 / own + slope * slope / other);
            row.held = together(row.held, self.weights.held[joint.dof]);
            row.yielding = together(row.yielding, self.weights.yielding[joint.dof]);
        }
        Ok(JointRow { dof, q, kind: JointRowKind::Coupling(row) })
    }
}
