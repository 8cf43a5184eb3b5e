//! Wavefront OBJ: vertices and faces of any number of corners.

use super::{Mesh, MeshMistake};
use pliant_math::Vec3;

/// `v x y z` and `f a b c …`: vertices are counted from 1, or backwards from the last one by negative numbers; `/vt/vn` behind them is
/// not looked at, nor is any other line. Faces are cut into triangles from their first corner.
pub(super) fn parse(text: &str) -> Result<Mesh, MeshMistake> {
    let mut mesh = Mesh::default();
    let mut faces: Vec<(usize, Vec<i64>)> = Vec::new();
    for (line, text) in text.lines().enumerate().map(|(k, text)| (k + 1, text.split('#').next().unwrap_or("").trim())) {
        let refused = |what| MeshMistake::Line { line, text: text.to_owned(), what };
        let mut words = text.split_whitespace();
        match words.next() {
            Some("v") => mesh.vertices.push(vertex(words).ok_or_else(|| refused("vertex"))?),
            Some("f") => faces.push((line, corners(words, mesh.vertices.len()).ok_or_else(|| refused("face"))?)),
            _ => {}
        }
    }
    let vertices = mesh.vertices.len();
    for (line, corners) in faces {
        let index = |&vertex: &i64| {
            let index = usize::try_from(vertex).ok().and_then(|v| v.checked_sub(1)).filter(|i| *i < vertices);
            index.ok_or(MeshMistake::NoVertex { line, vertex, vertices })
        };
        let corners = corners.iter().map(index).collect::<Result<Vec<_>, _>>()?;
        mesh.triangles.extend(corners.windows(2).skip(1).map(|pair| [corners[0], pair[0], pair[1]]));
    }
    Ok(mesh)
}

fn vertex<'a>(words: impl Iterator<Item = &'a str>) -> Option<Vec3<f64>> {
    let numbers: Vec<f64> = words.take(3).map(|word| word.parse().ok()).collect::<Option<_>>()?;
    <[f64; 3]>::try_from(numbers).ok().map(Vec3::from)
}

/// Numbers of a face's vertices from 1, at least three; negative ones counted back from the `so_far` vertices above the line.
fn corners<'a>(words: impl Iterator<Item = &'a str>, so_far: usize) -> Option<Vec<i64>> {
    let number = |word: &str| word.split('/').next()?.parse::<i64>().ok();
    let counted = |n: i64| if n < 0 { i64::try_from(so_far).ok()?.checked_add(n)?.checked_add(1) } else { Some(n) };
    let corners: Vec<i64> = words.map(|word| number(word).and_then(counted)).collect::<Option<_>>()?;
    (corners.len() >= 3).then_some(corners)
}
