//! The layers: dependencies of crates run one way, and within each crate those of its modules.
//!
//! Cargo refuses a cycle of crates, but neither a dependency that points up once, nor one among the `dev-dependencies`, nor a
//! source that reaches into the validation, nor a cycle of modules. These tests do.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The crates from the bottom up: folder of the manifest, name of the package, folders with its sources. Each may use those
/// before it, and none may use those after it.
const LAYERS: [(&str, &str, &[&str]); 11] = [
    ("math", "pliant-math", &["math"]),
    ("linalg", "pliant-linalg", &["linalg"]),
    ("smoothing", "pliant-smoothing", &["smoothing"]),
    ("scene", "pliant-scene", &["scene"]),
    ("engine", "pliant-engine", &["engine"]),
    ("import", "pliant-import", &["import"]),
    ("adjoint", "pliant-adjoint", &["adjoint"]),
    ("control", "pliant-control", &["control"]),
    ("identify", "pliant-identify", &["identify"]),
    (".", "pliant", &["src", "examples", "tests"]),
    ("py", "pliant-py", &["py"]),
];

/// The modules of each crate from the bottom up: source folder, and its top-level modules, each of which may use those before it. `lib`
/// stands for the items of `lib.rs` itself.
const MODULES: [(&str, &str); 9] = [
    ("math/src", "lib input params formula simd state dihedral spatial inertia rotation transport"),
    (
        "linalg/src",
        "lib constants buffer error layout matrix pivot band method panel prescribed dense multifrontal symbolic factor \
         products square coupling system",
    ),
    ("smoothing/src", "lib bounded schedule law natural split"),
    (
        "scene/src",
        "lib place words cloth_error force_error error advice shape body clip rope gripper coupling vector source mesh \
         obj cloth actuator force file cloth_initial parabola initial held rod check cable keys material motion \
         schema read table refine_cloth refine write",
    ),
    ("engine/src", "lib geometry bodies constraints memory terms rods grasp kinematics model step equilibrium rollout vector"),
    (
        "import/src",
        "constants pose inertia mesh element error advice report imported names view xml paths solid work mjcf urdf lib",
    ),
    (
        "adjoint/src",
        "lib constants seeds implicit stage step linearization inverse tangent linearize rollout \
         equilibrium gradcheck surrogate",
    ),
    (
        "control/src",
        "lib constants kernels linear qp ocp tube observer conformal sensing problem task plan mpc robust output mppi closed_loop",
    ),
    ("identify/src", "lib sensor stats form unknown number log error journal shooting causes fit audit diagnose report"),
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

/// Packages of the workspace under every kind of dependency of a manifest.
fn dependencies(manifest: &str) -> Vec<&'static str> {
    let mut found = Vec::new();
    let mut in_dependencies = false;
    for line in manifest.lines().map(str::trim) {
        if let Some(section) = line.strip_prefix('[') {
            let section = section.trim_end_matches(']');
            in_dependencies = section.contains("dependencies") && !section.starts_with("workspace");
            // [dependencies.pliant-engine]
            found.extend(LAYERS.iter().map(|c| c.1).filter(|name| in_dependencies && section.ends_with(&format!(".{name}"))));
        } else if in_dependencies {
            let key = line.split(['=', '.', ' ']).next().unwrap_or("");
            found.extend(LAYERS.iter().map(|c| c.1).filter(|name| *name == key));
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

/// Rust code without comments, and with empty strings: the rest names only items that the compiler reads.
fn bare(text: &str) -> String {
    let (mut out, mut rest) = (String::new(), text);
    while let Some(c) = rest.chars().next() {
        let skip = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            rest.find("*/").map_or(rest.len(), |end| end + 2)
        } else if let Some(raw) = rest.strip_prefix("r#\"") {
            raw.find("\"#").map_or(rest.len(), |end| end + 5)
        } else if c == '"' {
            let mut escaped = false;
            let end = rest[1..].find(|c| {
                let ends = c == '"' && !escaped;
                escaped = c == '\\' && !escaped;
                ends
            });
            end.map_or(rest.len(), |end| end + 2)
        } else if let Some(quote) = ["'\"'", "'{'", "'}'", "'\\''"].into_iter().find(|q| rest.starts_with(q)) {
            quote.len()
        } else {
            out.push(c);
            rest = &rest[c.len_utf8()..];
            continue;
        };
        out.push(' ');
        rest = &rest[skip..];
    }
    out
}

/// Where the item that begins at `from` ends: behind its semicolon, or behind its braces.
fn end_of_item(code: &str, from: usize) -> usize {
    let mut depth = 0;
    for (at, c) in code[from..].char_indices() {
        match c {
            ';' if depth == 0 => return from + at + 1,
            '{' => depth += 1,
            '}' if depth == 1 => return from + at + 1,
            '}' => depth -= 1,
            _ => {}
        }
    }
    code.len()
}

/// The code without items under `#[cfg(test)]`, and the modules among them that have a file of their own.
fn without_tests(mut code: String) -> (String, Vec<String>) {
    const TEST: &str = "#[cfg(test)]";
    let mut modules = Vec::new();
    while let Some(at) = code.find(TEST) {
        let end = end_of_item(&code, at + TEST.len());
        let item = code[at + TEST.len()..end].trim();
        modules.extend(item.strip_prefix("mod ").and_then(|m| m.strip_suffix(';')).map(|m| m.trim().to_owned()));
        code.replace_range(at..end, "");
    }
    (code, modules)
}

/// First identifiers behind a path's `::`: one, or those of a group in braces.
fn first_names(after: &str) -> Vec<String> {
    let name = |text: &str| text.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    let after = after.trim_start();
    let Some(group) = after.strip_prefix('{') else { return vec![name(after)] };
    let (mut names, mut depth, mut start) = (Vec::new(), 0, 0);
    for (at, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth > 0 => depth -= 1,
            ',' | '}' if depth == 0 => {
                names.push(name(&group[start..at]));
                start = at + 1;
                if c == '}' {
                    break;
                }
            }
            _ => {}
        }
    }
    names.retain(|n| !n.is_empty());
    names
}

/// Names that a source `depth` modules below its crate's root takes from the root: behind `crate::`, and behind enough of `super::`.
fn names_from_root(code: &str, depth: usize) -> Vec<String> {
    let mut out = Vec::new();
    let starts = |at: usize| !code[..at].chars().next_back().is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':');
    for (at, word) in code.match_indices("crate::").chain(code.match_indices("super::")).filter(|(at, _)| starts(*at)) {
        let mut rest = &code[at + word.len()..];
        let mut ups = 1;
        while let Some(further) = rest.strip_prefix("super::") {
            rest = further;
            ups += 1;
        }
        if word == "crate::" || ups >= depth {
            out.extend(first_names(rest));
        }
    }
    out
}

