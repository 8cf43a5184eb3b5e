//! Errors of sheets of cloth.

use super::words::Num;

/// The problem.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // the fields are the words of the messages
pub enum ClothMistake {
    /// A line of an OBJ file that cannot be read.
    #[error("`{text}` is no {what}")]
    Obj { what: &'static str, text: String },
    /// A face with more corners than four, or fewer than three.
    #[error("the face has {corners} corners; a sheet is made of triangles (and quadrilaterals, which are cut in two)")]
    Corners { corners: usize },
    /// A face of a vertex that the file does not have.
    #[error("the face names vertex {vertex}, but the file has {vertices}")]
    NoVertex { vertex: i64, vertices: usize },
    /// Nothing there.
    #[error("there is no triangle")]
    NoTriangles,
    /// An edge without length.
    #[error("triangle {triangle} has vertices {} and {} at the same place", vertices[0], vertices[1])]
    NoLength { triangle: usize, vertices: [usize; 2] },
    /// A triangle without area.
    #[error("triangle {triangle} has an area of {} m² at a longest edge of {} m: it is a line", Num(*.area), Num(*.longest))]
    Degenerate { triangle: usize, area: f64, longest: f64 },
    /// The same triangle twice.
    #[error("triangles {first} and {second} have the same vertices")]
    Duplicate { first: usize, second: usize },
    /// More than two triangles at an edge.
    #[error(
        "triangles {}, {} and {} meet at the edge from vertex {} to {}; a sheet has two sides there at most",
        triangles[0], triangles[1], triangles[2], edge[0], edge[1]
    )]
    ThreeAtEdge { edge: [usize; 2], triangles: [usize; 3] },
    /// A Möbius strip.
    #[error("triangles {} and {} cannot both face the same side: the sheet has only one, like a Möbius strip", triangles[0], triangles[1])]
    OneSided { triangles: [usize; 2] },
    /// A vertex of no triangle.
    #[error("vertex {vertex} belongs to no triangle, so it has no mass")]
    Unused { vertex: usize },
    /// A grid without cells.
    #[error("the grid has {nodes} node(s) along {side}; it needs at least 2")]
    NoCells { nodes: usize, side: &'static str },
    /// Axes that are not square.
    #[error("`u_axis` and `v_axis` are {degrees:.2} degrees apart, not 90")]
    Oblique { degrees: f64 },
    /// Axes of a mesh.
    #[error("a mesh has its own axes, so `{key}` says nothing")]
    AxesOfMesh { key: &'static str },
    /// As many points as nodes are needed.
    #[error("has {points} points, but the sheet has {nodes} nodes")]
    Points { points: usize, nodes: usize },
    /// A start far from the rest shape.
    #[error("the edge from node {} to node {} is {length:.4} m long, but {rest:.4} m at rest", nodes[0], nodes[1])]
    Stretched { nodes: [usize; 2], length: f64, rest: f64 },
    /// A start folded flat onto itself.
    #[error("the sheet folds back onto itself at the edge from node {} to node {}, where its curvature is infinite", nodes[0], nodes[1])]
    Folded { nodes: [usize; 2] },
    /// A node that the sheet does not have.
    #[error("cloth \"{cloth}\" has no node {node}: it has {nodes} nodes")]
    NoSuchNode { cloth: String, node: i64, nodes: usize },
    /// The end of a sheet.
    #[error("cloth \"{cloth}\" has no ends to hold")]
    NoEnds { cloth: String },
    /// Two commands for one node.
    #[error("node {node} of cloth \"{cloth}\" is already held by gripper \"{other}\"")]
    HeldTwice { cloth: String, node: usize, other: String, own: bool },
    /// A sheet that no shape can move.
    #[error("grippers hold every node of cloth \"{cloth}\", so it goes through the scene's {shapes} shape(s) and touches none")]
    AllHeld { cloth: String, shapes: usize },
    /// A node that starts inside a shape.
    #[error("node {node} of cloth \"{cloth}\" starts {depth:.4} m inside {shape} (its centre, not only its surface)")]
    Inside { cloth: String, node: usize, depth: f64, shape: String },
}

impl ClothMistake {
    /// (likely cause, fix).
    pub(super) fn advice(&self) -> (String, String) {
        let (cause, fix) = match self {
            Self::Obj { what, .. } => (
                "the file is no OBJ file, or was cut off",
                format!("write a {what} as `{}`", if *what == "vertex" { "v x y z" } else { "f a b c" }),
            ),
            Self::Corners { .. } => ("the mesh was exported with polygons", "triangulate it where it was made".to_owned()),
            Self::NoVertex { vertices, .. } => {
                ("vertices are counted from 1 in an OBJ file", format!("name a vertex from 1 to {vertices}"))
            }
            Self::NoTriangles => ("an empty mesh, or one of lines", "give it faces".to_owned()),
            Self::NoLength { .. } => {
                ("a vertex was written twice", "merge vertices by distance where the mesh was made".to_owned())
            }
            Self::Degenerate { .. } => ("three vertices on a line", "collapse it, or move one of its vertices aside".to_owned()),
            Self::Duplicate { .. } => ("a face was written twice, or once for each side", "keep one of them".to_owned()),
            Self::ThreeAtEdge { .. } => (
                "sheets that are sewn together, or a face inside a closed surface",
                "remove a face, or split the sheet in two".to_owned(),
            ),
            Self::OneSided { .. } => ("the strip is closed with half a turn", "cut it open at one edge".to_owned()),
            Self::Unused { .. } => ("a leftover of editing", "remove loose vertices where the mesh was made".to_owned()),
            Self::NoCells { .. } => ("numbers of cells instead of nodes", "write `nodes = [2, 2]` or more".to_owned()),
            Self::Oblique { .. } => (
                "axes that were measured, or one that was left at its default",
                "make them square; a sheared start is given by `points`".to_owned(),
            ),
            Self::AxesOfMesh { key } => {
                ("a grid was replaced by a mesh", format!("remove `{key}`; a start elsewhere is given by `points`"))
            }
            Self::Points { nodes, .. } => ("points were dropped, or the mesh was changed", format!("give {nodes} points")),
            Self::Stretched { length, rest, .. } if length > rest => (
                "points in mm and the size in m, or points in another order",
                "give points in the nodes' order, in m; an edge may start stretched by half at most".to_owned(),
            ),
            Self::Stretched { .. } => (
                "points in m and the size in mm, or points in another order",
                "give points in the nodes' order, in m; an edge may start at a tenth of its length at least".to_owned(),
            ),
            Self::Folded { .. } => {
                ("a fold without radius, or points in another order", "leave a gap between the layers".to_owned())
            }
            Self::NoSuchNode { nodes, .. } => (
                "nodes are counted from 0; node (i, j) of a grid has the number i · nodes[1] + j",
                format!("write a node from 0 to {}", nodes.saturating_sub(1)),
            ),
            Self::NoEnds { .. } => ("a gripper of a rope was copied", "name the nodes of an edge, `nodes = [...]`".to_owned()),
            Self::HeldTwice { own: true, .. } => {
                ("a node is listed twice, perhaps once as a negative number", "let one gripper hold each node".to_owned())
            }
            Self::HeldTwice { other, .. } => (
                "two grippers command one node, each its own way",
                format!("let one gripper hold each node: remove this one from `nodes` here, or from those of \"{other}\""),
            ),
            Self::AllHeld { .. } => {
                ("a gripper holds more nodes than meant", "leave nodes of it free, or remove the sheet or the shapes".to_owned())
            }
            Self::Inside { .. } => {
                ("the start or the shape is misplaced, or in another unit", "move the sheet or the shape apart".to_owned())
            }
        };
        (cause.to_owned(), fix)
    }
}
