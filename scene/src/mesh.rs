//! Triangles of a sheet: checks of the mesh, and neighbours.

use super::cloth_error::ClothMistake;
use super::error::{Mistake, SceneError};
use super::place::Place;
use super::vector::{V3, dot, norm, sub};
use std::collections::HashMap;

/// Least area of a triangle, as a part of its longest edge squared.
const THINNEST: f64 = 1e-6;

/// Nodes and triangles as a grid or a file has them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Raw {
    /// Positions [m].
    pub vertices: Vec<V3>,
    /// Triangles, by vertices from 0.
    pub faces: Vec<[usize; 3]>,
    /// The file.
    pub file: Option<String>,
    /// Its line of every vertex and of every face.
    pub vertex_lines: Vec<usize>,
    /// Lines of faces.
    pub face_lines: Vec<usize>,
}

/// A sheet at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// Positions of the nodes [m].
    pub vertices: Vec<V3>,
    /// Triangles, all of a piece turned the same way.
    pub triangles: Vec<[usize; 3]>,
    /// Of every triangle the third node of the neighbour across the edge opposite of each of its nodes.
    pub beyond: Vec<[Option<usize>; 3]>,
}

impl Mesh {
    /// Checks the triangles and turns them so that neighbours see the same side; `field` is its name in errors.
    pub fn new(raw: &Raw, field: &str) -> Result<Self, SceneError> {
        let at_face = |t: usize, mistake| refused(raw, raw.face_lines.get(t), field, mistake);
        if raw.faces.is_empty() {
            return Err(refused(raw, None, field, ClothMistake::NoTriangles));
        }
        for (t, face) in raw.faces.iter().enumerate() {
            triangle(raw, t, *face).map_err(|mistake| at_face(t, mistake))?;
        }
        duplicates(&raw.faces).map_err(|(t, mistake)| at_face(t, mistake))?;
        if let Some(vertex) = unused(raw) {
            return Err(refused(raw, raw.vertex_lines.get(vertex), field, ClothMistake::Unused { vertex }));
        }
        let edges = edges(&raw.faces).map_err(|(t, mistake)| at_face(t, mistake))?;
        let mut triangles = raw.faces.clone();
        turn(&mut triangles, &edges).map_err(|(t, mistake)| at_face(t, mistake))?;
        let beyond = triangles.iter().enumerate().map(|(t, face)| neighbours(&triangles, &edges, t, face)).collect();
        Ok(Self { vertices: raw.vertices.clone(), triangles, beyond })
    }

    /// Area of a triangle [m²].
    pub fn area(&self, t: usize) -> f64 {
        let [a, b, c] = self.triangles[t].map(|i| self.vertices[i]);
        area(a, b, c)
    }

    /// Area of the sheet [m²].
    pub fn total_area(&self) -> f64 {
        (0..self.triangles.len()).map(|t| self.area(t)).sum()
    }

    /// Part of the area that belongs to each node: a third of its triangles.
    pub fn fractions(&self) -> Vec<f64> {
        let (mut out, total) = (vec![0.0; self.vertices.len()], self.total_area());
        for (t, face) in self.triangles.iter().enumerate() {
            let share = self.area(t) / (3.0 * total);
            face.iter().for_each(|&i| out[i] += share);
        }
        out
    }

    /// Nodes and length [m] of the longest edge.
    pub fn longest_edge(&self) -> ([usize; 2], f64) {
        let edges = self.triangles.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]);
        let long = edges.map(|[a, b]| ([a, b], norm(sub(self.vertices[b], self.vertices[a]))));
        long.fold(([0, 0], 0.0), |longest, edge| if edge.1 > longest.1 { edge } else { longest })
    }

    /// Extents of the box around it, the largest first [m].
    pub fn extents(&self) -> V3 {
        let size = |a: usize| {
            let along = self.vertices.iter().map(|x| x[a]);
            let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
            high - low
        };
        let mut out = [size(0), size(1), size(2)];
        out.sort_by(|a, b| b.total_cmp(a));
        out
    }
}

fn refused(raw: &Raw, line: Option<&usize>, field: &str, mistake: ClothMistake) -> SceneError {
    let place = Place { file: raw.file.clone(), line: line.copied(), column: None, field: field.to_owned() };
    SceneError::new(place, Mistake::Cloth { error: mistake })
}

fn area(a: V3, b: V3, c: V3) -> f64 {
    let (u, v) = (sub(b, a), sub(c, a));
    let cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    0.5 * norm(cross)
}

fn triangle(raw: &Raw, t: usize, face: [usize; 3]) -> Result<(), ClothMistake> {
    let x = face.map(|i| raw.vertices[i]);
    let mut longest = 0.0_f64;
    for (k, [i, j]) in [[0, 1], [1, 2], [2, 0]].into_iter().enumerate() {
        let edge = sub(x[j], x[i]);
        if dot(edge, edge) == 0.0 {
            return Err(ClothMistake::NoLength { triangle: t, vertices: [face[k], face[(k + 1) % 3]] });
        }
        longest = longest.max(norm(edge));
    }
    let area = area(x[0], x[1], x[2]);
    // also where the numbers are not finite
    if area >= THINNEST * longest * longest { Ok(()) } else { Err(ClothMistake::Degenerate { triangle: t, area, longest }) }
}

fn duplicates(faces: &[[usize; 3]]) -> Result<(), (usize, ClothMistake)> {
    let mut seen = HashMap::new();
    for (t, face) in faces.iter().enumerate() {
        let mut key = *face;
        key.sort_unstable();
        if let Some(first) = seen.insert(key, t) {
            return Err((t, ClothMistake::Duplicate { first, second: t }));
        }
    }
    Ok(())
}

