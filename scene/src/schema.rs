//! The JSON Schema of scene files.

use super::file::Scene;
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, schema_for};
use serde_json::{Map, Value};

/// JSON Schema of a scene whose `experiment` is an `X`; every key is described, with its unit in brackets.
///
/// Only the schema of the `experiment` depends on `X`; that of the scene is compiled once, in this crate.
pub fn json_schema<X: JsonSchema>() -> Value {
    let mut generator = SchemaSettings::default().into_generator();
    let experiment = generator.subschema_for::<Option<X>>().to_value();
    with_experiment(experiment, generator.take_definitions(true))
}

/// The schema of scenes with that of an `experiment` and the definitions it refers to.
fn with_experiment(experiment: Value, definitions: Map<String, Value>) -> Value {
    let mut schema = schema_for!(Scene).to_value();
    if let (Value::Object(entry), Value::Object(experiment)) = (&mut schema["properties"]["experiment"], experiment) {
        entry.extend(experiment);
    }
    if let Value::Object(all) = &mut schema["$defs"] {
        all.extend(definitions);
    }
    schema
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::Nothing;
    use super::*;

    /// Paths of keys without description.
    fn silent(schema: &Value, path: &str, out: &mut Vec<String>) {
        for (key, value) in schema["properties"].as_object().into_iter().flatten() {
            let path = format!("{path}.{key}");
            if value["description"].is_null() && value["const"].is_null() {
                out.push(path.clone());
            }
            silent(value, &path, out);
        }
        // A branch that adds a single key (`nodes` or `end` of a gripper) is described as a whole.
        for branch in schema["oneOf"].as_array().into_iter().flatten() {
            if branch["description"].is_null() || branch["properties"].as_object().is_none_or(|keys| keys.len() > 1) {
                silent(branch, path, out);
            }
        }
    }

    #[test]
    fn the_schema_with_an_experiment_is_that_of_the_type() {
        #[derive(JsonSchema)]
        #[expect(dead_code)]
        struct Probe {
            part: Part,
        }
        #[derive(JsonSchema)]
        #[expect(dead_code)]
        struct Part {
            time: super::super::Time,
        }
        let mut schema = json_schema::<Probe>();
        assert!(schema["$defs"]["Part"].is_object());
        assert!(schema["$defs"].as_object_mut().unwrap().remove("Nothing").is_some());
        assert_eq!(schema, schema_for!(Scene<Probe>).to_value());
    }

    #[test]
    fn every_key_is_described() {
        let schema = json_schema::<Nothing>();
        let mut out = Vec::new();
        silent(&schema, "scene", &mut out);
        for (name, definition) in schema["$defs"].as_object().into_iter().flatten() {
            silent(definition, name, &mut out);
        }
        assert!(out.is_empty(), "{out:?}");
        assert_eq!(schema["$defs"]["Rope"]["properties"]["length"]["description"], "Rest length [m].");
    }
}
