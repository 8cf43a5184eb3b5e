//! pliant: a differentiable physics engine for things that bend.
//!
//! A step is one root of r(y; x, u, θ) = 0; its factorization is kept; every derivative follows from it:
//! ```text
//! scene.toml ── Case ── rollout(model, θ, x₀, u) ── Rollout { states, records }
//!                            jvp: (ẋ₀, u̇, θ̇) → ẋ      vjp: x̄ → (x̄₀, ū, θ̄)      linearize: A, B, C of a step
//! logs ── identify: fit, diagnose ── which physics the scene lacks, with estimates and intervals
//! ```
//! All quantities are in SI units. θ is one flat vector of parameters with named entries (`cable.bend_stiffness`,
//! `cable.node[3].mass`, …). These numbers of a scene are not parameters: the step, the rest gap, plane normals, shape orientations,
//! joint axes and anchors, body placements, the relative orientation of a weld, edge fractions and rest shapes of meshes.
//!
//! The gradient of the height of a hanging cable's tip by all of θ, from one backward sweep:
//! ```
//! use pliant::{Case, Differentiate, StepOptions, rollout};
//!
//! let case = Case::parse(
//!     r#"
//!     schema_version = 1
//!     [time]
//!     step = 0.01
//!     duration = 0.3
//!     integrator = "midpoint"
//!     [[rope]]
//!     name = "cable"
//!     nodes = 7
//!     length = 0.5
//!     linear_density = 0.05
//!     stretch_stiffness = 500.0
//!     bend_stiffness = 1e-3
//!     initial = { shape = "straight", from = [0, 0, 0], direction = [1, 0, 0] }
//!     [[gripper]]
//!     name = "hand"
//!     rope = "cable"
//!     nodes = [0, 1]
//!     "#,
//!     "hanging.toml",
//! )?;
//! let theta = case.model.params().values();
//! let run = rollout(&case.model, theta, &case.x0, &case.controls, StepOptions::default())?;
//!
//! // L = height of the last node at the end; x = (q, v), node 6 has its z at 3·6 + 2.
//! let mut x_bar = vec![vec![0.0; case.model.ndx()]; run.states.len()];
//! x_bar[30][20] = 1.0;
//! let gradient = run.vjp(&x_bar)?;
//! let stiffness = case.model.params().find("cable.bend_stiffness").unwrap();
//! assert!(gradient.theta[stiffness] > 0.0, "a stiffer cable holds its tip higher");
//!
//! // Finite differences confirm the gradients.
//! let report = pliant::gradcheck::gradcheck(&case.model, theta, &case.x0, &case.controls, 0)?;
//! assert_eq!(report.verdict, pliant::gradcheck::Verdict::Pass);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod case;
mod differentiate;
pub mod file;
mod task;
#[cfg(feature = "pages")]
pub mod view;

/// Custom forces: a [`Law`](terms::Law), or an [`EnergyLaw`](terms::EnergyLaw) in [`FromEnergy`](terms::FromEnergy), is added to a model
/// with [`ModelBuilder::add_law`].
pub mod terms {
    pub use pliant_engine::terms::{Element, EnergyLaw, FromEnergy, Law, Real, Vec3};
}

pub use case::{Case, CaseError, start};
pub use differentiate::Differentiate;
pub use task::TaskCase;

pub use pliant_adjoint::{
    AdjointError, Linearization, Linearizer, RolloutCotangent, Surrogate, equilibrium_jvp, equilibrium_vjp, gradcheck, linearize,
    rollout_jacobians, rollout_jvp_columns, surrogate_rollout,
};
pub use pliant_control as control;
pub use pliant_engine::bodies::{Joint, JointKind, Tree};
pub use pliant_engine::equilibrium::{Equilibrium, equilibrium};
pub use pliant_engine::grasp::{Grasp, Grasping};
pub use pliant_engine::model::{BuildError, ClothSpan, Model, ModelBuilder};
pub use pliant_engine::rollout::{Along, Rollout, RolloutOptions, Smoothing, rollout};
pub use pliant_engine::step::{StepError, StepOptions, StepRecord, StepTrace, Stepper};
pub use pliant_engine::vector::{ModelCopy, VectorError, VectorStepper};
pub use pliant_identify as identify;
pub use pliant_import as import;
pub use pliant_math::State;
pub use pliant_math::params::{ParamInfo, Params};
pub use pliant_scene as scene;
