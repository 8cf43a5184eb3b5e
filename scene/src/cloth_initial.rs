//! Where the nodes of a sheet are at the beginning.

use super::cloth::Cloth;
use super::cloth_error::ClothMistake;
use super::error::{Mistake, SceneError};
use super::mesh::Mesh;
use super::vector::{V3, add, dot, norm, scale, sub, unit};
use pliant_math::Vec3;
use pliant_math::dihedral::fold;

/// Edges may start at between these parts of their rest length.
const STRAIN: std::ops::RangeInclusive<f64> = 0.1..=1.5;
/// Sharpest fold at which a sheet may start, 2 tan(θ/2): as a rope's, whose cosine is −0.999.
const SHARPEST: f64 = 89.0;
/// Largest cosine of the angle between the axes of a grid [-]: rounding of axes written with six digits.
const SQUARE: f64 = 1e-5;

/// Positions of the nodes of a sheet [m]; `c` is its number in the scene.
pub(super) fn cloth_points(cloth: &Cloth, c: usize) -> Result<Vec<V3>, SceneError> {
    let at = |key: &str| format!("cloth[{c}].{key}");
    let rest = cloth.rest(&format!("cloth[{c}]"))?;
    if let Some(points) = &cloth.points {
        if points.len() != rest.vertices.len() {
            let error = ClothMistake::Points { points: points.len(), nodes: rest.vertices.len() };
            return Err(SceneError::at(at("points"), Mistake::Cloth { error }));
        }
        possible(points, &rest)
            .map_err(|(node, error)| SceneError::at(at(&format!("points[{node}]")), Mistake::Cloth { error }))?;
        return Ok(points.clone());
    }
    let [u, v] = axes(cloth, &at)?;
    let placed = |x: &V3| match cloth.grid {
        Some(_) => add(cloth.origin, add(scale(u, x[0]), scale(v, x[1]))),
        None => add(cloth.origin, *x),
    };
    Ok(rest.vertices.iter().map(placed).collect())
}

fn axes(cloth: &Cloth, at: &dyn Fn(&str) -> String) -> Result<[V3; 2], SceneError> {
    let given = [("u_axis", cloth.u_axis, [1.0, 0.0, 0.0]), ("v_axis", cloth.v_axis, [0.0, 1.0, 0.0])];
    let mut out = [[0.0; 3]; 2];
    for ((key, axis, usual), out) in given.into_iter().zip(&mut out) {
        if axis.is_some() && cloth.grid.is_none() {
            return Err(SceneError::at(at(key), Mistake::Cloth { error: ClothMistake::AxesOfMesh { key } }));
        }
        *out = unit(axis.unwrap_or(usual)).ok_or_else(|| SceneError::at(at(key), Mistake::NoDirection))?;
    }
    let cosine = dot(out[0], out[1]);
    if cosine.abs() > SQUARE {
        let degrees = cosine.clamp(-1.0, 1.0).acos().to_degrees();
        let key = if cloth.v_axis.is_some() { "v_axis" } else { "u_axis" };
        return Err(SceneError::at(at(key), Mistake::Cloth { error: ClothMistake::Oblique { degrees } }));
    }
    Ok(out)
}

/// Refuses edges far from their rest length, and folds without radius: (node, mistake).
fn possible(points: &[V3], rest: &Mesh) -> Result<(), (usize, ClothMistake)> {
    for (triangle, beyond) in rest.triangles.iter().zip(&rest.beyond) {
        for k in 0..3 {
            let nodes = [triangle[(k + 1) % 3], triangle[(k + 2) % 3]];
            let length = |x: &[V3]| norm(sub(x[nodes[1]], x[nodes[0]]));
            let (now, at_rest) = (length(points), length(&rest.vertices));
            if !STRAIN.contains(&(now / at_rest)) {
                return Err((nodes[1], ClothMistake::Stretched { nodes, length: now, rest: at_rest }));
            }
            if let Some(far) = beyond[k] {
                let x = [nodes[0], nodes[1], triangle[k], far].map(|i| Vec3::from(points[i]));
                // also where a triangle has collapsed, and the fold is not a number
                let psi = fold(&x).0;
                if psi.is_nan() || psi.abs() >= SHARPEST {
                    return Err((nodes[0], ClothMistake::Folded { nodes }));
                }
            }
        }
    }
    Ok(())
}
