//! The engine: model → step → record → rollout. It never runs time backwards; the adjoint does, over its records.
//!
//! **The problem.** A stage of length h is one root of
//! ```text
//! m (v⁺ − v)/h − Σ f(q̄, v̄; θ) − p(q⁺, v⁺, w)/h = 0      free nodes: inertia, forces, contact impulses      [N]
//! v⁺ − v_cmd(q, u; θ)                           = 0      prescribed nodes: what a gripper commands             [m/s]
//! F_κ(w; gap(q⁺)/h, v_t⁺, μ)                    = 0      every contact: the smoothed law of friction       [N·s]
//! ```
//! in v⁺ and the contacts' cone variables w ∈ R⁴. The integrator says where q̄, v̄ and q⁺ lie ([`step`]).
//!
//! **The flow.**
//! 1. a scene file is read and checked ([`pliant_scene`]) and built into an immutable [`model`] with its [`params`](pliant_math::params) θ;
//! 2. forces accumulate from [`terms`], gaps come from [`geometry`], commanded velocities from [`kinematics`];
//! 3. each contact is condensed into a force on its node, and Newton's method solves what is left with the factors of [`pliant_linalg`];
//! 4. at the root the matrix is assembled and factored once more and kept, with the root, in a record;
//! 5. a [`rollout`](rollout::rollout) is steps in a row, a [`vector`] steps many copies at once; [`equilibrium`] solves the same forces at rest.
//!
//! A rope let go falls as one, whatever its springs are; the midpoint rule is exact there:
//! ```
//! use pliant_engine::{model::ModelBuilder, rollout::rollout, step::StepOptions};
//! use pliant_scene as scene;
//! use std::sync::Arc;
//!
//! let text = r#"
//! schema_version = 1
//! [time]
//! step = 0.01
//! duration = 0.1
//! integrator = "midpoint"
//! [[rope]]
//! name = "cable"
//! nodes = 5
//! length = 0.5
//! linear_density = 0.05
//! stretch_stiffness = 500.0
//! bend_stiffness = 1e-3
//! initial = { shape = "straight", from = [0, 0, 0], direction = [1, 0, 0] }
//! "#;
//! let scene: scene::Scene = scene::parse_scene(text, "falling.toml")?;
//! let model = Arc::new(ModelBuilder::new(&scene)?.build());
//! let x0 = model.initial_state();
//! let controls = scene::control_rows(&scene, scene.time.n_steps())?;
//! let run = rollout(&model, model.params().values(), &x0, &controls, StepOptions::default())?;
//! for node in run.states[10].v.chunks(3) {
//!     assert!((node[2] + 9.81 * 0.1).abs() < 1e-9);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod bodies;
mod constraints;
pub mod equilibrium;
pub mod geometry;
pub mod grasp;
pub mod kinematics;
pub mod memory;
pub mod model;
pub mod rods;
pub mod rollout;
pub mod step;
pub mod terms;
pub mod vector;

pub use constraints::{ContactPair, Coupling, JointFriction, JointRow, JointRowKind, Lead};
pub use step::newton::{Attempt, Work};
