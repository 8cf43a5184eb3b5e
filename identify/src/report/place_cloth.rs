//! Where the numbers of a sheet stand in a scene file.

use pliant_scene::Cloth;
use toml::{Table, Value};

/// Writes out the numbers that a scene may leave to its other keys: each is a parameter of its own, and stays when those change.
pub(super) fn write_out(cloth: &mut Cloth) {
    cloth.bend_stiffness = Some(cloth.plate_stiffness());
    cloth.area_density = Some(cloth.mass_per_area());
    cloth.density = None;
    cloth.radius = Some(cloth.contact_radius());
}

/// Gives a grid this area, its sides in proportion, and returns the key; a mesh from a file has no such number.
pub(super) fn set_area(cloth: &mut Table, new: f64) -> Option<String> {
    let size = cloth.get_mut("grid")?.as_table_mut()?.get_mut("size")?.as_array_mut()?;
    let area: f64 = size.iter().filter_map(Value::as_float).product();
    for side in size.iter_mut() {
        *side = Value::Float(side.as_float()? * (new / area).sqrt());
    }
    Some("size".to_owned())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_new_stiffness_leaves_bending_and_weight_as_they_were() {
        let scene = Cloth { area_density: None, density: Some(200.0), thickness: 2e-3, ..Cloth::default() };
        let mut written = scene.clone();
        write_out(&mut written);
        assert_eq!((written.density, written.area_density, written.radius), (None, Some(0.4), Some(1e-3)));
        written.youngs_modulus *= 2.0;
        assert_eq!(written.plate_stiffness(), scene.plate_stiffness());
    }

    #[test]
    fn sides_grow_with_the_root_of_the_area() {
        let mut cloth: Table = toml::from_str("grid = { nodes = [3, 2], size = [0.4, 0.1] }").unwrap();
        assert_eq!(set_area(&mut cloth, 0.16).unwrap(), "size");
        let size: Vec<f64> = cloth["grid"]["size"].as_array().unwrap().iter().filter_map(Value::as_float).collect();
        assert!((size[0] - 0.8).abs() < 1e-12 && (size[1] - 0.2).abs() < 1e-12, "{size:?}");
        assert_eq!(set_area(&mut toml::from_str("mesh = \"sheet.obj\"").unwrap(), 1.0), None);
    }
}
