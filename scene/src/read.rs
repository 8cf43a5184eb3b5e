//! Reading scene files.

use super::check::check;
use super::error::{Mistake, SceneError};
use super::file::Scene;
use super::keys;
use super::material;
use super::obj;
use super::place::Place;
use super::schema::json_schema;
use super::source::Source;
use schemars::{JsonSchema, schema_for};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::path::Path;
use std::sync::Arc;
use toml::de::DeTable;

/// Reads a scene file and checks that it makes sense.
pub fn read_scene<X: DeserializeOwned + JsonSchema>(path: impl AsRef<Path>) -> Result<Scene<X>, SceneError> {
    parse_source(&Source::read(path.as_ref())?)
}

/// Reads a scene from a text; `file_name` is its name in errors.
pub fn parse_scene<X: DeserializeOwned + JsonSchema>(text: &str, file_name: &str) -> Result<Scene<X>, SceneError> {
    parse_source(&Source::new(file_name, text))
}

/// Reads a scene from a [`Source`], which the caller keeps to locate errors of its own.
///
/// Only the `experiment` is read by code that depends on `X`; everything else is compiled once, in this crate, and not in every crate
/// that reads a scene.
pub fn parse_source<X: DeserializeOwned + JsonSchema>(source: &Source) -> Result<Scene<X>, SceneError> {
    compare_keys(source, &json_schema::<X>())?;
    let experiment = experiment(&source.text).map_err(|error| refused(source, &error))?;
    Ok(parse_objects(source)?.with_experiment(experiment))
}

/// Reads a file of another kind than a scene, by the same rules: unknown and missing keys, wrong types and units in texts are refused with
/// line and field.
pub fn parse_as<T: DeserializeOwned + JsonSchema>(source: &Source) -> Result<T, SceneError> {
    let table = DeTable::parse(&source.text).map_err(|error| syntax(source, &error))?;
    keys::compare(&schema_for!(T).to_value(), &table, source)?;
    toml::from_str(&source.text).map_err(|error| refused(source, &error))
}

/// A scene as it stands in the text: nothing is loaded, resolved or checked.
pub(crate) fn from_text<X: DeserializeOwned>(text: &str) -> Result<Scene<X>, toml::de::Error> {
    Ok(objects(text)?.with_experiment(experiment(text)?))
}

fn experiment<X: DeserializeOwned>(text: &str) -> Result<Option<X>, toml::de::Error> {
    #[derive(Deserialize)]
    struct Measured<X> {
        experiment: Option<X>,
    }
    toml::from_str(text).map(|measured: Measured<X>| measured.experiment)
}

fn objects(text: &str) -> Result<Scene, toml::de::Error> {
    toml::from_str(text)
}

/// Refuses text that is not TOML, keys that are not in the schema, and material keys that exclude each other.
fn compare_keys(source: &Source, schema: &Value) -> Result<(), SceneError> {
    let table = DeTable::parse(&source.text).map_err(|error| syntax(source, &error))?;
    keys::compare(schema, &table, source)?;
    material::compare(&table, source)
}

/// The scene without its experiment.
fn parse_objects(source: &Source) -> Result<Scene, SceneError> {
    let mut scene = objects(&source.text).map_err(|error| refused(source, &error))?;
    load_meshes(&mut scene, source).map_err(|error| error.located(source))?;
    material::resolve(&mut scene).map_err(|error| error.located(source))?;
    check(&scene).map_err(|error| error.located(source))?;
    Ok(scene)
}

/// Meshes of sheets, from files beside the scene's.
fn load_meshes(scene: &mut Scene, source: &Source) -> Result<(), SceneError> {
    let folder = Path::new(&source.file).parent().unwrap_or(Path::new(""));
    for (c, cloth) in scene.cloth.iter_mut().enumerate() {
        if let Some(mesh) = &cloth.mesh {
            cloth.loaded = Some(Arc::new(obj::read(&folder.join(mesh), &format!("cloth[{c}].mesh"))?));
        }
    }
    Ok(())
}

fn syntax(source: &Source, error: &toml::de::Error) -> SceneError {
    let message = error.message().replace('\n', ", ");
    SceneError::new(place(source, error), Mistake::Syntax { message })
}

/// Errors of serde where the schema allows the text, e.g. a whole number too large for its type.
fn refused(source: &Source, error: &toml::de::Error) -> SceneError {
    let message = error.message().replace('\n', ", ");
    SceneError::new(place(source, error), Mistake::Refused { message })
}

fn place(source: &Source, error: &toml::de::Error) -> Place {
    match error.span() {
        Some(span) => source.place_at(span.start, ""),
        None => Place { file: Some(source.file.clone()), ..Place::default() },
    }
}
