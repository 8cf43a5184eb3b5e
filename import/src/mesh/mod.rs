//! Meshes of files: their triangles, their mass, and their convex hull.

mod obj;
mod stl;
mod volume;

pub use volume::Filling;

use crate::constants::IMPORT;
use crate::pose::Pose;
use pliant_engine::geometry::hull::{Hull, convex_hull};
use pliant_math::Vec3;
use std::collections::HashMap;
use std::path::Path;

/// Defect of a mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // the fields are the words of the messages
pub enum MeshMistake {
    /// The file cannot be read.
    #[error("cannot be read: {error}")]
    Read { error: String },
    /// A format that is not read.
    #[error("is a .{extension} file; .stl and .obj are read")]
    Format { extension: String },
    /// A file that would not fit into memory.
    #[error("has {bytes} bytes; at most {most} are read")]
    TooLarge { bytes: u64, most: u64 },
    /// A line that means nothing.
    #[error("line {line}: `{text}` is no {what}")]
    Line { line: usize, text: String, what: &'static str },
    /// A face of vertices that are not there.
    #[error("line {line}: the face names vertex {vertex}, but the file has {vertices} vertices")]
    NoVertex { line: usize, vertex: i64, vertices: usize },
    /// A binary file of another length than its number of triangles asks for.
    #[error("says that it has {triangles} triangles, which take {expected} bytes, but it has {bytes}")]
    Truncated { triangles: u64, expected: u64, bytes: u64 },
    /// Numbers of an attribute that make no vertices or faces.
    #[error("`{attribute}` has {found} numbers, which is no multiple of 3")]
    Threes { attribute: &'static str, found: usize },
    /// A mesh without triangles.
    #[error("has no triangles")]
    Empty,
    /// A coordinate that is not finite.
    #[error("vertex {vertex} is not finite")]
    NotFinite { vertex: usize },
    /// A mesh without a volume.
    #[error("is flat: its box has the sides {} m, and its hull no volume", sides(.0))]
    Flat([f64; 3]),
    /// A surface with holes, or whose triangles are turned differently.
    #[error(
        "is not closed: {edges} edges do not have one triangle on each side, turned alike; the first is from {from:?} to {to:?} m"
    )]
    Open { edges: usize, from: [f64; 3], to: [f64; 3] },
    /// A size that betrays millimetres.
    #[error("is {size} m long")]
    Size { size: f64 },
}

fn sides(x: &[f64; 3]) -> String {
    format!("{} × {} × {}", x[0], x[1], x[2])
}

impl MeshMistake {
    /// (likely cause, fix).
    pub fn advice(&self) -> (String, String) {
        let (cause, fix) = match self {
            Self::Read { .. } => ("the path is wrong, or the file may not be read", "check the path and the file's permissions"),
            Self::Format { .. } => ("a mesh for display", "convert it to STL or OBJ, or let a primitive shape touch instead"),
            Self::TooLarge { .. } => ("a scan, or a mesh for display", "reduce it; a hull needs few triangles"),
            Self::Line { .. } => ("the file is damaged, or of another format", "export the mesh again"),
            Self::NoVertex { .. } => ("vertices are counted from 1, or the file was cut off", "export the mesh again"),
            Self::Truncated { .. } => ("the file was cut off, or is another format", "export the mesh again"),
            Self::Threes { .. } => ("a number was left out", "write three numbers for each vertex or face"),
            Self::Empty => ("an empty export, or a file of lines and points alone", "export the mesh's surface"),
            Self::NotFinite { .. } => ("a damaged file, or a scale that is too large", "export the mesh again"),
            Self::Flat(_) => ("a plane for display", "give it a thickness, or use a box or a plane instead"),
            Self::Open { .. } => {
                ("a surface with holes, or exported without shared edges", "close it, or write inertia=\"convex\"")
            }
            Self::Size { .. } => {
                ("a mesh in millimetres", "write scale=\"0.001 0.001 0.001\"; if it is meant so, pass --approximate")
            }
        };
        (cause.to_owned(), fix.to_owned())
    }
}

/// A surface of triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Positions \[m\].
    pub vertices: Vec<Vec3<f64>>,
    /// Vertices of each triangle, counterclockwise from outside.
    pub triangles: Vec<[usize; 3]>,
}

impl Mesh {
    /// Reads an STL or OBJ file.
    pub fn read(path: &Path) -> Result<Self, MeshMistake> {
        let unread = |error: std::io::Error| MeshMistake::Read { error: error.to_string() };
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        if !["stl", "obj"].contains(&extension.as_str()) {
            return Err(MeshMistake::Format { extension });
        }
        let (bytes, most) = (std::fs::metadata(path).map_err(unread)?.len(), IMPORT.mesh_bytes);
        if bytes > most {
            return Err(MeshMistake::TooLarge { bytes, most });
        }
        let content = std::fs::read(path).map_err(unread)?;
        let mesh = if extension == "stl" { stl::parse(&content) } else { obj::parse(&String::from_utf8_lossy(&content)) }?;
        mesh.checked()
    }

