//! Failures of a command: place, mistake, likely cause and fix; and its exit code.

use super::inputs::InputsError;
use pliant::control::closed_loop::LoopError;
use pliant::control::plan::PlanError;
use pliant::control::robust::RobustError;
use pliant::control::sensing::SensingError;
use pliant::identify::IdentifyError;
use pliant::identify::log::LogError;
use pliant::identify::report::ReportError;
use pliant::import::ImportError;
use pliant::scene::SceneError;
use pliant::view::ViewError;
use pliant::{AdjointError, BuildError, CaseError, StepError};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// A failure of the command.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The scene is refused.
    #[error("error: {0}")]
    Scene(#[from] SceneError),
    /// A model of another format is refused.
    #[error("error: {0}")]
    Import(#[from] ImportError),
    /// The experiment or a log is refused.
    #[error("error: {0}")]
    Log(#[from] LogError),
    /// The scene cannot be built.
    #[error("error: {scene}: {source}\n  likely cause: {}\n  fix: {}", .advice.0, .advice.1, scene = .scene.display())]
    Case { scene: PathBuf, source: Box<CaseError>, advice: (&'static str, &'static str) },
    /// A step or an equilibrium failed.
    #[error("error: {scene}: {source}\n  likely cause: {}\n  fix: {}", .advice.0, .advice.1, scene = .scene.display())]
    Step { scene: PathBuf, source: Box<StepError>, advice: (&'static str, &'static str) },
    /// A derivative failed.
    #[error("error: {scene}: {source}\n  likely cause: an internal error\n  fix: report this as a bug", scene = .scene.display())]
    Adjoint { scene: PathBuf, source: AdjointError },
    /// A fit or a diagnosis failed.
    #[error("error: {scene}: {source}\n  likely cause: {}\n  fix: {}", .advice.0, .advice.1, scene = .scene.display())]
    Identify { scene: PathBuf, source: Box<IdentifyError>, advice: (&'static str, &'static str) },
    /// A control log is refused.
    #[error("error: {0}")]
    Inputs(#[from] InputsError),
    /// There is no plan.
    #[error("error: {task}: {source}\n  likely cause: {}\n  fix: {}", .advice.0, .advice.1, task = .task.display())]
    Plan { task: PathBuf, source: Box<PlanError>, advice: (&'static str, &'static str) },
    /// A closed loop ended early.
    #[error("error: {task}: {source}\n  likely cause: {}\n  fix: {}", .advice.0, .advice.1, task = .task.display())]
    Loop { task: PathBuf, source: Box<LoopError>, advice: (&'static str, &'static str) },
    /// A plant of another size.
    #[error("error: {plant}: {what}\n  likely cause: a scene with other objects or grippers\n  fix: give a scene that differs from the task's in its numbers alone", plant = .plant.display())]
    Plant { plant: PathBuf, what: String },
    /// The report cannot be written.
    #[error("error: {0}")]
    Report(#[from] ReportError),
    /// An output cannot be written.
    #[error("error: {path}: cannot be written: {source}\n  likely cause: {cause}\n  fix: {fix}", path = .path.display())]
    Write { path: PathBuf, source: std::io::Error, cause: &'static str, fix: &'static str },
    /// No scene can be made of a model and its logs.
    #[error("error: {place}: {what}\n  likely cause: {cause}\n  fix: {fix}")]
    Init { place: String, what: String, cause: &'static str, fix: String },
    /// An output of an unknown kind.
    #[error("error: {path}: ends neither in .csv nor in .npz\n  likely cause: another format was meant\n  fix: write `--out {stem}.csv` or `--out {stem}.npz`", path = .path.display(), stem = .path.with_extension("").display())]
    Kind { path: PathBuf },
    /// A control log of another kind.
    #[error("error: {path}: does not end in .csv\n  likely cause: another format was meant\n  fix: write `--inputs {stem}.csv`", path = .path.display(), stem = .path.with_extension("").display())]
    InputsKind { path: PathBuf },
    /// A page of another kind.
    #[error("error: {path}: does not end in .html\n  likely cause: another format was meant\n  fix: write `--view {stem}.html`", path = .path.display(), stem = .path.with_extension("").display())]
    PageKind { path: PathBuf },
    /// A page cannot be made.
    #[error("error: {path}: {source}", path = .path.display())]
    View { path: PathBuf, source: ViewError },
    /// Pictures of a program that draws none.
    #[cfg(not(feature = "png"))]
    #[error(
        "error: figures as PNG: this pliant was built without them\n  likely cause: the feature `png` is not a default\n  fix: build it with `cargo install --path . --features png`, or write the figures with `--svg`"
    )]
    NoPictures,
    /// Pictures without a font.
    #[cfg(feature = "png")]
    #[error(
        "error: figures as PNG: there is no font for their texts\n  likely cause: a machine without fonts, as a container is\n  fix: install fonts (such as `fonts-dejavu-core`), or write the figures with `--svg`, which needs none"
    )]
    Fonts,
    /// A figure that cannot be drawn.
    #[cfg(feature = "png")]
    #[error("error: {path}: cannot be drawn: {what}\n  likely cause: a mistake in pliant's own figures\n  fix: report this as a bug; `--svg` writes the figure itself", path = .path.display())]
    Picture { path: PathBuf, what: String },
    /// A check did not pass; its report has been printed.
    #[error("{0}")]
    NotPassed(String),
    /// A check that judges only a part; its report has been printed.
    #[error("{0}")]
    Inconclusive(String),
}

impl Failure {
    /// 1 numerics, 2 input, 3 an inconclusive check.
    pub fn exit_code(&self) -> ExitCode {
        let numerics = match self {
            Self::Inconclusive(_) => return ExitCode::from(3),
            Self::Case { source, .. } => matches!(&**source, CaseError::Start(step) if !is_input(step)),
            Self::Step { source, .. } => !is_input(source),
            Self::Adjoint { .. } | Self::View { .. } | Self::NotPassed(_) => true,
            #[cfg(feature = "png")]
            Self::Picture { .. } => true,
            Self::Identify { source, .. } => !source.is_input(),
            Self::Plan { source, .. } => !is_input_of_plan(source),
            Self::Loop { .. } => true,
            Self::Report(error) => !error.is_input(),
            _ => false,
        };
        ExitCode::from(if numerics { 1 } else { 2 })
    }

    /// A scene that cannot be made ready.
    pub fn case(scene: &Path, source: CaseError) -> Self {
        match source {
            CaseError::Scene(error) => Self::Scene(error),
            CaseError::Start(ref step) => Self::Case { scene: scene.to_owned(), advice: advice(step), source: Box::new(source) },
            CaseError::Build(_) => {
                let advice =
                    ("a force acts on a node the scene does not have", "compare the node's number with the rope's nodes");
                Self::Case { scene: scene.to_owned(), advice, source: Box::new(source) }
            }
        }
    }

    /// A step that failed.
    pub fn step(scene: &Path, source: StepError) -> Self {
        Self::Step { scene: scene.to_owned(), advice: advice(&source), source: Box::new(source) }
    }

    /// A derivative that failed, often because a step did.
    pub fn adjoint(scene: &Path, source: AdjointError) -> Self {
        match source {
            AdjointError::Step(step) => Self::step(scene, step),
            source => Self::Adjoint { scene: scene.to_owned(), source },
        }
    }

    /// A fit or a diagnosis that failed.
    pub fn identify(scene: &Path, source: IdentifyError) -> Self {
        let advice = match &source {
            IdentifyError::Build(BuildError::Scene(error)) => return Self::Scene(error.clone()),
            IdentifyError::Log(error) => return Self::Log(error.clone()),
            IdentifyError::Simulation { source, .. } => advice(source),
            IdentifyError::Input(_) | IdentifyError::Build(_) => {
                ("the scene does not match its logs", "correct the entry that the error names")
            }
            IdentifyError::DeadParameter { .. } => {
                ("the motion does not excite it", "fix its value, or move the rope differently")
            }
            IdentifyError::Stats(_) => ("too few samples, or channels that never change", "record longer, and with more motion"),
            IdentifyError::NotConverged { .. } => {
                ("starting values far from the truth", "start closer to the truth, or free fewer parameters")
            }
        };
        Self::Identify { scene: scene.to_owned(), source: Box::new(source), advice }
    }

    /// A plan that cannot be made.
    pub fn plan(task: &Path, source: PlanError) -> Self {
        Self::Plan { task: task.to_owned(), advice: advice_on_plan(&source), source: Box::new(source) }
    }

    /// A controller that cannot be made.
    pub fn controller(task: &Path, source: RobustError) -> Self {
        match source {
            RobustError::Plan(source) => Self::plan(task, source),
            other => Self::looped(task, LoopError::Controller { step: 0, failures: 1, source: other }),
        }
    }

    /// A closed loop that ended early.
    pub fn looped(task: &Path, source: LoopError) -> Self {
        let advice = match &source {
            LoopError::Start { .. } => ("the plant is not ready", "start it before the controller"),
            LoopError::Plant { .. } => (
                "the inputs lead where the plant's scene cannot be simulated",
                "shorten `time.step`, bound the inputs more narrowly, or look ahead further with `--horizon`",
            ),
            LoopError::Controller { source: RobustError::Plan(source), .. } => advice_on_plan(source),
            LoopError::Controller { source: RobustError::Sensing(SensingError::Step(step)), .. } => advice(step),
            LoopError::Controller { source: RobustError::Sensing(_), .. } => {
                ("sensors that do not fit the plant's scene", "correct `sensing` in the task")
            }
            LoopError::Controller { .. } => {
                ("the disturbance is too large for the constraints", "lower `--disturbance`, or plan without `--tubes`")
            }
        };
        Self::Loop { task: task.to_owned(), advice, source: Box::new(source) }
    }

    /// Stdout cannot be written; files that were written before are complete.
    pub fn stdout(source: std::io::Error) -> Self {
        let (cause, fix) = match source.kind() {
            std::io::ErrorKind::StorageFull | std::io::ErrorKind::QuotaExceeded => {
                ("the destination is full; files written before are complete", "free some space, or redirect it")
            }
            _ => ("the destination refuses it; files written before are complete", "redirect it"),
        };
        Self::Write { path: "stdout".into(), source, cause, fix }
    }

    /// A file or folder that cannot be written.
    pub fn write(path: &Path, source: std::io::Error) -> Self {
        use std::io::ErrorKind as E;
        let (cause, fix) = match source.kind() {
            E::StorageFull | E::QuotaExceeded => {
                ("the disk is full; nothing was left behind", "free some space, or write to another disk")
            }
            E::NotFound => ("the folder does not exist", "create it, or correct the path"),
            E::PermissionDenied | E::ReadOnlyFilesystem => ("the folder may not be written to", "choose another folder"),
            E::NotADirectory | E::IsADirectory => ("a file and a folder are mixed up", "correct the path"),
            _ => ("the file system refused", "choose another folder"),
        };
        Self::Write { path: path.to_owned(), source, cause, fix }
    }
}

/// Whether the input is to blame, not the numerics.
fn is_input(step: &StepError) -> bool {
    matches!(
        step,
        StepError::Command { .. }
            | StepError::Size { .. }
            | StepError::Memory { .. }
            | StepError::EquilibriumWithContact { .. }
            | StepError::Frames { .. }
            | StepError::Parameter { .. }
    )
}

/// Whether the input is to blame, not the numerics.
fn is_input_of_plan(error: &PlanError) -> bool {
    match error {
        PlanError::Guess(step) | PlanError::Adjoint(AdjointError::Step(step)) => is_input(step),
        PlanError::Inputs { .. }
        | PlanError::Empty
        | PlanError::Problem(_)
        | PlanError::Bounds { .. }
        | PlanError::Memory { .. } => true,
        PlanError::Adjoint(_) | PlanError::NotFinite { .. } | PlanError::Step(_) | PlanError::Hold { .. } => false,
    }
}

/// (likely cause, fix).
fn advice_on_plan(error: &PlanError) -> (&'static str, &'static str) {
    match error {
        PlanError::Guess(step) | PlanError::Adjoint(AdjointError::Step(step)) => advice(step),
        PlanError::Hold { .. } => (
            "a gripper far from what it may seize, whose weight would not be carried so",
            "begin nearer to it, or plan without the value of holding (`--no-holding`)",
        ),
        PlanError::Adjoint(_) => ("an internal error", "report this as a bug"),
        PlanError::NotFinite { .. } => {
            ("a weight, a goal or a price of an extreme size", "check the weights and prices of the task")
        }
        PlanError::Step(_) => (
            "weights and prices of very different sizes, or a rollout whose derivatives grow without bound",
            "choose weights of like size, or plan fewer steps with `--steps`",
        ),
        PlanError::Inputs { .. } | PlanError::Empty => ("inputs of another scene", "give one row of inputs per step"),
        PlanError::Memory { .. } => ("more steps than this machine has memory for", "plan fewer steps (`--steps`)"),
        PlanError::Problem(_) => ("a cost that has no value at this state", "check the task's costs and limits"),
        PlanError::Bounds { .. } => ("two limits of the same input", "correct `lower` and `upper` in the task"),
    }
}

/// (likely cause, fix).
fn advice(step: &StepError) -> (&'static str, &'static str) {
    match step {
        StepError::NotConverged { .. } => (
            "the motion is too fast, or a rope, a spring or a servo too stiff, for this step",
            "shorten `time.step`, or raise `solver.max_iterations` and `solver.max_halvings`",
        ),
        StepError::EnergyCreated { .. } => (
            "the step is too long for the stiffest element, and its substeps did not converge either",
            "shorten `time.step`, soften the stiffness, or raise `solver.max_halvings`",
        ),
        StepError::NotFinite { .. } => (
            "edges of length zero, a rope folded onto itself, a state that is not finite, or an extreme parameter",
            "check the initial shape and that parameter",
        ),
        StepError::Singular { .. } => {
            ("a part of the rope is unsupported, or a stiffness is zero", "add a gripper or a stiffness, or start \"as_given\"")
        }
        StepError::Command { .. } => ("a gripper is given an impossible target", "check the gripper's inputs at that step"),
        StepError::Geometry { .. } => {
            ("a node sits at the centre or on the axis of a shape", "start the rope outside the shape, or shorten `time.step`")
        }
        StepError::NoNormal { .. } => (
            "a body went through another within a step, or they overlap as the scene begins",
            "shorten `time.step`, or move them apart",
        ),
        StepError::ContactNotFinite { .. } => {
            ("an extreme size, mass, friction or compliance", "check the parameters of the two objects")
        }
        StepError::Frames { .. } => {
            ("positions of a rod were changed without its frames", "use the frames that `frames_at` returns for these positions")
        }
        StepError::Memory { .. } => ("many bodies and many steps", "simulate fewer steps, or keep fewer records"),
        StepError::Size { .. } => ("inputs of another scene", "give as many as the scene has"),
        StepError::EquilibriumWithContact { .. } => {
            ("`start = \"equilibrium\"` in a scene with shapes", "write `start = \"as_given\"`, or remove the shapes")
        }
        StepError::Parameter { .. } => ("a wrong unit or sign", "give a value inside its range"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_stdout_does_not_deny_the_files() {
        let text = Failure::stdout(std::io::ErrorKind::StorageFull.into()).to_string();
        assert!(text.contains("files written before are complete") && !text.contains("nothing was left"), "{text}");
    }
}