/// The modules that a crate's `lib.rs` takes the names from that it re-exports, and its own items.
fn root_names(lib: &str) -> (BTreeMap<String, String>, String) {
    let (mut from, mut own, mut rest) = (BTreeMap::new(), String::new(), lib);
    while let Some(at) = rest.find("use ") {
        let end = end_of_item(rest, at);
        let end = if rest[at..end].contains('{') { at + rest[at..].find(';').unwrap_or(0) + 1 } else { end };
        let path = &rest[at + 4..end - 1];
        if let Some((module, names)) = path.trim_start_matches("self::").split_once("::") {
            let words = names.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|w| !w.is_empty());
            from.extend(words.map(|word| (word.to_owned(), module.to_owned())));
        }
        own.push_str(&rest[..at]);
        rest = &rest[end..];
    }
    own.push_str(rest);
    (from, own)
}

/// Whether a path in the code begins with the module, or with `crate::` or `self::` and the module.
fn begins_a_path(code: &str, module: &str) -> bool {
    code.match_indices(&format!("{module}::")).any(|(at, _)| {
        let before = &code[..at];
        let inside = before.ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':');
        !inside || before.ends_with("crate::") || before.ends_with("self::")
    })
}

/// The code of a crate's sources without that of tests, by their paths below its folder.
fn codes_of(sources: &BTreeMap<String, String>) -> BTreeMap<&String, String> {
    let mut tests = BTreeSet::new();
    let mut codes = BTreeMap::new();
    for (path, text) in sources {
        let (code, modules) = without_tests(bare(text));
        let folder = path.trim_end_matches(".rs").trim_end_matches("/mod").trim_end_matches("lib").trim_end_matches("main");
        for module in modules {
            let base = if folder.is_empty() { module } else { format!("{folder}/{module}") };
            tests.extend([format!("{base}.rs"), format!("{base}/mod.rs")]);
        }
        codes.insert(path, code);
    }
    codes.retain(|path, _| !tests.contains(path.as_str()));
    codes
}

