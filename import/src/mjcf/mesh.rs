//! `<mesh>` of `<asset>`: the meshes of a model, which geoms name.

use super::contact::no_such;
use super::{Reader, words};
use crate::element::Element;
use crate::error::{ImportError, ImportMistake};
use crate::mesh::{Filling, Mesh, MeshMistake};
use crate::pose::Pose;
use crate::view::{View, check_attributes};
use pliant_math::rotation::normalized;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// The meshes that a model names, and where their files are.
#[derive(Debug, Default)]
pub(super) struct Meshes<'a> {
    named: Vec<Named<'a>>,
    /// Those that have been read, by name.
    read: HashMap<String, Rc<Mesh>>,
}

#[derive(Debug)]
struct Named<'a> {
    name: String,
    element: &'a Element,
    /// Its file, if it has one.
    file: Option<PathBuf>,
}

/// A mesh that a geom names.
pub(super) struct Found {
    /// In the geom's frame \[m\].
    pub mesh: Rc<Mesh>,
    pub filling: Filling,
    /// Its file, or its name.
    pub path: String,
}

/// A mesh, or its file and why it is not read.
type Looked = Result<Found, (String, MeshMistake)>;

impl<'a> Meshes<'a> {
    /// All meshes of a model in the file `path`.
    pub fn list(root: &'a Element, path: &Path) -> Self {
        let mut folder = path.parent().unwrap_or(Path::new("")).to_owned();
        for directory in ["assetdir", "meshdir"] {
            // that of meshes alone counts more, and the last one given
            let given = root.children_of("compiler").filter_map(|c| c.value(directory)).last();
            if let Some(directory) = given {
                folder = path.parent().unwrap_or(Path::new("")).join(directory);
            }
        }
        let strip = root.children_of("compiler").filter_map(|c| c.value("strippath")).last() == Some("true");
        let own = |element: &'a Element| {
            let file = element.value("file").map(Path::new);
            let stem = file.and_then(Path::file_stem).map(|stem| stem.to_string_lossy().into_owned());
            let place = file.map(|file| folder.join(if strip { file.file_name().map_or(file, Path::new) } else { file }));
            Named { name: element.value("name").map(str::to_owned).or(stem).unwrap_or_default(), element, file: place }
        };
        let assets = root.children_of("asset").flat_map(|asset| asset.children_of("mesh"));
        Self { named: assets.map(own).collect(), read: HashMap::new() }
    }
}

impl<'a> Reader<'a> {
    /// Refuses a geom whose mesh the model does not have, or whose file is not there; says so if it was asked to approximate.
    pub(super) fn missing_mesh(&mut self, view: &View, name: &str) -> Result<(), ImportError> {
        let known = || self.meshes.named.iter().map(|mesh| mesh.name.as_str()).collect();
        let mistake = match self.meshes.named.iter().find(|mesh| mesh.name == name) {
            None => no_such("mesh", name, known()),
            Some(Named { file: Some(file), .. }) if !file.exists() => {
                ImportMistake::MissingFile { what: "mesh", path: file.display().to_string(), looked: Vec::new() }
            }
            Some(_) => return Ok(()),
        };
        if !self.work.options.approximate {
            return Err(view.error("mesh", mistake));
        }
        self.work.ignored(view.element, view.element.label(), format!("{mistake}"));
        Ok(())
    }

    /// The mesh that a geom names; none if it is not there, which has been said.
    pub(super) fn find_mesh(&mut self, view: &View) -> Result<Option<Looked>, ImportError> {
        let name = view.required("mesh")?;
        self.missing_mesh(view, name)?;
        let Some(k) = self.meshes.named.iter().position(|mesh| mesh.name == name) else { return Ok(None) };
        let (element, file) = (self.meshes.named[k].element, self.meshes.named[k].file.clone());
        if file.as_ref().is_some_and(|file| !file.exists()) {
            return Ok(None);
        }
        check_attributes(element, words::MESH)?;
        let asset = self.view(element, None)?;
        let path = file.as_ref().map_or(name.to_owned(), |file| file.display().to_string());
        let filling = self.filling(&asset)?;
        if let Some(mesh) = self.meshes.read.get(name) {
            return Ok(Some(Ok(Found { mesh: Rc::clone(mesh), filling, path })));
        }
        Ok(match self.read_mesh(&asset, file.as_deref())? {
            Ok(mesh) => {
                let mesh = Rc::new(mesh);
                self.meshes.read.insert(name.to_owned(), Rc::clone(&mesh));
                self.work.kept(element, name, format!("{} vertices, {} triangles", mesh.vertices.len(), mesh.triangles.len()));
                self.work.leftovers(element, name, &words::MESH_REASONS);
                Some(Ok(Found { mesh, filling, path }))
            }
            Err(error) => Some(Err((path, error))),
        })
    }

    fn filling(&self, asset: &View) -> Result<Filling, ImportError> {
        Ok(match asset.word("inertia", &["convex", "exact", "legacy", "shell"])? {
            Some("convex") => Filling::Convex,
            Some("exact") => Filling::Exact,
            Some("shell") => Filling::Shell,
            Some(_) => Filling::Legacy,
            None if self.compiler.exact_meshes => Filling::Exact,
            None => Filling::Legacy,
        })
    }

    /// A mesh of a file or of numbers, moved to `refpos` and `refquat`, and scaled.
    fn read_mesh(&self, asset: &View, file: Option<&Path>) -> Result<Result<Mesh, MeshMistake>, ImportError> {
        if asset.has("builtin") {
            let (what, reason) = ("a mesh that MuJoCo makes".to_owned(), "save it as a file".to_owned());
            return Err(asset.error("builtin", ImportMistake::Unsupported { what, reason }));
        }
        let scale = asset.vector::<3>("scale")?.unwrap_or([1.0; 3]);
        let position = asset.vector::<3>("refpos")?.unwrap_or_default();
        let rotation = asset.direction::<4>("refquat")?.map_or([1.0, 0.0, 0.0, 0.0], |q| normalized(&q));
        let mesh = match file {
            Some(file) => Mesh::read(file),
            None => {
                let vertices = asset.numbers("vertex", 12..=usize::MAX)?.ok_or_else(|| asset.missing("`file` or `vertex`"))?;
                Mesh::of_numbers(&vertices, asset.numbers("face", 0..=usize::MAX)?.as_deref())
            }
        };
        let place = Pose { position: position.into(), rotation };
        Ok(mesh.map(|mesh| mesh.seen_from(&place).scaled(&scale)))
    }
}
