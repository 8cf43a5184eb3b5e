//! Wavefront OBJ: vertices and faces, and nothing else of it.

use super::cloth_error::ClothMistake;
use super::error::{Mistake, SceneError};
use super::mesh::Raw;
use super::place::Place;
use super::source::Source;
use super::vector::{V3, norm, sub};
use std::path::Path;

/// Reads a file; `field` is its name in errors, beside file and line.
pub(super) fn read(path: &Path, field: &str) -> Result<Raw, SceneError> {
    let source = Source::read(path).map_err(|e| SceneError { place: Place { field: field.to_owned(), ..e.place }, ..e })?;
    parse(&source, field)
}

/// `v x y z` and `f a b c`: vertices are counted from 1, or backwards from the last one by negative numbers; `/vt/vn` behind them is
/// not looked at, nor is any other line. Quadrilaterals are cut along their shorter diagonal.
pub(super) fn parse(source: &Source, field: &str) -> Result<Raw, SceneError> {
    let mut out = Raw { file: Some(source.file.clone()), ..Raw::default() };
    let mut faces: Vec<(usize, Vec<i64>)> = Vec::new();
    for (line, text) in source.text.lines().enumerate().map(|(k, text)| (k + 1, text.split('#').next().unwrap_or(""))) {
        let refused = |mistake| Err(at(source, line, field, mistake));
        let mut words = text.split_whitespace();
        match words.next() {
            Some("v") => {
                let Some(vertex) = vertex(words) else {
                    return refused(ClothMistake::Obj { what: "vertex", text: text.trim().to_owned() });
                };
                out.vertices.push(vertex);
                out.vertex_lines.push(line);
            }
            Some("f") => match corners(words, out.vertices.len()) {
                Some(corners) => faces.push((line, corners)),
                None => return refused(ClothMistake::Obj { what: "face", text: text.trim().to_owned() }),
            },
            _ => {}
        }
    }
    for (line, corners) in faces {
        let face = checked(&corners, out.vertices.len()).map_err(|mistake| at(source, line, field, mistake))?;
        for triangle in cut(&out.vertices, &face) {
            out.faces.push(triangle);
            out.face_lines.push(line);
        }
    }
    Ok(out)
}

fn at(source: &Source, line: usize, field: &str, error: ClothMistake) -> SceneError {
    let place = Place { file: Some(source.file.clone()), line: Some(line), column: None, field: field.to_owned() };
    SceneError::new(place, Mistake::Cloth { error })
}

fn vertex<'a>(words: impl Iterator<Item = &'a str>) -> Option<V3> {
    let numbers: Vec<f64> = words.take(3).map(|word| word.parse().ok().filter(|x: &f64| x.is_finite())).collect::<Option<_>>()?;
    numbers.try_into().ok()
}

/// Numbers of a face's vertices from 1; negative ones counted back from the `so_far` vertices above the line.
fn corners<'a>(words: impl Iterator<Item = &'a str>, so_far: usize) -> Option<Vec<i64>> {
    let number = |word: &str| word.split('/').next()?.parse::<i64>().ok();
    let counted = |n: i64| if n < 0 { Some(i64::try_from(so_far).ok()?.checked_add(n)?.checked_add(1)?) } else { Some(n) };
    words.map(|word| number(word).and_then(counted)).collect()
}

fn checked(corners: &[i64], vertices: usize) -> Result<Vec<usize>, ClothMistake> {
    if !(3..=4).contains(&corners.len()) {
        return Err(ClothMistake::Corners { corners: corners.len() });
    }
    let index = |&vertex: &i64| {
        let index = usize::try_from(vertex).ok().and_then(|v| v.checked_sub(1)).filter(|i| *i < vertices);
        index.ok_or(ClothMistake::NoVertex { vertex, vertices })
    };
    corners.iter().map(index).collect()
}

fn cut(vertices: &[V3], face: &[usize]) -> Vec<[usize; 3]> {
    match *face {
        [a, b, c, d] => {
            let length = |i: usize, j: usize| norm(sub(vertices[i], vertices[j]));
            if length(a, c) <= length(b, d) { vec![[a, b, c], [a, c, d]] } else { vec![[a, b, d], [b, c, d]] }
        }
        [a, b, c] => vec![[a, b, c]],
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn error(text: &str) -> String {
        parse(&Source::new("sheet.obj", text), "cloth[0].mesh").unwrap_err().to_string()
    }

    #[test]
    fn reads_vertices_and_faces_and_nothing_else() {
        let text = "# a sheet\no sheet\nv 0 0 0\nv 1 0 0 1.0\nv 1 1.5e0 0 # corner\nv 0 1 0\nvt 0 0\nvn 0 0 1\ns off\nf 1/1/1 2//1 3/1\nf -4 -2 -1\n";
        let raw = parse(&Source::new("sheet.obj", text), "").unwrap();
        assert_eq!((raw.vertices.len(), raw.vertices[2]), (4, [1.0, 1.5, 0.0]));
        assert_eq!((raw.faces, raw.face_lines, raw.vertex_lines), (vec![[0, 1, 2], [0, 2, 3]], vec![10, 11], vec![3, 4, 5, 6]));
    }

    #[test]
    fn cuts_quadrilaterals_along_the_shorter_diagonal() {
        let raw = parse(&Source::new("s.obj", "v 0 0 0\nv 1 0 0\nv 2 1 0\nv 1 1 0\nf 1 2 3 4\n"), "").unwrap();
        assert_eq!(raw.faces, [[0, 1, 3], [1, 2, 3]]);
    }

    #[test]
    fn names_the_line_of_what_it_refuses() {
        let begins = |text: &str, start: &str| assert!(error(text).starts_with(start), "{}", error(text));
        begins("v 0 0\n", "sheet.obj:1: cloth[0].mesh: `v 0 0` is no vertex");
        begins("v 0 0 0\nv 1 x 0\n", "sheet.obj:2: cloth[0].mesh: `v 1 x 0` is no vertex");
        begins("v 0 0 0\nf 1 a 2\n", "sheet.obj:2: cloth[0].mesh: `f 1 a 2` is no face");
        begins("v 0 0 0\nv 1 0 0\nf 1 2 3\n", "sheet.obj:3: cloth[0].mesh: the face names vertex 3, but the file has 2");
        begins("v 0 0 0\nf 0 1 1\n", "sheet.obj:2: cloth[0].mesh: the face names vertex 0");
        begins("v 0 0 0\nf 1 1 1 1 1\n", "sheet.obj:2: cloth[0].mesh: the face has 5 corners");
        begins("v 0 0 0\nf 1 1\n", "sheet.obj:2: cloth[0].mesh: the face has 2 corners");
        begins("v 0 0 0\nf 1 1 -3\n", "sheet.obj:2: cloth[0].mesh: the face names vertex -1");
    }
}
