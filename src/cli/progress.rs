//! Progress on stderr: a spinner on a terminal, now and then a line elsewhere.

use super::print;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Time between two lines where there is no terminal.
const PAUSE: Duration = Duration::from_secs(10);

/// Shows progress messages until it is dropped.
pub struct Progress {
    spinner: Option<ProgressBar>,
    last: Mutex<Option<Instant>>,
}

impl Progress {
    /// Begins; nothing is shown yet.
    pub fn start() -> Self {
        let spinner = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new_spinner();
            if let Ok(style) = ProgressStyle::with_template("{spinner} {elapsed:>4} {wide_msg}") {
                bar.set_style(style);
            }
            bar.enable_steady_tick(Duration::from_millis(120));
            bar
        });
        Self { spinner, last: Mutex::new(None) }
    }

    /// Shows a message.
    pub fn tell(&self, what: &str) {
        if let Some(spinner) = &self.spinner {
            return spinner.set_message(what.to_owned());
        }
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if last.is_none_or(|last| last.elapsed() >= PAUSE) {
            print::message(what);
            *last = Some(Instant::now());
        }
    }

    /// Shows a line that stays.
    pub fn note(&self, what: &str) {
        match &self.spinner {
            Some(spinner) => spinner.suspend(|| print::message(what)),
            None => print::message(what),
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(spinner) = &self.spinner {
            spinner.finish_and_clear();
        }
    }
}
