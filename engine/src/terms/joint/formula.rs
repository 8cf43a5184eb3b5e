//! A force of one's own at a joint.

use super::{AutomaticJoint, JointLaw, JointState};
use pliant_math::Real;
use pliant_math::formula::Formula;

/// f_a = F_a(q, v, p) [N·m or N], one formula F per degree of freedom of the joint: of a revolute or prismatic one f = F(q, v, p), of a
/// ball three of the rotation vector q \[rad\] and the angular velocity v [rad/s], all in the body's axes.
///
/// Parameters p, as many as [`AutomaticJoint::MAX_INPUTS`]. It never counts as absent: where all p are zero the derivatives by them
/// exist, and a formula may have a force without them. No energy is known. Non-smooth points and their slopes are those of
/// [`pliant_math::formula`]; where a formula is not defined the force is not finite, and the step fails with an error that names it.
#[derive(Clone, Debug)]
pub struct ByFormula {
    /// `force` and the name that the scene gives it.
    pub name: String,
    /// F.
    pub formulas: Vec<Formula>,
}

/// Coordinates and velocities of a ball joint.
const VARIABLES: usize = 6;

impl JointLaw for ByFormula {
    fn name(&self) -> &str {
        &self.name
    }

    fn force<S: Real>(&self, at: &JointState<S>, p: &[S], _constants: &[f64], f: &mut [S]) {
        let mut values = [S::zero(); VARIABLES + AutomaticJoint::<Self>::MAX_INPUTS];
        let given = at.q.iter().chain(at.v).chain(p);
        values.iter_mut().zip(given).for_each(|(value, given)| *value = *given);
        f.iter_mut().zip(&self.formulas).for_each(|(f, formula)| *f += formula.eval(&values));
    }
}
