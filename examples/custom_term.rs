//! A force of your own, in one file and without a line of derivative code.
//!
//! A magnet near the end of a swinging cable pulls its last node towards a point m,
//! ```text
//! E(q) = −k / √(|m − q|² + a²)   [J]        f = −∂E/∂q = k (m − q) / (|m − q|² + a²)^(3/2)   [N]
//! ```
//! with one unknown coefficient k [N·m²]; a [m] is the magnet's size and keeps E finite. The law is written once, generic over
//! the scalar. From then on `magnet.strength` is an entry of θ like any other: the example takes its gradient by one backward
//! sweep, lets the gradient check judge it, and fits it to simulated measurements by Gauss–Newton.
//!
//! ```text
//! cargo run --release --example custom_term
//! ```

use pliant::gradcheck::gradcheck;
use pliant::terms::{Element, Law, Real, Vec3};
use pliant::{Differentiate, Model, ModelBuilder, Rollout, StepOptions, rollout, scene};
use std::error::Error;
use std::sync::Arc;

const SCENE: &str = r#"
schema_version = 1
[time]
step = 0.01
duration = 0.8
integrator = "midpoint"
[[rope]]
name = "cable"
nodes = 11
length = 0.5
linear_density = 0.05
stretch_stiffness = 500.0
stretch_damping = 0.02
bend_stiffness = 1e-3
bend_damping = 1e-5
initial = { shape = "straight", from = [0, 0, 0], direction = [0, 0, -1] }
[[gripper]]
name = "hand"
rope = "cable"
nodes = [0, 1]
motion = { kind = "sine", amplitude = [0.03, 0, 0], frequency = 1.5, phase = 0.0 }
"#;

/// The strength that makes the measurements [N·m²].
const TRUTH: f64 = 2.0e-4;
/// Noise of the measurements [m], uniform within ± this.
const NOISE: f64 = 5.0e-4;
/// Steps between measurements.
const EVERY: usize = 5;

/// Nodes: one. Parameter: k [N·m²]. Constants: m (3) and a [m].
#[derive(Debug)]
struct Magnet;

impl Law for Magnet {
    fn name(&self) -> &str {
        "magnet"
    }

    fn force<S: Real>(&self, q: &[Vec3<S>], _v: &[Vec3<S>], p: &[S], constants: &[f64], f: &mut [Vec3<S>]) {
        let (to_magnet, distance) = reach(q, constants);
        f[0] += to_magnet * (p[0] * distance.powi(-3));
    }

    fn energy<S: Real>(&self, q: &[Vec3<S>], p: &[S], constants: &[f64]) -> S {
        -p[0] * reach(q, constants).1.recip()
    }

    /// A potential has symmetric second derivatives; saying so lets the solver factor a symmetric matrix.
    fn symmetric(&self, _p: &[f64]) -> bool {
        true
    }
}

/// m − q, and √(|m − q|² + a²).
fn reach<S: Real>(q: &[Vec3<S>], constants: &[f64]) -> (Vec3<S>, S) {
    let to_magnet = Vec3::new(constants[0], constants[1], constants[2]).map(S::from) - q[0];
    (to_magnet, (to_magnet.dot(&to_magnet) + constants[3] * constants[3]).sqrt())
}

/// The scene's model with the magnet, the index of its strength in θ, and the controls of every step.
type Magnetic = (Arc<Model>, usize, Vec<Vec<f64>>);

fn model() -> Result<Magnetic, Box<dyn Error>> {
    let scene: scene::Scene = scene::parse_scene(SCENE, "magnet.toml")?;
    let controls = scene::control_rows(&scene, scene.time.n_steps())?;
    let mut builder = ModelBuilder::new(&scene)?;
    let strength = builder.add_param("magnet.strength", "N·m²", (0.0, f64::INFINITY), 0.0);
    let last = builder.model().n_nodes() - 1;
    let constants = vec![0.15, 0.05, -0.5, 0.1];
    builder.add_law(Magnet, vec![Element { nodes: vec![last], params: vec![strength], constants }])?;
    Ok((Arc::new(builder.build()), strength, controls))
}

