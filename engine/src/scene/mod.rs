//! Scene files: what a scene is, reading it, and refusing what makes no sense.

mod file;
mod gripper;
mod rope;
mod shape;

pub use file::{Air, Contact, Gravity, Integrator, Law, LinearSolver, Nothing, SCHEMA_VERSION, Scene, Solver, Time};
pub use gripper::{Clamp, End, Gripper, Mode, Motion};
pub use rope::{Initial, NodeMass, Rope, Start};
pub use shape::{Capsule, Plane, Sphere};
