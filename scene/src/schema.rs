//! The JSON Schema of scene files.

use super::file::Scene;
use schemars::{JsonSchema, schema_for};
use serde_json::Value;

/// JSON Schema of a scene whose `experiment` is an `X`; every key is described, with its unit in brackets.
pub fn json_schema<X: JsonSchema>() -> Value {
    schema_for!(Scene<X>).to_value()
}

#[cfg(test)]
mod tests {
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
