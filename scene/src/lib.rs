//! Scene files: schema, reading and validation.
//!
//! ```text
//! text ── keys against the JSON Schema ── serde ── check ── Scene ── initial_state, control_rows
//! ```
//! Every error names the place (file, line, field), the mistake, the likely cause and the fix.
//!
//! ```
//! use pliant_scene::{Nothing, parse_scene};
//! let text = "
//! schema_version = 1
//! [time]
//! step = 0.01
//! [[rope]]
//! name = \"cable\"
//! nodes = 13
//! lenght = 1.0
//! ";
//! let error = parse_scene::<Nothing>(text, "scene.toml").unwrap_err().to_string();
//! assert!(error.starts_with("scene.toml:8: rope[0].lenght: unknown key `lenght`"));
//! assert!(error.ends_with("fix: did you mean `length`?"));
//! ```

#![allow(rustdoc::broken_intra_doc_links)] // `[m]` is a unit here, and its escape would be read in the schema's descriptions

mod actuator;
mod advice;
mod body;
mod cable;
mod check;
mod clip;
mod cloth;
mod cloth_error;
mod cloth_initial;
mod coupling;
mod error;
mod file;
mod force;
mod force_error;
mod gripper;
mod held;
mod initial;
mod keys;
mod material;
mod mesh;
mod motion;
mod obj;
mod parabola;
mod place;
mod read;
mod refine;
mod refine_cloth;
mod rod;
mod rope;
mod schema;
mod shape;
mod source;
mod table;
mod vector;
pub mod words;
mod write;

pub use actuator::{Actuator, ActuatorKind, Command};
pub use body::{Body, Cogging, Joint, JointKind, Presliding};
pub use body::{Closure, ClosureKind};
pub use cable::{Cable, cable_scene};
pub use check::{MOST_NODES, MOST_STEPS, available_memory, check, warnings};
pub use check::{RESERVED, inertia_matrix};
pub use clip::Clip;
pub use cloth::{Cloth, Diagonal, Grid};
pub use cloth_error::ClothMistake;
pub use coupling::Coupling;
pub use error::{Mistake, SceneError};
pub use file::{Air, Contact, Gravity, Integrator, Law, LinearSolver, Nothing, SCHEMA_VERSION, Scene, Solver, Time};
pub use force::{Force, Formulas, MOST_AT_JOINT, MOST_ON_NODES};
pub use force_error::ForceMistake;
pub use gripper::{Clamp, End, Grasp, Gripper, Mode, Motion};
pub use held::Held;
pub use initial::initial_state;
pub use mesh::Mesh;
pub use mesh::Raw;
pub use motion::{Control, control_list, control_rows, resting_inputs};
pub use place::Place;
pub use read::{parse_as, parse_scene, parse_source, read_scene};
pub use refine::Refined;
pub use rod::RodStart;
pub use rope::{
    BendFriction, Creep, Initial, JointSection, NodeMass, Plasticity, Rest, Rope, Start, Stiffening, Touching, Twist,
};
pub use schema::json_schema;
pub use shape::{Block, BodyShape, Capsule, ContactRule, Cylinder, Plane, ShapeKind, Sphere};
pub use source::Source;
pub use write::to_toml;
