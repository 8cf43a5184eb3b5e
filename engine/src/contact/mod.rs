//! Contact of nodes, edges and triangles with fixed shapes, and friction and stops at joints, and joints that follow others. Of contacts: the smoothed law of `pliant-smoothing` joined with a shape's gap, condensed to a
//! force on the node.
//!
//! With w the cone variable of a contact, the impulse is `p = w₀ n + μ w̄` and `F(w, v̂) = 0` is the smoothed natural residual.
//! One Newton step eliminates `dw = −F_w⁻¹ (F + F_v dv)`; what is left acts on the node like a force `p/h` with derivatives
//! `∂(p/h)/∂q⁺` and `∂(p/h)/∂v⁺`, so that contact is one more term to everything above it.

mod condensed;
mod coupling;
mod facet;
mod joint_row;
mod meeting;
mod pair;
mod solid_pair;
mod tie;

pub(crate) use condensed::{Condensed, LawPoint, impulse};
pub use coupling::{Coupling, Lead};
pub use facet::{Facet, FacetGroup};
pub(crate) use facet::{FacetLinear, facet_changes, facet_law, tangential, weighted};
pub(crate) use joint_row::RowLinear;
pub(crate) use joint_row::RowPoint;
pub use joint_row::{JointFriction, JointRow, JointRowKind};
pub(crate) use meeting::meeting_changes;
pub use pair::ContactPair;
pub(crate) use pair::Touch;
pub use solid_pair::{Friction, SolidPair};
pub(crate) use solid_pair::{Sliding, SpotKey, SpotLaw, SpotLinear, SpotState, node_of, pose_of_world, spot_wrench};
pub use tie::Tie;
pub(crate) use tie::{TieLaw, TieRows};
