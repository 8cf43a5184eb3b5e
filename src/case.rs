//! A scene, ready to run.

use crate::scene::{self, Scene, SceneError, Source};
use crate::{BuildError, Model, ModelBuilder, State, StepError, equilibrium};
use std::path::Path;
use std::sync::Arc;

/// A scene with its model, initial state and controls.
#[derive(Clone, Debug)]
pub struct Case {
    /// The scene.
    pub scene: Scene,
    /// Its model.
    pub model: Arc<Model>,
    /// Initial state at the scene's parameters; see [`start`].
    pub x0: State,
    /// One row of inputs for each step of the scene's duration.
    pub controls: Vec<Vec<f64>>,
    /// Warnings of things that are allowed but likely not meant, or cost more than one may expect; located if the scene was read.
    pub warnings: Vec<SceneError>,
}

/// A scene that cannot be made ready.
#[derive(Clone, Debug, thiserror::Error)]
pub enum CaseError {
    /// It is refused.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A custom term does not fit.
    #[error(transparent)]
    Build(BuildError),
    /// Its initial equilibrium is not found.
    #[error("initial equilibrium: {0}")]
    Start(StepError),
}

impl From<BuildError> for CaseError {
    fn from(error: BuildError) -> Self {
        match error {
            BuildError::Scene(error) => Self::Scene(error),
            other => Self::Build(other),
        }
    }
}

impl Case {
    /// Reads a scene file.
    ///
    /// # Errors
    /// A scene that is refused, or whose initial equilibrium is not found.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, CaseError> {
        Self::from_source(&Source::read(path.as_ref())?)
    }

    /// Reads a scene from a text; `file_name` is its name in errors.
    ///
    /// # Errors
    /// As [`Case::read`].
    pub fn parse(text: &str, file_name: &str) -> Result<Self, CaseError> {
        Self::from_source(&Source::new(file_name, text))
    }

    /// Mistakes that only the model can find, such as an overlap, are located in the file too.
    pub(crate) fn from_source(source: &Source) -> Result<Self, CaseError> {
        let mut case = Self::new(scene::parse_source(source)?).map_err(|error| match error {
            CaseError::Scene(error) => CaseError::Scene(error.located(source)),
            other => other,
        })?;
        case.warnings = case.warnings.into_iter().map(|warning| warning.located(source)).collect();
        Ok(case)
    }
}

impl Case {
    /// Builds the model of a scene.
    ///
    /// # Errors
    /// As [`Case::read`].
    pub fn new(scene: Scene) -> Result<Self, CaseError> {
        let model = Arc::new(ModelBuilder::new(&scene)?.build());
        let u = scene::resting_inputs(&scene)?;
        let x0 = start(&model, model.params().values(), &u).map_err(CaseError::Start)?;
        let controls = scene::control_rows(&scene, scene.time.n_steps())?;
        Ok(Self { warnings: scene::warnings(&scene), scene, model, x0, controls })
    }
}

/// The initial state: as the scene gives it, or the equilibrium at θ with the grippers at the inputs `u` if it asks for one.
///
/// # Errors
/// An equilibrium that is not found, or asked for in a scene with contact.
pub fn start(model: &Arc<Model>, theta: &[f64], u: &[f64]) -> Result<State, StepError> {
    let mut start = model.initial_state();
    if model.starts_at_equilibrium() {
        let found = equilibrium(model, theta, &start.q, u)?;
        start.z[model.ndz()..].copy_from_slice(&found.frames);
        start.q = found.q;
    }
    Ok(start)
}
