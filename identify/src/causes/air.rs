//! What the air does to bodies: one density and one viscosity for all of them.
//!
//! Asked for where a sensor of positions watches bodies, and there is neither rope nor cloth: what encoders read of the drag on an arm's
//! links is damping of its joints ([`super::viscous_friction`], [`super::quadratic_damping`]).

use super::Situation;
use crate::unknown::Unknown;

/// A property of the air that is a parameter of its drag on bodies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Medium {
    /// f = −½ ρ A |u| u.
    Density,
    /// f = −6 η √(π A) u.
    Viscosity,
}

impl Medium {
    fn path(self) -> &'static str {
        match self {
            Self::Density => "air.density",
            Self::Viscosity => "air.viscosity",
        }
    }
}

impl Situation<'_> {
    /// Whether the air's drag on bodies is a cause here.
    pub(super) fn bodies_meet_the_air(&self) -> bool {
        let seen = self.plan.model.node_spans().next().is_none() && !self.plan.markers.is_empty();
        seen && self.plan.model.body_drags().next().is_some()
    }

    /// The property as an unknown, whose typical size has a drag at 1 m/s of a tenth of the bodies' weight.
    pub(super) fn of_bodies(&self, medium: Medium) -> Option<Unknown> {
        if !self.bodies_meet_the_air() {
            return None;
        }
        let model = &self.plan.model;
        let per_unit: f64 = model
            .body_drags()
            .map(|drag| drag.area(&self.values.theta))
            .map(|area| match medium {
                Medium::Density => 0.5 * area,
                Medium::Viscosity => 6.0 * (std::f64::consts::PI * area).sqrt(),
            })
            .sum();
        let mass: f64 = model.inertias(&self.values.theta).iter().map(|body| body.m).sum();
        let size = 0.1 * mass * self.value("gravity.magnitude").max(1.0) / per_unit;
        self.theta(medium.path(), size)
    }

    /// Whether the scene itself has a drag on bodies.
    pub(super) fn has_drag_on_bodies(&self) -> bool {
        let params = self.plan.model.params();
        let mut entries = [Medium::Density, Medium::Viscosity].into_iter().filter_map(|medium| params.find(medium.path()));
        entries.any(|k| self.plan.scene_values.theta[k] > 0.0)
    }
}
