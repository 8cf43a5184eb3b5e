//! A report from its files: the page written again, and its figures as files.

use super::error::ReportError;
use super::reproduce::{self, Provenance};
use super::{curves, page, shapes, stages};
use crate::diagnose::{Diagnosis, SCHEMA_VERSION};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Colours of a figure outside the page, on white.
const STYLE: &str = "<style>text { fill: #5d6773; font: 12px system-ui, sans-serif; } .name { fill: #1b1f24; font-size: 14px; } \
     .grid { stroke: #eceff2; } path { fill: none; stroke-width: 2; stroke-linejoin: round; } .before { stroke: #d2691e; } \
     .after { stroke: #1f6feb; } .measured { fill: #3b444f; } .pale { opacity: .28; } .held { fill: #1f6feb; } \
     .fit { fill: #1f6feb; opacity: .4; } .noise { stroke: #3b444f; stroke-dasharray: 4 4; }</style>\
     <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>";

/// A diagnosis that was written, and how it was made.
#[derive(Clone, Debug)]
pub struct Saved {
    /// The diagnosis.
    pub diagnosis: Diagnosis,
    /// Its provenance; empty where no `reproduce.toml` lies beside it.
    pub provenance: Provenance,
    /// The folder that it lies in.
    folder: PathBuf,
}

impl Saved {
    /// Reads the folder of a report, or the JSON of a diagnosis (that of `pliant diagnose --json` as well).
    ///
    /// # Errors
    /// Files that are missing, that are no diagnosis, or that another version wrote.
    pub fn read(path: &Path) -> Result<Self, ReportError> {
        let file = if path.is_dir() { path.join("diagnosis.json") } else { path.to_owned() };
        let text =
            |file: &Path| std::fs::read_to_string(file).map_err(|source| ReportError::Absent { path: file.to_owned(), source });
        let foreign = |what: String| ReportError::Foreign { path: file.clone(), what };
        let value: serde_json::Value = serde_json::from_str(&text(&file)?).map_err(|e| foreign(e.to_string()))?;
        match value.get("schema_version").and_then(serde_json::Value::as_u64) {
            Some(version) if version == u64::from(SCHEMA_VERSION) => {}
            Some(version) => return Err(foreign(format!("schema_version {version}, and this pliant reads {SCHEMA_VERSION}"))),
            None => return Err(foreign("no schema_version".to_owned())),
        }
        let diagnosis = serde_json::from_value(value).map_err(|e| foreign(e.to_string()))?;
        let folder = file.parent().map_or_else(PathBuf::new, Path::to_owned);
        let made = folder.join("reproduce.toml");
        let provenance = match made.exists() {
            true => {
                let read = reproduce::read(&text(&made)?, &folder);
                read.map_err(|e| ReportError::Foreign { path: made, what: e.message().to_owned() })?
            }
            false => Provenance::default(),
        };
        Ok(Self { diagnosis, provenance, folder })
    }

    /// Writes the page again, as `report.html` beside the JSON; returns its path.
    ///
    /// # Errors
    /// A file system that refuses; the old page then stays.
    pub fn write_page(&self) -> Result<PathBuf, ReportError> {
        let path = self.folder.join("report.html");
        whole(&path, &page::page(&self.diagnosis, &self.provenance)?)?;
        Ok(path)
    }

    /// Writes the page's figures as SVG files into a folder, which is made if it is not there; returns their paths.
    ///
    /// # Errors
    /// A file system that refuses.
    pub fn write_figures(&self, folder: &Path) -> Result<Vec<PathBuf>, ReportError> {
        std::fs::create_dir_all(folder).map_err(|error| ReportError::write(folder, error))?;
        let write = |(name, svg): (String, String)| {
            let path = folder.join(name);
            whole(&path, &svg).map(|()| path)
        };
        self.figures().into_iter().map(write).collect()
    }

    /// Name and text of each of the page's figures as an SVG file of its own.
    pub fn figures(&self) -> Vec<(String, String)> {
        figures(&self.diagnosis)
    }
}

