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
pub(crate) use collider::{Sliding, SplitLaw, body_contact_law, contact_wrench};
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

/// The slip factor σ of a contact's cone variable s̄ = σ v_t [-], and its derivative by μ: of Coulomb's law √(μ² + μ₀²)/ε with ε of
/// [`sharpness`], of the convex relaxation μ.
///
/// With σ = μ/ε the impulse would hold μ², and its derivative by a coefficient of zero would be zero, where any friction slows what
/// slides.
pub(crate) fn slip(law: pliant_scene::Law, mu: f64, sharpness: f64) -> (f64, f64) {
    match law {
        pliant_scene::Law::Coulomb => {
            let slip = mu.hypot(CONSTRAINTS.least_slip);
            (slip / sharpness, mu / (slip * sharpness))
        }
        pliant_scene::Law::Anitescu => (mu, 1.0),
    }
}

/// ε = min(1, h²/τ²): smoothing of friction over that along the normal, in a scene with steps of the length h [s] (also in their
/// stages and halves).
///
/// A contact that rests at the gap δ closes at v_n = δ/h, and the same smoothing would let friction act only from speeds of that size on:
/// the shorter the step, the later. With ε v_n instead, a sticking contact creeps at speeds of the order of δ h/(μ τ²) in steps shorter than
/// τ, which vanish with h at any δ.
pub(crate) fn sharpness(h: f64) -> f64 {
    (h / CONSTRAINTS.friction_time).powi(2).min(1.0)
}
