//! The scene with the estimates in place, as a scene file with comments on every change.

use super::error::ReportError;
use super::place_body::{set_inertia, set_joint};
use super::place_cloth::{set_area, write_out};
use super::place_rod::{node_count, set_rod};
use super::reproduce::{Provenance, relative};
use crate::diagnose::{Cause, Diagnosis, Estimate};
use crate::log::{Experiment, Free, RecordFile, SensorStart, Setup};
use crate::number::{estimate_plain, number_plain};
use pliant_engine::model::ModelBuilder;
use pliant_scene::{Scene, Source};
use std::fmt::Write;
use std::path::Path;
use toml::{Table, Value};

const FILE: &str = "scene_extended.toml";
/// Lists of named objects.
const OBJECTS: [&str; 8] = ["rope", "cloth", "gripper", "plane", "sphere", "capsule", "body", "actuator"];

/// Bounds of a found number that is freed, on both sides of it, over the larger of it and the scene's.
const FREED: f64 = 10.0;

/// Keys that a scene without such an effect leaves out.
const LEFT_OUT: [&str; 6] = ["delay", "lag", "friction_backward", "load_friction", "plastic_time", "yield"];

/// A value that was set, by where it stands: table, its number in a list of tables, key.
pub(super) struct Place {
    pub table: String,
    pub number: usize,
    pub key: String,
}

/// The text of `scene_extended.toml` in the folder `report`.
pub(super) fn text(diagnosis: &Diagnosis, setup: &Setup, provenance: &Provenance, report: &Path) -> Result<String, ReportError> {
    let mut scene = setup.to_scene();
    if let Some(refined) = diagnosis.refined {
        scene.time.step = refined.step;
    }
    if let Some(experiment) = &mut scene.experiment {
        if let Some(refined) = diagnosis.refined {
            experiment.interpolation = refined.interpolation;
        }
        move_records(experiment, setup, provenance, report);
    }
    let estimated = |name: &str| estimates(diagnosis).iter().any(|e| e.path.split('.').next() == Some(name));
    for cloth in &mut scene.cloth {
        if estimated(&cloth.name) {
            write_out(cloth);
        }
        cloth.mesh = cloth.mesh.as_ref().map(|mesh| relative(report, &setup.folder.join(mesh)));
    }
    let at = |source| ReportError::Toml { file: FILE, source };
    let mut table = scene.to_table().map_err(at)?;
    let mut placed = Vec::new();
    let mut header = header(diagnosis);
    for estimate in estimates(diagnosis) {
        match set(&mut table, estimate) {
            Some(place) => {
                let _ = writeln!(header, "#   {}", note(estimate));
                placed.push((place, estimate));
            }
            None => {
                let _ = writeln!(header, "#   not part of a scene, so only said here: {}", note(estimate));
            }
        }
    }
    for cause in diagnosis.causes.iter().chain(&diagnosis.extension).filter(|cause| !cause.sizes.is_empty()) {
        let sizes = cause.sizes_by_record().replace(char::is_control, " ");
        let _ =
            writeln!(header, "#   {} differs between the records, and no single value follows them all: {sizes}", cause.title());
    }
    free_found(&mut table, diagnosis, &placed, report).map_err(at)?;
    let text = Scene::<Experiment>::table_to_text(&table).map_err(at)?;
    Ok(header + "\n" + &annotate(&text, &placed))
}

