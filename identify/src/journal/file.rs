//! The file of a diagnosis that is not finished: there complete, or not at all.

use super::partial::{Partial, VERSION};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Name of the file.
pub const PROGRESS: &str = "progress.json";
/// Its name while it is written.
pub const PART: &str = "progress.json.part";

/// Time between two routine writings over the time that one takes [-], so that they take less than a hundredth of a diagnosis. Where a stage ends
/// the file is written at once.
const PAUSE: u32 = 100;

/// How a diagnosis begins.
#[derive(Clone, Debug, PartialEq)]
pub enum Begun {
    /// From its beginning.
    Anew,
    /// From its beginning, for a file that was there is of no use; why.
    Refused(String),
    /// With what an earlier run has finished.
    Resumed {
        /// Causes that it has accepted.
        causes: usize,
        /// Its time \[s\].
        seconds: f64,
    },
}

impl std::fmt::Display for Begun {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Anew => Ok(()),
            Self::Refused(why) => write!(f, "{why}: the diagnosis begins anew"),
            Self::Resumed { causes, seconds } => {
                let causes = match causes {
                    0 => "no cause".to_owned(),
                    1 => "one cause".to_owned(),
                    some => format!("{some} causes"),
                };
                write!(f, "goes on with an interrupted diagnosis, which had accepted {causes} in {seconds:.0} s")
            }
        }
    }
}

/// The progress of an earlier run with the same inputs, if the file has it.
pub(super) fn read(path: &Path, inputs: BTreeMap<String, String>) -> (Partial, Begun) {
    let anew = |inputs| Partial { inputs, ..Partial::default() };
    let refused = |inputs, why: String| (anew(inputs), Begun::Refused(format!("{}: {why}", path.display())));
    let text = match std::fs::read(path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return (anew(inputs), Begun::Anew),
        Err(error) => return refused(inputs, format!("cannot be read: {error}")),
    };
    let found: Partial = match serde_json::from_slice(&text) {
        Ok(found) => found,
        Err(error) => return refused(inputs, format!("is damaged, or of another version: {error}")),
    };
    if found.schema_version != VERSION {
        return refused(inputs, format!("has schema_version {}, and this pliant reads {VERSION}", found.schema_version));
    }
    let others = inputs.iter().filter(|(name, hash)| found.inputs.get(*name) != Some(hash)).map(|(name, _)| name);
    let gone = found.inputs.keys().filter(|name| !inputs.contains_key(*name));
    let changed: Vec<&str> = others.chain(gone).map(String::as_str).collect();
    if !changed.is_empty() {
        let why = format!("is of other inputs, changed since: {}", changed.join(", "));
        return refused(inputs, why);
    }
    let begun = Begun::Resumed { causes: found.causes.len(), seconds: found.seconds };
    (found.gone_on_from(), begun)
}

/// The place of the file, and when it was written.
pub(super) struct Place {
    path: PathBuf,
    /// When the last writing ended, and how long it took.
    last: Option<(Instant, Duration)>,
    writings: usize,
    spent: Duration,
    /// A place that refused once is not asked again: the diagnosis goes on without.
    refused: bool,
}

impl Place {
    pub fn new(path: PathBuf) -> Self {
        Self { path, last: None, writings: 0, spent: Duration::ZERO, refused: false }
    }

    pub fn written(&self) -> (usize, f64) {
        (self.writings, self.spent.as_secs_f64())
    }

    pub fn save(&mut self, so_far: &Partial, at_once: bool) {
        let began = Instant::now();
        if self.refused || !at_once && !self.last.is_none_or(|(at, took)| due(began - at, took)) {
            return;
        }
        self.refused = write(&self.path, so_far).is_err();
        let took = began.elapsed();
        (self.last, self.writings, self.spent) = (Some((Instant::now(), took)), self.writings + 1, self.spent + took);
    }

    pub fn remove(self) {
        for path in [&self.path, &self.path.with_file_name(PART)] {
            let _ = std::fs::remove_file(path);
        }
        if let Some(folder) = self.path.parent() {
            // refused where anything else is in it
            let _ = std::fs::remove_dir(folder);
        }
    }
}

/// Whether to write again, so long after a writing that took so long.
fn due(since: Duration, took: Duration) -> bool {
    since >= PAUSE * took
}

/// Writes beside the place and renames. The name beside it is always the same, so that an interrupt leaves one such file at most, which the next
/// run writes over. The disk need not have it when the program goes on: a machine that stops may leave a file that is read as damaged.
fn write(path: &Path, so_far: &Partial) -> std::io::Result<()> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let part = path.with_file_name(PART);
    std::fs::write(&part, serde_json::to_vec_pretty(so_far)?)?;
    std::fs::rename(part, path)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::Journal;
    use super::*;

    fn inputs(scene: &str) -> BTreeMap<String, String> {
        [("scene.toml", scene), ("seed", "0")].map(|(name, hash)| (name.to_owned(), hash.to_owned())).into()
    }

    #[test]
    fn writing_takes_a_hundredth_of_the_time() {
        let ms = Duration::from_millis;
        assert!(!due(ms(999), ms(10)) && due(ms(1000), ms(10)));
    }

    /// Finished stages are there again with the same inputs, and only then.
    #[test]
    fn the_same_inputs_go_on() {
        let around = tempfile::tempdir().unwrap();
        let folder = around.path().join("report");
        let open = |scene: &str| Journal::at(&folder, inputs(scene), Box::new(|_| ()));
        let (journal, begun) = open("a");
        assert_eq!((begun, folder.exists()), (Begun::Anew, false), "nothing is written before anything begins");
        journal.reaches("round", &vec![0.1, f64::NAN]);
        journal.baseline(0.003, "m");
        let (again, begun) = open("a");
        assert!(matches!(begun, Begun::Resumed { causes: 0, .. }), "{begun:?}");
        let numbers: Vec<f64> = again.reached("round").unwrap();
        assert!(numbers[0].to_bits() == 0.1f64.to_bits() && numbers[1].is_nan());
        assert_eq!(again.so_far().baseline, None, "told again on the way");
        let (other, begun) = open("b");
        assert!(begun.to_string().ends_with("changed since: scene.toml: the diagnosis begins anew"), "{begun}");
        assert!(other.so_far().states.is_empty());
        // a file that was cut short
        let path = folder.join(PROGRESS);
        let text = std::fs::read(&path).unwrap();
        std::fs::write(&path, &text[..text.len() / 2]).unwrap();
        let (_, begun) = open("a");
        assert!(begun.to_string().contains("progress.json: is damaged"), "{begun}");
        journal.remove();
        assert_eq!(std::fs::read_dir(around.path()).unwrap().count(), 0);
    }

    #[test]
    fn it_is_written_when_due_and_at_once_when_something_was_accepted() {
        let around = tempfile::tempdir().unwrap();
        let (journal, _) = Journal::at(&around.path().join("report"), inputs("a"), Box::new(|_| ()));
        journal.reaches("round", &vec![0.0; 1000]);
        for _ in 0..1000 {
            journal.says("trying");
        }
        // saying it takes no time beside writing it
        let (writings, _) = journal.written();
        assert!(writings < 300, "{writings}");
        journal.causes(|_| Vec::new());
        assert_eq!(journal.written().0, writings + 1);
        // a place that refuses does not stop the diagnosis
        let (nowhere, _) = Journal::at(Path::new("/proc/nowhere/report"), inputs("a"), Box::new(|_| ()));
        nowhere.reaches("round", &1usize);
        assert_eq!(nowhere.reached("round"), Some(1usize));
    }
}
