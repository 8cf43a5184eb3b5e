//! Simulating a record, and linearizing the simulation in everything unknown.
//!
//! A record is shot in segments. The state at each segment's start is an unknown of its own, joined to the end of the
//! segment before it by a continuity constraint. The constraints are condensed as the tangents are carried along: in
//! ```text
//! x_b(next) = x_b + T_b (Δz, Δφ) + a_b,     a_b = (end of the segment before) − x_b carried through the linearized dynamics
//! ```
//! the columns T are tangents of the record's own initial state z and of the common unknowns φ, and a is one more column, the
//! accumulated defects. So statistics are those of one long record, and nonlinearity that of short ones; with all defects
//! zero it is the plain simulation.

mod blend;
mod bodies;
mod constants;
mod dormant;
mod extension;
mod input_delay;
mod marker_offset;
mod observe;
mod observed;
mod own_size;
mod plan;
mod run;
mod start;
mod start_bodies;
mod stretch_prior;
mod torque;

pub(crate) use constants::SHOOTING;
pub(crate) use dormant::opened;
pub use observed::{JointPlace, MarkerPlace, NodePair, Observed, OrientationPlace};
pub use own_size::{OwnSize, own_squares, own_unknowns, pieces_by_record};
pub use plan::{OtherInputs, Plan, RecordPlan};
pub use run::{Shot, ShotWants, shoot};
pub use start::{StartState, initial_guess, state_at};
pub use torque::DrivePlace;