/// Frees what was found, so that `pliant fit` refits it beside what the experiment frees already: each number of an accepted cause that
/// stands in the scene and has a path of its own there (the limits of a motor have two, and stay).
fn free_found(
    table: &mut Table,
    diagnosis: &Diagnosis,
    placed: &[(Place, &Estimate)],
    report: &Path,
) -> Result<(), toml::ser::Error> {
    let text = Scene::<Experiment>::table_to_text(table)?;
    // one that cannot be read says so where it is used
    let Ok(mut setup) = Setup::from_source(Source { file: FILE.to_owned(), text }, report.to_owned()) else { return Ok(()) };
    let Ok(model) = ModelBuilder::new(&setup.scene).map(ModelBuilder::build) else { return Ok(()) };
    let of_causes: Vec<&Estimate> = diagnosis.causes.iter().chain(&diagnosis.extension).flat_map(|c| &c.parameters).collect();
    for e in placed.iter().map(|(_, e)| *e).filter(|e| of_causes.iter().any(|own| own.path == e.path)) {
        let reach = FREED * e.estimate.abs().max(e.scene_value.abs());
        if let Some((low, high)) = setup.may_be_freed(&e.path, model.params()).filter(|_| reach > 0.0) {
            let (lower, upper) = (low.max(e.estimate - reach), high.min(e.estimate + reach));
            setup.experiment.fit.free.push(Free { path: e.path.clone(), lower, upper, prior: None });
        }
    }
    let experiment = table.get_mut("experiment").and_then(Value::as_table_mut);
    if let Some(fit) = experiment.and_then(|e| e.entry("fit").or_insert(Value::Table(Table::new())).as_table_mut()) {
        fit.insert("free".to_owned(), Value::try_from(&setup.experiment.fit.free)?);
    }
    Ok(())
}

fn header(diagnosis: &Diagnosis) -> String {
    let names = |causes: &[Cause]| causes.iter().map(Cause::title).collect::<Vec<_>>().join(", ");
    let found = match (diagnosis.causes.as_slice(), diagnosis.extension.as_slice()) {
        ([], []) => "no cause was accepted".to_owned(),
        ([], more) => format!("extended, without a name being given, by: {}", names(more)),
        (named, []) => format!("accepted: {}", names(named)),
        (named, more) => format!("accepted: {}; besides extended, without a name being given, by: {}", names(named), names(more)),
    };
    // A line break in a file's name would end the comment.
    let scene = diagnosis.scene.replace(char::is_control, " ");
    format!("# {scene}, extended by pliant diagnose ({found}). These values are estimates from the logs:\n")
}

/// Estimates of the last fit: the baseline's free parameters and those of the accepted causes, from their joint refit.
fn estimates(diagnosis: &Diagnosis) -> Vec<&Estimate> {
    let found = || diagnosis.causes.iter().chain(&diagnosis.extension);
    let causes = || found().flat_map(|cause| &cause.parameters);
    let mut out: Vec<&Estimate> = diagnosis.baseline.iter().collect();
    // Without an accepted cause the last stage may belong to one that was rejected in the end.
    if let Some(last) = diagnosis.stages.last().filter(|_| found().next().is_some()) {
        for estimate in &mut out {
            *estimate = last.parameters.iter().find(|other| other.path == estimate.path).unwrap_or(estimate);
        }
    }
    out.retain(|estimate| causes().all(|other| other.path != estimate.path));
    out.extend(causes());
    out
}

fn note(e: &Estimate) -> String {
    let (value, interval) = estimate_plain(e.estimate, e.interval);
    let interval = interval.map_or_else(String::new, |[low, high]| format!(" (90 %: {low} to {high})"));
    format!("{} = {value} {}{interval}; was {}", e.path, e.unit, number_plain(e.scene_value))
}

