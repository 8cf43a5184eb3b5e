//! Prints a line of hashes per scene and integrator: bits of the states, work of the solver, A and B, C, jvp, vjp. Two versions of the
//! program with the same lines have the same rollouts and derivatives to the bit (on one processor: kernels differ between processors).
//!
//! `cargo run --release -p pliant-adjoint --example fingerprint -- [steps] [dump=folder] [scene.toml …]`; without files, those of
//! `tests/scenes` and `examples`. With a folder, the numbers themselves are written there too, to see by how much they differ: little-endian
//! doubles, states, then A and B, C, jvp, vjp, in files that name scene, integrator and part.

use pliant_adjoint::{Linearizer, rollout_jvp, rollout_vjp};
use pliant_engine::model::ModelBuilder;
use pliant_engine::rollout::rollout;
use pliant_engine::step::StepOptions;
use pliant_scene as scene;
use pliant_scene::Scene;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Steps of a rollout, unless given.
const STEPS: usize = 30;
/// Numbers a matrix may have to be linearized in every step; larger ones in the last step alone.
const SMALL: usize = 100_000;
const INTEGRATORS: [&str; 4] = ["euler", "midpoint", "sdirk2", "quasi_static"];

/// FNV-1a over the bits of numbers.
#[derive(Clone, Copy)]
struct Hash(u64);

impl Hash {
    fn of<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> u64 {
        let mut hash = Self(0xcbf2_9ce4_8422_2325);
        numbers.into_iter().for_each(|x| hash.add(x.to_bits()));
        hash.0
    }

    fn add(&mut self, bits: u64) {
        for byte in bits.to_le_bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}

/// Numbers in [−1, 1] that look random, the same every time.
fn numbers(count: usize, seed: u64) -> Vec<f64> {
    let mut x = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut next = || {
        x ^= x << 13;
        x ^= x >> 7;
        x ^= x << 17;
        (x >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    (0..count).map(|_| next()).collect()
}

/// The scene with another integrator.
fn with_integrator(text: &str, integrator: &str) -> String {
    let kept = text.lines().filter(|line| !line.trim_start().starts_with("integrator"));
    let line = format!("[time]\nintegrator = \"{integrator}\"");
    kept.map(|l| if l.trim() == "[time]" { line.as_str() } else { l }).collect::<Vec<_>>().join("\n")
}

/// Numbers by name.
type Part = (&'static str, Vec<f64>);

/// Hashes of a rollout and its derivatives; and the numbers, by name.
fn fingerprint(text: &str, file: &str, steps: usize) -> Result<(String, Vec<Part>), Box<dyn Error>> {
    let scene: Scene = scene::parse_scene(text, file)?;
    let model = Arc::new(ModelBuilder::new(&scene)?.build());
    let controls = scene::control_rows(&scene, steps.min(scene.time.n_steps()))?;
    let theta = model.params().values();
    let run = rollout(&model, theta, &model.initial_state(), &controls, StepOptions::default())?;
    let states = run.states.iter().flat_map(|x| x.q.iter().chain(&x.v).chain(&x.z)).copied().collect();
    let works = run.traces.iter().flat_map(|t| [t.work.iterations, t.work.evaluations, t.retries]).map(|n| n as f64).collect();
    let small = model.ndx() * model.ndx() <= SMALL;
    let (mut ab, mut c) = (Vec::new(), Vec::new());
    let mut linearizer = Linearizer::new(&model, theta, small);
    for record in run.records.iter().skip(if small { 0 } else { run.records.len() - 1 }) {
        let at = linearizer.linearize(record);
        ab.extend(at.a.into_iter().chain(at.b));
        c.extend(at.c);
    }
    let u_dot: Vec<Vec<f64>> = (0..controls.len()).map(|k| numbers(model.nu(), 3 + k as u64)).collect();
    let jvp = rollout_jvp(&run, Some(&numbers(model.ndx(), 1)), Some(&u_dot), Some(&numbers(model.n_params(), 2)))?;
    let x_bar: Vec<Vec<f64>> = (0..run.states.len()).map(|k| numbers(model.ndx(), 100 + k as u64)).collect();
    let vjp = rollout_vjp(&run, &x_bar)?;
    let vjp = [vjp.x0, vjp.u.concat(), vjp.theta].concat();
    let parts = vec![("states", states), ("work", works), ("ab", ab), ("c", c), ("jvp", jvp.concat()), ("vjp", vjp)];
    let hashes: Vec<String> = parts.iter().map(|(name, x)| format!("{name} {:016x}", Hash::of(x))).collect();
    Ok((hashes.join(" "), parts))
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1).peekable();
    let steps = words.next_if(|w| w.parse::<usize>().is_ok()).map_or(Ok(STEPS), |w| w.parse())?;
    let folder = words.next_if(|w| w.starts_with("dump=")).map(|w| PathBuf::from(&w["dump=".len()..]));
    let mut files: Vec<PathBuf> = words.map(PathBuf::from).collect();
    if files.is_empty() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        for folder in ["tests/scenes", "examples"] {
            for entry in std::fs::read_dir(root.join(folder))? {
                files.push(entry?.path());
            }
        }
        files.retain(|path| path.extension().is_some_and(|e| e == "toml"));
        files.sort();
    }
    for path in files {
        let (text, name) = (std::fs::read_to_string(&path)?, path.file_name().unwrap_or_default().to_string_lossy().into_owned());
        for integrator in INTEGRATORS {
            let found = fingerprint(&with_integrator(&text, integrator), &path.to_string_lossy(), steps);
            if let (Some(folder), Ok((_, parts))) = (&folder, &found) {
                std::fs::create_dir_all(folder)?;
                for (part, numbers) in parts {
                    let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
                    std::fs::write(folder.join(format!("{name}.{integrator}.{part}")), bytes)?;
                }
            }
            let line = found.map_or_else(|e| format!("error: {}", e.to_string().lines().next().unwrap_or("")), |(line, _)| line);
            println!("{name} {integrator}: {}", line.replace(&*path.to_string_lossy(), ""));
        }
    }
    Ok(())
}
