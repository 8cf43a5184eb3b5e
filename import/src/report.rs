//! Outcome of every element: kept, approximated or ignored, and why.

use super::element::Element;
use serde::Serialize;
use std::fmt::Write;

/// Outcome of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The scene holds its meaning.
    Kept,
    /// The scene holds something like it.
    Approximated,
    /// The scene does without it.
    Ignored,
}

/// One line of a report.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Entry {
    /// File.
    pub file: String,
    /// Line, counted from 1.
    pub line: usize,
    /// Tag of the element.
    pub element: String,
    /// Name in the scene if it is there, otherwise in the file; may be empty.
    pub name: String,
    /// Name in the file, if it is another one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub original: Option<String>,
    /// Its outcome.
    pub verdict: Verdict,
    /// The reason, or the replacement.
    pub reason: String,
}

/// Outcomes of all elements of a model.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Report {
    /// Version of this format; 1.
    pub schema_version: u32,
    /// Format of the model, `mjcf` or `urdf`.
    pub format: &'static str,
    /// The model's file.
    pub source: String,
    /// One or more per element, in the order of reading.
    pub entries: Vec<Entry>,
}

impl Report {
    /// Nothing yet.
    pub fn new(format: &'static str, source: String) -> Self {
        Self { schema_version: 1, format, source, entries: Vec::new() }
    }

    /// Adds a line on an element.
    pub fn add(&mut self, element: &Element, name: &str, verdict: Verdict, reason: impl Into<String>) {
        let original = element.label();
        self.entries.push(Entry {
            file: element.file.to_string(),
            line: element.line,
            element: element.tag.clone(),
            name: name.to_owned(),
            original: (!original.is_empty() && original != name).then(|| original.to_owned()),
            verdict,
            reason: reason.into(),
        });
        element.mark();
    }

    /// Number of lines of that verdict.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.entries.iter().filter(|e| e.verdict == verdict).count()
    }

    /// Lines grouped by verdict, ignored elements first.
    pub fn text(&self) -> String {
        let mut out = String::new();
        for (verdict, title) in [(Verdict::Ignored, "ignored"), (Verdict::Approximated, "approximated"), (Verdict::Kept, "kept")]
        {
            let count = self.count(verdict);
            if count == 0 {
                continue;
            }
            let _ = writeln!(out, "{title} ({count})");
            for entry in self.entries.iter().filter(|e| e.verdict == verdict) {
                let name = match (&entry.name, &entry.original) {
                    (name, _) if name.is_empty() => String::new(),
                    (name, None) => format!(" \"{name}\""),
                    (name, Some(original)) => format!(" \"{name}\" (\"{original}\" in the file)"),
                };
                let _ = writeln!(out, "  {}:{}: {}{name}: {}", entry.file, entry.line, entry.element, entry.reason);
            }
        }
        out.trim_end().to_owned()
    }
}
