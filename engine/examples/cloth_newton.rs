//! Newton iterations a step of sheets that hang, drape, crumple and are pushed together:
//! `cargo run --release -p pliant-engine --example cloth_newton -- 20 1e5 held,sphere,crumpled,pushed`; `LINEAR=band` factors in a
//! band, `RECORD=1` keeps records.

use pliant_engine::model::ModelBuilder;
use pliant_engine::step::{StepOptions, Stepper};
use pliant_scene as scene;
use pliant_scene::Scene;
use std::error::Error;
use std::fmt::Write;
use std::time::Instant;

/// A square sheet of `n` × `n` nodes that falls for a second.
fn sheet(kind: &str, n: usize, young: f64) -> Result<String, std::fmt::Error> {
    let mut text = format!(
        "schema_version = 1\n[time]\nstep = {}\nduration = 1.0\nintegrator = \"euler\"\n[solver]\nlinear = \"{}\"\n\
         [[cloth]]\nname = \"sheet\"\ngrid = {{ nodes = [{n}, {n}], size = [0.4, 0.4] }}\n\
         thickness = 1e-3\narea_density = 0.2\nyoungs_modulus = {young}\n",
        1.0 / 60.0,
        std::env::var("LINEAR").unwrap_or("auto".into())
    );
    let hold = |text: &mut String, name: &str, nodes: &[usize], motion: &str| {
        write!(text, "[[gripper]]\nname = \"{name}\"\ncloth = \"sheet\"\nnodes = {nodes:?}\nmotion = {motion}\n")
    };
    match kind {
        "held" => {
            hold(&mut text, "left", &[0], "{ kind = \"hold\" }")?;
            hold(&mut text, "right", &[n - 1], "{ kind = \"hold\" }")?;
        }
        "sphere" => {
            text +=
                "origin = [-0.2, -0.2, 0.105]\n[[sphere]]\nname = \"ball\"\ncenter = [0, 0, 0]\nradius = 0.1\nfriction = 0.4\n";
            text += "[contact]\nrest_gap = 1e-6\n";
        }
        "crumpled" => {
            // squeezed by a tenth and waved, and let go
            text += "points = [";
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                let (x, y) = (i as f64 / (n - 1) as f64, j as f64 / (n - 1) as f64);
                let z = 0.01 * (9.0 * x + 2.0 * y).sin() + 0.004 * (17.0 * y - 5.0 * x).cos();
                write!(text, "[{}, {}, {}],", 0.36 * x, 0.38 * y, z)?;
            }
            text += "]\n";
        }
        _ => {
            let (first, last): (Vec<usize>, Vec<usize>) = ((0..n).collect(), (n * (n - 1)..n * n).collect());
            hold(&mut text, "left", &first, "{ kind = \"line\", velocity = [0.1, 0, 0] }")?;
            hold(&mut text, "right", &last, "{ kind = \"line\", velocity = [-0.1, 0, 0] }")?;
        }
    }
    Ok(text)
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().collect();
    let list =
        |k: usize, default: &str| words.get(k).map_or(default, |w| w.as_str()).split(',').map(str::to_owned).collect::<Vec<_>>();
    println!("scene n E: iterations, factorizations, evaluations, halvings a step (worst step); ms a step");
    for kind in list(3, "held,sphere,crumpled,pushed") {
        for n in list(1, "10,20") {
            for young in list(2, "1e3,1e4,1e5,1e6,1e7") {
                let scene: Scene = scene::parse_scene(&sheet(&kind, n.parse()?, young.parse()?)?, "sheet.toml")?;
                let model = ModelBuilder::new(&scene)?.build();
                let controls = scene::control_rows(&scene, scene.time.n_steps())?;
                let theta = model.params().values();
                let mut stepper = Stepper::new(
                    &model,
                    theta,
                    StepOptions { record: std::env::var("RECORD").is_ok(), ..StepOptions::default() },
                )?;
                let (mut state, mut sums, mut worst, mut spent) = (model.initial_state(), [0; 4], 0, 0.0);
                for (step, u) in controls.iter().enumerate() {
                    let start = Instant::now();
                    let (trace, _) = match stepper.step(&mut state, u) {
                        Ok(done) => done,
                        Err(error) => {
                            println!("   {error} at {step}");
                            break;
                        }
                    };
                    spent += start.elapsed().as_secs_f64();
                    let all = [trace.work.iterations, trace.work.factorizations, trace.work.evaluations, trace.retries];
                    sums.iter_mut().zip(all).for_each(|(sum, x)| *sum += x);
                    worst = worst.max(trace.work.iterations);
                }
                let steps = controls.len() as f64;
                let [i, f, e, r] = sums.map(|s| s as f64 / steps);
                let energy = model.kinetic_energy(&state.q, &state.v, theta) + model.potential_energy(&state.q, &state.z, theta);
                println!(
                    "{kind:8} {n:>3} {young:4}: {i:6.2} {f:6.2} {e:6.2} {r:5.2} ({worst:3}) {:7.2} ms  E {energy:.6}",
                    1e3 * spent / steps
                );
            }
        }
    }
    Ok(())
}
