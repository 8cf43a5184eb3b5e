//! The engine of pliant.

mod contact;
pub mod equilibrium;
pub mod geometry;
pub mod kinematics;
pub mod kkt;
pub mod model;
mod newton;
pub mod params;
pub mod rollout;
pub mod scene;
pub mod state;
pub mod step;
pub mod terms;

pub use contact::ContactPair;
pub use newton::Work;
