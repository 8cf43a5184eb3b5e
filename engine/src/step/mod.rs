//! One step: integrators as sequences of stages, retries, and the record of what was solved.

mod blame;
mod blocks;
mod bodies;
mod body_inputs;
pub(crate) mod central_path;
mod constants;
mod constraints;
mod energy_check;
mod error;
mod frozen;
mod impact_check;
pub(crate) mod newton;
mod node_energy_check;
mod options;
mod record;
mod scheme;
mod stage;
mod stepper;
mod system;
mod system_rows;
mod workspace;

pub(crate) use bodies::end_positions;
pub use error::StepError;
pub use node_energy_check::LastHalves;
pub(crate) use node_energy_check::Run;
pub(crate) use options::SolverOptions;
pub use record::StageRecord;
pub use scheme::{EULER, MIDPOINT, QUASI_STATIC, SDIRK_GAMMA, STATIC, Scheme, Weights};
pub(crate) use stage::{Iterate, Masses, Stage};
pub(crate) use stepper::check_size;
pub use stepper::{Retry, StageKind, StepOptions, StepRecord, StepTrace, Stepper};
pub use system::NodeBlock;
pub use workspace::{Warm, Workspace};