/// Constants of the code that are real numbers.
fn lone_numbers(code: &str) -> Vec<String> {
    let items = code.match_indices("const ").filter_map(|(at, word)| code[at + word.len()..].split_once(':'));
    let is_real = |kind: &str| ["f64", "[f64"].iter().any(|real| kind.trim_start().starts_with(real));
    let constants = items.filter(|(name, kind)| is_real(kind) && name.chars().all(|c| c.is_alphanumeric() || c == '_'));
    constants.map(|(name, _)| name.to_owned()).collect()
}

type Graph = BTreeMap<String, BTreeSet<String>>;

/// Which top-level module uses which, from the sources of a crate by their paths below its folder.
fn module_graph(sources: &BTreeMap<String, String>) -> Graph {
    let codes = codes_of(sources);
    let module_of = |path: &str| path.split('/').next().unwrap_or("").trim_end_matches(".rs").to_owned();
    let modules: BTreeSet<String> = codes.keys().map(|path| module_of(path)).collect();
    let (handed_on, own) = codes.get(&"lib.rs".to_owned()).map(|code| root_names(code)).unwrap_or_default();
    let module_named = |name: &str| {
        let module = handed_on.get(name).filter(|m| modules.contains(*m)).cloned().unwrap_or_else(|| name.to_owned());
        if modules.contains(&module) { module } else { "lib".to_owned() }
    };
    let mut graph: Graph = modules.iter().map(|module| (module.clone(), BTreeSet::new())).collect();
    for (path, code) in &codes {
        let module = module_of(path);
        let used: Vec<String> = if module == "lib" {
            modules.iter().filter(|m| begins_a_path(&own, m)).cloned().collect()
        } else {
            let depth = path.trim_end_matches(".rs").trim_end_matches("/mod").split('/').count();
            names_from_root(code, depth).iter().map(|name| module_named(name)).collect()
        };
        graph.entry(module.clone()).or_default().extend(used.into_iter().filter(|m| *m != module));
    }
    graph
}

/// Faults of this order of modules: some that use later ones, and some that are missing.
fn upward(graph: &Graph, order: &[&str]) -> Vec<String> {
    let level = |module: &str| order.iter().position(|m| *m == module);
    let mut wrong = Vec::new();
    for (module, used) in graph {
        let Some(own) = level(module) else {
            wrong.push(format!("{module} is in no layer"));
            continue;
        };
        wrong.extend(used.iter().filter(|m| level(m) >= Some(own)).map(|m| format!("{module} uses {m}")));
    }
    wrong
}

fn sources_of(folder: &str) -> BTreeMap<String, String> {
    let base = root().join(folder);
    let relative = |path: &Path| path.strip_prefix(&base).unwrap().to_string_lossy().replace('\\', "/");
    files(&base, &["rs"]).into_iter().map(|path| (relative(&path), fs::read_to_string(&path).unwrap())).collect()
}

