//! Keys and types of a file against the published JSON Schema, with the exact place of whatever does not fit.
//!
//! The reader itself (serde) would refuse the same files, but without line and unit inside tagged tables.

use super::error::{Mistake, SceneError};
use super::source::Source;
use super::words::{list, nearest, number_in};
use serde_json::{Map, Value};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The part of a key's description beyond its type.
type Unit<'a> = Option<&'a str>;

/// Compares a table with the schema of the whole file.
pub(super) fn compare(schema: &Value, table: &Spanned<DeTable>, source: &Source) -> Result<(), SceneError> {
    let walk = Walk { root: schema, source };
    walk.table(schema, table.get_ref(), table.span().start, "")
}

struct Walk<'a> {
    root: &'a Value,
    source: &'a Source,
}

impl<'a> Walk<'a> {
    fn refuse<T>(&self, byte: usize, field: &str, mistake: Mistake) -> Result<T, SceneError> {
        Err(SceneError::new(self.source.place_at(byte, field), mistake))
    }

    /// Follows `$ref` and the optional half of `anyOf: [X, null]`.
    fn resolve(&self, schema: &'a Value) -> &'a Value {
        if let Some(target) = schema["$ref"].as_str() {
            let found = target.strip_prefix("#").and_then(|pointer| self.root.pointer(pointer));
            return found.map_or(schema, |found| self.resolve(found));
        }
        let optional = |branches: &&Vec<Value>| branches.iter().any(|b| b["type"] == "null");
        let branches = schema["anyOf"].as_array().filter(optional);
        let some = branches.and_then(|branches| branches.iter().find(|b| b["type"] != "null"));
        match (branches, some) {
            (Some(branches), Some(some)) if branches.len() == 2 => self.resolve(some),
            _ => schema,
        }
    }

    fn value(&self, schema: &'a Value, value: &Spanned<DeValue>, field: &str, unit: Unit) -> Result<(), SceneError> {
        let unit = unit_of(schema).or(unit);
        let schema = self.resolve(schema);
        let unit = unit.or(unit_of(schema));
        let start = value.span().start;
        if let Some(branches) = schema["anyOf"].as_array() {
            return match branches.iter().find(|branch| takes(branch, value.get_ref())) {
                Some(branch) => self.value(branch, value, field, unit),
                None => {
                    let (found, expected) = (kind(value.get_ref()), alternatives(branches));
                    self.refuse(start, field, Mistake::WrongType { found, expected, unit: unit.map(str::to_owned) })
                }
            };
        }
        if let Some(choices) = choices(schema) {
            return self.choice(&choices, value, field);
        }
        let wrong = |expected: &str| {
            let unit = unit.map(str::to_owned);
            self.refuse(start, field, Mistake::WrongType { found: kind(value.get_ref()), expected: expected.to_owned(), unit })
        };
        match (type_of(schema), value.get_ref()) {
            ("object", DeValue::Table(table)) => self.table(schema, table, start, field),
            ("array", DeValue::Array(array)) => {
                let expected = schema["minItems"].as_u64().filter(|n| Some(*n) == schema["maxItems"].as_u64());
                if let Some(expected) = expected.filter(|n| *n != array.len() as u64) {
                    return self.refuse(start, field, Mistake::Count { found: array.len(), expected: expected as usize });
                }
                let mut entries = array.iter().enumerate();
                entries.try_for_each(|(i, entry)| self.value(&schema["items"], entry, &format!("{field}[{i}]"), unit))
            }
            ("number", DeValue::Integer(_) | DeValue::Float(_)) => Ok(()),
            ("integer", DeValue::Integer(n)) if schema["minimum"] == 0 && n.as_str().starts_with('-') => {
                wrong("a whole number from 0 on")
            }
            ("integer", DeValue::Integer(_)) | ("string", DeValue::String(_)) | ("boolean", DeValue::Boolean(_)) => Ok(()),
            ("number" | "integer", DeValue::String(text)) => {
                let mistake =
                    Mistake::Text { found: text.to_string(), unit: unit.map(str::to_owned), value: number_in(text, unit) };
                self.refuse(start, field, mistake)
            }
            ("object", _) => wrong("a table"),
            ("array", _) => wrong("a list"),
            ("number", _) => wrong("a number"),
            ("integer", _) => wrong("a whole number"),
            ("string", _) => wrong("a text in quotes"),
            ("boolean", _) => wrong("true or false"),
            ("", DeValue::Table(table)) => self.table(schema, table, start, field),
            ("", _) if schema["oneOf"].is_array() => wrong("a table"),
            _ => Ok(()),
        }
    }

    fn choice(&self, choices: &[&str], value: &Spanned<DeValue>, field: &str) -> Result<(), SceneError> {
        let quoted = choices.iter().map(|c| format!("\"{c}\"")).collect::<Vec<_>>().join(", ");
        match value.get_ref() {
            DeValue::String(found) if choices.contains(&&**found) => Ok(()),
            DeValue::String(found) => {
                let nearest = nearest(found, choices.iter().copied()).map(str::to_owned);
                self.refuse(value.span().start, field, Mistake::Choice { found: found.to_string(), choices: quoted, nearest })
            }
            other => {
                let expected = format!("one of {quoted}");
                self.refuse(value.span().start, field, Mistake::WrongType { found: kind(other), expected, unit: None })
            }
        }
    }

    /// A table with fixed keys, with keys that select one of several sets of keys, or with a tag that does.
    fn table(&self, schema: &'a Value, table: &DeTable, start: usize, field: &str) -> Result<(), SceneError> {
        let mut known: Map<String, Value> = schema["properties"].as_object().cloned().unwrap_or_default();
        let mut required = required(schema);
        let mut strict = schema["additionalProperties"] == false || schema["unevaluatedProperties"] == false;
        if let Some(branches) = schema["oneOf"].as_array() {
            if let Some(tag) = tag_of(branches) {
                let branch = self.branch(branches, tag, table, start, field)?;
                known.extend(branch["properties"].as_object().cloned().unwrap_or_default());
                required.extend(self::required(branch));
                strict |= branch["additionalProperties"] == false;
            } else {
                let keys: Vec<&str> = branches.iter().flat_map(self::required).collect();
                let given = keys.iter().filter(|key| table.contains_key(**key)).count();
                if given != 1 {
                    return self.refuse(start, field, Mistake::OneOf { keys: list(keys), given });
                }
                known.extend(branches.iter().filter_map(|b| b["properties"].as_object().cloned()).flatten());
            }
        }
        if strict {
            self.no_unknown_keys(&known, table, field)?;
        }
        if let Some(key) = required.iter().find(|key| !table.contains_key(**key)) {
            let unit = known.get(*key).and_then(|schema| unit_of(schema).map(str::to_owned));
            return self.refuse(start, field, Mistake::MissingKey { key: (*key).to_owned(), unit });
        }
        // a table of names that somebody chooses, all of one type
        let free = &schema["additionalProperties"];
        if free.is_object() && schema["properties"].is_null() {
            table.iter().try_for_each(|(key, value)| self.value(free, value, &join(field, key.get_ref()), None))?;
        }
        // Values are compared with the schema's own nodes, which outlive `known`.
        let groups = std::iter::once(schema).chain(schema["oneOf"].as_array().into_iter().flatten().filter(|b| fits(b, table)));
        for group in groups {
            for (key, schema) in group["properties"].as_object().into_iter().flatten() {
                if let Some(value) = table.get(key.as_str()) {
                    self.value(schema, value, &join(field, key), None)?;
                }
            }
        }
        Ok(())
    }

    fn no_unknown_keys(&self, known: &Map<String, Value>, table: &DeTable, field: &str) -> Result<(), SceneError> {
        if let Some(key) = table.keys().find(|key| !known.contains_key(&**key.get_ref())) {
            let names = || known.keys().map(String::as_str);
            let mistake = Mistake::UnknownKey {
                key: key.get_ref().to_string(),
                nearest: nearest(key.get_ref(), names().filter(|n| !table.contains_key(*n))).map(str::to_owned),
                known: list(names()),
            };
            return self.refuse(key.span().start, &join(field, key.get_ref()), mistake);
        }
        Ok(())
    }

    /// The branch whose tag the table carries.
    fn branch(
        &self,
        branches: &'a [Value],
        tag: &str,
        table: &DeTable,
        start: usize,
        field: &str,
    ) -> Result<&'a Value, SceneError> {
        let Some(value) = table.get(tag) else {
            return self.refuse(start, field, Mistake::MissingKey { key: tag.to_owned(), unit: None });
        };
        let choices: Vec<&str> = branches.iter().filter_map(|b| b["properties"][tag]["const"].as_str()).collect();
        self.choice(&choices, value, &join(field, tag))?;
        let found = branches.iter().find(|b| value.get_ref().as_str() == b["properties"][tag]["const"].as_str());
        Ok(found.unwrap_or(&branches[0]))
    }
}

