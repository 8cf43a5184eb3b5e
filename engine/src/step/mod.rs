//! One step: integrators as sequences of stages, retries, and the record of what was solved.

mod bodies;
mod body_inputs;
mod contact_inverse;
mod contact_rows;
mod error;
mod facet_rows;
mod facets;
mod frozen;
mod guard;
mod joint_rows;
mod node_guard;
mod rebound;
mod record;
mod scheme;
mod spot_forces;
mod spot_products;
mod spot_rows;
mod spots;
mod stage;
mod stepper;
mod workspace;

pub(crate) use bodies::end_positions;
pub use error::StepError;
pub use record::StageRecord;
pub use scheme::{EULER, MIDPOINT, QUASI_STATIC, SDIRK_GAMMA, STATIC, Scheme, Weights};
pub(crate) use spots::{WEIGHT as SOLID_WEIGHT, pose as solid_pose};
pub(crate) use stage::{Measure, Stage};
pub(crate) use stepper::check_size;
pub use stepper::{Link, StepOptions, StepRecord, StepTrace, Stepper};
pub use workspace::{Warm, Workspace};
