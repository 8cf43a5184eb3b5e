//! STL, binary and as text.

use super::{Mesh, MeshMistake};
use pliant_math::Vec3;

/// Bytes before the triangles of a binary file, and of each triangle.
const HEAD: u64 = 84;
const TRIANGLE: u64 = 50;

/// A file is binary if its length is that of the triangles it announces, and text if it begins with `solid`.
pub(super) fn parse(content: &[u8]) -> Result<Mesh, MeshMistake> {
    let bytes = content.len() as u64;
    let triangles = content.get(80..84).and_then(|b| <[u8; 4]>::try_from(b).ok()).map_or(0, |b| u64::from(u32::from_le_bytes(b)));
    let expected = HEAD + TRIANGLE * triangles;
    if bytes == expected {
        return Ok(binary(content));
    }
    if content.trim_ascii_start().starts_with(b"solid") {
        return text(&String::from_utf8_lossy(content));
    }
    Err(MeshMistake::Truncated { triangles, expected, bytes })
}

/// Normals are not read: those of the corners' order count.
fn binary(content: &[u8]) -> Mesh {
    let mut mesh = Mesh::default();
    for triangle in content[HEAD as usize..].chunks_exact(TRIANGLE as usize) {
        let mut numbers = triangle[12..48].chunks_exact(4).map(|b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])));
        let mut next = || numbers.next().unwrap_or(f64::NAN);
        mesh.push([(); 3].map(|()| Vec3::new(next(), next(), next())));
    }
    mesh
}

fn text(text: &str) -> Result<Mesh, MeshMistake> {
    let mut mesh = Mesh::default();
    let mut corners = Vec::new();
    for (line, text) in text.lines().enumerate().map(|(k, text)| (k + 1, text.trim())) {
        let refused = |what| MeshMistake::Line { line, text: text.to_owned(), what };
        let mut words = text.split_whitespace();
        match words.next() {
            Some("vertex") => {
                let numbers: Option<Vec<f64>> = words.map(|word| word.parse().ok()).collect();
                let corner = numbers.and_then(|x| <[f64; 3]>::try_from(x).ok()).ok_or_else(|| refused("vertex"))?;
                corners.push(Vec3::from(corner));
            }
            Some("endloop") => {
                let triangle =
                    <[Vec3<f64>; 3]>::try_from(std::mem::take(&mut corners)).map_err(|_| refused("end of three vertices"))?;
                mesh.push(triangle);
            }
            Some("solid" | "facet" | "outer" | "endfacet" | "endsolid") | None => {}
            Some(_) => return Err(refused("line of STL")),
        }
    }
    Ok(mesh)
}

impl Mesh {
    fn push(&mut self, corners: [Vec3<f64>; 3]) {
        let first = self.vertices.len();
        self.vertices.extend(corners);
        self.triangles.push([first, first + 1, first + 2]);
    }
}