/// Whether a value is of the type that one of several alternatives has.
fn takes(branch: &Value, value: &DeValue) -> bool {
    match value {
        DeValue::String(_) => branch["type"] == "string",
        DeValue::Array(_) => branch["type"] == "array",
        _ => false,
    }
}

/// `a text in quotes or a list of 3`
fn alternatives(branches: &[Value]) -> String {
    let name = |branch: &Value| match (branch["type"].as_str(), branch["minItems"].as_u64()) {
        (Some("array"), Some(n)) => format!("a list of {n}"),
        _ => "a text in quotes".to_owned(),
    };
    branches.iter().map(name).collect::<Vec<_>>().join(" or ")
}

/// Words a text may be, if the schema lists them.
fn choices(schema: &Value) -> Option<Vec<&str>> {
    if let Some(words) = schema["enum"].as_array() {
        return words.iter().map(Value::as_str).collect();
    }
    if let Some(word) = schema["const"].as_str() {
        return Some(vec![word]);
    }
    let branches = schema["oneOf"].as_array()?;
    let words: Option<Vec<Vec<&str>>> = branches.iter().map(choices).collect();
    words.map(|words| words.concat())
}

/// The key that every branch fixes to a word of its own.
fn tag_of(branches: &[Value]) -> Option<&str> {
    let first = branches.first()?["properties"].as_object()?;
    first.iter().find(|(_, schema)| schema["const"].is_string()).map(|(key, _)| key.as_str())
}

