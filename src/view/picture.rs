//! The header of a page: the drawn objects, and the places of their numbers.
//!
//! Arrays over time have one row per frame: `positions` [frames × nodes × 3] and `poses` [frames × bodies × 7] in m and relative to
//! `center`, quaternions (w, x, y, z); `director` [frames × edges × 3], a unit vector across each edge.

use super::Caption;
use super::numbers::Slice;
use serde::Serialize;

/// Version of the header and of its meaning.
const SCHEMA_VERSION: u32 = 1;

/// Everything that is drawn.
#[derive(Debug, Serialize)]
pub(super) struct Picture<'a> {
    schema_version: u32,
    title: &'a str,
    /// Where the origin of all positions is \[m\].
    pub center: [f64; 3],
    /// Times of the frames \[s\].
    pub time: Slice,
    /// Total energies of the frames \[J\].
    pub energy: Slice,
    /// Says that states were left out, if some were.
    pub note: Option<String>,
    pub ropes: Vec<Rope<'a>>,
    pub meshes: Vec<Mesh>,
    /// The body that each body hangs on, and their poses.
    pub parents: Vec<Option<usize>>,
    pub poses: Slice,
    pub solids: Vec<Drawn<'a>>,
    /// Lines that show bodies without a shape.
    pub bones: Vec<Bone>,
    /// Points of grippers that grasp.
    pub points: Vec<Slice>,
    /// Quantities by which ropes and meshes can be coloured.
    pub scale: Option<Scale>,
}

/// A rope: a tube along its nodes.
#[derive(Debug, Serialize)]
pub(super) struct Rope<'a> {
    pub name: &'a str,
    pub nodes: usize,
    /// \[m\]
    pub radius: f64,
    pub positions: Slice,
    /// Nodes that a gripper moves, counted from the first.
    pub held: Vec<usize>,
    /// Values that colour each edge, [frames × edges].
    pub colour: Option<Slice>,
    /// A unit vector across each edge, painted as a stripe.
    pub director: Option<Slice>,
}

/// A surface of triangles, seen from both sides.
#[derive(Debug, Serialize)]
pub(super) struct Mesh {
    pub name: String,
    pub nodes: usize,
    pub positions: Slice,
    /// Three nodes each, counted from the mesh's first.
    pub triangles: Vec<[usize; 3]>,
    pub held: Vec<usize>,
    /// Values that colour each node, [frames × nodes].
    pub colour: Option<Slice>,
}

/// A shape that a body carries, or one that is fixed.
#[derive(Debug, Serialize)]
pub(super) struct Drawn<'a> {
    pub name: &'a str,
    pub form: &'static str,
    /// The body that carries it.
    pub body: Option<usize>,
    /// In the body's frame; of a fixed one relative to `center` \[m\].
    pub position: [f64; 3],
    pub quaternion: [f64; 4],
    /// \[m\]; as many as the form has.
    pub sizes: Vec<f64>,
    /// The surface of a hull.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hull: Option<Polyhedron>,
}

/// Corners \[m\] and triangles, counterclockwise from outside.
#[derive(Debug, Serialize)]
pub(super) struct Polyhedron {
    pub corners: Vec<[f64; 3]>,
    pub triangles: Vec<[usize; 3]>,
}

/// A line from a body's origin to a point of it.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Bone {
    pub body: usize,
    /// In the body's frame \[m\].
    pub to: [f64; 3],
    /// Whether that is its centre of mass.
    pub mass: bool,
}

/// Scale of a colour: from −`most` to `most`.
#[derive(Debug, Serialize)]
pub(super) struct Scale {
    pub name: &'static str,
    pub unit: &'static str,
    pub most: f64,
}

impl<'a> Picture<'a> {
    /// A picture of nothing yet.
    pub(super) fn new(caption: &'a Caption, center: [f64; 3], time: Slice, energy: Slice, poses: Slice) -> Self {
        Self {
            schema_version: SCHEMA_VERSION,
            title: &caption.title,
            center,
            time,
            energy,
            note: None,
            ropes: Vec::new(),
            meshes: Vec::new(),
            parents: Vec::new(),
            poses,
            solids: Vec::new(),
            bones: Vec::new(),
            points: Vec::new(),
            scale: None,
        }
    }

    /// JSON that may stand in a script element: `<` could end it.
    pub(super) fn to_script(&self) -> Result<String, serde_json::Error> {
        Ok(serde_json::to_string(self)?.replace('<', "\\u003c"))
    }
}

/// Says that states were left out.
pub(super) fn left_out(frames: usize, states: usize) -> String {
    format!("{frames} of {states} states are shown: at most 60 a second, and no more than keep the page below 20 MB")
}