/// Puts an estimate where its path says; `None` if a scene has no such place (a term of one's own).
fn set(table: &mut Table, estimate: &Estimate) -> Option<Place> {
    let (object, rest) = estimate.path.split_once('.')?;
    if object == "sensor" {
        let experiment = table.get_mut("experiment")?.as_table_mut()?;
        let perfect = Value::try_from(SensorStart::default()).ok()?;
        let key = set_value(experiment.entry("sensor").or_insert(perfect).as_table_mut()?, rest, estimate.estimate)?;
        return Some(Place { table: "experiment.sensor".to_owned(), number: 0, key });
    }
    if let Some((marker, axis)) = offset_of(&estimate.path) {
        let marker_table = table.get_mut("experiment")?.as_table_mut()?.get_mut("marker")?.as_array_mut()?.get_mut(marker)?;
        let nowhere = || Value::Array(vec![Value::Float(0.0); 2]);
        let offset = marker_table.as_table_mut()?.entry("offset").or_insert_with(nowhere);
        *offset.as_array_mut()?.get_mut(axis)? = Value::Float(estimate.estimate);
        return Some(Place { table: "experiment.marker".to_owned(), number: marker, key: "offset".to_owned() });
    }
    if let Some(place) = set_force(table, object, rest, estimate.estimate) {
        return Some(place);
    }
    let list = OBJECTS.iter().find_map(|list| {
        let items = table.get(*list)?.as_array()?;
        Some((*list, items.iter().position(|item| item.get("name").and_then(Value::as_str) == Some(object))?))
    });
    if list.is_none()
        && let Some(place) = set_joint(table, object, rest, estimate)
    {
        return Some(place);
    }
    let (name, number, target) = match list {
        Some((list, number)) => (list, number, table.get_mut(list)?.as_array_mut()?.get_mut(number)?.as_table_mut()?),
        None => (object, 0, table.get_mut(object)?.as_table_mut()?),
    };
    if let Some(node) = rest.strip_prefix("node[").and_then(|rest| rest.strip_suffix("].mass")) {
        set_mass(target, node, estimate.estimate)?;
        return Some(Place { table: format!("{name}.node_mass"), number, key: String::new() });
    }
    // `stiffening` is the name of a table, too
    if name == "rope"
        && (rest == "stiffening" || (rest.contains(['_', '[']) && !target.contains_key(rest)))
        && let Some((table, key)) = set_rod(target, rest, estimate.estimate)
    {
        return Some(Place { table: table.to_owned(), number, key });
    }
    if name == "cloth" && rest == "area" {
        let key = set_area(target, estimate.estimate)?;
        return Some(Place { table: "cloth.grid".to_owned(), number, key });
    }
    let inertia = if name == "body" { set_inertia(target, rest, estimate.estimate) } else { None };
    let key = inertia.or_else(|| set_value(target, rest, estimate.estimate))?;
    Some(Place { table: name.to_owned(), number, key })
}

/// A parameter of a force of one's own.
fn set_force(scene: &mut Table, object: &str, parameter: &str, new: f64) -> Option<Place> {
    let mut forces = scene.get_mut("force")?.as_array_mut()?.iter_mut().enumerate();
    let (number, force) = forces.find(|(_, force)| force.get("name").and_then(Value::as_str) == Some(object))?;
    *force.get_mut("parameters")?.as_table_mut()?.get_mut(parameter)? = Value::Float(new);
    Some(Place { table: "force.parameters".to_owned(), number, key: parameter.to_owned() })
}

/// Marker and axis of `marker[2].offset[1]`.
fn offset_of(path: &str) -> Option<(usize, usize)> {
    let (marker, axis) = path.strip_prefix("marker[")?.strip_suffix(']')?.split_once("].offset[")?;
    Some((marker.parse().ok()?, axis.parse().ok()?))
}

/// Sets `key` or `key[index]` of a table, and returns the key. A `saturation` is the same both ways.
pub(super) fn set_value(table: &mut Table, path: &str, new: f64) -> Option<String> {
    let (key, index) = match path.strip_suffix(']').and_then(|path| path.split_once('[')) {
        Some((key, index)) => (key, Some(index.parse::<usize>().ok()?)),
        None => (path, None),
    };
    if key == "saturation" && index.is_none() {
        table.insert(key.to_owned(), Value::Array(vec![Value::Float(-new), Value::Float(new)]));
        return Some(key.to_owned());
    }
    let value = match LEFT_OUT.contains(&key) {
        true => table.entry(key).or_insert(Value::Float(new)),
        false => table.get_mut(key)?,
    };
    match index {
        Some(index) => *value.as_array_mut()?.get_mut(index)? = Value::Float(new),
        None => *value = Value::Float(new),
    }
    Some(key.to_owned())
}