#[test]
fn modules_use_those_below_them_alone() {
    for (folder, modules) in &MODULES {
        let order: Vec<&str> = modules.split_whitespace().collect();
        let graph = module_graph(&sources_of(folder));
        let edges: usize = graph.values().map(BTreeSet::len).sum();
        assert!(edges >= order.len() / 3, "{folder}: {edges} edges between {} modules: the sources are not read", order.len());
        let wrong = upward(&graph, &order);
        assert!(wrong.is_empty(), "{folder}: {}", wrong.join(", "));
        let missing: Vec<_> = order.iter().filter(|m| !graph.contains_key(**m)).collect();
        assert!(missing.is_empty(), "{folder} has no modules {missing:?}");
    }
}

#[test]
fn no_manifest_points_up() {
    for (floor, (folder, package, _)) in LAYERS.iter().enumerate() {
        let manifest = fs::read_to_string(root().join(folder).join("Cargo.toml")).unwrap();
        for dependency in dependencies(&manifest) {
            let level = LAYERS.iter().position(|c| c.1 == dependency).unwrap();
            assert!(level < floor, "{package} depends on {dependency}, which lies above it");
        }
    }
}

#[test]
fn no_source_points_up() {
    for (floor, (_, package, folders)) in LAYERS.iter().enumerate() {
        for path in folders.iter().flat_map(|f| files(&root().join(f), &["rs"])) {
            let text = code(&fs::read_to_string(&path).unwrap());
            for (_, above, _) in &LAYERS[floor + 1..] {
                let above_name = above.replace('-', "_");
                assert!(!names(&text, &above_name), "{} of {package} uses {above}", path.display());
            }
        }
    }
}

