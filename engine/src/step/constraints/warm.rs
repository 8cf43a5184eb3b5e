//! Impulses of the last stage, from which the next one starts.

use super::ConstraintId;
use nalgebra::Vector4;

/// Multipliers of the last converged stage.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct WarmImpulses {
    /// Of joint friction, limits and couplings [N·m·s, N·s].
    pub joints: Vec<f64>,
    /// Cone variables of node contacts [N·s].
    pub nodes: Vec<f64>,
    /// Cone variables of constraints that are listed anew in each stage [N·s], in the order of their identities.
    pub listed: Vec<(ConstraintId, Vector4<f64>)>,
}

impl WarmImpulses {
    /// That of a constraint, if it acted.
    pub fn of(&self, id: &ConstraintId) -> Option<Vector4<f64>> {
        let at = self.listed.binary_search_by(|(other, _)| other.cmp(id)).ok()?;
        Some(self.listed[at].1)
    }
}