    /// Of numbers, three for each vertex and three for each triangle; without triangles the hull of the vertices.
    pub fn of_numbers(vertices: &[f64], triangles: Option<&[f64]>) -> Result<Self, MeshMistake> {
        for (attribute, numbers) in [("vertex", vertices), ("face", triangles.unwrap_or(&[]))] {
            if numbers.len() % 3 != 0 {
                return Err(MeshMistake::Threes { attribute, found: numbers.len() });
            }
        }
        let vertices: Vec<_> = vertices.chunks_exact(3).map(|x| Vec3::new(x[0], x[1], x[2])).collect();
        let Some(triangles) = triangles else {
            let mesh = Self { vertices, triangles: vec![[0; 3]] }.checked()?;
            return mesh.hull().map(|hull| Self { vertices: hull.corners, triangles: hull.triangles });
        };
        let index = |x: &f64| {
            let index = (*x >= 0.0 && *x < vertices.len() as f64 && x.fract() == 0.0).then_some(*x as usize);
            index.ok_or(MeshMistake::NoVertex { line: 1, vertex: *x as i64, vertices: vertices.len() })
        };
        let triangles: Result<_, _> =
            triangles.chunks_exact(3).map(|t| Ok([index(&t[0])?, index(&t[1])?, index(&t[2])?])).collect();
        Self { triangles: triangles?, vertices }.checked()
    }

    /// With vertices at one place as one, and without triangles that this makes lines.
    fn checked(self) -> Result<Self, MeshMistake> {
        if self.triangles.is_empty() {
            return Err(MeshMistake::Empty);
        }
        if let Some(vertex) = self.vertices.iter().position(|x| !x.iter().all(|x| x.is_finite())) {
            return Err(MeshMistake::NotFinite { vertex });
        }
        let (mut places, mut vertices): (HashMap<[u64; 3], usize>, Vec<Vec3<f64>>) = (HashMap::new(), Vec::new());
        let index: Vec<usize> = self
            .vertices
            .iter()
            .map(|x| {
                *places.entry([0, 1, 2].map(|k| (x[k] + 0.0).to_bits())).or_insert_with(|| {
                    vertices.push(*x);
                    vertices.len() - 1
                })
            })
            .collect();
        let triangles =
            self.triangles.iter().map(|t| t.map(|k| index[k])).filter(|[a, b, c]| a != b && b != c && c != a).collect();
        Ok(Self { vertices, triangles })
    }

    /// Scaled along its axes; a mirrored one is turned inside out again.
    pub fn scaled(mut self, scale: &[f64; 3]) -> Self {
        self.vertices.iter_mut().for_each(|x| x.component_mul_assign(&Vec3::from(*scale)));
        if scale.iter().product::<f64>() < 0.0 {
            self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        self
    }

    /// In the axes of `pose`.
    pub fn seen_from(mut self, pose: &Pose) -> Self {
        let axes = pose.matrix();
        self.vertices.iter_mut().for_each(|x| *x = axes.tr_mul(&(*x - pose.position)));
        self
    }

    /// Sides of the box around it \[m\].
    pub fn extents(&self) -> [f64; 3] {
        [0, 1, 2].map(|k| {
            let along = self.vertices.iter().map(|x| x[k]);
            let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
            high - low
        })
    }

    /// Refuses one that is likely in millimetres.
    pub fn check_size(&self) -> Result<(), MeshMistake> {
        let size = self.extents().into_iter().fold(0.0, f64::max);
        if size > IMPORT.longest { Err(MeshMistake::Size { size }) } else { Ok(()) }
    }

    /// Its convex hull.
    pub fn hull(&self) -> Result<Hull, MeshMistake> {
        convex_hull(&self.vertices).ok_or_else(|| MeshMistake::Flat(self.extents()))
    }

    /// Its convex hull as a shape that touches: at most as many corners as are tried against those of others, the number that was left out,
    /// and how far these are outside \[m\].
    pub fn touching(&self) -> Result<(Vec<Vec3<f64>>, usize, f64), MeshMistake> {
        let hull = self.hull()?;
        let (reduced, outside) = hull.reduced(IMPORT.hull_corners);
        let left_out = hull.corners.len() - reduced.corners.len();
        Ok((reduced.corners, left_out, outside))
    }
}
