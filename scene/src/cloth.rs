//! Sheets of cloth in a scene file.

use super::error::SceneError;
use super::mesh::{Mesh, Raw};
use super::obj;
use super::rope::{Start, Touching};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A sheet of cloth, paper or rubber: triangles that stretch, shear and bend. Its parameters are `name.youngs_modulus`,
/// `name.bend_stiffness`, `name.area`, …
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cloth {
    /// Name, unique in the scene, used in parameter paths.
    pub name: String,
    /// A rectangle, flat at rest. Either this or `mesh`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid: Option<Grid>,
    /// An OBJ file of triangles, relative to the scene file; its shape is the shape at rest. Either this or `grid`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mesh: Option<String>,
    /// Where node (0, 0) of a grid begins, or how far a mesh is moved [m].
    #[serde(default)]
    pub origin: [f64; 3],
    /// Direction of a grid's u side as it begins (of any length); along x without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub u_axis: Option<[f64; 3]>,
    /// Direction of a grid's v side as it begins, square to `u_axis`; along y without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub v_axis: Option<[f64; 3]>,
    /// Where each node begins [m], instead of `origin` and axes: a deformed start of the same sheet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<Vec<[f64; 3]>>,
    /// Whether the initial positions are the start, or the guess of an equilibrium.
    #[serde(default)]
    pub start: Start,
    /// Initial velocity of every node [m/s].
    #[serde(default)]
    pub velocity: [f64; 3],
    /// Thickness t [m].
    pub thickness: f64,
    /// Mass per volume [kg/m³]. Either this or `area_density`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub density: Option<f64>,
    /// Mass per area [kg/m²]. Either this or `density`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub area_density: Option<f64>,
    /// Young's modulus E [Pa].
    pub youngs_modulus: f64,
    /// Poisson's ratio ν [-], from -0.999 to 0.5.
    #[serde(default = "third")]
    pub poisson_ratio: f64,
    /// Bending stiffness D of the plate [N·m]; E t³/(12 (1 − ν²)) without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bend_stiffness: Option<f64>,
    /// Viscosity against the rate of strain in the plane [Pa·s].
    #[serde(default)]
    pub membrane_damping: f64,
    /// Bending damping c_b [N·m·s].
    #[serde(default)]
    pub bend_damping: f64,
    /// Linear air drag per area, along the normal [kg/(m²·s)].
    #[serde(default)]
    pub drag_normal: f64,
    /// Quadratic air drag per area, along the normal [kg/m³].
    #[serde(default)]
    pub drag_quadratic: f64,
    /// Distance at which nodes touch [m]; half the thickness without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
    /// Parts of it that touch fixed shapes.
    #[serde(default, skip_serializing_if = "Touching::is_nodes")]
    pub contact: Touching,
    /// The file of `mesh`, read.
    #[serde(skip)]
    #[doc(hidden)]
    pub loaded: Option<Arc<Raw>>,
}

fn third() -> f64 {
    0.3
}

impl Default for Cloth {
    fn default() -> Self {
        Self {
            name: "sheet".to_owned(),
            grid: Some(Grid::default()),
            mesh: None,
            origin: [0.0; 3],
            u_axis: None,
            v_axis: None,
            points: None,
            start: Start::default(),
            velocity: [0.0; 3],
            thickness: 1e-3,
            density: None,
            area_density: Some(0.2),
            youngs_modulus: 1e5,
            poisson_ratio: third(),
            bend_stiffness: None,
            membrane_damping: 0.0,
            bend_damping: 0.0,
            drag_normal: 0.0,
            drag_quadratic: 0.0,
            radius: None,
            contact: Touching::default(),
            loaded: None,
        }
    }
}

impl Cloth {
    /// Number of nodes; 0 if the scene gives neither a grid nor a mesh that can be read.
    pub fn n_nodes(&self) -> usize {
        match (&self.grid, &self.loaded) {
            (Some(grid), _) => grid.nodes[0].saturating_mul(grid.nodes[1]),
            (None, Some(raw)) => raw.vertices.len(),
            (None, None) => self.raw("cloth").map_or(0, |raw| raw.vertices.len()),
        }
    }

