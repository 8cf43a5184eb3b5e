//! Sheets of cloth: required keys, signs, sizes, start.

use super::super::cloth::{Cloth, Grid};
use super::super::cloth_error::ClothMistake;
use super::super::cloth_initial::cloth_points;
use super::super::error::{Mistake, SceneError};
use super::super::mesh::Mesh;
use super::super::rope::Touching;
use super::super::words::list;
use super::{not_negative, positive};

/// The largest sheet [m] that is not taken for one in millimetres.
const LARGEST: f64 = 1000.0;
/// The densest material [kg/m³]; osmium has 22 600.
const DENSEST: f64 = 1e5;
/// A sheet lighter than air [kg/m³] has a thickness or a density in another unit.
const LIGHTEST: f64 = 1.0;
/// Poisson's ratios that an isotropic material can have, with a distance from −1, where its shear stiffness is infinite.
const POISSON: (f64, f64) = (-0.999, 0.5);

pub(super) fn check(cloth: &Cloth, c: usize) -> Result<(), SceneError> {
    let at = |key: &str| format!("cloth[{c}].{key}");
    one_of(&at, ["grid", "mesh"], [cloth.grid.is_some(), cloth.mesh.is_some()])?;
    one_of(&at, ["density", "area_density"], [cloth.density.is_some(), cloth.area_density.is_some()])?;
    if let Some(grid) = &cloth.grid {
        cells(grid, &at)?;
    }
    numbers(cloth, &at)?;
    if cloth.contact == Touching::Edges && cloth.contact_radius() == 0.0 {
        return Err(SceneError::at(at("radius"), Mistake::ThinEdges));
    }
    let rest = cloth.rest(&format!("cloth[{c}]"))?;
    units(cloth, &rest, &at)?;
    cloth_points(cloth, c).map(|_| ())
}

fn one_of(at: &dyn Fn(&str) -> String, keys: [&str; 2], given: [bool; 2]) -> Result<(), SceneError> {
    match given.iter().filter(|given| **given).count() {
        1 => Ok(()),
        given => {
            let field = if given == 0 { at("") } else { at(keys[0]) };
            Err(SceneError::at(field.trim_end_matches('.'), Mistake::OneOf { keys: list(keys), given }))
        }
    }
}

fn cells(grid: &Grid, at: &dyn Fn(&str) -> String) -> Result<(), SceneError> {
    for (a, side) in ["u", "v"].into_iter().enumerate() {
        if grid.nodes[a] < 2 {
            let error = ClothMistake::NoCells { nodes: grid.nodes[a], side };
            return Err(SceneError::at(at(&format!("grid.nodes[{a}]")), Mistake::Cloth { error }));
        }
        positive(&at(&format!("grid.size[{a}]")), grid.size[a], "m")?;
    }
    Ok(())
}

fn numbers(cloth: &Cloth, at: &dyn Fn(&str) -> String) -> Result<(), SceneError> {
    positive(&at("thickness"), cloth.thickness, "m")?;
    for (key, value, unit) in [("density", cloth.density, "kg/m³"), ("area_density", cloth.area_density, "kg/m²")] {
        value.map_or(Ok(()), |value| positive(&at(key), value, unit))?;
    }
    positive(&at("youngs_modulus"), cloth.youngs_modulus, "Pa")?;
    let (low, high) = POISSON;
    if !(low..=high).contains(&cloth.poisson_ratio) {
        return Err(SceneError::at(at("poisson_ratio"), Mistake::Range { value: cloth.poisson_ratio, low, high }));
    }
    let quantities = [
        ("bend_stiffness", cloth.bend_stiffness.unwrap_or(0.0), "N·m"),
        ("membrane_damping", cloth.membrane_damping, "Pa·s"),
        ("bend_damping", cloth.bend_damping, "N·m·s"),
        ("drag_normal", cloth.drag_normal, "kg/(m²·s)"),
        ("drag_quadratic", cloth.drag_quadratic, "kg/m³"),
        ("radius", cloth.radius.unwrap_or(0.0), "m"),
    ];
    quantities.iter().try_for_each(|(key, value, unit)| not_negative(&at(key), *value, unit))
}

/// Sizes that betray another unit.
fn units(cloth: &Cloth, rest: &Mesh, at: &dyn Fn(&str) -> String) -> Result<(), SceneError> {
    let refuse = |key: &str, value: f64, unit, reason: String, likely| {
        Err(SceneError::at(at(key), Mistake::Unit { value, unit, reason, likely, instead: 1e-3 * value }))
    };
    let [longest, across, _] = rest.extents();
    if longest > LARGEST {
        let key = if cloth.grid.is_some() { "grid.size" } else { "mesh" };
        return refuse(key, longest, "m", format!(", longer than {LARGEST} m"), "mm");
    }
    if cloth.thickness > across {
        return refuse("thickness", cloth.thickness, "m", format!(", thicker than the sheet is wide ({across} m)"), "mm");
    }
    if cloth.contact_radius() > across {
        return refuse("radius", cloth.contact_radius(), "m", format!(", more than the sheet is wide ({across} m)"), "mm");
    }
    let (nodes, edge) = rest.longest_edge();
    let [first, second] = nodes;
    if cloth.thickness > 0.2 * across || cloth.thickness > 2.0 * edge {
        let edge = format!("the longest edge, from node {first} to node {second}, is {edge} m long");
        let reason = format!(", too thick for a sheet: it is {across} m wide, and {edge}");
        return refuse("thickness", cloth.thickness, "m", reason, "mm");
    }
    if cloth.contact_radius() > 5.0 * edge {
        let reason = format!(", but the longest edge, from node {first} to node {second}, is {edge} m long");
        return refuse("radius", cloth.contact_radius(), "m", reason, "mm");
    }
    let density = cloth.mass_per_area() / cloth.thickness;
    if density < LIGHTEST {
        return match (cloth.area_density, cloth.density) {
            (None, Some(value)) => {
                let mistake = Mistake::Unit {
                    value,
                    unit: "kg/m³",
                    reason: ", lighter than air".to_owned(),
                    likely: "g/cm³",
                    instead: 1e3 * value,
                };
                Err(SceneError::at(at("density"), mistake))
            }
            _ => {
                let reason = format!(", which makes the sheet lighter than air, {density:.2e} kg/m³");
                refuse("thickness", cloth.thickness, "m", reason, "mm")
            }
        };
    }
    if density > DENSEST {
        let reason = format!(", which in a thickness of {} m is {density:.0} kg/m³, denser than any metal", cloth.thickness);
        return match (cloth.area_density, cloth.density) {
            (Some(value), _) => refuse("area_density", value, "kg/m²", reason, "g/m²"),
            (_, value) => refuse("density", value.unwrap_or(density), "kg/m³", ", denser than any metal".to_owned(), "g/m³"),
        };
    }
    Ok(())
}