/// Mass added at one node, or at all nodes (`*`).
fn set_mass(rope: &mut Table, node: &str, mass: f64) -> Option<()> {
    let nodes = node_count(rope)?;
    let which = match node.split_once("..") {
        Some((first, last)) => first.parse().ok()?..last.parse::<i64>().ok()? + 1,
        None if node == "*" => 0..nodes,
        None => node.parse().ok().map(|node: i64| node..node + 1)?,
    };
    let list = rope.entry("node_mass").or_insert_with(|| Value::Array(Vec::new())).as_array_mut()?;
    for node in which {
        let same = |item: &Value| item.get("node").and_then(Value::as_integer).is_some_and(|k| k.rem_euclid(nodes) == node);
        list.retain(|item| !same(item));
        let entry = [("node".to_owned(), Value::Integer(node)), ("mass".to_owned(), Value::Float(mass))];
        list.push(Value::Table(entry.into_iter().collect()));
    }
    Some(())
}

/// Adds a comment to each line whose value was set.
fn annotate(text: &str, placed: &[(Place, &Estimate)]) -> String {
    let mut out = String::with_capacity(text.len());
    let (mut table, mut count) = (String::new(), Vec::<(String, usize)>::new());
    let mut number = 0;
    for line in text.lines() {
        if let Some(name) = line.strip_prefix("[[").and_then(|l| l.strip_suffix("]]")) {
            table = name.to_owned();
            number = match count.iter_mut().find(|(other, _)| other == name) {
                Some((_, count)) => {
                    *count += 1;
                    *count
                }
                None => {
                    count.push((name.to_owned(), 0));
                    0
                }
            };
        } else if let Some(name) = line.strip_prefix('[').and_then(|l| l.strip_suffix(']')) {
            // a table of an object in a list (`[rope.twist]`) has that object's number
            let list = name.split('.').next().unwrap_or_default();
            number = count.iter().find(|(other, _)| other == list).map_or(0, |(_, count)| *count);
            name.clone_into(&mut table);
        }
        out += line;
        let key = line.split_once(" = ").map(|(key, _)| key);
        let here = |place: &Place| place.table == table && place.number == number && Some(place.key.as_str()) == key;
        let notes: Vec<String> = placed.iter().filter(|(place, _)| here(place)).map(|(_, e)| was(e)).collect();
        // A list that goes on over several lines has its comment in the header alone.
        if !notes.is_empty() && !line.ends_with('[') {
            out += &format!("  # estimated; {}", notes.join(", "));
        }
        out.push('\n');
    }
    out
}

fn was(e: &Estimate) -> String {
    format!("{} was {} {}", e.path, number_plain(e.scene_value), e.unit)
}