    /// The node of that number, negative ones counted from the end; `None` if there is no such node.
    pub fn node(&self, number: i64) -> Option<usize> {
        let n = self.n_nodes();
        let index = if number < 0 { number.checked_add(i64::try_from(n).ok()?)? } else { number };
        usize::try_from(index).ok().filter(|index| *index < n)
    }

    /// Mass per area [kg/m²].
    pub fn mass_per_area(&self) -> f64 {
        self.area_density.unwrap_or_else(|| self.density.unwrap_or(0.0) * self.thickness)
    }

    /// Bending stiffness D [N·m]: as given, or E t³/(12 (1 − ν²)).
    pub fn plate_stiffness(&self) -> f64 {
        let nu = self.poisson_ratio;
        self.bend_stiffness.unwrap_or_else(|| self.youngs_modulus * self.thickness.powi(3) / (12.0 * (1.0 - nu * nu)))
    }

    /// Distance at which nodes touch [m].
    pub fn contact_radius(&self) -> f64 {
        self.radius.unwrap_or(0.5 * self.thickness)
    }

    /// The sheet at rest, checked. `field` names it in errors, e.g. `cloth[0]`.
    /// # Errors
    /// A file that cannot be read, and triangles that make no sheet.
    pub fn rest(&self, field: &str) -> Result<Mesh, SceneError> {
        let key = if self.grid.is_some() { "grid" } else { "mesh" };
        Mesh::new(&*self.raw(field)?, &format!("{field}.{key}"))
    }

    /// Nodes and triangles as the grid or the file has them.
    pub(super) fn raw(&self, field: &str) -> Result<Arc<Raw>, SceneError> {
        match (&self.grid, &self.loaded, &self.mesh) {
            (Some(grid), ..) => Ok(Arc::new(grid.raw())),
            (None, Some(raw), _) => Ok(Arc::clone(raw)),
            (None, None, Some(path)) => Ok(Arc::new(obj::read(path.as_ref(), &format!("{field}.mesh"))?)),
            (None, None, None) => Ok(Arc::default()),
        }
    }
}

/// A rectangle of nodes. Node (i, j), i along u and j along v, has the number i · nodes\[1\] + j.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Numbers of nodes along u and v, at least 2 each. The matrix is narrowest with the smaller one second.
    pub nodes: [usize; 2],
    /// Lengths of the sides along u and v [m].
    pub size: [f64; 2],
    /// Which way each cell is cut in two.
    #[serde(default)]
    pub diagonal: Diagonal,
}

impl Default for Grid {
    fn default() -> Self {
        Self { nodes: [6, 6], size: [0.5, 0.5], diagonal: Diagonal::default() }
    }
}

/// Diagonals that cut the cells of a grid into triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Diagonal {
    /// From node (i, j) to (i + 1, j + 1).
    #[default]
    Up,
    /// From node (i + 1, j) to (i, j + 1).
    Down,
    /// In turn, like a union jack: the grid has no direction of its own, but resists twist twice as much as a plate.
    Alternating,
}

impl Grid {
    fn raw(&self) -> Raw {
        let [nu, nv] = self.nodes;
        let along = |k: usize, a: usize| self.size[a] * k as f64 / (self.nodes[a] - 1).max(1) as f64;
        let along = &along;
        let vertices = (0..nu).flat_map(|i| (0..nv).map(move |j| [along(i, 0), along(j, 1), 0.0])).collect();
        let cells = (0..nu.saturating_sub(1)).flat_map(|i| (0..nv.saturating_sub(1)).map(move |j| (i, j)));
        let faces = cells.flat_map(|(i, j)| {
            let [a, b, c, d] = [i * nv + j, (i + 1) * nv + j, (i + 1) * nv + j + 1, i * nv + j + 1];
            match self.diagonal {
                Diagonal::Up => [[a, b, c], [a, c, d]],
                Diagonal::Alternating if (i + j) % 2 == 0 => [[a, b, c], [a, c, d]],
                Diagonal::Down | Diagonal::Alternating => [[a, b, d], [b, c, d]],
            }
        });
        Raw { faces: faces.collect(), vertices, ..Raw::default() }
    }
}
