//! Errors of forces of one's own.

use pliant_math::formula::FormulaError;

/// The problem.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // the fields are the words of the messages
pub enum ForceMistake {
    /// A text that is no formula.
    #[error("\"{text}\": {error}")]
    Formula { text: String, error: Box<FormulaError> },
    /// A joint without coordinates that a formula could name.
    #[error("joint \"{joint}\" is {kind}; a force of one's own acts at a revolute, prismatic or ball joint")]
    Kind { joint: String, kind: &'static str },
    /// One formula for three axes, or three for one.
    #[error("{found} formula(s) for {axes}, which needs {expected}")]
    Count { found: usize, expected: usize, axes: &'static str },
    /// A parameter that no formula could name.
    #[error("\"{name}\" cannot be the name of a parameter: {why}")]
    Parameter { name: String, why: &'static str },
    /// A parameter without effect.
    #[error("no formula has the parameter \"{name}\"")]
    Unused { name: String },
    /// More parameters than derivatives have room for.
    #[error("{found} parameters; a force {place} may have {most}")]
    Many { found: usize, most: usize, place: &'static str },
    /// Nodes of a joint.
    #[error("a joint has no nodes")]
    NodesOfJoint,
    /// A force on nothing.
    #[error("the list of nodes is empty")]
    NoNodes,
    /// The same node twice.
    #[error("node {node} is listed twice")]
    NodeTwice { node: i64 },
}

impl ForceMistake {
    /// (likely cause, fix).
    pub(super) fn advice(&self) -> (String, String) {
        let (cause, fix) = match self {
            Self::Formula { error, .. } => {
                ("the formula is not in Python's syntax, or names something that is not there", error.fix())
            }
            Self::Kind { kind: "free", .. } => {
                ("a free body has six coordinates", "hang it on three prismatic joints and a ball joint".to_owned())
            }
            Self::Kind { .. } => ("it has two axes", "write it as two revolute joints, with a force at each".to_owned()),
            Self::Count { expected: 1, .. } => ("formulas for nodes were copied", "write `formula = \"-c*v\"`".to_owned()),
            Self::Count { .. } => (
                "a formula for a joint was copied",
                "write `formula = [\"-c*vx\", \"-c*vy\", \"-c*vz\"]`, \"0\" where there is no force".to_owned(),
            ),
            Self::Parameter { .. } => (
                "a name that means something else, or that is no name",
                "use letters, digits and `_`, beginning with a letter, and no variable or function".to_owned(),
            ),
            Self::Unused { name } => ("a typing error, or a formula that was changed", format!("use `{name}`, or remove it")),
            Self::Many { .. } => {
                ("a long series", "write numbers that are known into the formula, or make two forces of it".to_owned())
            }
            Self::NodesOfJoint => ("a force on nodes was copied", "remove `nodes`".to_owned()),
            Self::NoNodes => {
                ("an empty list", "write e.g. `nodes = [-1]`, or remove `nodes` for a force on the whole of it".to_owned())
            }
            Self::NodeTwice { .. } => {
                ("it is listed twice, perhaps once as a negative number", "list every node once".to_owned())
            }
        };
        (cause.to_owned(), fix)
    }
}
