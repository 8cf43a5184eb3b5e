//! `pliant cable`.

use super::failure::Failure;
use super::{file, print};
use pliant::scene::{Cable, Clip, cable_scene, to_toml};
use std::io::Write;
use std::path::PathBuf;

#[derive(clap::Args)]
#[command(allow_negative_numbers = true)]
pub struct Arguments {
    /// File for the scene (TOML); without it the scene goes to stdout.
    #[arg(long, value_name = "SCENE.toml")]
    out: Option<PathBuf>,
    /// Number of links.
    #[arg(long, default_value_t = Cable::default().links)]
    links: usize,
    /// Length [m].
    #[arg(long, default_value_t = Cable::default().length)]
    length: f64,
    /// Radius [m].
    #[arg(long, default_value_t = Cable::default().radius)]
    radius: f64,
    /// Mass per length ρA [kg/m]; that of 1200 kg/m³ if left out.
    #[arg(long)]
    linear_density: Option<f64>,
    /// Bending stiffness EI [N·m²].
    #[arg(long, default_value_t = Cable::default().bend_stiffness)]
    bend_stiffness: f64,
    /// Twist stiffness GJ [N·m²]; EI if left out.
    #[arg(long)]
    twist_stiffness: Option<f64>,
    /// Damping of bending and twist [N·m²·s].
    #[arg(long, default_value_t = Cable::default().bend_damping)]
    bend_damping: f64,
    /// Fraction of a joint's elastic bend that relaxes every 1/240 s; 0 is elastic.
    #[arg(long, default_value_t = Cable::default().plasticity)]
    plasticity: f64,
    /// Elastic bend of a joint below which nothing relaxes [rad].
    #[arg(long)]
    yield_angle: Option<f64>,
    /// Friction coefficient of cable, clips and floor.
    #[arg(long, default_value_t = Cable::default().friction)]
    friction: f64,
    /// Hold the first end.
    #[arg(long)]
    clamped: bool,
    /// Position of the first end [m].
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], default_values_t = Cable::default().position)]
    position: Vec<f64>,
    /// Direction of the cable from its first end.
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], default_values_t = Cable::default().direction)]
    direction: Vec<f64>,
    /// Height of a floor [m].
    #[arg(long)]
    floor: Option<f64>,
    /// A U-shaped clip: centre of its floor [m], and yaw of its slot from the x axis [rad]. May be repeated.
    #[arg(long, num_args = 4, value_names = ["X", "Y", "Z", "YAW"])]
    clip: Vec<f64>,
    /// Width between the walls of clips [m].
    #[arg(long, default_value_t = Clip::default().opening)]
    clip_opening: f64,
    /// Thickness of walls and floors of clips [m].
    #[arg(long, default_value_t = Clip::default().wall)]
    clip_wall: f64,
    /// Length of the slots of clips [m].
    #[arg(long, default_value_t = Clip::default().depth)]
    clip_depth: f64,
    /// Height of the walls of clips [m].
    #[arg(long, default_value_t = Clip::default().height)]
    clip_height: f64,
}

/// Writes the scene of a cable.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    if let Some(out) = &arguments.out {
        file::check(out)?;
    }
    let clips: Vec<Clip> = arguments.clip.chunks_exact(4).enumerate().map(|(k, at)| clip(arguments, k, at)).collect();
    let cable = cable(arguments);
    let scene = to_toml(&cable_scene(&cable, &clips, arguments.floor)?, &cable.summary());
    match &arguments.out {
        Some(out) => {
            file::write(out, |file| file.write_all(scene.as_bytes()))?;
            print::data(&format!("wrote {}: {}", out.display(), cable.summary()))
        }
        None => print::data(scene.trim_end()),
    }
}

fn cable(arguments: &Arguments) -> Cable {
    let vector = |x: &[f64]| std::array::from_fn(|k| x[k]);
    Cable {
        links: arguments.links,
        length: arguments.length,
        radius: arguments.radius,
        linear_density: arguments.linear_density.unwrap_or_else(|| Cable::density_of(arguments.radius)),
        bend_stiffness: arguments.bend_stiffness,
        twist_stiffness: arguments.twist_stiffness,
        bend_damping: arguments.bend_damping,
        plasticity: arguments.plasticity,
        yield_angle: arguments.yield_angle,
        friction: arguments.friction,
        clamped: arguments.clamped,
        position: vector(&arguments.position),
        direction: vector(&arguments.direction),
        ..Cable::default()
    }
}

fn clip(arguments: &Arguments, k: usize, at: &[f64]) -> Clip {
    Clip {
        name: format!("clip_{k}"),
        position: [at[0], at[1], at[2]],
        yaw: at[3],
        opening: arguments.clip_opening,
        wall: arguments.clip_wall,
        depth: arguments.clip_depth,
        height: arguments.clip_height,
        friction: arguments.friction,
    }
}
