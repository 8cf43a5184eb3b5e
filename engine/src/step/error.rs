//! Why a step failed.

use crate::geometry::GeometryError;
use crate::kinematics::CommandError;
use pliant_linalg::KktError;

/// Why a step, a rollout or an equilibrium failed.
#[derive(Clone, Debug, thiserror::Error)]
pub enum StepError {
    /// Newton's method did not converge.
    #[error(
        "step {step}: not converged after {iterations} iterations: correction {correction:.3e} m/s, largest residual {residual:.3e} N \
         in row {row} ({place}), where `{term}` is the largest force; a shorter step or softer stiffness may help"
    )]
    NotConverged {
        /// Step number, from 0.
        step: usize,
        /// Newton iterations of the last attempt.
        iterations: usize,
        /// Norm of the last Newton correction [m/s].
        correction: f64,
        /// Largest entry of the residual \[N\].
        residual: f64,
        /// Its row.
        row: usize,
        /// The node and axis, or the joint, of that row.
        place: String,
        /// The term with the largest force in that row.
        term: String,
    },
    /// A step creates energy however often it is halved.
    #[error(
        "step {step}: creates {created:.3e} J where {at_hand:.3e} J are at hand, halved as often as is allowed; it grows most in `{term}`; \
         a shorter step or softer stiffness may help"
    )]
    EnergyCreated {
        /// Step number, from 0.
        step: usize,
        /// Energy created by its substeps at the halving limit, and by those of the steps right before it that had such substeps \[J\].
        created: f64,
        /// Kinetic and elastic energy, and weight times extent, as the first of them begins \[J\].
        at_hand: f64,
        /// The inner force whose energy grows most, or `contact`.
        term: String,
    },
    /// Records that do not fit into memory.
    #[error(
        "the records of {records} steps with {dofs} degrees of freedom of bodies take at least {bytes} bytes, and {available} are free; \
         keep fewer of them (`max_records`), or none where no derivatives are wanted"
    )]
    Memory {
        /// Records that would be kept at once.
        records: usize,
        /// Degrees of freedom of bodies, whose matrices are dense.
        dofs: usize,
        /// Bytes that they take at least.
        bytes: u64,
        /// Bytes that are free.
        available: u64,
    },
    /// A number became infinite or NaN.
    #[error("step {step}: `{term}` gives {value:e} at {place}; the state or a parameter has left the range where it is defined")]
    NotFinite {
        /// Step number.
        step: usize,
        /// The term that made it, or `state`.
        term: String,
        /// Node and axis, or joint.
        place: String,
        /// The number.
        value: f64,
    },
    /// The matrix of the step is singular.
    #[error("step {step}: {source}")]
    Singular {
        /// Step number.
        step: usize,
        /// The factorization's message.
        source: KktError,
    },
    /// A command could not be computed.
    #[error("step {step}: {source}")]
    Command {
        /// Step number.
        step: usize,
        /// The gripper's message.
        source: CommandError,
    },
    /// A node is where its distance to a shape has no direction.
    #[error("step {step}: node {node} and shape `{shape}`: {source}")]
    Geometry {
        /// Step number.
        step: usize,
        /// Node.
        node: usize,
        /// Shape.
        shape: String,
        /// The shape's message.
        source: GeometryError,
    },
    /// Two colliders are where their distance has no direction.
    #[error(
        "step {step}: `{first}` and `{second}` are {distance:e} m apart at their middles or axes, where their contact has no normal; \
         one has gone through the other: a shorter step helps, or a start where they do not overlap"
    )]
    NoNormal {
        /// Step number.
        step: usize,
        /// One solid.
        first: String,
        /// The other.
        second: String,
        /// The distance that is too small \[m\].
        distance: f64,
    },
    /// The impulse between two colliders became infinite or NaN.
    #[error(
        "step {step}: the impulse between `{first}` and `{second}` is {value}; the state or a parameter has left the range where contact is defined"
    )]
    ContactNotFinite {
        /// Step number.
        step: usize,
        /// One solid.
        first: String,
        /// The other.
        second: String,
        /// Size of the impulse.
        value: f64,
    },
    /// The reference axes in z do not belong to the positions.
    #[error(
        "step {step}: the reference axis of {place} is no unit vector across its edge; positions were changed without the axes that \
         belong to them: change states by their tangents, or take the axes of `frames_at`"
    )]
    Frames {
        /// Step number.
        step: usize,
        /// The edge.
        place: String,
    },
    /// An input has the wrong size.
    #[error("{what} has {got} entries, but the model needs {expected}")]
    Size {
        /// Which input.
        what: &'static str,
        /// Its size.
        got: usize,
        /// The right size.
        expected: usize,
    },
    /// Equilibrium was asked of a scene with contact.
    #[error(
        "an equilibrium with contact is not unique under friction (shape `{shape}` is present): simulate until everything rests, or remove the shape"
    )]
    EquilibriumWithContact {
        /// A shape of the model.
        shape: String,
    },
    /// A parameter is outside its physical range.
    #[error("parameter `{path}` is {value} {unit}, outside its physical range [{lower}, {upper}]")]
    Parameter {
        /// Path.
        path: String,
        /// Value given.
        value: f64,
        /// Unit.
        unit: &'static str,
        /// Smallest admissible value.
        lower: f64,
        /// Largest admissible value.
        upper: f64,
    },
}

impl StepError {
    /// The same error at step `k` of a rollout.
    pub fn at_step(mut self, k: usize) -> Self {
        match &mut self {
            Self::NotConverged { step, .. }
            | Self::EnergyCreated { step, .. }
            | Self::NotFinite { step, .. }
            | Self::Singular { step, .. }
            | Self::Command { step, .. }
            | Self::NoNormal { step, .. }
            | Self::ContactNotFinite { step, .. }
            | Self::Frames { step, .. }
            | Self::Geometry { step, .. } => *step = k,
            Self::Size { .. } | Self::Memory { .. } | Self::EquilibriumWithContact { .. } | Self::Parameter { .. } => {}
        }
        self
    }
}