#[test]
fn nothing_in_the_product_uses_the_validation() {
    for folder in ["math", "linalg", "smoothing", "scene", "engine", "import", "adjoint", "identify", "src", "examples", "py"] {
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

/// Thresholds and tolerances stand in a `constants` module; these are numbers of a formula.
#[test]
fn numbers_that_decide_stand_together() {
    const OF_FORMULAS: [(&str, &str); 3] = [
        ("engine/src/step/scheme.rs", "SDIRK_GAMMA"),
        ("adjoint/src/step.rs", "RATIO"),
        ("adjoint/src/gradcheck/difference.rs", "RATIO"),
    ];
    let mut lone = Vec::new();
    for folder in ["linalg/src", "engine/src", "import/src", "adjoint/src"] {
        let sources = sources_of(folder);
        for (path, code) in codes_of(&sources).into_iter().filter(|(path, _)| !path.ends_with("constants.rs")) {
            lone.extend(lone_numbers(&code).into_iter().map(|name| (format!("{folder}/{path}"), name)));
        }
    }
    lone.sort();
    let mut expected = OF_FORMULAS.map(|(path, name)| (path.to_owned(), name.to_owned()));
    expected.sort();
    assert_eq!(lone, expected);
}

/// Every test of a crate stands in its one binary `tests/suite`: a second binary would be linked again, and a file that no `mod` names
/// would never run.
#[test]
fn every_integration_test_is_in_its_crates_one_binary() {
    let folders = fs::read_dir(root()).unwrap().map(|entry| entry.unwrap().path());
    let crates = folders.filter(|f| f.join("Cargo.toml").is_file()).chain([root().to_owned()]);
    for tests in crates.map(|f| f.join("tests")).filter(|f| f.is_dir()) {
        let suite = tests.join("suite");
        for path in files(&tests, &["rs"]) {
            assert!(path.starts_with(&suite), "{} is not in {}", path.display(), suite.display());
            let folder = path.parent().unwrap();
            let (within, name) = match path.file_name().unwrap().to_str().unwrap() {
                "main.rs" => continue,
                "mod.rs" => (folder.parent().unwrap(), folder.file_name().unwrap()),
                _ => (folder, path.file_stem().unwrap()),
            };
            let index = within.join(if within == suite { "main.rs" } else { "mod.rs" });
            let declared = format!("mod {};", name.to_str().unwrap());
            let modules = code(&fs::read_to_string(&index).unwrap());
            assert!(modules.contains(&declared), "{} is not a module of {}, so it never runs", path.display(), index.display());
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
    let numbers = "const A: f64 = 1.0;\npub(crate) const B: [f64; 2] = [A, A];\nconst C: usize = 3;\nfn f<const N: usize>(x: f64) {}\nconst fn g(x: f64) {}\n\
                   const SET: Set = Set { a: 1.0 };\n#[cfg(test)]\nmod tests { const D: f64 = 1.0; }";
    assert_eq!(lone_numbers(&codes_of(&crate_of(&[("lib.rs", numbers)]))[&"lib.rs".to_owned()]), ["A", "B"]);
}

/// A crate of a few lines.
fn crate_of(files: &[(&str, &str)]) -> BTreeMap<String, String> {
    files.iter().map(|(path, text)| ((*path).to_owned(), (*text).to_owned())).collect()
}

#[test]
fn cycles_of_modules_are_seen_however_they_are_written() {
    let below = ("state.rs", "pub struct State;");
    let lib = ("lib.rs", "pub mod model;\npub mod state;\npub mod step;\npub use step::{Step, Work as Done};");
    let cycles = [
        "use crate::step::Step;",
        "use crate::{state::State, step::Step};",
        "use crate::{\n    state::{State},\n    Step,\n};",
        "fn f() -> crate::Step { crate::step::go() }",
        "use super::super::step::Step;",
        "mod inner { use crate::step::Step; }",
        "#[cfg(test)]\nmod tests { fn g() {} }\nuse crate::step::Step;",
    ];
    for text in cycles {
        let sources = crate_of(&[lib, below, ("model/build.rs", text), ("step.rs", "use super::model::Model;")]);
        let wrong = upward(&module_graph(&sources), &["state", "model", "step", "lib"]);
        assert_eq!(wrong, ["model uses step"], "{text}");
        // and no other order is right
        for order in [["state", "step", "model", "lib"], ["step", "state", "model", "lib"]] {
            assert!(!upward(&module_graph(&sources), &order).is_empty(), "{text}");
        }
    }
}

#[test]
fn what_is_no_use_of_a_module_is_none() {
    let none = [
        "// use crate::step::Step;",
        "/// See [`crate::step`].\nfn f() {}",
        "/* crate::step */",
        "#[cfg(test)]\nmod tests { use crate::step::Step; }",
        "#[cfg(test)]\nmod tests;",
        "const TEXT: &str = \"crate::step::Step \\\" crate::step\";",
        "use super::step::Step;",
        "use other_crate::step::Step;",
        "fn f(c: char) -> bool { c == '\"' || c == '{' }",
    ];
    for text in none {
        let others = [("lib.rs", "mod model;\nmod step;"), ("step.rs", "use crate::model::Model;"), ("model/build.rs", text)];
        let mut sources = crate_of(&others);
        let order = ["model", "step", "lib"];
        assert!(upward(&module_graph(&sources), &order).is_empty(), "{text}");
        // a file is one of tests where it is declared so
        sources.insert("model/build/tests.rs".to_owned(), "use crate::step::Step;".to_owned());
        assert_eq!(upward(&module_graph(&sources), &order).is_empty(), text.contains("mod tests;"), "{text}");
    }
    let missing = module_graph(&crate_of(&[("lib.rs", "mod model;"), ("model.rs", "")]));
    assert_eq!(upward(&missing, &["lib"]), ["model is in no layer"]);
    let defined = module_graph(&crate_of(&[("lib.rs", "mod model;\nfn f() -> model::Model {}"), ("model.rs", "use crate::f;")]));
    assert_eq!(upward(&defined, &["model", "lib"]), ["model uses lib"]);
    assert_eq!(upward(&defined, &["lib", "model"]), ["lib uses model"]);
}
