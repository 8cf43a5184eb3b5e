//! The library of causes: a file per cause.
//!
//! A cause says what it is called, what it means, which unknowns it frees, when it cannot be tested, and what experiment
//! would excite it. Everything else (derivatives, tests, refits) is common.

mod discretisation;
mod extensibility;
mod frame_rotation;
mod gravity_tilt;
mod gripper_offset;
mod internal_damping;
mod length_scale;
mod linear_drag;
mod quadratic_drag;
mod sensor_bias;
mod spacing;
mod time_offset;
mod tip_mass;
mod wind;

pub use discretisation::{Discretisation, TOLERATED, discretisation};
pub use spacing::{Spacing, spacing};

use crate::shoot::Plan;
use crate::unknown::{Unknown, Values};

/// A possible cause of what a simulation gets wrong.
#[derive(Clone, Debug, PartialEq)]
pub struct Cause {
    /// Name.
    pub name: &'static str,
    /// The gripper it is about, where each has a cause of this name.
    pub object: Option<String>,
    /// What it means, in a sentence.
    pub meaning: &'static str,
    /// What it frees; empty where it cannot be tested.
    pub unknowns: Vec<Unknown>,
    /// Why it cannot be tested.
    pub untestable: Option<String>,
    /// The experiment that would show it best.
    pub excitation: &'static str,
}

impl Cause {
    /// What tells it from all others: `gripper_offset (left)`.
    pub fn title(&self) -> String {
        title(self.name, self.object.as_deref())
    }
}

/// A cause's name, and the object it is about.
pub(crate) fn title(name: &str, object: Option<&str>) -> String {
    object.map_or(name.to_owned(), |object| format!("{name} ({object})"))
}

/// Context a cause is proposed in.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// The experiment.
    pub plan: &'a Plan,
    /// Values of the current fit.
    pub values: &'a Values,
    /// Paths that are free already.
    pub free: &'a [Unknown],
}

impl Situation<'_> {
    /// An entry of θ with a typical size of its change.
    fn theta(&self, pattern: &str, scale: f64) -> Option<Unknown> {
        Unknown::of_theta(&self.plan.model, pattern, scale)
    }

    /// Value of a parameter by path.
    fn value(&self, path: &str) -> f64 {
        self.plan.model.params().find(path).map_or(0.0, |k| self.values.theta[k])
    }

    /// Names of the ropes.
    fn ropes(&self) -> Vec<&str> {
        self.plan.model.ropes().iter().map(|r| r.name.as_str()).collect()
    }

    /// One unknown per rope for a quantity of ropes.
    fn per_rope(&self, quantity: &str, scale: impl Fn(&str) -> f64) -> Vec<Unknown> {
        self.ropes().iter().filter_map(|rope| self.theta(&format!("{rope}.{quantity}"), scale(rope))).collect()
    }

    /// A drag coefficient [kg/(m·s)] whose force at 1 m/s is a tenth of the rope's weight: a typical size.
    fn typical_drag(&self, rope: &str) -> f64 {
        0.1 * self.value(&format!("{rope}.linear_density")) * self.value("gravity.magnitude").max(1.0)
    }
}

/// All causes of the library as they stand in this situation. A cause whose unknowns are all free already is left out.
pub fn library(at: &Situation) -> Vec<Cause> {
    let mut causes = vec![
        linear_drag::cause(at),
        quadratic_drag::cause(at),
        wind::cause(at),
        gravity_tilt::cause(at),
        extensibility::cause(at),
        internal_damping::cause(at),
        tip_mass::cause(at),
    ];
    causes.extend(gripper_offset::causes(at));
    causes.extend([sensor_bias::cause(at), frame_rotation::cause(at), length_scale::cause(at), time_offset::cause(at)]);
    let is_free = |u: &Unknown| at.free.iter().any(|f| f.target == u.target);
    for cause in &mut causes {
        cause.unknowns.retain(|u| !is_free(u));
    }
    causes.retain(|c| !c.unknowns.is_empty() || c.untestable.is_some());
    causes
}