/// Whether a table is of this branch: its required keys are there, its tag agrees.
fn fits(branch: &Value, table: &DeTable) -> bool {
    let tags = branch["properties"].as_object().into_iter().flatten().filter(|(_, s)| s["const"].is_string());
    let mut tags =
        tags.map(|(key, schema)| table.get(key.as_str()).and_then(|v| v.get_ref().as_str()) == schema["const"].as_str());
    tags.all(|agrees| agrees) && required(branch).iter().all(|key| table.contains_key(*key))
}

fn required(schema: &Value) -> Vec<&str> {
    schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str).collect()
}

/// The one type that is not null; empty if the schema names none.
fn type_of(schema: &Value) -> &str {
    match &schema["type"] {
        Value::String(name) => name,
        Value::Array(names) => names.iter().filter_map(Value::as_str).find(|name| *name != "null").unwrap_or(""),
        _ => "",
    }
}

/// The text in brackets in the key's description.
fn unit_of(schema: &Value) -> Unit<'_> {
    let text = schema["description"].as_str()?;
    let (_, rest) = text.split_once(" [")?;
    rest.split_once(']').map(|(unit, _)| unit).filter(|unit| *unit != "-")
}

fn kind(value: &DeValue) -> String {
    match value {
        DeValue::String(text) => format!("the text \"{text}\""),
        DeValue::Integer(n) => format!("the whole number {}", n.as_str()),
        DeValue::Float(x) => format!("the number {}", x.as_str()),
        DeValue::Boolean(b) => format!("{b}"),
        DeValue::Datetime(_) => "a date".to_owned(),
        DeValue::Array(_) => "a list".to_owned(),
        DeValue::Table(_) => "a table".to_owned(),
    }
}

fn join(field: &str, key: &str) -> String {
    if field.is_empty() { key.to_owned() } else { format!("{field}.{key}") }
}
