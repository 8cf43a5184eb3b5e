//! Scenes of cables.

use crate::errors::input;
use pliant::scene::{Cable, Clip, cable_scene, to_toml};
use pyo3::prelude::*;
use std::collections::BTreeMap;

/// The text of a scene with a cable: `links` capsules joined by springs of EI/link. The defaults are SILO's cable.
///
/// `clips` are dictionaries with `position` and, if they differ from the defaults, `yaw`, `opening`, `wall`, `depth`, `height`,
/// `friction`, `name`. `floor` is the height of a floor. All numbers are in SI units.
#[pyfunction]
#[pyo3(signature = (*, name=None, links=None, length=None, radius=None, linear_density=None, bend_stiffness=None,
    twist_stiffness=None, bend_damping=None, plasticity=None, yield_angle=None, friction=None, clamped=false, position=None,
    direction=None, clips=Vec::new(), floor=None))]
#[allow(clippy::too_many_arguments)] // keywords of Python
pub fn cable(
    name: Option<String>,
    links: Option<usize>,
    length: Option<f64>,
    radius: Option<f64>,
    linear_density: Option<f64>,
    bend_stiffness: Option<f64>,
    twist_stiffness: Option<f64>,
    bend_damping: Option<f64>,
    plasticity: Option<f64>,
    yield_angle: Option<f64>,
    friction: Option<f64>,
    clamped: bool,
    position: Option<[f64; 3]>,
    direction: Option<[f64; 3]>,
    clips: Vec<BTreeMap<String, Bound<'_, PyAny>>>,
    floor: Option<f64>,
) -> PyResult<String> {
    let default = Cable::default();
    let radius = radius.unwrap_or(default.radius);
    let cable = Cable {
        name: name.unwrap_or(default.name),
        links: links.unwrap_or(default.links),
        length: length.unwrap_or(default.length),
        radius,
        linear_density: linear_density.unwrap_or_else(|| Cable::density_of(radius)),
        bend_stiffness: bend_stiffness.unwrap_or(default.bend_stiffness),
        twist_stiffness,
        bend_damping: bend_damping.unwrap_or(default.bend_damping),
        plasticity: plasticity.unwrap_or(default.plasticity),
        yield_angle,
        friction: friction.unwrap_or(default.friction),
        clamped,
        position: position.unwrap_or(default.position),
        direction: direction.unwrap_or(default.direction),
    };
    let clips = clips.iter().enumerate().map(|(k, given)| clip(k, given)).collect::<PyResult<Vec<_>>>()?;
    let scene = cable_scene(&cable, &clips, floor).map_err(input)?;
    Ok(to_toml(&scene, &cable.summary()))
}

fn clip(k: usize, given: &BTreeMap<String, Bound<'_, PyAny>>) -> PyResult<Clip> {
    let mut clip = Clip { name: format!("clip_{k}"), ..Clip::default() };
    for (key, value) in given {
        match key.as_str() {
            "name" => clip.name = value.extract()?,
            "position" => clip.position = value.extract()?,
            "yaw" => clip.yaw = value.extract()?,
            "opening" => clip.opening = value.extract()?,
            "wall" => clip.wall = value.extract()?,
            "depth" => clip.depth = value.extract()?,
            "height" => clip.height = value.extract()?,
            "friction" => clip.friction = value.extract()?,
            _ => {
                let known = "name, position, yaw, opening, wall, depth, height, friction";
                return Err(input(format!(
                    "clips[{k}]: unknown key `{key}`\n  likely cause: a typing error\n  fix: write keys among {known}"
                )));
            }
        }
    }
    Ok(clip)
}
