//! The house: dependencies run one way, smoothing ← engine ← adjoint ← identify ← pliant ← py.
//!
//! Cargo refuses a circle of dependencies, but neither an arrow that goes the wrong way once, nor one among the
//! `dev-dependencies`, nor a source that reaches into the validation. This test does.

#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

/// The crates from the ground up: folder of the manifest, name of the package, folders with its sources. Each may use those
/// before it, and none may use those after it.
const HOUSE: [(&str, &str, &[&str]); 6] = [
    ("smoothing", "pliant-smoothing", &["smoothing"]),
    ("engine", "pliant-engine", &["engine"]),
    ("adjoint", "pliant-adjoint", &["adjoint"]),
    ("identify", "pliant-identify", &["identify"]),
    (".", "pliant", &["src", "examples", "tests"]),
    ("py", "pliant-py", &["py"]),
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Files with one of the extensions, at any depth; build outputs and hidden folders are left out.
fn files(folder: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    let mut out = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            if name != "target" && !name.starts_with('.') {
                out.extend(files(&path, extensions));
            }
        } else if path.extension().is_some_and(|e| extensions.iter().any(|wanted| e == *wanted)) {
            out.push(path);
        }
    }
    out.sort();
    out
}

/// Packages of the house under every kind of dependency of a manifest.
fn dependencies(manifest: &str) -> Vec<&'static str> {
    let mut found = Vec::new();
    let mut in_dependencies = false;
    for line in manifest.lines().map(str::trim) {
        if let Some(section) = line.strip_prefix('[') {
            let section = section.trim_end_matches(']');
            in_dependencies = section.contains("dependencies") && !section.starts_with("workspace");
            // [dependencies.pliant-engine]
            found.extend(HOUSE.iter().map(|c| c.1).filter(|name| in_dependencies && section.ends_with(&format!(".{name}"))));
        } else if in_dependencies {
            let key = line.split(['=', '.', ' ']).next().unwrap_or("");
            found.extend(HOUSE.iter().map(|c| c.1).filter(|name| *name == key));
        }
    }
    found
}

/// The code of a Rust source: its lines without comments.
fn code(text: &str) -> String {
    text.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n")
}

/// Whether `text` has `word` as a whole identifier followed by a path.
fn names(text: &str, word: &str) -> bool {
    text.match_indices(word).any(|(at, _)| {
        let before = text[..at].chars().next_back();
        !before.is_some_and(|c| c.is_alphanumeric() || c == '_') && text[at + word.len()..].starts_with("::")
    })
}

#[test]
fn no_manifest_points_up() {
    for (floor, (folder, package, _)) in HOUSE.iter().enumerate() {
        let manifest = fs::read_to_string(root().join(folder).join("Cargo.toml")).unwrap();
        for dependency in dependencies(&manifest) {
            let level = HOUSE.iter().position(|c| c.1 == dependency).unwrap();
            assert!(level < floor, "{package} depends on {dependency}, which lies above it");
        }
    }
}

#[test]
fn no_source_points_up() {
    for (floor, (_, package, folders)) in HOUSE.iter().enumerate() {
        for path in folders.iter().flat_map(|f| files(&root().join(f), &["rs"])) {
            let text = code(&fs::read_to_string(&path).unwrap());
            for (_, above, _) in &HOUSE[floor + 1..] {
                let above_name = above.replace('-', "_");
                assert!(!names(&text, &above_name), "{} of {package} uses {above}", path.display());
            }
        }
    }
}

#[test]
fn nothing_in_the_product_uses_the_validation() {
    for folder in ["smoothing", "engine", "adjoint", "identify", "src", "examples", "py"] {
        for path in files(&root().join(folder), &["rs", "py", "pyi"]) {
            let text = fs::read_to_string(&path).unwrap();
            for (number, line) in text.lines().enumerate() {
                let line = line.split("//").next().unwrap_or("").trim();
                let uses = line.starts_with("import validation")
                    || line.starts_with("from validation")
                    || (line.contains("include") && line.contains("validation/"));
                assert!(!uses, "{}:{} uses the validation", path.display(), number + 1);
            }
        }
    }
}

#[test]
fn the_theorem_has_one_minus_and_knows_no_physics() {
    let adjoint = root().join("adjoint/src");
    let users: Vec<_> =
        files(&adjoint, &["rs"]).into_iter().filter(|path| fs::read_to_string(path).unwrap().contains("fn negate(")).collect();
    assert_eq!(users, [adjoint.join("implicit.rs")]);
    for path in files(&adjoint, &["rs"]) {
        let text = code(&fs::read_to_string(&path).unwrap());
        for law in ["BendLaw", "StretchLaw", "DragLaw", "GravityLaw", "pliant_smoothing::linearize"] {
            assert!(!text.contains(law), "{} names {law}: physics belongs into the engine", path.display());
        }
    }
}

#[test]
fn the_checks_see_what_they_are_for() {
    let manifest = "[package]\nname = \"x\"\n[dev-dependencies]\npliant-identify.workspace = true\nserde = \"1\"\n[dependencies.pliant-engine]\npath = \"..\"";
    assert_eq!(dependencies(manifest), ["pliant-identify", "pliant-engine"]);
    assert!(names("use pliant_identify::fit;", "pliant_identify"));
    assert!(!names("use pliant_identify::fit;", "pliant"));
    assert!(!names(&code("// pliant_identify::fit"), "pliant_identify"));
}