/// Name and text of every figure as a file of its own.
fn figures(d: &Diagnosis) -> Vec<(String, String)> {
    let of = |kind: &str, figures: Vec<shapes::Figure>| -> Vec<(String, String)> {
        let drawn =
            figures.iter().flat_map(|f| f.svg.to_string().split_inclusive("</svg>").map(str::to_owned).collect::<Vec<_>>());
        drawn.enumerate().map(|(k, svg)| (format!("{kind}_{}.svg", k + 1), svg)).collect()
    };
    let bars = stages::bars(&d.stages, d.noise.sigma, &d.remainder.unit);
    let all = [("stages.svg".to_owned(), bars)].into_iter().chain(of("shape", shapes::figures(&d.snapshots)));
    let all = all.chain(of("curve", curves::figures(&d.curves))).filter(|(_, svg)| svg.contains("<svg"));
    all.map(|(name, svg)| (name, alone(&svg))).collect()
}

/// A figure of the page with its own colours.
fn alone(svg: &str) -> String {
    let svg = svg.replacen("<svg", "<svg xmlns=\"http://www.w3.org/2000/svg\"", 1);
    match svg.split_once('>') {
        Some((head, body)) => format!("{head}>{STYLE}{body}\n"),
        None => svg,
    }
}

/// Writes a file that is there whole or as it was.
fn whole(path: &Path, text: &str) -> Result<(), ReportError> {
    let at = |error| ReportError::write(path, error);
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666)); // less the umask
    }
    // the kind alone: the path in the error would be the temporary one
    let mut file = builder.tempfile_in(folder).map_err(|error| at(error.kind().into()))?;
    file.write_all(text.as_bytes()).map_err(at)?;
    file.persist(path).map(drop).map_err(|error| at(error.error))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::{json, sample, write_report};
    use super::*;

    fn written() -> (tempfile::TempDir, PathBuf) {
        let around = tempfile::tempdir().unwrap();
        let path = around.path().join("report");
        let command = ["pliant", "diagnose", "scene.toml"].map(str::to_owned).to_vec();
        let provenance = Provenance { command, seed: 7, threads: 2, ..Provenance::default() };
        write_report(&path, &sample::diagnosis(), &sample::setup(), &provenance).unwrap();
        (around, path)
    }

    #[test]
    fn the_page_is_the_same_again() {
        let (_around, path) = written();
        let first = std::fs::read_to_string(path.join("report.html")).unwrap();
        std::fs::write(path.join("report.html"), "spoilt").unwrap();
        let saved = Saved::read(&path).unwrap();
        assert_eq!(saved.write_page().unwrap(), path.join("report.html"));
        assert_eq!(std::fs::read_to_string(path.join("report.html")).unwrap(), first);
        assert_eq!(json::text(&saved.diagnosis).unwrap(), json::text(&sample::diagnosis()).unwrap());
    }

    #[test]
    fn figures_stand_alone() {
        let (around, path) = written();
        let out = around.path().join("a/figures");
        let files = Saved::read(&path.join("diagnosis.json")).unwrap().write_figures(&out).unwrap();
        assert!(files.len() >= 2, "{files:?}");
        for file in files {
            let text = std::fs::read_to_string(&file).unwrap();
            assert!(text.starts_with("<svg xmlns=") && text.trim_end().ends_with("</svg>"), "{text}");
            assert_eq!(text.matches("<svg").count(), 1);
        }
    }

    #[test]
    fn missing_readings_stay_missing() {
        let (_around, path) = written();
        let mut holed = sample::diagnosis();
        holed.curves[0].measured[0] = [f64::NAN; 3];
        std::fs::write(path.join("diagnosis.json"), json::text(&holed).unwrap()).unwrap();
        assert!(Saved::read(&path).unwrap().diagnosis.curves[0].measured[0][1].is_nan());
    }

    #[test]
    fn what_is_no_diagnosis_is_refused() {
        let (_around, path) = written();
        let json = path.join("diagnosis.json");
        let refused = |text: &str| {
            std::fs::write(&json, text).unwrap();
            let error = Saved::read(&path).unwrap_err();
            assert!(error.is_input());
            error.to_string()
        };
        assert!(refused("{").contains("diagnosis.json"));
        assert!(refused("{}").contains("no schema_version"));
        assert!(refused("{\"schema_version\": 1}").contains("schema_version 1, and this pliant reads 2"));
        assert!(refused("{\"schema_version\": 2}").contains("missing field"));
        std::fs::remove_file(&json).unwrap();
        assert!(Saved::read(&path).unwrap_err().to_string().contains("cannot be read"));
    }
}
