//! Constraints between points, frames and joint coordinates: which there are in a model, and their laws linearized at one point. No
//! stage, no solver: a step's sets of constraints are in [`crate::step`]'s `constraints`.

mod closure;
mod collider;
mod constants;
mod coupling;
mod distance_change;
mod edge;
mod joint_law;
mod link;
mod node_contact;
mod pair;
mod place;

pub use closure::LoopClosure;
pub(crate) use closure::{ClosureLaw, TieRows, closure_law};
pub use collider::{ColliderPair, Friction};
pub(crate) use collider::{Sliding, SplitLaw, body_contact_law, contact_wrench, rounding};
pub(crate) use constants::CONSTRAINTS;
pub use coupling::{Coupling, Lead};
pub(crate) use distance_change::contact_geometry_changes;
pub(crate) use edge::{ConeLinear, ElementLinear, element_changes, element_law, of_nodes, tangential, weighted};
pub use edge::{ContactElement, ElementGroup};
pub use joint_law::{JointFriction, JointRow, JointRowKind};
pub(crate) use joint_law::{RowLinear, RowPoint};
pub(crate) use link::LinkLinear;
pub(crate) use node_contact::{Condensed, LawPoint, impulse, weighed};
pub use pair::ContactPair;
pub(crate) use pair::Touch;
pub(crate) use place::{node_of, pose, pose_of_world, velocity};

use pliant_smoothing::ContactLaw;

/// The smoothed law of a scene's contact.
pub(crate) fn contact_law(law: pliant_scene::Law) -> ContactLaw {
    match law {
        pliant_scene::Law::Coulomb => ContactLaw::Coulomb,
        pliant_scene::Law::Anitescu => ContactLaw::Anitescu,
    }
}
