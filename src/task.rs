//! A task file, ready to plan.

use crate::scene::{Mistake, SceneError, Source, parse_as};
use crate::{Case, CaseError};
use pliant_control::task::{Task, TaskProblem};
use std::path::Path;

/// A task with its scene.
#[derive(Clone, Debug)]
pub struct TaskCase {
    /// The task.
    pub task: Task,
    /// Its scene.
    pub case: Case,
    /// Its cost and constraints.
    pub problem: TaskProblem,
}

impl TaskCase {
    /// Reads a task file and its scene, which stands beside it.
    ///
    /// # Errors
    /// A task or a scene that is refused.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, CaseError> {
        Self::from_source(&Source::read(path.as_ref())?)
    }

    /// Reads a task from a text; `file_name` is its name in errors, and its folder that of the scene unless `scene` is given.
    ///
    /// # Errors
    /// As [`TaskCase::read`].
    pub fn parse(text: &str, file_name: &str, scene: Option<&Source>) -> Result<Self, CaseError> {
        let source = Source::new(file_name, text);
        scene.map_or_else(|| Self::from_source(&source), |scene| Self::of_scene(parse_as(&source)?, &source, scene))
    }

    fn from_source(source: &Source) -> Result<Self, CaseError> {
        let task: Task = parse_as(source)?;
        let folder = Path::new(&source.file).parent().unwrap_or(Path::new(""));
        if task.scene.is_empty() {
            let missing = Mistake::MissingKey { key: "scene".to_owned(), unit: None };
            return Err(SceneError::at("scene", missing).located(source).into());
        }
        // a scene that is not there is the task's mistake
        let scene =
            Source::read(&folder.join(&task.scene)).map_err(|error| SceneError { place: source.place("scene"), ..error })?;
        Self::of_scene(task, source, &scene)
    }

    fn of_scene(task: Task, source: &Source, scene: &Source) -> Result<Self, CaseError> {
        let case = Case::from_source(scene)?;
        let problem = TaskProblem::new(&task, &case.scene, &case.model).map_err(|error| error.located(source))?;
        Ok(Self { task, case, problem })
    }

    /// Inputs to start from for so many steps: those of the scene's motions, their last row repeated, within the task's limits.
    pub fn first_guess(&self, steps: usize) -> Vec<Vec<f64>> {
        let nothing = vec![0.0; self.case.model.nu()];
        let last = self.case.controls.last().unwrap_or(&nothing);
        let mut rows: Vec<Vec<f64>> = self.case.controls.iter().take(steps).cloned().collect();
        rows.resize(steps, last.clone());
        rows
    }
}
