//! The progress of a diagnosis: states that it can go on from after an interrupt, and its messages.
//!
//! A diagnosis is a fixed sequence of computations on its inputs. One that was interrupted is made again from its beginning, and takes from here
//! what it had finished: its last pass, its search, or the state of that after the last round. The rest is the same by construction. A state is
//! kept only if it is read back as it was.
//!
//! A plan carries the journal; one that nobody asked for keeps nothing.

mod file;
mod left;
mod partial;
mod words;

pub use file::{Begun, PART, PROGRESS};
pub use partial::{BaselineSoFar, CauseSoFar, NumberSoFar, Partial};
pub(crate) use words::words;
pub use words::{Words, read, written};

use file::Place;
use left::Counted;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// Called with a line for people whenever there is something new.
pub type Tell = Box<dyn Fn(&str) + Send + Sync>;

/// Finished stages of a diagnosis, and how far it is.
#[derive(Default)]
pub struct Journal {
    kept: Option<Kept>,
}

struct Kept {
    state: Mutex<State>,
    tell: Tell,
}

/// The part that changes while a diagnosis runs.
struct State {
    so_far: Partial,
    /// Seconds of earlier runs.
    earlier: f64,
    began: Instant,
    counted: Option<Counted>,
    round: Option<Round>,
    place: Option<Place>,
}

/// A round of the search: one cause more is sought.
struct Round {
    number: usize,
    most: usize,
    began: Instant,
}

impl std::fmt::Debug for Journal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Journal").field("kept", &self.kept.is_some()).finish()
    }
}

impl Journal {
    /// A journal in memory, with what another one has of the same diagnosis.
    pub fn new(kept: Partial, tell: Tell) -> Arc<Self> {
        Self::of(kept.gone_on_from(), None, tell)
    }

    /// The journal of a diagnosis of these `inputs` (name and hash of each), kept in the file [`PROGRESS`] of a folder, which is made if it is
    /// not there; and how it begins.
    pub fn at(folder: &Path, inputs: BTreeMap<String, String>, tell: Tell) -> (Arc<Self>, Begun) {
        let path: PathBuf = folder.join(PROGRESS);
        let (so_far, begun) = file::read(&path, inputs);
        (Self::of(so_far, Some(Place::new(path)), tell), begun)
    }

    fn of(so_far: Partial, place: Option<Place>, tell: Tell) -> Arc<Self> {
        let (earlier, began) = (so_far.seconds, Instant::now());
        let state = State { so_far, earlier, began, counted: None, round: None, place };
        Arc::new(Self { kept: Some(Kept { state: Mutex::new(state), tell }) })
    }

    /// Whether anything is kept.
    pub fn keeps(&self) -> bool {
        self.kept.is_some()
    }

    /// A state of this name that was reached with the present simulation.
    pub fn reached<T: Words>(&self, name: &str) -> Option<T> {
        let state = self.state()?;
        read(words::of_text(state.so_far.states.get(&state.name(name))?)?)
    }

    /// Keeps a state, in place of an earlier one of its name.
    pub fn reaches(&self, name: &str, reached: &impl Words) {
        let words = self.keeps().then(|| words::text(&written(reached)));
        self.change(true, |state| {
            let name = state.name(name);
            state.so_far.states.extend(words.map(|words| (name, words)));
        });
    }

    /// The progress of the diagnosis, with all that is kept.
    pub fn so_far(&self) -> Partial {
        self.state().map_or_else(Partial::default, |state| state.so_far.clone())
    }

    /// Number of writings of its file, and the seconds that they took.
    pub fn written(&self) -> (usize, f64) {
        self.state().and_then(|state| state.place.as_ref().map(Place::written)).unwrap_or_default()
    }

    /// A stage begins.
    pub fn says(&self, stage: &str) {
        self.change(false, |state| {
            stage.clone_into(&mut state.so_far.stage);
            state.counted = None;
        });
    }

    /// The diagnosis is made (once more) with this simulation.
    pub fn pass(&self, finer: Option<String>) {
        self.change(true, |state| {
            (state.so_far.finer, state.so_far.baseline) = (finer, None);
            state.so_far.causes.clear();
            state.round = None;
        });
    }

    /// The baseline is fitted.
    pub fn baseline(&self, rmse: f64, unit: &str) {
        self.change(true, |state| state.so_far.baseline = Some(BaselineSoFar { rmse, unit: unit.to_owned() }));
    }