/// Paths of records are relative to the scene, which now stands in the folder `report`.
fn move_records(experiment: &mut Experiment, setup: &Setup, provenance: &Provenance, report: &Path) {
    for record in &mut experiment.record {
        record.file = if provenance.example.is_empty() {
            relative(report, &setup.folder.join(&record.file))
        } else {
            format!("example/{}", record.file)
        };
    }
    let array = experiment.record.first().and_then(|record| record.array.clone());
    for log in &provenance.logs {
        let file = relative(report, log);
        experiment.record.push(RecordFile { file, array: array.clone(), role: None, skip: Vec::new() });
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic)]
    use super::super::sample;
    use super::*;
    use crate::diagnose::RecordSize;
    use pliant_scene::parse_scene;
    use std::path::PathBuf;

    #[test]
    fn estimates_stand_in_the_scene_and_say_so() {
        let (setup, mut diagnosis) = (sample::setup(), sample::diagnosis());
        let found = [
            ("cable.node[2].mass", 0.02),
            ("left.offset[1]", 0.003),
            ("sensor.time_offset", 0.01),
            ("sensor.bias[2]", 0.002),
            ("magnet.strength", 0.3),
        ];
        for (path, value) in found {
            diagnosis.causes[0].parameters.push(sample::estimate(path, value));
        }
        let text = text(&diagnosis, &setup, &Provenance::default(), Path::new("/somewhere/report")).unwrap();
        let scene = parse_scene::<Experiment>(&text, FILE).unwrap();
        assert_eq!(scene.rope[0].bend_damping, 1.5e-4);
        assert_eq!(scene.rope[0].bend_stiffness, 2.1e-3);
        assert_eq!((scene.rope[0].node_mass[0].node, scene.rope[0].node_mass[0].mass), (2, 0.02));
        assert_eq!(scene.gripper[0].offset, [0.0, 0.003, 0.0]);
        assert!(text.contains("bend_damping = 0.00015  # estimated; cable.bend_damping was 0 N·m²·s"), "{text}");
        assert!(text.contains("#   not part of a scene, so only said here: magnet.strength = 0.3"), "{text}");
        assert!(text.contains("time_offset = 0.01  # estimated; sensor.time_offset was 0 N·m²·s"), "{text}");
        let experiment = scene.experiment.unwrap();
        // what was found is free, between bounds that physics and its size allow; what is no part of a scene is not
        let free: Vec<(&str, [f64; 2])> = experiment.fit.free.iter().map(|f| (f.path.as_str(), [f.lower, f.upper])).collect();
        let bounded =
            |(path, value): (&str, f64)| free.iter().find(|f| f.0 == path).is_some_and(|(_, b)| b[0] < value && value < b[1]);
        assert!(bounded(("cable.bend_damping", 1.5e-4)) && found[..4].iter().all(|one| bounded(*one)), "{free:?}");
        assert!(free.len() == 5 && free[..2].iter().all(|(_, [lower, _])| *lower == 0.0), "{free:?}");
        let sensor = SensorStart { bias: [0.0, 0.0, 0.002], time_offset: 0.01, ..SensorStart::default() };
        assert_eq!(experiment.sensor, sensor);
        assert!(experiment.record[0].file.ends_with("data/run1.csv"));
    }

    #[test]
    fn sizes_that_differ_are_listed_by_record() {
        let (setup, mut diagnosis) = (sample::setup(), sample::diagnosis());
        diagnosis.causes[0].sizes =
            [("a.csv", 0.9), ("b\nc", 1.1)].map(|(record, size)| RecordSize { record: record.to_owned(), size }).to_vec();
        let text = text(&diagnosis, &setup, &Provenance::default(), Path::new("/somewhere/report")).unwrap();
        assert!(text.contains("no single value follows them all: 0.9 in a.csv, 1.1 in b c\n"), "{text}");
    }

    #[test]
    fn estimates_of_a_sheet_change_nothing_else_of_it() {
        let scene = "schema_version = 1\n[time]\nstep = 0.01\n[[cloth]]\nname = \"sheet\"\ngrid = { nodes = [3, 2], size = [0.4, 0.2] }\n\
                     thickness = 1e-3\ndensity = 200.0\nyoungs_modulus = 1e5\n[[gripper]]\nname = \"hand\"\ncloth = \"sheet\"\n\
                     nodes = [0, 1]\n[experiment]\ntime = { column = \"t\" }\n[[experiment.marker]]\ncloth = \"sheet\"\nnode = 5\n\
                     columns = [\"x\", \"y\", \"z\"]\n[[experiment.input]]\ngripper = \"hand\"\n\
                     columns = [\"a\", \"b\", \"c\", \"d\", \"e\", \"f\"]\n";
        let setup = Setup::from_source(Source::new("scene.toml", scene), PathBuf::new()).unwrap();
        let mut diagnosis = sample::diagnosis();
        let found =
            [("sheet.youngs_modulus", 2e5), ("sheet.drag_quadratic", 0.3), ("sheet.area", 0.32), ("hand.offset[0]", 0.01)];
        diagnosis.causes[0].parameters = found.map(|(path, value)| sample::estimate(path, value)).to_vec();
        let text = text(&diagnosis, &setup, &Provenance::default(), Path::new("/somewhere/report")).unwrap();
        let extended = parse_scene::<Experiment>(&text, FILE).unwrap();
        let (old, new) = (&setup.scene.cloth[0], &extended.cloth[0]);
        assert_eq!((new.youngs_modulus, new.drag_quadratic, extended.gripper[0].offset[0]), (2e5, 0.3, 0.01));
        assert_eq!((new.plate_stiffness(), new.mass_per_area()), (old.plate_stiffness(), old.mass_per_area()));
        let size = new.grid.as_ref().map_or([0.0; 2], |grid| grid.size);
        assert!((size[0] - 0.8).abs() < 1e-12 && (size[1] - 0.4).abs() < 1e-12, "{size:?}");
        assert!(text.contains("youngs_modulus = 200000.0  # estimated; sheet.youngs_modulus was 0"), "{text}");
        assert_eq!(extended.experiment.unwrap().marker[0].cloth.as_deref(), Some("sheet"));
    }

    #[test]
    fn a_rejected_imitation_stays_out() {
        let mut diagnosis = sample::diagnosis();
        diagnosis.causes.clear();
        let [only] = estimates(&diagnosis)[..] else { panic!("more than the baseline") };
        assert_eq!((only.path.as_str(), only.estimate), ("cable.bend_stiffness", 1.9e-3));
    }

    #[test]
    fn effects_that_the_scene_left_out_are_written() {
        let mut motor: Table = toml::from_str("name = 'motor'").unwrap();
        assert_eq!(set_value(&mut motor, "delay", 0.004).unwrap(), "delay");
        assert_eq!(set_value(&mut motor, "saturation", 1.5).unwrap(), "saturation");
        assert_eq!(set_value(&mut motor, "strength", 1.5), None);
        let limits: Vec<f64> = motor["saturation"].as_array().unwrap().iter().filter_map(Value::as_float).collect();
        assert_eq!((motor["delay"].as_float(), limits), (Some(0.004), vec![-1.5, 1.5]));
    }

    #[test]
    fn tables_of_a_second_rope_have_their_own_comments() {
        let text =
            "[[rope]]\nname = \"a\"\n[rope.twist]\nstiffness = 1.0\n[[rope]]\nname = \"b\"\n[rope.twist]\nstiffness = 2.0\n";
        let found = sample::estimate("b.twist_stiffness", 2.0);
        let place = Place { table: "rope.twist".to_owned(), number: 1, key: "stiffness".to_owned() };
        let lines: Vec<String> = annotate(text, &[(place, &found)]).lines().map(str::to_owned).collect();
        assert_eq!(lines[3], "stiffness = 1.0");
        assert!(lines[7].starts_with("stiffness = 2.0  # estimated; b.twist_stiffness was"), "{}", lines[7]);
    }

    #[test]
    fn a_force_of_ones_own_gets_its_size() {
        let force = |name: &str| format!("[[force]]\nname = \"{name}\"\nformula = \"-c*v\"\n[force.parameters]\nc = 0.0\n");
        let text = force("first") + &force("second");
        let mut scene: Table = toml::from_str(&text).unwrap();
        let place = set_force(&mut scene, "second", "c", 0.25).unwrap();
        assert_eq!(scene["force"][1]["parameters"]["c"].as_float(), Some(0.25));
        assert_eq!(scene["force"][0]["parameters"]["c"].as_float(), Some(0.0));
        assert!(set_force(&mut scene, "second", "d", 1.0).is_none() && set_force(&mut scene, "third", "c", 1.0).is_none());
        let found = sample::estimate("second.c", 0.25);
        let lines: Vec<String> = annotate(&text, &[(place, &found)]).lines().map(str::to_owned).collect();
        assert_eq!(lines[4], "c = 0.0");
        assert!(lines[9].starts_with("c = 0.0  # estimated; second.c was"), "{}", lines[9]);
    }

    #[test]
    fn tied_masses_are_set_at_every_node() {
        let mut rope: Table = toml::from_str("nodes = 3\nnode_mass = [{ node = -1, mass = 1.0 }]").unwrap();
        set_mass(&mut rope, "*", 0.1).unwrap();
        set_mass(&mut rope, "1..2", 0.2).unwrap();
        let masses = rope["node_mass"].as_array().unwrap();
        let of = |k: usize| (masses[k]["node"].as_integer().unwrap(), masses[k]["mass"].as_float().unwrap());
        assert_eq!((masses.len(), of(0), of(1), of(2)), (3, (0, 0.1), (1, 0.2), (2, 0.2)));
    }
}