fn unused(raw: &Raw) -> Option<usize> {
    let mut used = vec![false; raw.vertices.len()];
    raw.faces.iter().flatten().for_each(|&i| used[i] = true);
    used.iter().position(|used| !used)
}

/// Triangles at every edge, its lower vertex first.
type Edges = HashMap<[usize; 2], Vec<usize>>;

fn key(i: usize, j: usize) -> [usize; 2] {
    [i.min(j), i.max(j)]
}

fn edges(faces: &[[usize; 3]]) -> Result<Edges, (usize, ClothMistake)> {
    let mut out = Edges::new();
    for (t, face) in faces.iter().enumerate() {
        for k in 0..3 {
            let edge = key(face[k], face[(k + 1) % 3]);
            let sides = out.entry(edge).or_default();
            sides.push(t);
            if let [first, second, third] = sides[..] {
                return Err((t, ClothMistake::ThreeAtEdge { edge, triangles: [first, second, third] }));
            }
        }
    }
    Ok(out)
}

/// The triangle on the other side of an edge.
fn across(edges: &Edges, t: usize, edge: [usize; 2]) -> Option<usize> {
    edges.get(&edge)?.iter().copied().find(|other| *other != t)
}

/// Whether a triangle runs from i to j.
fn runs(face: &[usize; 3], i: usize, j: usize) -> bool {
    (0..3).any(|k| face[k] == i && face[(k + 1) % 3] == j)
}

/// Turns triangles so that neighbours agree with the first one of their piece.
fn turn(triangles: &mut [[usize; 3]], edges: &Edges) -> Result<(), (usize, ClothMistake)> {
    let mut seen = vec![false; triangles.len()];
    let mut open = Vec::new();
    for first in 0..triangles.len() {
        if seen[first] {
            continue;
        }
        seen[first] = true;
        open.push(first);
        while let Some(t) = open.pop() {
            let face = triangles[t];
            for k in 0..3 {
                let (i, j) = (face[k], face[(k + 1) % 3]);
                let Some(other) = across(edges, t, key(i, j)) else { continue };
                let against = runs(&triangles[other], i, j);
                if seen[other] && against {
                    return Err((t, ClothMistake::OneSided { triangles: [t, other] }));
                }
                if !seen[other] {
                    if against {
                        triangles[other].swap(1, 2);
                    }
                    seen[other] = true;
                    open.push(other);
                }
            }
        }
    }
    Ok(())
}

fn neighbours(triangles: &[[usize; 3]], edges: &Edges, t: usize, face: &[usize; 3]) -> [Option<usize>; 3] {
    [0, 1, 2].map(|k| {
        let (i, j) = (face[(k + 1) % 3], face[(k + 2) % 3]);
        let other = across(edges, t, key(i, j))?;
        triangles[other].into_iter().find(|n| *n != i && *n != j)
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn raw(faces: &[[usize; 3]]) -> Raw {
        let vertices = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.5, 1.0]];
        Raw { vertices, faces: faces.to_vec(), ..Raw::default() }
    }

    fn mistake(raw: &Raw) -> ClothMistake {
        match *Mesh::new(raw, "cloth[0].mesh").unwrap_err().mistake {
            Mistake::Cloth { error } => error,
            other => unreachable!("{other}"),
        }
    }

    #[test]
    fn turns_triangles_to_agree_and_finds_who_is_beyond() {
        let mesh = Mesh::new(&raw(&[[0, 1, 2], [0, 2, 3], [4, 0, 3]]), "").unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [4, 0, 3].map(|i| i)].map(|t| t));
        assert_eq!(mesh.beyond[0], [None, Some(3), None]);
        let mesh = Mesh::new(&raw(&[[0, 1, 2], [3, 2, 0], [4, 3, 0]]), "").unwrap();
        assert_eq!(mesh.triangles[1], [3, 0, 2]);
        assert!((mesh.fractions().iter().sum::<f64>() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn refuses_what_no_sheet_can_be() {
        assert_eq!(mistake(&raw(&[])), ClothMistake::NoTriangles);
        assert!(matches!(mistake(&raw(&[[0, 1, 1]])), ClothMistake::NoLength { triangle: 0, vertices: [1, 1] }));
        let mut line = raw(&[[0, 1, 2], [0, 2, 3], [0, 1, 4]]);
        line.vertices[4] = [2.0, 1e-9, 0.0];
        assert!(matches!(mistake(&line), ClothMistake::Degenerate { triangle: 2, .. }));
        line.vertices[4] = [0.0, f64::NAN, 0.0];
        assert!(matches!(mistake(&line), ClothMistake::Degenerate { triangle: 2, .. }));
        assert_eq!(mistake(&raw(&[[0, 1, 2], [2, 0, 1]])), ClothMistake::Duplicate { first: 0, second: 1 });
        assert_eq!(mistake(&raw(&[[0, 1, 2], [0, 2, 3]])), ClothMistake::Unused { vertex: 4 });
        let three = raw(&[[0, 1, 2], [0, 1, 3], [1, 0, 4]]);
        assert_eq!(mistake(&three), ClothMistake::ThreeAtEdge { edge: [0, 1], triangles: [0, 1, 2] });
    }

    /// Five triangles in a ring with half a turn.
    #[test]
    fn refuses_a_sheet_with_one_side() {
        let band = raw(&[[0, 1, 2], [1, 2, 3], [2, 3, 4], [3, 4, 0], [4, 0, 1]]);
        assert!(matches!(mistake(&band), ClothMistake::OneSided { .. }));
    }
}