    /// These causes are accepted.
    pub fn causes(&self, causes: impl FnOnce(&[CauseSoFar]) -> Vec<CauseSoFar>) {
        self.change(true, |state| state.so_far.causes = causes(&state.so_far.causes));
    }

    /// A round begins, of at most so many; none: the search is over.
    pub fn round(&self, round: Option<(usize, usize)>) {
        self.change(true, |state| {
            if let Some(last) = state.round.take() {
                state.so_far.finished_round(last.number, last.began.elapsed().as_secs_f64());
            }
            state.round = round.map(|(number, most)| Round { number, most, began: Instant::now() });
        });
    }

    /// So many things of a kind begin, so many of them side by side.
    pub fn counts(&self, what: &'static str, of: usize, beside: usize) {
        self.change(false, |state| state.counted = Some(Counted { what, of, beside, done: 0, began: Instant::now() }));
    }

    /// One of them is done.
    pub fn one_done(&self) {
        self.change(false, |state| state.counted.iter_mut().for_each(|counted| counted.done += 1));
    }

    /// Removes its file, and the folder if nothing else is in it.
    pub fn remove(&self) {
        if let Some(place) = self.state().and_then(|mut state| state.place.take()) {
            place.remove();
        }
    }

    fn state(&self) -> Option<MutexGuard<'_, State>> {
        // what is kept is whole between two statements, also where another thread has panicked
        self.kept.as_ref().map(|kept| kept.state.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn change(&self, save: bool, change: impl FnOnce(&mut State)) {
        let (Some(kept), Some(mut state)) = (&self.kept, self.state()) else { return };
        change(&mut state);
        state.so_far.left = state.left();
        state.save(save);
        let line = state.line();
        drop(state);
        (kept.tell)(&line);
    }
}

impl State {
    /// The name of a state with the present simulation.
    fn name(&self, name: &str) -> String {
        self.so_far.finer.as_ref().map_or_else(|| name.to_owned(), |finer| format!("{name} with {finer}"))
    }

    /// Writes the file, at once or when it is due.
    fn save(&mut self, at_once: bool) {
        self.so_far.seconds = self.earlier + self.began.elapsed().as_secs_f64();
        if let Some(place) = &mut self.place {
            place.save(&self.so_far, at_once);
        }
    }

    fn left(&self) -> String {
        let round = self.round.as_ref().map(|round| (round.number, round.most));
        let last = round.and_then(|(number, _)| self.so_far.rounds.get(number.checked_sub(2)?).copied());
        let counted = self.counted.as_ref().map(|counted| (counted, counted.began.elapsed().as_secs_f64()));
        left::sentence(round, last, counted)
    }

    fn line(&self) -> String {
        let Partial { stage, left, .. } = &self.so_far;
        if left.is_empty() { stage.clone() } else { format!("{stage} ({left})") }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// A journal that nobody asked for keeps nothing.
    #[test]
    fn the_default_keeps_nothing() {
        let journal = Journal::default();
        journal.reaches("round", &1usize);
        journal.says("working");
        assert!(!journal.keeps() && journal.reached::<usize>("round").is_none());
        assert_eq!(journal.so_far(), Partial::default());
    }

    #[test]
    fn it_tells_how_far_it_is() {
        let lines = Arc::new(Mutex::new(Vec::new()));
        let told = Arc::clone(&lines);
        let journal = Journal::new(Partial::default(), Box::new(move |line| told.lock().unwrap().push(line.to_owned())));
        journal.says("fitting the baseline");
        journal.baseline(0.003, "m");
        journal.round(Some((1, 6)));
        journal.round(Some((2, 6)));
        journal.says("trying wind");
        journal.counts("causes", 3, 1);
        journal.one_done();
        let lines = lines.lock().unwrap().clone();
        assert_eq!(lines[0], "fitting the baseline");
        let last = &lines[lines.len() - 1];
        assert!(last.starts_with("trying wind (round 2 of at most 6, the last took "), "{last}");
        assert!(last.contains("2 of 3 causes to go, less than 1 s"), "{last}");
        let so_far = journal.so_far();
        assert_eq!((so_far.baseline.unwrap().rmse, so_far.rounds.len(), so_far.stage.as_str()), (0.003, 1, "trying wind"));
        // a state is one of the simulation that it was reached with
        journal.reaches("search", &7usize);
        journal.pass(Some("a step of 0.001 s".to_owned()));
        assert_eq!((journal.so_far().baseline, journal.reached::<usize>("search")), (None, None));
        journal.reaches("search", &8usize);
        assert_eq!((journal.reached("search"), journal.so_far().states.len()), (Some(8usize), 2));
    }
}
