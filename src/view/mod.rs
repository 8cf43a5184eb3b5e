//! A run as one page with a 3-D view of it, which needs no network.
//!
//! ```text
//! states ── frames: which of them ── draw: ropes, cloths, bodies, shapes ── numbers: f32, base64
//!                                         │ picture: the header (JSON)             │
//!                                         └────────── page/index.html ─────────────┘
//! ```
//! The page draws by a small WebGL renderer of its own (`page/*.js`); nothing here knows about pixels. Positions are taken relative to
//! a centre, so that single precision shows them to a ten-millionth of their distance from it.

mod draw;
mod error;
mod frames;
mod numbers;
mod picture;

pub use error::ViewError;

use crate::{Model, Rollout, State};
use frames::chosen;
use minijinja::{Environment, Value, context};
use numbers::Numbers;
use std::path::Path;

/// A trajectory to show.
#[derive(Clone, Copy, Debug)]
pub struct Run<'a> {
    /// The model.
    pub model: &'a Model,
    /// The parameters it ran with.
    pub theta: &'a [f64],
    /// States x₀ … x_T, a step of the model apart.
    pub states: &'a [State],
}

impl<'a> From<&'a Rollout> for Run<'a> {
    fn from(run: &'a Rollout) -> Self {
        Self { model: &run.model, theta: &run.theta, states: &run.states }
    }
}

/// Origin of a run, as its page states it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Caption {
    /// Title: the scene's name.
    pub title: String,
    /// The scene file's name, if there is one.
    pub scene: String,
    /// The command that made the page.
    pub command: String,
}

/// A page, and how much of the run it shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Page {
    /// The text of the HTML file.
    pub html: String,
    /// Frames in it.
    pub frames: usize,
    /// States of the run.
    pub states: usize,
}

impl Page {
    /// Says that states were left out, if some were.
    pub fn left_out(&self) -> Option<String> {
        (self.frames < self.states).then(|| picture::left_out(self.frames, self.states))
    }
}

/// Whether a file's name is that of a page: it ends in `.html`.
pub fn is_page(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("html"))
}

/// The page of a run.
///
/// # Errors
/// A run without states; anything else is a mistake in the page's own template.
pub fn page<'a>(run: impl Into<Run<'a>>, caption: &Caption) -> Result<Page, ViewError> {
    let run = run.into();
    if run.states.is_empty() {
        return Err(ViewError::NoStates);
    }
    let frames = chosen(run.states.len(), run.model.step_length(), draw::numbers_per_frame(run.model));
    let mut numbers = Numbers::default();
    let picture = draw::picture(&run, &frames, caption, &mut numbers);
    let html = fill(&picture.to_script()?, &numbers.to_base64(), caption)?;
    Ok(Page { html, frames: frames.len(), states: run.states.len() })
}

/// Files of the page, in the order in which they stand in it.
const SCRIPTS: [&str; 10] = [
    include_str!("page/vector.js"),
    include_str!("page/data.js"),
    include_str!("page/batch.js"),
    include_str!("page/solids.js"),
    include_str!("page/tube.js"),
    include_str!("page/gpu.js"),
    include_str!("page/camera.js"),
    include_str!("page/stage.js"),
    include_str!("page/controls.js"),
    include_str!("page/main.js"),
];

/// Header and numbers in their places in the page.
fn fill(header: &str, numbers: &str, caption: &Caption) -> Result<String, ViewError> {
    let mut environment = Environment::new();
    // The name ends in .html, so every text is escaped.
    environment.add_template("index.html", include_str!("page/index.html"))?;
    let context = context! {
        title => caption.title,
        scene => caption.scene,
        command => caption.command,
        version => env!("CARGO_PKG_VERSION"),
        style => Value::from_safe_string(include_str!("page/style.css").to_owned()),
        header => Value::from_safe_string(header.to_owned()),
        numbers => Value::from_safe_string(numbers.to_owned()),
        script => Value::from_safe_string(SCRIPTS.concat()),
    };
    Ok(environment.get_template("index.html")?.render(context)?)
}