/// Where a measurement looks: the last node, every [`EVERY`] steps. Calls `each(state number, entry of x)`.
fn for_readings(model: &Model, n_states: usize, mut each: impl FnMut(usize, usize)) {
    for k in (EVERY..n_states).step_by(EVERY) {
        (model.nq() - 3..model.nq()).for_each(|i| each(k, i));
    }
}

fn readings(run: &Rollout) -> Vec<f64> {
    let mut out = Vec::new();
    for_readings(&run.model, run.states.len(), |k, i| out.push(run.states[k].q[i]));
    out
}

/// Uniform in [−1, 1), the same in every run.
fn noise(k: usize) -> f64 {
    let x = (k as f64 * 12.9898 + 78.233).sin() * 43_758.545_3;
    2.0 * (x - x.floor()) - 1.0
}

fn main() -> Result<(), Box<dyn Error>> {
    let (model, strength, controls) = model()?;
    let x0 = model.initial_state();
    let with = |k: f64| {
        let mut theta = model.params().values().to_vec();
        theta[strength] = k;
        theta
    };
    let simulate = |k: f64| rollout(&model, &with(k), &x0, &controls, StepOptions::default());

    // Measurements of a cable that has the magnet.
    let measured: Vec<f64> = readings(&simulate(TRUTH)?).iter().enumerate().map(|(k, x)| x + NOISE * noise(k)).collect();

    // The gradient of L = ½ Σ (simulated − measured)² at k = 0, for all of θ in one backward sweep.
    let run = simulate(0.0)?;
    let residual: Vec<f64> = readings(&run).iter().zip(&measured).map(|(a, b)| a - b).collect();
    let mut x_bar = vec![vec![0.0; model.ndx()]; run.states.len()];
    let mut next = residual.iter();
    for_readings(&model, run.states.len(), |k, i| x_bar[k][i] = next.next().copied().unwrap_or(0.0));
    println!("dL/dk at k = 0:        {:.4e} m²/(N·m²)", run.vjp(&x_bar)?.theta[strength]);

    // Is it right? The check compares every block of inputs with differences, the new one too.
    let report = gradcheck(&model, &with(TRUTH), &x0, &controls, 0)?;
    let block = report.blocks.iter().find(|b| b.name == "magnet.strength").ok_or("the check skipped the magnet")?;
    println!("gradient check:        {:?}, relative error {:.0e}", block.verdict, block.relative_error);

    // Gauss–Newton from a cable without a magnet: k ← k − (Jᵀr)/(JᵀJ), J = d readings/dk by one forward sweep.
    let mut k = 0.0;
    let mut theta_dot = vec![0.0; model.n_params()];
    theta_dot[strength] = 1.0;
    for iteration in 0..8 {
        let run = simulate(k)?;
        let tangent = run.jvp(None, None, Some(&theta_dot))?;
        let mut slope = Vec::new();
        for_readings(&model, run.states.len(), |k, i| slope.push(tangent[k][i]));
        let residual: Vec<f64> = readings(&run).iter().zip(&measured).map(|(a, b)| a - b).collect();
        let (jr, jj) = slope.iter().zip(&residual).fold((0.0, 0.0), |(jr, jj), (j, r)| (jr + j * r, jj + j * j));
        let rms = (residual.iter().map(|r| r * r).sum::<f64>() / residual.len() as f64).sqrt();
        println!("iteration {iteration}: k = {k:.6e}, residual {:.4} mm, ± {:.1e}", 1e3 * rms, rms / jj.sqrt());
        k -= jr / jj;
        if (jr / jj).abs() < 1e-9 * k.abs() {
            break;
        }
    }
    println!("fitted k = {k:.5e} N·m², true {TRUTH:.5e}");
    Ok(())
}
