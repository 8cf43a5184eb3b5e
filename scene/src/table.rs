//! A scene as a TOML table, in which values can be set by their keys, and such a table as the text of a scene file.

use super::file::Scene;
use super::read::from_text;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde::ser::Error as _;
use toml::ser::Error;
use toml::{Table, Value};

/// The table of a scene without experiment; compiled once, here, and not in every crate that writes a scene.
fn objects(scene: &Scene) -> Result<Table, Error> {
    Table::try_from(scene)
}

impl<X: Serialize + DeserializeOwned> Scene<X> {
    /// All keys of the scene, in the order of the schema.
    ///
    /// # Errors
    /// A whole number above 2⁶³, which TOML does not have.
    pub fn to_table(&self) -> Result<Table, Error> {
        let mut table = objects(&self.with_experiment(None))?;
        if let Some(experiment) = &self.experiment {
            table.insert("experiment".to_owned(), Value::try_from(experiment)?);
        }
        Ok(table)
    }

    /// The text of a scene file with the keys of a table. It goes through the scene: keys stand in the order of the schema.
    ///
    /// # Errors
    /// A table that is no scene.
    pub fn table_to_text(table: &Table) -> Result<String, Error> {
        let scene: Self = from_text(&toml::to_string(table)?).map_err(Error::custom)?;
        toml::to_string(&scene.to_table()?)
    }
}
